"""Gap between wall and strand, as the heat that crosses it asks for it.

The wall meets the surface at two points of each facet, along which the displacement is of second
order: a wave that is out at both ends of a facet and in between is zero at its points, and no wall
feels it.  All along a face that is liquid nothing else resists that wave either, so that the shell
may freeze in it.  The gap is therefore that of the points, where the wall is met, and at a vertex
what the line through those of a facet says of its end.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.physics.contact.wall_contact import WallContact
from castfem.physics.mechanics.state import MechanicalState

OFF = 1e-9  # a vertex' hat function at points of facets that are not its own: rounding


class SurfaceGap:
    """Gap between wall and strand at the vertices of the surface: what heat transfer asks for.

    Args:
        contact: Of the mechanical problem.

    Attributes:
        dofs: Owned vertices on the groups in contact (n,).
    """

    def __init__(self, contact: WallContact) -> None:
        self._contact = contact
        section = contact.section
        self._space = section.vertex_space
        self._length = self._gathered(contact.facets.weight)
        shortest = OFF * reductions.largest(section.comm, self._length)
        self.dofs = np.flatnonzero(self._length > shortest)
        self._ends = _ends(contact)

    def _gathered(self, density: Array) -> Array:
        """Sum of values at facet points by the vertices' hat functions (owned,)."""
        return dof_values.summed(self._space, self._contact.at_vertices.T @ density)

    def mean(self, values: Array) -> Array:
        """Mean of values at the facets' points (points,) around each of the vertices `dofs`."""
        gathered = self._gathered(self._contact.facets.weight * values)
        return gathered[self.dofs] / self._length[self.dofs]

    def at(self, state: MechanicalState) -> Array:
        """Distance to the wall along its normal at the vertices `dofs` (n,), m (collective).

        Negative where the strand has penetrated, infinite where there is no wall.  Each facet of a
        vertex has its own; the vertex has their mean by length.  At a sharp corner that is the mean
        of the gaps to two walls.

        Args:
            state: Has the displacement and the time.
        """
        contact = self._contact
        position = contact.contact.position(state.time)
        return self.of_points(contact.gap(position, state.displacement, state.generalized_strains))

    def of_points(self, gap: Array) -> Array:
        """The same of the distances at the facets' points (points,), m (collective)."""
        none = np.isinf(gap)
        found = self.spread(np.where(none, 0.0, gap))
        return np.where(self.mean(none.astype(float)) > OFF, np.inf, found)

    def spread(self, values: Array) -> Array:
        """Values at the points (points,) at the vertices `dofs`, by what the facets' lines say."""
        at_ends = dof_values.summed(self._space, self._ends @ values)
        return at_ends[self.dofs] / self._length[self.dofs]

    def crossed(self, state: MechanicalState) -> Array:
        """The gap that heat crosses, at all owned vertices (owned,), m (collective).

        0 where the strand touches the wall, and off the groups in contact.

        Args:
            state: Has the displacement and the time.
        """
        found = np.zeros(self._contact.section.owned)
        found[self.dofs] = np.maximum(self.at(state), 0.0)
        return found


def _ends(contact: WallContact) -> sparse.csr_matrix:
    """Operator from values at the points to those at the ends of the facets (vertices, points), m.

    Along each facet it takes the line nearest to the values, by least squares, and adds what that
    is at either end times the length of facet that belongs to this end.
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
