"""The demonstration caster has all facts that the thesis reports of its caster (VI.1 to VI.4).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import importlib.util
import itertools
import math
from itertools import accumulate
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from rolls_of_file import rolls_of

from castfem.base.csv_files import read_csv
from castfem.model import load_case
from castfem.model.machine import thickness_of
from castfem.physics.machine.bending_zones import Phase, phases
from castfem.physics.machine.line import Bent
from castfem.physics.machine.rolls import Rolls, Segment, expand
from castfem.physics.machine.spray_layout import (
    Row,
    footprint,
    gap_below,
    longest_spray,
    scale_water,
    stretches,
)

FOLDER = Path(__file__).parents[2] / "cases" / "slab1200"
TONNE = 9.80665e3  # N


@pytest.fixture(scope="module")
def rolls() -> Rolls:
    case = load_case(FOLDER / "thermal.toml")
    found = rolls_of(case)
    assert thickness_of(case.section) == 0.22
    assert (case.casting.speed, case.section.width) == (0.02, 1.2)
    assert case.mould_exit() == 0.8
    return found


@pytest.fixture(scope="module")
def line(rolls: Rolls) -> Bent:
    return rolls.line(0.22)


def position(rolls: Rolls, number: int) -> float:
    return rolls.pairs[number - 1].position


def pitch(rolls: Rolls, number: int) -> float:
    """Return the distance from the previous pair, m."""
    return position(rolls, number) - position(rolls, number - 1)


def test_shipped_files_are_those_of_the_script(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("make_rolls", FOLDER / "make_rolls.py")
    script: ModuleType = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.HERE = tmp_path
    script.main()
    for name in ("rolls.csv", "edge_rolls.csv", "resistance.csv"):
        assert (tmp_path / name).read_text() == (FOLDER / name).read_text()


def test_pairs_and_phases_are_those_of_the_thesis(rolls: Rolls) -> None:
    """87 pairs, 8 of them vertical, bending over 7 pitches, straightening over #50 to #57."""
    assert len(rolls.pairs) == 87 and rolls.face == "extrados"
    assert phases(rolls) == [
        Phase("vertical", 0, 7),
        Phase("bending", 7, 14),
        Phase("arc", 14, 48),
        Phase("straightening", 48, 56),
        Phase("straight", 56, 86),
    ]
    assert position(rolls, 1) == 0.87
    assert position(rolls, 8) == pytest.approx(2.3, abs=0.05)  # bending begins at about 2.3 m
    assert position(rolls, 49) == pytest.approx(14.2, abs=0.1)
    assert position(rolls, 57) == pytest.approx(16.75, abs=0.1)
    assert position(rolls, 49) - position(rolls, 15) == pytest.approx(10.2, abs=0.1)
    assert position(rolls, 62) > position(rolls, 57) + 1.0  # computed to 5 pairs beyond


def test_pitches_grow_smoothly(rolls: Rolls) -> None:
    found = np.array([pitch(rolls, i) for i in range(2, 88)])
    assert found[0] == pytest.approx(0.165, abs=1e-6)
    assert pitch(rolls, 8) == pytest.approx(0.25, abs=1e-6)
    for number in (48, 49):
        assert 0.331 <= pitch(rolls, number) <= 0.345
        assert pitch(rolls, number) == pytest.approx(0.335, abs=2e-6)
    assert np.allclose(found[48:], 0.32, atol=2e-6)
    growth = np.diff(found[:48])
    assert (growth >= -2e-6).all() and growth.max() < 0.0145


def test_diameters_and_clear_distance_are_those_of_the_thesis(rolls: Rolls) -> None:
    sizes = [pair.diameter for pair in rolls.pairs]
    assert (min(sizes), max(sizes)) == (0.13, 0.275)
    assert sizes == sorted(sizes)
    assert sizes[6] == sizes[7] == 0.215
    assert rolls.clearance(7, 0.22) == pytest.approx(0.035, abs=1e-6)  # (306)
    assert min(rolls.clearance(i, 0.22) for i in range(1, 87)) > 0.02


