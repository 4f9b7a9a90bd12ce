"""Gap between wall and strand, as the heat that crosses it asks for it."""

from __future__ import annotations

import copy

import numpy as np

from castfem.contact.wall_contact import WallContact
from castfem.fem import dof_values, reductions
from castfem.mechanics.quadrature import Points
from castfem.mechanics.state import MechanicalState
from castfem.values.types import Array


class SurfaceGap:
    """Gap between wall and strand at the vertices of the surface: what heat transfer asks for.

    Args:
        contact: Of the mechanical problem.
        points: Its quadrature points.

    Attributes:
        dofs: Owned vertices on the groups in contact (n,).
    """

    def __init__(self, contact: WallContact, points: Points) -> None:
        self._contact, self._points = contact, points
        section = contact.section
        self._space = section.vertex_space
        length = self._gathered(contact.facets.weight)
        # What a vertex off the surface gets of the facets around it is rounding.
        self.dofs = np.flatnonzero(length > 1e-9 * reductions.largest(section.comm, length))
        self._places = section.vertex_space.tabulate_dof_coordinates()[self.dofs, :2]

    def to_wall(self, contact: WallContact) -> SurfaceGap:
        """The gap of the same vertices to the wall of another contact on the same points."""
        other = copy.copy(self)
        other._contact = contact
        return other

    def _gathered(self, density: Array) -> Array:
        """Sum of values at facet points by the vertices' hat functions (owned,)."""
        return dof_values.summed(self._space, self._contact.at_vertices.T @ density)

    def mean(self, values: Array) -> Array:
        """Mean of values at the facets' points (points,) around each of the vertices `dofs`."""
        weights = self._contact.facets.weight
        return self._gathered(weights * values)[self.dofs] / self._gathered(weights)[self.dofs]

    def at(self, state: MechanicalState) -> Array:
        """Distance to the wall along its normal at the vertices `dofs` (n,), m (collective).

        Negative where the strand has penetrated, infinite where there is no wall.

        Args:
            state: Has the displacement and the time.
        """
        return self.of(state.time, state.displacement, state.generalized_strains)

    def of(self, time: float, displacement: Array, generalized_strains: Array) -> Array:
        """See `at`.

        Args:
            time: Which says where the slice is, s.
            displacement: Of all nodes of this rank, m.
            generalized_strains: Generalized strains (4,).
        """
        contact = self._contact
        position = contact.contact.position(time)
        normal = contact.strand.facing(displacement, generalized_strains)[0]
        weights = contact.facets.weight
        mean = np.column_stack([self._gathered(weights * c) for c in normal.T])[self.dofs]
        mean /= np.maximum(np.hypot(*mean.T), 1e-300)[:, None]
        place = self._places + self._points.moved(displacement, generalized_strains)[self.dofs]
        met = contact.contact.wall.gap_function(place, mean, position)
        return np.asarray(met.gap) * np.einsum("ni,ni->n", met.normal, mean)

    def crossed(self, state: MechanicalState) -> Array:
        """The gap that heat crosses, at all owned vertices (owned,), m (collective).

        0 where the strand touches the wall, and off the groups in contact.

        Args:
            state: Has the displacement and the time.
        """
        found = np.zeros(self._contact.section.owned)
        found[self.dofs] = np.maximum(self.at(state), 0.0)
        return found
