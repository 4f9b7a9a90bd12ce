"""A slab between rolls of which one is lost or misaligned: bulge, slice, resistance."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from interrupted import history_of
from runs.billet_runs import Kept, run_in_memory
from runs.bulging_slab import SLAB, below, rolls_of

from castfem.model import Case
from castfem.runs.results.sample import Sample

pytestmark = pytest.mark.slow

PITCH, FIRST, COUNT = 0.2, 0.9, 7
PLACES = [FIRST + PITCH * k for k in range(COUNT)]
LOST = {"kind": "lost", "roll": 4}
OFF = {"kind": "misaligned", "roll": 4, "by": "4 mm"}
FRICTION = 0.015


def slab(*defects: dict[str, object], **changes: object) -> Case:
    """Return a slab of 400 x 100 mm from 0.85 m over seven pairs of rolls, which may bend it."""
    from small_case import small

    rolls = {
        "position": [f"{place:.4g} m" for place in PLACES],
        "diameter": ["120 mm"] * COUNT,
        "radius_extrados": [*["straight"] * 2, *["60 m"] * (COUNT - 2)],
        "driven": [False] * (COUNT - 1) + [True],
    }
    machine = {"rolls": rolls, "extraction": {"resistance": "coupled"}, "defect": list(defects)}
    given = {
        "machine": machine,
        "mechanics": {"law": "kozlowski_zhu_signed", "bulging": "elastic"},
        "coupling": {"interval": "100 mm"},
        "casting.length": "1.75 m",
    } | {key.replace("__", "."): value for key, value in changes.items()}
    return small(deepcopy(SLAB) | given)


@pytest.fixture(scope="module")
def sound() -> Kept:
    return run_in_memory(slab())


@pytest.fixture(scope="module")
def lost() -> Kept:
    return run_in_memory(slab(LOST))


@pytest.fixture(scope="module")
def off() -> Kept:
    return run_in_memory(slab(OFF))


def within(kept: Kept, pitch: int) -> Sample:
    """Return the first sample in a pitch, by the number of the roll above it."""
    return below(kept, PLACES[pitch - 1])


def at(kept: Kept, roll: int) -> Sample:
    """Return the sample at a roll, from 1."""
    return next(s for s in kept.samples if abs(s.position - PLACES[roll - 1]) < 1e-6)


def test_lost_roll_is_one_long_pitch(sound: Kept, lost: Kept) -> None:
    long, short = (rolls_of(within(kept, 3)).memory for kept in (lost, sound))
    assert long["z"][0, -1] == pytest.approx(2 * PITCH) and short["z"][0, -1] < 1.01 * PITCH
    # Clamped between long pitches the ratio would be 16; sound neighbours yield.
    ratio = long["largest"] / short["largest"]
    assert np.all(ratio > 18.0) and np.all(ratio < 40.0)
    beside = [rolls_of(within(kept, 2)).memory["largest"][0] for kept in (lost, sound)]
    assert beside[0] < beside[1]
    # The face follows as far as its edges allow: it is no wider than the pitch is long.
    bed = rolls_of(within(lost, 3)).beds["wide_face_intrados"]
    moved = [within(kept, 3).strained.moved["mid_face_intrados"] for kept in (lost, sound)]
    assert moved[0] > 0.5 * bed.bulge and moved[0] > 8.0 * moved[1]


def test_bed_below_a_lost_roll_is_as_soft_as_its_dip(sound: Kept, lost: Kept) -> None:
    """The shell dips by more than it bulges there: stiffness is pressure over the dip."""
    memory = rolls_of(within(lost, 5)).memory
    low, top = memory["deflection"].min(axis=1), memory["largest"]
    assert np.all(-low > 1.2 * top) and np.all(-low > 60e-6)
    pressure = memory["load"] / PITCH
    assert memory["stiffness"] == pytest.approx(pressure / -low, rel=0.02)
    plain = rolls_of(within(sound, 5)).memory
    soft = np.maximum(plain["largest"], 50e-6)
    assert plain["stiffness"] == pytest.approx(plain["load"] / PITCH / soft, rel=0.02)


def test_rolls_near_a_lost_one_take_more_than_half(sound: Kept, lost: Kept) -> None:
    memory = rolls_of(within(lost, 3)).memory
    statics = 1.5 * PITCH * memory["load"] / (2 * PITCH)
    assert np.all(memory["force"] > 1.05 * statics)
    assert memory["added"][:, 0] == pytest.approx(memory["force"] - statics, rel=1e-6)
    assert "added" not in rolls_of(within(sound, 3)).memory


def steps(kept: Kept) -> dict[int, float]:
    """Return the accumulated friction by the number of passed rolls."""
    found = {}
    for sample in kept.samples:
        withdrawal = sample.bending.withdrawal
        found[withdrawal.pairs] = withdrawal.friction
    return found


def test_resistance_near_a_lost_roll_is_by_the_strip(lost: Kept, sound: Kept) -> None:
    """A pair resists with the pressure over its length and the addition by the strip."""
    added = rolls_of(at(lost, 3)).memory["added"][:, 1].sum()
    assert added > 0.0
    with_strip, plain = steps(lost), steps(run_in_memory(slab(LOST, mechanics__bulging="thesis")))
    more = (with_strip[3] - with_strip[2]) - (plain[3] - plain[2])
    assert 0.6 * 0.3 < more / (FRICTION * added) < 0.4  # by the width of the liquid, m
    # The load of a single pitch is by statics, in both models.
    models = steps(sound), steps(run_in_memory(slab(mechanics__bulging="thesis")))
    for k in range(1, max(models[0]) + 1):
        assert models[0][k] == pytest.approx(models[1][k], rel=5e-3)


def test_misaligned_roll_changes_strip_slice_and_effort(sound: Kept, off: Kept) -> None:
    beds, memory = rolls_of(at(off, 4)).beds, rolls_of(at(off, 4)).memory
    # The line of the strand takes 2/3 of the offset, the shell the rest.
    assert beds["wide_face_intrados"].offset == pytest.approx(4e-3 / 3, rel=0.02)
    assert beds["wide_face_extrados"].offset == pytest.approx(-4e-3 / 3, rel=0.02)
    # The roll of the extrados is pressed in, that of the intrados is out of contact: no load.
    intrados, extrados = memory["added"][:, 1]
    load = memory["load"]
    assert extrados > load[1] and intrados == pytest.approx(-load[0], rel=0.02)
    # A pair resists with the added load of both, over the width of the liquid.
    plate = run_in_memory(slab(OFF, mechanics__bulging="thesis"))
    taken = [steps(kept)[4] - steps(kept)[3] for kept in (off, plate)]
    assert 0.18 < (taken[0] - taken[1]) / (FRICTION * (intrados + extrados)) < 0.4
    # Two rolls above it the position is unchanged.
    for kept in (off, sound):
        assert rolls_of(within(kept, 1)).beds["wide_face_intrados"].offset == 0.0


def test_creeping_strip_passes_a_lost_roll() -> None:
    """With a shell that spans it: at the speed of the other tests it would bulge by over 5 %."""
    slowly = {"casting__speed": "0.7 m/min", "casting__length": "1.15 m"}
    third = LOST | {"roll": 3}
    creep = run_in_memory(slab(third, mechanics__bulging="creep", **slowly))
    elastic = run_in_memory(slab(third, **slowly))
    memory = rolls_of(creep.samples[-1]).memory
    assert memory["z"][0, -1] == pytest.approx(2 * PITCH)
    assert np.all(memory["largest"] > 1.3 * rolls_of(within(elastic, 2)).memory["largest"])
    assert np.all(memory["error"] < 0.1 * memory["largest"])


def test_run_resumes_byte_for_byte(tmp_path: Path) -> None:
    """Stopped within the pitch of the lost roll."""
    case = slab(LOST, casting__length="1.55 m")
    assert history_of(case, tmp_path / "whole") == history_of(case, tmp_path / "cut", 7)


@pytest.mark.mpi
def test_ranks_agree() -> None:
    """From above a misaligned roll until its pitches are passed: strip and statics."""
    case = slab(OFF | {"roll": 2}, casting__length="1.11 m")
    one, several = (run_in_memory(case, comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    added = [rolls_of(s).memory["added"] for s in one.samples]
    assert len(added) == 5 and all(np.abs(a).max() > 1e3 for a in added[2:])
    for ours, theirs in zip(one.samples, several.samples, strict=True):
        both = [rolls_of(s).memory["added"] for s in (ours, theirs)]
        assert both[0] == pytest.approx(both[1], rel=1e-6, abs=1e-6)
        first, second = (s.bending.withdrawal for s in (ours, theirs))
        assert first.friction == pytest.approx(second.friction, rel=1e-6)
