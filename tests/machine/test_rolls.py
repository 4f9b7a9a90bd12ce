"""Rolls in a case: CSV file, columns or segments, one line per error; zones of misaligned rolls."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from rolls_of_file import HEADER, ROWS, SLAB, case, rolls_of, written
from runs.billet_runs import simulated

from castfem.base.errors import InputError
from castfem.cli.machine import machine_rows
from castfem.model import Case, load_case
from castfem.model.checks.unusual import warnings
from castfem.model.load import load, read_case
from castfem.model.machine_from_case import build_machine
from castfem.model.shipped_cases import CASE_NAME
from castfem.physics.machine.bending_zones import off_stretches, phases
from castfem.physics.machine.stations import Stations
from castfem.post.plots.secondary import close_by
from castfem.post.report.tables import places_of
from castfem.runs.results.crack_index import BENDS

SEGMENTS = (
    'machine={first="0.9 m", segment=[{rolls=5, pitch="200 mm", diameter="150 mm"}, '
    '{rolls=6, pitch="250 mm", diameter="200 mm", radius="8 m"}, '
    '{rolls=40, pitch="280 mm", diameter="200 mm", radius="8 m"}, '
    '{rolls=6, pitch="300 mm", diameter="220 mm"}]}'
)


def test_rolls_are_read_with_their_units(tmp_path: Path) -> None:
    rolls = rolls_of(case(tmp_path))
    assert [p.position for p in rolls.pairs] == [0.9, 1.2, 1.5, 1.8]
    assert [p.diameter for p in rolls.pairs] == [0.15, 0.15, 0.2, 0.2]
    assert [p.radius for p in rolls.pairs] == [math.inf, math.inf, 8.0, 8.0]
    assert [p.driven for p in rolls.pairs] == [False, False, True, True]
    assert [p.capacity for p in rolls.pairs] == [None, None, 120e3, None]
    assert [p.aperture for p in rolls.pairs] == [0.222, 0.222, 0.222, 0.221]
    inch = rolls_of(case(tmp_path, ("900 mm, 6 inch",), "position [m], diameter [mm]"))
    assert (inch.pairs[0].position, inch.pairs[0].diameter) == (0.9, pytest.approx(0.1524))
    assert inch.pairs[0].aperture is None and inch.aperture(0, 0.22) == 0.22


def test_case_with_rolls_is_unchanged_when_reread(tmp_path: Path) -> None:
    original = case(tmp_path)
    (tmp_path / "mine.csv").unlink()  # the resolved case does not need the file
    (tmp_path / "again.toml").write_text(original.resolved_toml())
    again = load_case(tmp_path / "again.toml")
    assert again == original
    assert again.physics_hash() == original.physics_hash()
    changed = original.with_({"machine.rolls.diameter": ["150 mm", "150 mm", "200 mm", "210 mm"]})
    assert rolls_of(changed).pairs[3].diameter == 0.21
    assert changed.physics_hash() != original.physics_hash()


def test_aperture_in_wrong_units_is_rejected(tmp_path: Path) -> None:
    """222 m instead of mm."""
    with pytest.raises(InputError, match=r"roll 1: aperture \(222000 mm\): the section between"):
        case(tmp_path, ROWS, HEADER.replace("aperture [mm]", "aperture [m]"))


def test_segments_are_expanded_to_pairs() -> None:
    what = load_case(SLAB, ["machine.segment=[]", SEGMENTS])
    rolls = rolls_of(what)
    assert len(rolls.pairs) == 57
    positions = np.array([p.position for p in rolls.pairs])
    assert positions[0] == 0.9
    assert np.allclose(np.diff(positions[:5]), 0.2) and np.allclose(np.diff(positions[4:11]), 0.25)
    chi = np.array([1.0 / p.radius for p in rolls.pairs])
    assert (chi[:5] == 0.0).all() and chi[-1] == 0.0
    assert np.allclose(np.diff(chi[4:11]), 0.125 / 6) and np.allclose(chi[10:51], 0.125)
    assert np.allclose(np.diff(chi[50:]), -0.125 / 6)
    machine = build_machine(what)
    angle = machine.inclination(30.0)
    assert angle == pytest.approx((0.5 * 1.5 + 40 * 0.28 + 0.5 * 1.8) / 8.0, rel=1e-12)
    again = what.with_({"title": "again"})
    assert again.machine == what.machine


def test_machine_of_a_case_has_its_rolls(tmp_path: Path) -> None:
    machine = build_machine(load_case(SLAB))
    assert machine.position(100.0) == 2.0
    assert 10.5 < machine.height(20.0) < 11.5
    assert machine.curvature(8.0) == pytest.approx(1.0 / 8.006, rel=1e-12)
    assert machine.mould_length == 0.8
    assert len(machine.bends) == 11  # ends of bending and straightening, and rolls between
    plain = build_machine(load_case(SLAB.parents[1] / "billet125" / "thermal.toml"))
    assert (plain.height(0.3), plain.bends) == (0.3, ())


def test_ferrostatic_head_is_the_height_in_a_bent_machine() -> None:
    """A coupled run uses the height, not the length along the strand."""
    bent = SEGMENTS.replace("0.9 m", "0.65 m")
    coarse = [f"mesh.{name}=14 mm" for name in ("surface_size", "corner_size", "core_size")]
    coarse += ["mesh.face_size=14 mm", "casting.length=15 m", "section.symmetry=half"]
    what = load_case(SLAB.parents[1] / "billet125" / "taper_1.toml", [bent, *coarse])
    with simulated(what) as simulation:
        machine, steel = simulation.machine, simulation.steel
        liquid = simulation.mechanics.problem.slice.ferrostatic
        assert liquid is not None
        weight = 9.81 * float(steel.density(steel.liquidus + 1.0))
        for time in (5.0, 100.0, 240.0):
            height = machine.height(machine.position(time))
            assert liquid.head(time) == pytest.approx(weight * height, rel=1e-12)
        assert machine.height(14.4) < 0.8 * 14.4
        within = [bend for bend in machine.bends if bend < 15.0]
        assert len(within) == 3
        for bend in within:
            assert simulation.control.next_stop(bend / 0.06 - 0.01) == pytest.approx(bend / 0.06)


@pytest.mark.parametrize(
    ("rows", "header", "message"),
    [
        (("0.9, 150, 222, x, no,",), HEADER, r"line 3, roll 1: radius_extrados \(x\): "),
        (("0.9, 150",), HEADER, r"line 3: 2 cells, the header has 6; write an empty cell"),
        (("0.9, 0, 222, , no,",), HEADER, r"roll 1: diameter \(0\): must be above 0 mm"),
        (("0.9, 150, 222, 8, maybe,",), HEADER, r"roll 1: driven \(maybe\): yes or no"),
        ((), HEADER, r"has no rolls; it needs a header and one row per pair"),
        (ROWS, HEADER.replace("_extrados", ""), r"line 2: column 'radius': say which face"),
        (ROWS, HEADER.replace("position [m]", "position"), r"name the unit of the column, pos"),
        (("0.9, 8",), "position [m], radius_extrados [m]", r"column 'diameter' is missing"),
    ],
)  # fmt: skip
def test_invalid_files_are_rejected(
    tmp_path: Path, rows: tuple[str, ...], header: str, message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        case(tmp_path, rows, header)
    (line,) = caught.value.problems
    assert line.startswith(f"{tmp_path / 'mine.toml'}: machine.rolls: '{tmp_path / 'mine.csv'}'")


@pytest.mark.parametrize(
    ("row", "text", "message"),
    [
        (0, "0.7, 150, 222, , no,", r"line 3, roll 1: position \(0\.7 m\) lies within the mould, "
         r"which ends at 0\.8 m"),
        (1, "1.0, 150, 222, , no,", r"line 4, roll 2: diameter \(150 mm\) overlaps the previous "
         r"roll by 50 mm at the intrados, 100 mm below it"),
        (2, "1.5, 200, 223, 8, yes, 1", r"line 5, roll 3: aperture \(223 mm\) grows from 222 mm at "
         r"'.*' line 4, roll 2: .* one of the two is wrong"),
        (2, "1.5, 200, 222, 0.4, yes, 1", r"line 5, roll 3: radius_extrados \(0\.4 m\) is below"),
    ],
)  # fmt: skip
def test_impossible_rolls_are_rejected(tmp_path: Path, row: int, text: str, message: str) -> None:
    rows = tuple(text if i == row else valid for i, valid in enumerate(ROWS))
    with pytest.raises(InputError) as caught:
        case(tmp_path, rows)
    lines = caught.value.problems
    assert any(re.search(message, line) for line in lines), lines
    assert all(line.startswith(str(tmp_path)) and "\n" not in line for line in lines)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('machine={rolls="none.csv"}', r"rolls: '.*none\.csv': file not found; correct"),
        ("machine={rolls=3}", r"machine\.rolls: the rolls of a machine are a file"),
        ('machine={first="1 m", segment=[{rolls=0, pitch="0.3 m", diameter="0.2 m"}]}',
         r"machine\.segment\.0\.rolls: "),
        ("machine.roll=3", r"machine\.roll: unknown key.*did you mean rolls"),
    ],
)  # fmt: skip
def test_invalid_machine_tables_are_rejected(tmp_path: Path, change: str, message: str) -> None:
    base = tmp_path / "plain.toml"
    text = (SLAB.parent / "base.toml").read_text().replace('[machine]\nrolls = "rolls.csv"\n', "")
    base.write_text(text)
    with pytest.raises(InputError, match=message):
        load_case(base, [change])


def test_rolls_of_a_strip_are_rejected() -> None:
    strip = SLAB.parents[1] / "verification" / "neumann.toml"
    with pytest.raises(InputError, match="a strip has no thickness"):
        load_case(strip, [SEGMENTS])


def test_equal_errors_of_many_rolls_are_summarised(tmp_path: Path) -> None:
    """Diameters of 9 m: each pair overlaps the previous one."""
    for count, expected in ((4, 3), (6, 1)):
        rows = tuple(f"{0.9 + 0.3 * i:.1f}, 9" for i in range(count))
        with pytest.raises(InputError) as caught:
            case(tmp_path, rows, "position [m], diameter [m]")
        assert len(caught.value.problems) == expected
        assert "line 4, roll 2: diameter (9000 mm) overlaps" in caught.value.problems[0]
    assert caught.value.problems[0].endswith("the pitch longer (and 4 more like it)")


def test_doubtful_machines_give_warnings(tmp_path: Path) -> None:
    """Angles that do not add up, a strand still bent at the end, a section that does not fit."""
    texts = read_case(SLAB, [SEGMENTS]).warnings
    assert any(
        "the angles do not close: the strand leaves the last bent roll at 92" in t for t in texts
    )
    assert any(
        "still bent at the last roll, R = 8 m" in t for t in read_case(written(tmp_path)).warnings
    )
    thick = read_case(SLAB, ["section.height=300 mm"]).warnings
    assert any("roll 1: aperture (229.6 mm) of a section 300 mm thick" in t for t in thick)
    tight = tuple(row.replace(" 8,", " 2,") for row in ROWS)
    (tmp_path / "tight").mkdir()
    assert any(
        "strains the faces" in t for t in read_case(written(tmp_path / "tight", tight)).warnings
    )
    assert read_case(SLAB).warnings == ()


def test_bulging_beyond_the_last_roll_gives_a_warning() -> None:
    """The last roll is at 26.4 m, 0.32 m below the previous one."""
    bulging = SLAB.parent / "reference.toml"
    for length, key, expected in (
        ("26.9 m", "mechanics.bulging=elastic", True),
        ("26.6 m", "mechanics.bulging=elastic", False),
        ("26.9 m", "mechanics.bulging=none", False),
    ):
        found = read_case(bulging, [f"casting.length={length}", key]).warnings
        assert any("beyond the last roll, at 26.4" in text for text in found) == expected, length
    lost = [{"kind": "lost", "roll": number} for number in (86, 87)]
    ended = read_case(bulging, ["casting.length=26.4 m", "mechanics.bulging=elastic"]).case
    assert isinstance(ended, Case)
    without = list(warnings(ended.with_({"machine.defect": lost})))
    assert any("beyond the last roll, at 25." in one.text for one in without)


@pytest.mark.parametrize(
    ("position", "value", "message"),
    [
        (["0.87 m", "26.5 m"], ["7 kN", "700 kN"], ""),
        (["0.87 m", "26.3 m"], ["0 kN", "700 kN"], ""),  # within the last pitch
        (["2 m", "26.5 m"], ["0 kN", "700 kN"], "26.5 m, the rolls .*: rolls 1 to 6 have no res"),
        (["2 m", "26 m"], ["0 kN", "700 kN"], ": rolls 1 to 6 and roll 87 have no resistance"),
    ],
)
def test_incomplete_curve_of_resistance_gives_a_warning(
    position: list[str], value: list[str], message: str
) -> None:
    slab = load_case(SLAB.parent / "reference.toml")
    case = slab.with_({"machine.extraction.resistance": {"position": position, "value": value}})
    texts = [problem.text for problem in warnings(case)]
    assert bool(texts) == bool(message)
    assert not message or re.search(message, texts[0]), texts


THICKNESS = 0.220


def slab(*off: int, **more: int) -> Case:
    """Return the slab of the thesis with rolls off by 1.5 mm, by number, and `lost` rolls."""
    defects = [{"kind": "misaligned", "roll": roll, "by": "1.5 mm"} for roll in off]
    defects += [{"kind": "lost", "roll": roll} for roll in more.values()]
    return load("slab1200/reference").with_({"machine.defect": defects} if defects else {})


@pytest.mark.parametrize("off", [(30,), (5,), (30, 45)])
def test_phases_are_independent_of_misaligned_rolls(off: tuple[int, ...]) -> None:
    normal, rolls = rolls_of(slab()), rolls_of(slab(*off))
    assert phases(rolls) == phases(normal)
    assert off_stretches(normal) == []
    assert [one.name for one in off_stretches(rolls)] == [f"roll {roll} off" for roll in off]
    assert close_by(rolls, 0.0, 18.0) == close_by(normal, 0.0, 18.0)


def test_stretch_is_where_the_curvature_differs() -> None:
    normal, rolls = rolls_of(slab()), rolls_of(slab(30))
    (stretch,) = off_stretches(rolls)
    first, last = (rolls.pairs[i].position for i in (stretch.first, stretch.last))
    lines = [one.line(THICKNESS) for one in (normal, rolls)]
    for position in np.linspace(0.8, 18.0, 2000):
        before, after = (line.curvature(float(position)) for line in lines)
        inside = first + 1e-9 < position < last - 1e-9
        assert (abs(before - after) > 1e-12) <= inside
    assert (stretch.first + 1, stretch.last + 1) == (28, 32)


def test_overlapping_stretches_are_merged() -> None:
    (one,) = off_stretches(rolls_of(slab(30, 32)))
    assert (one.name, one.first + 1, one.last + 1) == ("rolls 30, 32 off", 28, 34)
    one, other = off_stretches(rolls_of(slab(30, 34)))
    assert one.last == other.first


def test_stretch_skips_a_lost_pair() -> None:
    (one,) = off_stretches(rolls_of(slab(30, lost=31)))
    assert (one.first + 1, one.last + 1) == (28, 33)


def test_positions_have_the_name_of_their_roll() -> None:
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


def test_report_and_machine_name_the_misaligned_roll(tmp_path: Path) -> None:
    named = {}
    for name, one in (("order", slab()), ("off", slab(30))):
        (tmp_path / CASE_NAME).write_text(one.resolved_toml())
        named[name] = {p.name: p.position for p in places_of(tmp_path, None, 18.4)}
    roll = rolls_of(slab(30)).pairs[29].position
    assert named["off"] == named["order"] | {"roll 30 off": roll}
    assert {"bending ends", "straightening ends"} < set(named["order"])
    rows = machine_rows(rolls_of(slab(30)), THICKNESS)
    assert dict(rows)["roll 30 off"].endswith("rolls 28 to 32 bend the strand as well")
    assert [row for row in rows if row[0] != "roll 30 off"][:6] == machine_rows(
        rolls_of(slab()), THICKNESS
    )[:6]
