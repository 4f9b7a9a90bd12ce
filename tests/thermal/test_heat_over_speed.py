"""A measured mould heat at other casting speeds: by dwell time, by a table, or fixed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.cli.drawing import build_mesh
from castfem.cli.plant_numbers import heat_lines
from castfem.model import Case
from castfem.model.checks.shared_heat import fixed_while_varied, shared_heat
from castfem.model.checks.unusual import warnings
from castfem.physics.materials import load_steel
from castfem.physics.thermal.mould_flux import MOULD_FLUXES

SPEEDS = {"speed": ["1 m/min", "2 m/min"], "value": ["400 kW", "600 kW"]}
PLACES = {"position": [0, 0.4, 0.8], "position_unit": "m", "value": [3, 2, 1], "unit": "MW/m^2"}


def billet(speed: Any, law: dict[str, Any]) -> Case:
    contact = {"law": "contact", "flux": "savage_pritchard", "wall": "160 degC", **law}
    zones = [{"name": "mould", "to": "800 mm", "surface": [contact]}, {"name": "below"}]
    return small({"cooling": zones, "casting.speed": speed, "casting.length": "1 m"})


def kilowatts(case: Case) -> float:
    """Return the heat of the mould that `castfem check` prints, kW."""
    steel = load_steel(case.steel.name)
    line = heat_lines(case, steel, build_mesh(case))[0]
    return float(line.partition(": ")[2].partition(" kW")[0])


def mean(name: str, time: float) -> float:
    """Return the mean of a published flux over a time in the mould, MW/m2."""
    times = np.linspace(0.0, time, 20001)
    flux = [MOULD_FLUXES[name].formula(t) for t in times]
    return 1e-6 * float(np.trapezoid(flux, times)) / time


@pytest.mark.parametrize(
    "total", [{"power": "500 kW"}, {"water": "1500 L/min", "water_rise": "5 K"}]
)
def test_flux_follows_the_time_in_the_mould(total: dict[str, str]) -> None:
    """At 1.5 times the speed the heat changes by the ratio of the means of the published curve."""
    law = {**total, "measured_at": "2 m/min"}
    expected = kilowatts(billet("2 m/min", total))
    assert kilowatts(billet("2 m/min", law)) == pytest.approx(expected, rel=1e-3)
    ratio = mean("savage_pritchard", 16.0) / mean("savage_pritchard", 24.0)
    assert 1.12 < ratio < 1.14
    assert kilowatts(billet("3 m/min", law)) == pytest.approx(ratio * expected, rel=1e-3)
    for fixed in ({}, {"measured_at": "any speed"}):
        assert kilowatts(billet("3 m/min", {**total, **fixed})) == pytest.approx(expected, rel=1e-3)


def test_flux_over_position_follows_the_time_in_the_mould() -> None:
    """At twice the speed the slice leaves the mould with the flux of its middle, 2 MW/m2."""
    law = {"flux": PLACES, "measured_at": "2 m/min"}
    slow, fast = (kilowatts(billet(speed, law)) for speed in ("2 m/min", "4 m/min"))
    assert fast / slow == pytest.approx(2.5 / 2.0, rel=1e-3)
    assert kilowatts(billet("4 m/min", {"flux": PLACES})) == pytest.approx(slow, rel=1e-3)


def test_run_removes_the_heat_that_check_prints() -> None:
    """A step ends at the kink of a table over position, at the time of its measurement."""
    law = {"law": "flux", "value": PLACES, "power": "400 kW", "measured_at": "2 m/min"}
    zones = [{"name": "mould", "to": "800 mm", "surface": [law]}, {"name": "below"}]
    changes = {"cooling": zones, "casting.speed": "4 m/min", "casting.length": "800 mm"}
    result = castfem.run(small(changes))
    assert result.history["cooling_power"].iloc[-1] == pytest.approx(500.0, rel=2e-3)
    assert np.isclose(result.history["time"], 12.0, atol=1e-9).any()


def test_total_follows_a_table_over_the_speed() -> None:
    assert kilowatts(billet("1.5 m/min", {"power": SPEEDS})) == pytest.approx(500.0)
    water = {"speed": ["1 m/min", "2 m/min"], "value": ["1000 L/min", "2000 L/min"]}
    rise = {"speed": ["1 m/min", "2 m/min"], "value": ["8 K", "6 K"]}
    found = kilowatts(billet("1.5 m/min", {"water": water, "water_rise": rise}))
    assert found == pytest.approx(4.17e3 * 0.025 * 7.0, rel=1e-3)
    changing = {"time": ["0 s", "32 s"], "value": ["1 m/min", "2 m/min"]}
    case = billet(changing, {"power": SPEEDS, "flux": "brimacombe"})
    assert kilowatts(case) == pytest.approx(500.0, rel=1e-3)


def test_measured_heat_is_unchanged_when_reread() -> None:
    for law in ({"power": SPEEDS}, {"power": "5 kW", "measured_at": "any speed"},
                {"flux": PLACES, "measured_at": "1.7 m/min"}):  # fmt: skip
        case = billet("1.5 m/min", law)
        (read,) = castfem.model.load.from_document(case.document()).cooling[0].surface
        assert read == case.cooling[0].surface[0]


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"power": SPEEDS, "measured_at": "1 m/min"}, "excludes power as a table over the"),
        ({"measured_at": "1 m/min"}, "needs a measured total .* or flux over position"),
        ({"power": "5 kW", "measured_at": "all"}, '"2 m/min"|or "any speed"'),
        (
            {"power": "5 kW", "measured_at": "1.2 m/min"},
            "this zone after .* s, at the speed of measured_at;",
        ),
        ({"power": {"time": ["0 s", "1 s"], "value": ["1 kW", "2 kW"]}}, "unknown key 'time'"),
    ],
)
def test_contradicting_input_is_rejected(law: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        billet("3 m/min", law)


def test_formula_beyond_its_range_is_rejected_with_a_fix() -> None:
    """The error names formulas valid for that time, and the allowed end of the zone."""
    with pytest.raises(InputError, match='take flux = "brimacombe" or flux = "li_thomas" or a tab'):
        billet("1 m/min", {})
    with pytest.raises(InputError, match=r'end, to = "266 mm" at most; else take a table$'):
        billet("0.5 m/min", {})  # 32 s


@pytest.mark.parametrize(
    ("length", "fix"), [(600.0, 'end the zone with the mould, to = "600 mm", or '), (900.0, "")]
)
def test_zone_too_long_for_a_formula_may_end_with_the_mould(length: float, fix: str) -> None:
    """The formula is valid for 32 s, which is 800 mm; a longer mould needs another one."""
    changes = {"mechanics": {}, "mould": {"length": f"{length} mm"}}
    changes |= {"cooling.0.surface.0.gap_conductivity": "0.15 W/(m K)"}
    with pytest.raises(InputError) as error:
        billet("1.5 m/min", {}).with_({**changes, "cooling.0.to": "900 mm"})
    (message,) = [one for one in error.value.problems if "savage_pritchard" in one]
    assert f"after 36 s; {fix}take flux" in message


@pytest.mark.parametrize("law", [{"power": "500 kW"}, {"flux": PLACES}])
def test_equal_heat_at_different_speeds_is_reported(law: dict[str, Any]) -> None:
    slow, fast = (billet(speed, law) for speed in ("2 m/min", "3 m/min"))
    (line,) = shared_heat([slow, fast, fast])
    assert line.startswith("mould: ") and "casting speeds 2 and 3 m/min" in line
    assert shared_heat([slow, slow]) == []
    for rule in ("2 m/min", "any speed"):
        assert (
            shared_heat(billet(s, {**law, "measured_at": rule}) for s in ("2 m/min", "3 m/min"))
            == []
        )
    assert len(fixed_while_varied(slow, ["casting.speed"])) == 1
    assert fixed_while_varied(slow, ["casting.superheat"]) == []


def test_total_over_the_speed_is_not_reported_as_equal() -> None:
    cases = [billet(speed, {"power": SPEEDS}) for speed in ("1.5 m/min", "2 m/min")]
    assert shared_heat(cases) == []


def test_speed_beyond_a_table_is_reported() -> None:
    within, beyond = (billet(speed, {"power": SPEEDS}) for speed in ("2 m/min", "2.1 m/min"))
    assert not [one for one in warnings(within) if one.path[-1] == "power"]
    (found,) = [one for one in warnings(beyond) if one.path[-1] == "power"]
    assert "from 1 m/min to 2 m/min, the strand at 2.1 m/min" in found.text


def test_compare_and_report_print_the_equal_heat(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from castfem.cli import execute

    law = {"law": "contact", "flux": "2 MW/m^2", "wall": "160 degC", "power": "50 kW"}
    zones = [{"name": "mould", "to": "30 mm", "surface": [law]}, {"name": "below"}]
    for name, speed in (("slow", "3 m/min"), ("fast", "4 m/min")):
        changes = {"cooling": zones, "casting.speed": speed, "casting.length": "30 mm"}
        castfem.run(small(changes), folder=tmp_path / name)
    words = [str(tmp_path / "slow"), str(tmp_path / "fast")]
    assert execute(["compare", *words, "--no-figures"]) == 0
    message = "mould: 50 kW in all at each of the casting speeds 3 and 4 m/min"
    assert message in capsys.readouterr().out
    assert execute(["report", *words, "-o", str(tmp_path / "both.html")]) == 0
    assert message in (tmp_path / "both.html").read_text()
