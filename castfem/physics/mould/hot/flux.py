"""Heat flux into the wall of a mould, around a quarter and along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.mould.cavity import Sides
from castfem.physics.mould.perimeter import Places, lengths


@dataclass(frozen=True, slots=True, eq=False)
class FluxMap:
    """Flux at places and positions; linear between them, zero above the first position."""

    positions: Array  #: positions below the meniscus (p,), m, increasing
    ways: Array  #: length of wall from the middle of the right-hand face (w,), m, increasing
    flux: Array  #: (p, w), W/m2; constant below the last position

    def on(self, positions: Array, ways: Array) -> Array:
        """Return the flux (positions, ways) at a mesh's nodes.

        Args:
            positions: Positions of its layers, m.
            ways: Places of its columns, m.
        """
        rows = np.array([np.interp(ways, self.ways, row) for row in self.flux])
        found = np.array(
            [np.interp(positions, self.positions, column, left=0.0) for column in rows.T]
        ).T
        return np.asarray(found)

    def heat(self, positions: Array) -> float:
        """Return the heat of the quarter between the first and the last of some positions, W."""
        fine = np.union1d(positions, self.positions)
        fine = fine[(fine >= max(positions[0], self.positions[0])) & (fine <= positions[-1])]
        values = self.on(fine, self.ways)
        return float(np.trapezoid(np.trapezoid(values, self.ways, axis=1), fine))


def profile(
    flux: Constant | Table, sides: Sides, length: float, corner: float = 1.0, reach: float = 0.02
) -> FluxMap:
    """Return a given profile along the mould, falling towards the corners.

    Args:
        flux: Flux over the position below the meniscus, W/m2.
        sides: Section of the wall at the meniscus.
        length: Length of the mould, m.
        corner: Flux on the arc of the corner over that at mid-face.
        reach: Length of face over which the flux falls to that, m.
    """
    kinks = [k for k in flux.kinks if 0.0 < k < length]
    positions = np.unique([0.0, *kinks, length])
    right, arc, upper = lengths(sides)
    near = min(reach, right, upper)
    whole = right + arc + upper
    if right == 0.0 or near == 0.0 or corner == 1.0:
        knots = {0.0: 1.0, whole: 1.0}
    else:
        falls = {right - near: 1.0, right: corner, right + arc: corner, right + arc + near: 1.0}
        knots = {0.0: 1.0, **falls, whole: 1.0}
    values = np.asarray(flux(positions), float)
    share = np.array(list(knots.values()))
    return FluxMap(positions, np.array(list(knots)), values[:, None] * share[None, :])


class WallPlaces:
    """Places of the wall that receive the heat of the strand's surface.

    A place of the strand's surface corresponds to the place of the wall at the same relative
    position on its face or corner.

    Args:
        places: Positions of the surface's vertices on the undeformed strand (n, 2), m.
        sides: Section of the wall at the meniscus.

    Attributes:
        ways: Length of wall from the middle of the right-hand face to these places (w,), m.
    """

    def __init__(self, places: Array, sides: Sides) -> None:
        dense = Places.spread(sides, 200, 200, order=1)
        wall, _ = dense.on(sides)
        folded = np.abs(places) / np.abs(places).max(axis=0) * wall.max(axis=0)
        near = np.hypot(folded[:, None, 0] - wall[:, 0], folded[:, None, 1] - wall[:, 1])
        ways = dense.ways(sides)[near.argmin(axis=1)]
        self.ways, self._number = np.unique(np.round(ways, 6), return_inverse=True)

    def mean(self, flux: Array) -> Array:
        """Return the flux at the places (w,), W/m2, from that at the vertices (n,).

        For a half or a whole section several vertices correspond to one place.
        """
        return np.asarray(np.bincount(self._number, flux) / np.bincount(self._number))


def of_strand(positions: Array, places: Array, flux: Array, sides: Sides) -> FluxMap:
    """Return the flux of a strand, transferred to the wall's places.

    Args:
        positions: Positions of the samples (p,), m, increasing.
        places: Positions of the surface's vertices on the undeformed strand (n, 2), m.
        flux: Flux (p, n), W/m2.
        sides: Section of the wall at the meniscus.
    """
    wall = WallPlaces(places, sides)
    return FluxMap(
        np.asarray(positions, float), wall.ways, np.array([wall.mean(row) for row in flux])
    )
