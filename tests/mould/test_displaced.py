"""Displaced walls: compared with moulds of the same shape, in case files, invalid input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.model import load_case
from castfem.model.load import from_document
from castfem.model.mould_from_case import build_mould
from castfem.model.wall_shape import WallShape, write_wall
from castfem.physics.mould import (
    DisplacedMould,
    Expansion,
    Mould,
    RectangleCavity,
    RoundCavity,
    Taper,
    WallDisplacement,
    same,
)
from castfem.physics.mould.perimeter import Places, sides_of

TAPER = same(Taper.single(0.01, 0.6))
SQUARE = RectangleCavity(0.125, 0.125, 0.005)
BULGED = RectangleCavity(0.125, 0.11, 0.006)


def displaced(cavity: RectangleCavity | RoundCavity, by: float) -> DisplacedMould:
    """Return a mould whose wall is `by` times as far from the axis as that of its cavity."""
    start = sides_of(cavity, TAPER, 0.0)
    places = Places.spread(start, 5, 6)
    positions = np.linspace(0.0, 0.6, 7)
    moved = np.array([(by - 1.0) * places.on(sides_of(cavity, TAPER, z))[0] for z in positions])
    wall = WallDisplacement(positions, places.ways(start), moved)
    return DisplacedMould(cavity, 0.6, TAPER, wall)


def rays(count: int = 200) -> tuple[Array, Array]:
    """Return points inside every cavity used here, and directions all round."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return 0.04 * unit, unit


@pytest.mark.parametrize("cavity", [SQUARE, BULGED, RoundCavity(0.12)])
@pytest.mark.parametrize("by", [1.0, 1.003])
def test_uniform_growth_is_free_expansion(cavity: RectangleCavity | RoundCavity, by: float) -> None:
    expansion = Expansion((by - 1.0) / 100.0, 300.0, Constant(400.0))
    plain, shaped = Mould(cavity, 0.6, TAPER, None, expansion), displaced(cavity, by)
    points, normals = rays()
    for position in (0.0, 0.237, 0.6):
        expected = plain.gap_function(points, normals, position)
        found = shaped.gap_function(points, normals, position)
        # Here arcs are parabolas of a few degrees each, 0.3 um off a circle of 60 mm.
        assert found.gap == pytest.approx(expected.gap, abs=1e-6)
        assert (found.normal * expected.normal).sum(axis=1) == pytest.approx(1.0, abs=1e-4)
        assert shaped.dimensions(position) == pytest.approx(plain.dimensions(position), abs=1e-7)
        assert shaped.marks(position) == pytest.approx(plain.marks(position), abs=1e-7)
    assert np.isinf(shaped.gap_function(points, normals, 0.7).gap).all()


def test_dimensions_as_made_are_those_of_the_drawing() -> None:
    shaped = displaced(SQUARE, 1.002)
    assert shaped.dimensions(0.3, as_made=True) == Mould(SQUARE, 0.6, TAPER).dimensions(0.3)


def test_gap_and_normal_of_a_bulged_wall_are_exact() -> None:
    """The wall bulges by a parabola, which adds to the gap and tilts the normal."""
    start = sides_of(SQUARE, TAPER, 0.0)
    places = Places.spread(start, 8, 4)
    points, _ = places.on(start)
    bulge = 1e-3 * np.maximum(1.0 - (points[:, 1] / 0.0575) ** 2, 0.0)
    right = points[:, 0] > 0.0624
    moved = np.stack([np.where(right, bulge, 0.0), np.zeros(len(bulge))], axis=1)
    wall = WallDisplacement(np.array([0.0, 0.6]), places.ways(start), np.array([moved, moved]))
    mould = DisplacedMould(SQUARE, 0.6, same(Taper.single(0.0, 0.6)), wall)
    y = np.linspace(-0.05, 0.05, 21)
    surface, east = np.stack([np.full(21, 0.0625), y], 1), np.tile([1.0, 0.0], (21, 1))
    found = mould.gap_function(surface, east, 0.3)
    assert found.gap == pytest.approx(1e-3 * (1.0 - (y / 0.0575) ** 2), abs=1e-9)
    slope = 2e-3 * y / 0.0575**2
    assert found.normal[:, 1] / found.normal[:, 0] == pytest.approx(slope, abs=1e-6)
    west = mould.gap_function(-surface, -east, 0.3)
    assert west.gap == pytest.approx(found.gap, abs=1e-12)


def test_wall_is_smooth_between_positions() -> None:
    start = sides_of(SQUARE, TAPER, 0.0)
    ways = Places.spread(start, 2, 2).ways(start)
    z = np.linspace(0.0, 0.6, 25)
    moved = np.zeros((25, len(ways), 2))
    moved[..., 0] = (1e-4 * np.sin(2.0 * np.pi * z / 0.6))[:, None]
    wall = WallDisplacement(z, ways, moved)
    between = np.linspace(0.05, 0.55, 101)
    exact = 1e-4 * np.sin(2.0 * np.pi * between / 0.6)
    assert [wall.at(p)[0, 0] for p in between] == pytest.approx(exact, abs=2e-9)
    assert wall.at(-1.0) == pytest.approx(wall.at(0.0))
    assert wall.at(9.0) == pytest.approx(wall.at(0.6))
    assert wall.less(0.15).at(0.15) == pytest.approx(0.0, abs=1e-18)