def test_radii_are_those_of_the_thesis(rolls: Rolls, line: Bent) -> None:
    """Bending is linear in s to 8006 mm; straightening starts at 8400 mm and increases."""
    chi = [1.0 / pair.radius for pair in rolls.pairs]
    assert chi[:8] == [0.0] * 8 and chi[56:] == [0.0] * 31
    start, end = position(rolls, 8), position(rolls, 15)
    for i in range(9, 15):
        share = (position(rolls, i) - start) / (end - start)
        assert chi[i - 1] == pytest.approx(share / 8.006, rel=1e-6)
    assert [pair.radius for pair in rolls.pairs[14:49]] == [8.006] * 35
    assert rolls.pairs[49].radius == pytest.approx(8.4, abs=1e-6)
    powers = [math.log(1.0 - 8.006 * chi[i - 1]) / math.log((i - 49) / 8) for i in range(50, 57)]
    assert powers == pytest.approx([1.4714] * 7, abs=1e-4)  # 1.47, and 8400 mm at #50
    changes = -np.diff(chi[48:57])
    assert (np.diff(changes) > 0.0).all()


def test_strand_is_horizontal_at_roll_57(rolls: Rolls, line: Bent) -> None:
    assert math.degrees(line.inclination(position(rolls, 57))) == pytest.approx(90.0, abs=2e-5)
    assert math.degrees(line.inclination(30.0)) == pytest.approx(90.0, abs=2e-5)


def test_apertures_decrease_step_by_step(rolls: Rolls) -> None:
    """By 0.1 mm a roll below straightening, to 220 mm cold thickness for 930 K of cooling."""
    gaps = np.array([pair.aperture for pair in rolls.pairs], float)
    assert (np.diff(gaps) <= 1e-12).all()
    assert np.allclose(np.diff(gaps[56:]), -1e-4, atol=1e-9)
    assert 4 <= np.count_nonzero(np.diff(gaps[:57])) <= 12
    assert gaps[-1] / (1.0 + 15e-6 * 930.0) == pytest.approx(0.22, abs=1e-4)


def resistance() -> tuple[np.ndarray, np.ndarray]:
    """Return positions, m, and the resistance up to them, t."""
    rows = np.array(
        [[float(c) for c in row.cells] for row in read_csv(FOLDER / "resistance.csv").rows]
    )
    return 1e-3 * rows[:, 0], 1e3 * rows[:, 1] / TONNE


def test_resistance_is_that_of_the_thesis(rolls: Rolls) -> None:
    """A pair has 0.75 t above straightening, 2.3 t in it, 0.5 t below #67; 60 t up to 20 m."""
    place, total = resistance()
    assert np.allclose(place, [pair.position for pair in rolls.pairs], atol=1e-9)
    steps = np.diff(total, prepend=0.0)
    assert steps[:49].mean() == pytest.approx(0.75, abs=1e-4)
    assert steps[47] == pytest.approx(0.79, abs=1e-4)
    assert np.allclose(steps[49:57], 2.3, atol=1e-4) and np.allclose(steps[67:], 0.5, atol=1e-4)
    assert np.interp(20.0, place, total) == pytest.approx(60.0, abs=0.2)
    assert total[-1] == pytest.approx(70.0, abs=1e-3)
    assert 2.8 < steps[51] / steps[47] < 3.0  # #52 has almost three times the resistance of #48


def effort(extra: float = 0.0) -> list[float]:
    """Return the load of each drive, t, if each takes the resistance above it up to its limit."""
    case = load_case(FOLDER / "thermal.toml")
    steps = np.diff(resistance()[1], prepend=0.0)
    steps[47] += extra
    untaken, loads = 0.0, []
    for pair, step in zip(case.machine.pairs().pairs, steps, strict=True):
        untaken += step
        if pair.driven:
            loads.append(min(untaken, pair.capacity / TONNE))
            untaken -= loads[-1]
    return loads


def test_loads_of_the_drives_are_those_of_the_thesis(rolls: Rolls) -> None:
    """In total 175 t; about 5 t per drive above, 5 to 15 t below; a locked #48 saturates #50."""
    driven = [i for i, pair in enumerate(rolls.pairs, 1) if pair.driven]
    assert {26, 44, 50, 55} < set(driven)
    forces = [pair.capacity for pair in rolls.pairs if pair.driven]
    assert sum(f / TONNE for f in forces if f is not None) == pytest.approx(175.0, abs=1e-3)
    loads = dict(zip(driven, effort(), strict=True))
    assert all(3.5 < loads[i] < 6.5 for i in driven if i <= 50)
    assert 11.0 < loads[55] < 15.0
    assert sum(loads.values()) == pytest.approx(70.0, abs=1e-3)
    locked = dict(zip(driven, effort(15.0), strict=True))
    assert locked[50] - loads[50] == pytest.approx(7.38, abs=1e-3)
    assert locked[55] - loads[55] == pytest.approx(15.0 - 7.38, abs=1e-3)
    assert locked[60] == pytest.approx(loads[60], abs=1e-9)


