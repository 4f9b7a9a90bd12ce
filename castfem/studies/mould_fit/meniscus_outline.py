"""The section at the meniscus that gives a wanted outline further down (Fig. 121).

In an idealised mould the strand bulges and shrinks. A fixed-point iteration of its outline
compensates for that: where it is too large at the end, the section is made smaller. The change of
the strand hardly depends on such a correction (0.2 mm of 60), so that each iteration leaves a few
hundredths of the deviation.

Figures are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np

from castfem.base.errors import InputError, RunFailure
from castfem.base.types import Array
from castfem.meshes.bulge import normals_round, ways_round
from castfem.model.section import Rectangle
from castfem.physics.mould.cavity import Sides, rectangle
from castfem.physics.mould.displaced import WallDisplacement
from castfem.physics.mould.perimeter import Places
from castfem.studies.mould_fit.follow import Followed, follow

if TYPE_CHECKING:
    from castfem.model import Case


@dataclass(frozen=True, slots=True)
class SectionLimits:
    """Convergence criteria of the section."""

    close: float = 10e-6  #: largest deviation from the wanted outline, m
    runs: int = 6  #: largest number of runs


LIMITS = SectionLimits()


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """An outline relative to a rectangle, over the length round a quarter."""

    ways: Array  #: lengths to the vertices (n,), m, increasing
    offset: Array  #: outward distance from the rectangle (n,), m


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """One run."""

    start: Outline  #: outline at the meniscus
    end: Outline  #: outline at the wanted position
    worst: float  #: largest deviation there, m
    strand: Followed  #: surface of the strand in the run


def find_section(
    case: Case,
    comm: MPI.Comm,
    origin: str,
    at: float | None = None,
    report: Callable[[int, Attempt], None] = lambda number, attempt: None,
) -> list[Attempt]:
    """Return the runs, the last of which ends with the rectangle of the case (collective).

    Args:
        case: A case with mechanics and without a mould.
        comm: Communicator.
        origin: Name of the case in messages.
        at: Position of the wanted section, m; None: the end of the mould, or of the run.
        report: Called after each run.
    """
    section = _checked(case, origin)
    if at is None:
        at = min(case.mould_exit() or case.casting.length, case.casting.length)
    sides = sides_of_section(section)
    found: list[Attempt] = []
    start: Outline | None = None
    for number in range(1, LIMITS.runs + 1):
        strand = follow(_changed(case, at, start), comm)
        if start is None:
            ways = _vertices(strand.line.place, sides)[0]
            start = Outline(ways, np.zeros(len(ways)))
        end = outline_of(strand.outline[-1], strand.line.place, start, sides)
        found.append(Attempt(start, end, float(np.abs(end.offset).max()), strand))
        report(number, found[-1])
        if found[-1].worst <= LIMITS.close:
            return found
        start = Outline(start.ways, start.offset - end.offset)
    raise RunFailure(
        f"{origin}: after {LIMITS.runs} runs the section is still "
        f"{1e6 * found[-1].worst:.0f} um off the required one at "
        f"{1e3 * at:g} mm (allowed: {1e6 * LIMITS.close:.0f} um)"
    )


def _checked(case: Case, origin: str) -> Rectangle:
    """Return the section of a case, after checking that it can be used."""
    section = case.section
    if not isinstance(section, Rectangle) or section.corner_radius == 0.0:
        raise InputError(
            f"{origin}: section: only a rectangle with rounded corners is supported; shape = "
            '"rectangle" with corner_radius = "5 mm"'
        )
    if case.mechanics is None:
        raise InputError(
            f"{origin}: mechanics: the table is missing, so the strand does not deform; "
            "billet125/idealised has one"
        )
    if case.mould is not None:
        raise InputError(
            f"{origin}: mould: the outline is computed in an idealised mould, which follows the "
            "strand; leave [mould] out, as billet125/idealised does"
        )
    return section


def sides_of_section(section: Rectangle) -> Sides:
    """Return the rectangle of a section, without its bulge."""
    half = 0.5 * section.width, 0.5 * section.height
    return Sides(half, half, section.corner_radius)


def _changed(case: Case, at: float, start: Outline | None) -> Case:
    """Return the case down to a position, with an outline at the meniscus."""
    changes: dict[str, Any] = {"casting.length": f"{at!r} m"}
    if start is not None:
        changes["section.bulge"] = {
            "way": start.ways.tolist(),
            "way_unit": "m",
            "value": start.offset.tolist(),
            "unit": "m",
        }
    return case.with_(changes)


def _vertices(place: Array, sides: Sides) -> tuple[Array, Array]:
    """Return the distinct lengths of vertices (n, 2), and the index of that of each vertex."""
    (a, b), r = sides.middle, sides.radius
    ways, number = np.unique(np.round(ways_round(place, a, b, r), 12), return_inverse=True)
    return np.asarray(ways), np.asarray(number)


def outline_of(points: Array, place: Array, start: Outline, sides: Sides) -> Outline:
    """Return the outward distance of a strand's surface from the rectangle.

    Vertices of a half or a whole section that correspond to one place of the quarter are averaged.

    Args:
        points: Present positions of its vertices (n, 2), m.
        place: Their positions at the meniscus (n, 2), m.
        start: Outline at the meniscus.
        sides: The rectangle.
    """
    (a, b), r = sides.middle, sides.radius
    ways = ways_round(place, a, b, r)
    number = np.abs(start.ways[None, :] - ways[:, None]).argmin(axis=1)
    normals = normals_round(start.ways, b, r)[number]
    gap = rectangle(sides).gap_function(np.abs(points), normals).gap
    count = np.bincount(number, minlength=len(start.ways))
    return Outline(start.ways, -np.bincount(number, gap, len(start.ways)) / count)


def natural_wall(attempt: Attempt, sides: Sides) -> WallDisplacement:
    """Return the wall that follows a strand all round and along the mould, from the rectangle."""
    places = Places.spread(sides, 8, 6)
    ways = places.ways(sides)
    _, normals = places.on(sides)
    strand = attempt.strand
    rows = [
        np.interp(
            ways,
            attempt.start.ways,
            outline_of(points, strand.line.place, attempt.start, sides).offset,
        )
        for points in strand.outline
    ]
    moved = np.array(rows)[:, :, None] * normals[None]
    return WallDisplacement(strand.positions, ways, moved)