def test_file_and_columns_are_read_back(tmp_path: Path) -> None:
    shape = displaced(SQUARE, 1.002).displacement
    path = tmp_path / "wall.csv"
    write_wall(path, shape, "a wall")
    again = WallShape().read({"file": str(path)})
    assert again.moved == pytest.approx(shape.moved, abs=1e-11)
    notation = WallShape()
    assert notation.read(notation.write(shape)) == shape
    assert notation.read({"file": str(path)}) == again
    assert hash(notation.read(notation.write(shape))) == hash(shape)
    assert shape != again and shape != 1


def test_case_with_a_displaced_wall_is_unchanged_when_reread(write, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    shape = displaced(SQUARE, 1.002).displacement
    write_wall(tmp_path / "wall.csv", shape, "a wall")
    lines = 'taper = "1 %/m"\ncondition = "cold"\ndisplacement = { file = "wall.csv" }'
    case = load_case(write(lines))
    assert case.mould is not None
    found = build_mould(case.mould, case.section)
    assert isinstance(found, DisplacedMould) and found.expansion is None
    assert found.dimensions(0.3) == pytest.approx(
        displaced(SQUARE, 1.002).dimensions(0.3), abs=1e-9
    )
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "again.toml").write_text(case.resolved_toml())
    again = load_case(elsewhere / "again.toml")
    assert again.mould == case.mould
    assert again.physics_hash() == case.physics_hash()
    assert from_document(case.document()).physics_hash() == case.physics_hash()


WRONG = {
    "head": ("way [mm], x [mm]\n0, 0\n", r"line 1: a header and rows are needed: position \[mm\]"),
    "text": ("position [mm], way [mm], x [mm], y [mm]\n0, 0, a, 0\n", r"line 2: x \(a\): "),
    "twice": (
        "position [mm], way [mm], x [mm], y [mm]\n"
        + "".join(f"{z}, {s}, 0, 0\n" for z in (0, 1) for s in (0, 9, 9 if z else 18)),
        "a place appears twice at one position",
    ),
    "lacks": (
        "position [mm], way [mm], x [mm], y [mm]\n0, 0, 0, 0\n0, 9, 0, 0\n1, 0, 0, 0\n",
        "3 rows do not make 2 positions of 2 places",
    ),
    "corner": (
        "position [mm], way [mm], x [mm], y [mm]\n"
        + "".join(f"{z}, {s}, 0, 0\n" for z in (0, 600) for s in (0, 61.427, 122.854)),
        "needs a place at 57.5 mm of its quarter",
    ),
    "folds": (
        "position [mm], way [mm], x [mm], y [mm]\n"
        + "".join(f"{z}, {s}, 0, {80 if s == 28.75 else 0}\n" for z in (0, 600)
                  for s in (0, 28.75, 57.5, 61.4, 65.354, 94, 122.854)),
        "turns back",
    ),
}  # fmt: skip


@pytest.mark.parametrize("which", WRONG)
def test_invalid_files_are_rejected_in_one_line(write, tmp_path: Path, which: str) -> None:  # type: ignore[no-untyped-def]
    text, words = WRONG[which]
    (tmp_path / "wall.csv").write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        load_case(write('displacement = { file = "wall.csv" }'))
    assert str(caught.value).count("\n") == 0 and "mould.displacement" in str(caught.value)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ('"wall.csv"', "a displaced wall is needed"),
        ('{ file = "none.csv" }', "the displaced wall '.*none.csv': file not found"),
        ("{ place = [0] }", "unknown key 'place' in a displaced wall"),
        ("{ position = [0], way = [0], x = [0], y = [0, 1], unit = 'mm' }", "equally long"),
    ],
)
def test_invalid_columns_are_rejected(write, value: str, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=words):
        load_case(write(f"displacement = {value}"))


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('thickness = "10 mm"\nflux = "2 MW/m^2"\nhot_face = "150 degC"', "hot_face: the flux is"),
        ('thickness = "10 mm"\ncells_across = 1.5', "cells_across: must be a whole number"),
        ('above = "50 mm"', "thickness: is missing"),
        ('thickness = "10 mm"\nsupport = "glued"', "support"),
    ],
)
def test_invalid_tubes_are_rejected(write, lines: str, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=words):
        load_case(write(f"[mould.tube]\n{lines}"))


def test_sharp_corner_has_no_tube(write) -> None:  # type: ignore[no-untyped-def]
    path = write('[mould.tube]\nthickness = "10 mm"', more='[section]\ncorner_radius = "0 mm"')
    with pytest.raises(InputError, match=r"mould.tube: a tube has rounded corners"):
        load_case(path)
