"""A slice that leaves the meniscus later: speed, superheat and water by one clock."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.model import Case
from castfem.model.build.simulation import case_steel, starting_temperature
from castfem.model.plausibility import warnings
from castfem.model.water import seen_by_slice

LADLE = {"time": [0, 60, 120], "time_unit": "s", "value": [40, 20, 30], "unit": "K"}
RAMP = {"time": [60, 61], "time_unit": "s", "value": [2, 4], "unit": "m/min"}
LATER = {"time": [0, 1], "time_unit": "s", "value": [2, 4], "unit": "m/min"}


def cast(**changes: Any) -> Case:
    return small({key.replace("__", "."): value for key, value in changes.items()})


@pytest.mark.parametrize(
    ("time", "kelvin"), [(None, 40.0), ("30 s", 30.0), ("500 s", 30.0), ("-3 s", 40.0)]
)
def test_a_slice_has_the_superheat_of_its_own_start(time: str | None, kelvin: float) -> None:
    given = {} if time is None else {"casting__start__time": time}
    case = cast(casting__superheat=LADLE, **given)
    steel = case_steel(case)
    assert starting_temperature(case, steel) == pytest.approx(steel.liquidus + kelvin, abs=1e-9)


def test_it_meets_the_speed_that_the_clock_has() -> None:
    here, there = cast(casting__speed=LATER), cast(casting__speed=RAMP, casting__start__time="60 s")
    one, other = here.casting.travel, there.casting.travel
    for time in (0.0, 0.3, 1.0, 1.7):
        assert other.position(time) == pytest.approx(one.position(time), rel=1e-12)
    assert other.kinks == pytest.approx(one.kinks)
    early = cast(casting__speed=RAMP, casting__start__time="-3 s").casting.travel
    assert early.kinks == pytest.approx((63.0, 64.0)) and early.speed(62.0) == one.speed(0.0)
    before = cast(casting__speed=RAMP, casting__start__time="60.5 s").casting.travel
    assert before.speed(0.0) == pytest.approx(3.0 / 60.0)


def test_a_whole_run_by_the_clock() -> None:
    spray = {"law": "spray", "correlation": "nozaki", "water_temperature": "25 degC"}
    flows = {"time": [60, 61], "time_unit": "s", "value": [0, 2], "unit": "L/min"}
    then = {**flows, "time": [0, 1]}
    water = {"cooling.0.to": "100 mm"}  # over which it is spread
    by_clock = cast(**{
        **water | {"cooling.0.surface": [spray | {"flow": flows}]},
        "casting__speed": RAMP, "casting__start__time": "60 s",
    })  # fmt: skip
    own = cast(**water | {"cooling.0.surface": [spray | {"flow": then}], "casting__speed": LATER})
    one, other = (castfem.run(case).history["heat_removed"].to_numpy() for case in (by_clock, own))
    assert len(one) == len(other) and one == pytest.approx(other, rel=1e-9)


def test_a_flow_as_a_slice_sees_it() -> None:
    flow = Table("time", (0.0, 10.0, 20.0), (1.0, 3.0, 2.0))
    seen = seen_by_slice(flow, 5.0)
    assert isinstance(seen, Table) and seen.arguments == (0.0, 5.0, 15.0)
    times = np.linspace(0.0, 30.0, 7)
    assert seen(times) == pytest.approx(flow(times + 5.0), rel=1e-12)
    last = seen_by_slice(flow, 50.0)
    assert isinstance(last, Table) and last.values == (2.0,)
    assert seen_by_slice(flow, 0.0) is flow and seen_by_slice(3.0, 5.0) == 3.0


def test_a_clock_by_which_nothing_goes_is_told() -> None:
    told = [problem.text for problem in warnings(cast(casting__start__time="60 s"))]
    assert any("no speed, superheat or flow" in text for text in told)
    told = [p.text for p in warnings(cast(casting__start__time="60 s", casting__speed=RAMP))]
    assert not any("no speed, superheat" in text for text in told)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"casting__superheat": {**LADLE, "value": [40, -20, 30]}}, "casting.superheat.*below 0"),
        ({"casting__superheat": {**LADLE, "unit": "degC"}}, "written in kelvin"),
    ],
)
def test_what_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        cast(**changes)
