"""Gap between wall and strand for heat transfer.

The wall acts at two points of each facet, along which the displacement is quadratic: a wave that is
outwards at both ends of a facet and inwards in between is zero at these points, and the wall does
not resist it. Along a liquid face nothing else does either, so that the shell may freeze in it. The
gap is therefore that of the points, where the wall acts, extrapolated linearly along each facet to
its vertices.

A vertex at a sharp corner faces two walls, which may be millimetres apart: heat crosses each of the
two gaps over its part of the surface, which differs from the heat across the mean gap.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.physics.contact.wall_contact import WallContact
from castfem.physics.mechanics.state import MechanicalState

SHARP = 0.5  # largest cosine of the angle between the facets of a corner that faces two walls
OFF = 1e-9  # rounding: a vertex' hat function at points of facets that are not its own


class SurfaceGap:
    """Gap between wall and strand at the vertices of the surface, for heat transfer.

    Args:
        contact: Contact of the mechanical problem.

    Attributes:
        dofs: Owned vertices on the groups in contact (n,).
        corners: Owned vertices that face two walls (k,).
        count: Number of gaps: one at each owned vertex, followed by the second one of each corner.
        places: Indices of the gaps at the surface in contact (n + k,). second: Index of the second
            gap of each owned vertex, its own except at corners (owned,). first: Fraction of the
            surface of each owned vertex with its first gap (owned,).
    """

    def __init__(self, contact: WallContact) -> None:
        self._contact = contact
        section = contact.section
        self._space = section.vertex_space
        self._length = self._gathered(contact.facets.weight)
        shortest = OFF * reductions.largest(section.comm, self._length)
        self.dofs = np.flatnonzero(self._length > shortest)
        self._ends = _ends(contact)
        weight, normal = contact.facets.weight, contact.facets.normal
        along_y = (np.abs(normal[:, 0]) > np.abs(normal[:, 1])).astype(float)
        self._of_sides = 1.0 - along_y, along_y
        lengths = [self._gathered(weight * side) for side in self._of_sides]
        facing = [[self._gathered(weight * side * n) for n in normal.T] for side in self._of_sides]
        cosine = np.sum(np.prod(facing, axis=0), axis=0)
        there = np.minimum(*lengths) > shortest
        self.corners = np.flatnonzero(there & (cosine < SHARP * lengths[0] * lengths[1]))
        self._lengths = [length[self.corners] for length in lengths]
        self.count = section.owned + len(self.corners)
        self.places = np.concatenate([self.dofs, np.arange(section.owned, self.count)])
        self.second = np.arange(section.owned)
        self.second[self.corners] = np.arange(section.owned, self.count)
        self.first = np.ones(section.owned)
        self.first[self.corners] = self._lengths[0] / np.sum(self._lengths, axis=0)

    def _gathered(self, density: Array) -> Array:
        """Sum of values at facet points by the vertices' hat functions (owned,)."""
        return dof_values.summed(self._space, self._contact.at_vertices.T @ density)

    def mean(self, values: Array) -> Array:
        """Mean of values at the facets' points (points,) around each of the vertices `dofs`."""
        gathered = self._gathered(self._contact.facets.weight * values)
        return gathered[self.dofs] / self._length[self.dofs]

    def at(self, state: MechanicalState) -> Array:
        """Distance to the wall along its normal at the vertices `dofs` (n,), m (collective).

        Negative where the strand has penetrated, infinite without a wall. Each facet of a vertex
        has its own gap; that of the vertex is their mean by length. At a sharp corner this is the
        mean of the gaps to two walls.

        Args:
            state: Gives the displacement and the time.
        """
        contact = self._contact
        position = contact.contact.position(state.time)
        return self.of_points(contact.gap(position, state.displacement, state.generalized_strains))

    def of_points(self, gap: Array) -> Array:
        """The same from the distances at the facets' points (points,), m (collective)."""
        none = np.isinf(gap)
        found = self.spread(np.where(none, 0.0, gap))
        return np.where(self.mean(none.astype(float)) > OFF, np.inf, found)

    def spread(self, values: Array) -> Array:
        """Extrapolate values at the points (points,) along the facets to the vertices `dofs`."""
        at_ends = dof_values.summed(self._space, self._ends @ values)
        return at_ends[self.dofs] / self._length[self.dofs]

    def sides(self, values: Array) -> Array:
        """Like `spread`, separately for the two sides of a corner: at `places` (n + k,)."""
        found, ends = self.spread(values), list[Array]()
        for side, length in zip(self._of_sides, self._lengths, strict=True):
            at_ends = dof_values.summed(self._space, self._ends @ (side * values))
            ends.append(at_ends[self.corners] / length)
        found[np.searchsorted(self.dofs, self.corners)] = ends[0]
        return np.concatenate([found, ends[1]])

    def across(self, gap: Array) -> Array:
        """Gaps for heat transfer from the distances at the points (points,), at `places`, m.

        (Collective.)
        """
        none = np.isinf(gap)
        found, without = self.sides(np.where(none, 0.0, gap)), none.astype(float)
        off = np.concatenate([self.mean(without) > OFF, np.zeros(len(self.corners), bool)])
        corners = [np.searchsorted(self.dofs, self.corners), slice(len(self.dofs), None)]
        for at, side, length in zip(corners, self._of_sides, self._lengths, strict=True):
            met = self._gathered(self._contact.facets.weight * side * without)[self.corners]
            off[at] = met > OFF * length
        return np.where(off, np.inf, found)

    def crossed(self, state: MechanicalState) -> Array:
        """The gaps for heat transfer (count,), m (collective).

        0 where the strand touches the wall, and on groups without contact.

        Args:
            state: Gives the displacement and the time.
        """
        found, position = np.zeros(self.count), self._contact.contact.position(state.time)
        gap = self._contact.gap(position, state.displacement, state.generalized_strains)
        found[self.places] = np.maximum(self.across(gap), 0.0)
        return found

    def shares(self, perimeter: Array) -> Array:
        """Perimeter of each gap (count,), from that of the owned vertices (owned,), m."""
        rest = (1.0 - self.first[self.corners]) * perimeter[self.corners]
        return np.concatenate([self.first * perimeter, rest])


def _ends(contact: WallContact) -> sparse.csr_matrix:
    """Operator from values at the points to those at the ends of the facets (vertices, points), m.

    Along each facet it takes the least-squares line through the values, and adds its value at
    either end times the length of facet that belongs to this end.
    """
    facets, hats = contact.facets, contact.at_vertices
    own = hats.multiply(abs(hats) > OFF).tocsr()
    own.sort_indices()
    shape = (len(facets.cells), facets.per_facet, 2)
    values, vertices = own.data.reshape(shape), own.indices.reshape(shape)
    weighted = facets.weight.reshape(shape[:2])[:, :, None] * values
    moments = np.einsum("fpa,fpb->fab", weighted, values)
    line = np.linalg.solve(moments, np.swapaxes(weighted, 1, 2))
    entries = weighted.sum(axis=1)[:, :, None] * line
    of_facet = np.arange(facets.count).reshape(shape[0], 1, shape[1])
    points = np.broadcast_to(of_facet, entries.shape)
    places = np.swapaxes(vertices, 1, 2).ravel(), points.ravel()
    return sparse.csr_matrix((entries.ravel(), places), shape=(hats.shape[1], facets.count))
