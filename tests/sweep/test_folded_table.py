"""The table of a sweep on a narrow terminal: what came of it stays, what was varied is folded."""

from __future__ import annotations

import pytest

from castfem.base.shown_quantity import Quantity
from castfem.post.compare.study_tables import sweep_table
from castfem.studies.sweep.results import Row

GIVEN = {
    "casting.speed": "{} m/min", "casting.superheat": "40 K", "mould.taper": "1 percent/m",
    "cooling.mould.surface.0.coefficient": "1600 W/(m^2 K)", "mesh.surface_size": "0.8 mm",
    "coupling.interval": "0.1 s",
}  # fmt: skip
RESULTS = {
    "shell_mid_face": Quantity(4.8e-3, "mm", "shell, mid-face"),
    "surface_temperature_mid_face": Quantity(1500.0, "degC", "surface, mid-face"),
    "heat_removed": Quantity(2.4e6, "MJ/m", "heat removed per m"),
    "mould_mean_flux": Quantity(1.9e6, "kW/m^2", "mean heat flux in the mould"),
    "shell_least": Quantity(4.1e-3, "mm", "thinnest shell, mould exit"),
    "contact_lost": Quantity(0.3, "mm", "contact lost at"),
    "contact_regained": Quantity(0.4, "mm", "contact mid-face found"),
}


def table(width: int) -> list[str]:
    rows = [
        Row(f"run{i}", {k: v.format(3 + i) for k, v in GIVEN.items()}, "finished", RESULTS, 3.0, "")
        for i in range(3)
    ]
    return sweep_table(rows, width).lines(width)


@pytest.mark.parametrize("width", [80, 100])
def test_six_keys_leave_room_for_the_results(width: int) -> None:
    lines = table(width)
    assert max(map(len, lines)) <= width
    first = next(line for line in lines if "speed 3 m/min" in line)
    assert first.split()[3:7] == ["4.80", "1226.8", "2.4", "1900"]
    text = "\n".join(lines)
    for key, value in (("superheat", "40 K"), ("taper", "1 percent/m"), ("interval", "0.1 s")):
        assert f"{key} {value}" in text
    below = " ".join(text.split())
    assert "not shown, but in sweep.csv: " in below and "contact mid-face found" in below


def test_a_wide_terminal_has_a_column_for_each_key_and_all_results() -> None:
    lines = table(240)
    assert not any("not shown" in line for line in lines)
    (first,) = [line for line in lines if line.split()[:1] == ["3"]]
    assert first.split() == [
        "3", "40", "1", "1600", "0.8", "0.1", "4.80", "1226.8", "2.4", "1900", "4.10", "300.00",
        "400.00",
    ]  # fmt: skip