def test_head_is_that_of_a_bent_machine(line: Bent) -> None:
    """It is constant after the bend."""
    heights = [line.height(s) for s in np.linspace(0.0, 26.0, 131)]
    assert list(accumulate(heights, max)) == pytest.approx(heights, abs=1e-4)
    assert line.height(2.3) == pytest.approx(2.3, rel=1e-9)
    assert 10.5 < line.height(16.75) < 11.5


def test_shipped_slab_is_computed_as_in_the_thesis() -> None:
    """From the mould exit to five pairs of rolls below straightening, without defects."""
    case = load_case(FOLDER / "slab.toml")
    assert case.machine is not None and not case.machine.defect
    pairs = case.machine.pairs()
    assert case.casting.length == pytest.approx(pairs.pairs[61].position, abs=0.01)
    assert case.casting.start is not None and case.casting.start.at == "mould_exit"
    assert case.mechanics.bulging.model == "creep" and not case.mechanics.held
    assert case.machine.extraction is not None and case.quality is not None


# Stretches from roll to roll, and the area sprayed by a nozzle between two rolls.
#
# Equation numbers are those of [Pascon2003] (docs/references.md).


ROWS = (Row("a", 1, 1.10, 1.16), Row("a", 2, 1.35, 1.41), Row("b", 2, 1.33, 1.39))
CONTACTS = ((0.99, 1.01), (1.24, 1.26), (1.49, 1.51))


def test_sprayed_width_is_that_of_the_angle() -> None:
    assert footprint(0.21, math.radians(90.0)) == pytest.approx(0.42)


def test_longest_spray_is_that_of_the_thesis() -> None:
    """Between rolls #7 and #8: 72 mm (306)."""
    assert longest_spray(0.035, 0.210, 0.215) == pytest.approx(0.0717, abs=5e-5)
    rolls = expand([Segment(2, 0.25, 0.215)], 2.0)
    gap = gap_below(rolls, 1, 0.22)
    assert (gap.middle, gap.clear) == pytest.approx((2.125, 0.035))


@pytest.mark.parametrize(("clear", "off", "diameter"), [(0.035, 0.21, 0.215), (0.06, 0.3, 0.13)])
def test_longest_spray_just_passes_the_rolls(clear: float, off: float, diameter: float) -> None:
    """The ray to its end crosses the level of the roll axes at the narrowest gap."""
    half = 0.5 * longest_spray(clear, off, diameter)
    at_axes = half * (off - 0.5 * diameter) / off
    assert at_axes == pytest.approx(0.5 * clear)


def test_nozzle_below_the_roll_axes_is_rejected() -> None:
    with pytest.raises(ValueError, match="between the rolls"):
        longest_spray(0.035, 0.1, 0.215)


def test_stretches_repeat_from_roll_to_roll() -> None:
    found = stretches(CONTACTS, ROWS, 0.8, 2.0, gathers=lambda above: above != 1)
    assert [(s.kind, s.gap) for s in found] == [
        ("shade", 0), ("contact", 1), ("shade", 1), ("spray", 1), ("shade", 1),
        ("contact", 2), ("shade", 2), ("spray", 2), ("spray", 2), ("spray", 2), ("run_off", 2),
        ("contact", 3), ("shade", 3),
    ]  # fmt: skip
    assert (found[0].start, found[-1].end) == (0.8, 2.0)
    assert all(a.end == b.start for a, b in itertools.pairwise(found))
    assert [s.rows for s in found if s.kind == "spray"] == [(0,), (2,), (1, 2), (1,)]


def test_face_without_rolls_has_no_contact() -> None:
    places = [(1.0, 1.0), (1.25, 1.25), (1.5, 1.5)]
    found = stretches(places, ROWS[:1], 0.8, 1.4, gathers=lambda above: False)
    assert [s.kind for s in found] == ["shade", "shade", "spray", "shade", "shade"]
    assert sum(s.end - s.start for s in found) == pytest.approx(0.6)


def test_water_of_some_nozzles_is_scaled() -> None:
    scaled = scale_water(ROWS, "a", 2, 3, 0.66)
    assert [row.share for row in scaled] == [1.0, 0.66, 1.0]
    again = scale_water(scaled, "a", 1, 3, 0.5)
    assert [row.share for row in again] == pytest.approx([0.5, 0.33, 1.0])
    assert np.array_equal([r.start for r in again], [r.start for r in ROWS])
    with pytest.raises(ValueError, match="no nozzles between rolls 2 and 3"):
        scale_water(ROWS, "c", 2, 3, 0.66)
    with pytest.raises(ValueError, match="negative"):
        scale_water(ROWS, "a", 2, 3, -0.1)
