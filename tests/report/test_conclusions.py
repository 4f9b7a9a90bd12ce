"""A report begins with a summary of the run, and ends with its provenance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from synthetic_maps import write_maps
from synthetic_run import summary, write_run

from castfem.base.atomic_files import write_json
from castfem.base.shown_quantity import Quantity
from castfem.model.load import load
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.html.graphics import sections
from castfem.post.html.page import write
from castfem.post.report.conclusions import conclusions
from castfem.post.report.remarks import THINNEST, Remark, remarks_of
from castfem.runs.output.history import HISTORY_NAME
from castfem.runs.output.summary_file import Summary


def test_thinner_place_between_the_probes_comes_first(tmp_path: Path) -> None:
    """The page and the remarks name one thinnest shell, not two."""
    folder = write_run(tmp_path / "run")
    least = Quantity(8e-3, "mm", "thinnest shell of the probes, mould exit")
    found = replace(summary(), quantities={**summary().quantities, "shell_least": least})
    thin = Remark(THINNEST, 6.5, "mm", "x = 50.0, y = 20.0 mm, mould exit; mid-face: 8 mm", "shell")
    known = [one for one in remarks_of(folder, found) if one.what != THINNEST]
    for remark, wanted in ((thin, "6.50 mm, x = 50.0"), (replace(thin, value=8.0), "8.0")):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("castfem.post.report.conclusions.remarks_of",
                          lambda *_, one=remark: [*known, one])  # fmt: skip
            (text,) = (t for what, t in conclusions(folder, found) if what.startswith(THINNEST))
        assert text.startswith(wanted)


def test_times_and_data_from_memory_are_at_the_end(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    changed = replace(summary(), unchecked=("density: somebody",))
    write_json(folder / "summary.json", changed.to_json())
    page = write([folder], tmp_path / "page.html").read_text()
    assert page.index("density: somebody") > page.index('id="provenance"')


def slab(folder: Path, position: np.ndarray) -> None:
    """Write a run of the slab: surface temperatures fall from 1000 to 700 degC at 18 m."""
    (folder / CASE_NAME).write_text(load("slab1200/slab").resolved_toml())
    kelvin = 1000.0 - 300.0 * position / 18.0
    pandas.DataFrame(
        {
            "time [s]": 50.0 * position,
            "position [m]": position,
            "surface_temperature_mid_face_intrados [degC]": kelvin,
            "surface_temperature_corner_intrados [degC]": kelvin - 400.0,
        }
    ).to_csv(folder / HISTORY_NAME, index=False)


def test_surface_temperature_in_straightening(tmp_path: Path) -> None:
    slab(tmp_path, np.linspace(0.5, 18.0, 200))
    found = dict(conclusions(tmp_path, Summary("slab", "finished", {})))
    text = found["surface temperature in straightening"]
    low, high = (1000.0 - 300.0 * z / 18.0 for z in (16.832, 14.272))
    assert f"mid-face intrados {low:.0f} °C to {high:.0f} °C" in text.replace("degC", "°C")
    assert text.count("low-ductility band") == 0  # 719 to 762 and 319 to 362: below 800 to 950
    assert text.endswith("between 14.27 and 16.83 m")
    slab(tmp_path, np.linspace(0.5, 10.0, 200))
    assert "surface temperature in straightening" not in dict(
        conclusions(tmp_path, Summary("slab", "finished", {}))
    )


@pytest.mark.parametrize(("scale", "ratio"), [(1.0, "1.00 times"), (1.5, "1.50 times")])
def test_worst_place_is_compared_with_a_machine_in_order(
    tmp_path: Path, scale: float, ratio: str
) -> None:
    runs = {"order": 1.0, "off": scale}
    for name, factor in runs.items():
        (tmp_path / name).mkdir()
        write_maps(tmp_path / name, scale=factor)
    empty = Summary("x", "finished", {})
    found = dict(conclusions(tmp_path / "off", empty, ("order", tmp_path / "order", empty)))
    worst = found["worst place by I1"]
    assert (
        worst.startswith("intrados, corner, 2.12 m (roll 8)") and f"{ratio} that of order" in worst
    )
    for name, other in (("misaligned_48", "the intact machine"), ("slab", "another machine or")):
        (tmp_path / "off" / CASE_NAME).write_text(load(f"slab1200/{name}").resolved_toml())
        single = dict(conclusions(tmp_path / "off", empty))["worst place by I1"]
        assert f"no limit is known: compare with a run of {other}" in single


def test_unfinished_pool_is_reported(tmp_path: Path) -> None:
    quantities = {
        "position": Quantity(5.0, "m", "position"),
        "metallurgical_length": Quantity(np.nan, "m", "metallurgical length"),
    }
    (tmp_path / CASE_NAME).write_text("")
    found = dict(conclusions(tmp_path, Summary("x", "finished", quantities)))
    assert found["metallurgical length"].startswith("not reached: the run ends at 5")


def test_section_is_first_shown_at_the_mould_exit(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    (found,) = sections([folder])
    assert found is not None and found.start == len(found.places) - 1  # it ends there
    write_json(folder / "summary.json", replace(summary(), mould_exit=0.2).to_json())
    (found,) = sections([folder])
    assert found is not None and 0 < found.start < len(found.places) - 1
