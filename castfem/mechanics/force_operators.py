"""Forces of stress and pressure as sparse operators: many at once, at small strain.

Where strain is linear in the displacement, the virtual work of `castfem.forms.mechanics` is linear
in all it sees, and its forces are those of the transposed strain operator.  Projected on each cell
is the strain here, the stress there: the projection is its own adjoint.

The last axis of the arrays here counts what is asked about (k).
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from scipy import sparse

from castfem.fem import reductions
from castfem.fem.dolfinx_compat import assemble_owned
from castfem.forms.mechanics import pressure_work
from castfem.mechanics.fields import MEAN, ONE
from castfem.mechanics.problem import MechanicalProblem
from castfem.values.types import Array


class ForceOperators:
    """Of the slice of a problem.

    Args:
        problem: At small strain, without tractions and pressures of its own on the surface.
    """

    def __init__(self, problem: MechanicalProblem) -> None:
        self._problem, points = problem, problem.points
        self._lever = np.column_stack([np.ones(points.count), points.position])
        every = points.strain[4 * points.deviator_points :]
        self._dilation: sparse.csr_matrix = every[0::4] + every[1::4] + every[2::4]
        self._held: tuple[fem.Function, fem.Form] | None = None
        if problem.loads.liquid is not None:
            section, loads = problem.section, problem.loads
            pressure = fem.Function(section.vertex_space)
            test = ufl.TestFunction(problem.space)
            groups = tuple(section.matching(section.outer_groups))
            work = -pressure_work(pressure, test, section.mesh, loads.measure(groups))
            self._held = pressure, section.compile("mechanics.held_liquid", work)

    def strains(self, motion: Array, generalized_strains: Array) -> Array:
        """Strain at the active points by motions (dofs, k) and (4, k): (n, 4, k)."""
        active = self._problem.active
        found = (active.strain @ motion).reshape(active.count, 4, -1)
        found[:, 1] += generalized_strains[3]
        found[:, 2] += self._lever[active.rows] @ generalized_strains[:3]
        return np.asarray(found)

    def of_stress(self, stress: Array) -> tuple[Array, Array]:
        """Forces of stresses at the active points (n, 4, k), Pa (collective).

        Returns:
            At this rank's nodes, ghosts included (dofs, k), N/m; work on each generalized strain
            (4, k).
        """
        active = self._problem.active
        mean = np.tensordot(MEAN, stress, axes=(0, 1))
        borne = stress.copy()
        deviator = slice(0, active.deviator_points)
        borne[deviator] -= ONE[None, :, None] * mean[deviator, None]
        rest = slice(active.deviator_points, None)
        borne[rest] = ONE[None, :, None] * mean[rest, None]
        borne *= active.volume[:, None, None]
        forces = active.strain.T @ borne.reshape(-1, borne.shape[2])
        work = np.vstack([self._lever[active.rows].T @ borne[:, 2], borne[:, 1].sum(axis=0)[None]])
        return np.asarray(forces), reductions.totals(self._problem.section.comm, work)

    def of_pressure(self, pressure: Array) -> tuple[Array, Array]:
        """The same of ferrostatic pressure at all points of the mean stress (n, k), Pa."""
        weighted = self._problem.points.mean.volume[:, None] * pressure
        work = np.zeros((4, pressure.shape[1]))
        work[3] = -weighted.sum(axis=0)
        comm = self._problem.section.comm
        return -np.asarray(self._dilation.T @ weighted), reductions.totals(comm, work)

    def of_held_liquid(self, pressure: Array) -> Array:
        """Forces (owned, k), N/m, of liquid held from outside, its pressure at the owned vertices.

        Args:
            pressure: (vertices, k), Pa (collective).
        """
        assert self._held is not None
        function, form = self._held
        found = np.zeros((self._problem.owned, pressure.shape[1]))
        for number in range(pressure.shape[1]):
            function.x.array[: len(pressure)] = pressure[:, number]
            function.x.scatter_forward()
            found[:, number] = assemble_owned(form, self._problem.owned)
        return found
