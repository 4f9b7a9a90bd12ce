"""A roll that is off has a stretch of its own: it is no bender and no straightener."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from castfem.cli.machine import machine_rows
from castfem.model import Case
from castfem.model.shipped_cases import CASE_NAME, load
from castfem.physics.machine.phases import off_stretches, phases
from castfem.physics.machine.rolls import Rolls
from castfem.physics.machine.stations import Stations
from castfem.post.plots.secondary import close_by
from castfem.post.report.tables import places_of
from castfem.runs.results.crack_index import BENDS

THICKNESS = 0.220


def slab(*off: int, **more: int) -> Case:
    """The slab of the thesis with rolls 1.5 mm off, by number, and perhaps one `lost`."""
    defects = [{"kind": "misaligned", "roll": roll, "by": "1.5 mm"} for roll in off]
    defects += [{"kind": "lost", "roll": roll} for roll in more.values()]
    return load("slab1200/reference").with_({"machine.defect": defects} if defects else {})


def rolls_of(case: Case) -> Rolls:
    assert case.machine is not None
    rolls = case.machine.pairs()
    assert rolls is not None
    return rolls


@pytest.mark.parametrize("off", [(30,), (5,), (30, 45)])
def test_the_phases_are_those_of_the_machine(off: tuple[int, ...]) -> None:
    normal, rolls = rolls_of(slab()), rolls_of(slab(*off))
    assert phases(rolls) == phases(normal)
    assert off_stretches(normal) == []
    assert [one.name for one in off_stretches(rolls)] == [f"roll {roll} off" for roll in off]
    assert close_by(rolls, 0.0, 18.0) == close_by(normal, 0.0, 18.0)


def test_the_stretch_is_where_the_curvature_is_another_one() -> None:
    normal, rolls = rolls_of(slab()), rolls_of(slab(30))
    (stretch,) = off_stretches(rolls)
    first, last = (rolls.pairs[i].position for i in (stretch.first, stretch.last))
    lines = [one.line(THICKNESS) for one in (normal, rolls)]
    for position in np.linspace(0.8, 18.0, 2000):
        one, other = (line.curvature(float(position)) for line in lines)
        inside = first + 1e-9 < position < last - 1e-9
        assert (abs(one - other) > 1e-12) <= inside
    assert (stretch.first + 1, stretch.last + 1) == (28, 32)


def test_rolls_whose_stretches_overlap_share_one() -> None:
    (one,) = off_stretches(rolls_of(slab(30, 32)))
    assert (one.name, one.first + 1, one.last + 1) == ("rolls 30, 32 off", 28, 34)
    one, other = off_stretches(rolls_of(slab(30, 34)))
    assert one.last == other.first


def test_a_lost_pair_beside_it_is_passed_over() -> None:
    (one,) = off_stretches(rolls_of(slab(30, lost=31)))
    assert (one.first + 1, one.last + 1) == (28, 33)


def test_positions_are_named_by_the_roll_and_kept_with_the_maps() -> None:
    case = slab(30)
    rolls = rolls_of(case)
    stations = Stations(rolls, THICKNESS, 0.7)
    kept = json.loads(json.dumps(stations.columns()))
    restored = Stations.of_columns(kept, THICKNESS, 0.7)
    places = [pair.position for pair in rolls.pairs]
    for one in (stations, restored):
        assert one.phase(places[29]) == "roll 30 off"
        assert one.phase(places[27]) == one.phase(places[33]) == "arc"
        assert [one.phase(3.0), one.phase(15.5)] == list(BENDS)
        assert one.words(places[29]) == f"{places[29]:.2f} m (roll 30), roll 30 off"
    assert phases(restored.rolls) == phases(rolls)  # type: ignore[arg-type]


def test_places_and_machine_name_it(tmp_path: Path) -> None:
    named = {}
    for name, case in (("order", slab()), ("off", slab(30))):
        (tmp_path / CASE_NAME).write_text(case.resolved_toml())
        named[name] = {p.name: p.position for p in places_of(tmp_path, None, 18.4)}
    roll = rolls_of(slab(30)).pairs[29].position
    assert named["off"] == named["order"] | {"roll 30 off": roll}
    assert {"bending ends", "straightening ends"} < set(named["order"])
    rows = machine_rows(rolls_of(slab(30)), THICKNESS)
    assert dict(rows)["roll 30 off"].endswith("rolls 28 to 32 bend the strand as well")
    assert [row for row in rows if row[0] != "roll 30 off"][:6] == machine_rows(
        rolls_of(slab()), THICKNESS
    )[:6]
