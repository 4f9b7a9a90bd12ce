"""Sparse operators for the forces of stress and pressure, for many at once, at small strain.

Where strain is linear in the displacement, the virtual work of `castfem.forms.mechanics` is linear
in its arguments, and its forces follow from the transposed strain operator. Here the strain is
projected on each cell, there the stress: the projection is self-adjoint.

One axis of the arrays counts the vectors (k): the last one, for values at points of the law the
first.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from scipy import sparse

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.compat import assemble_owned
from castfem.forms.mechanics import pressure_work
from castfem.physics.mechanics.fields import MEAN, ONE
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.quadrature import ActivePoints


class ForceOperators:
    """Operators of the slice of a problem.

    Args:
        problem: Problem at small strain, without surface tractions and pressures of its own.
    """

    def __init__(self, problem: MechanicalProblem) -> None:
        self._problem, points = problem, problem.points
        self._strain: sparse.csr_matrix = sparse.hstack([points.strain, self._of_planes()], "csr")
        self._active: ActivePoints | None = None
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

    def _of_planes(self) -> sparse.csr_matrix:
        """Strain of all points from the generalized strains (4 points, 4): zz, and yy across."""
        points = self._problem.points
        zz = np.column_stack([np.ones(points.count), points.position, np.zeros(points.count)])
        found = np.zeros((points.count, 4, 4))
        found[:, 2], found[:, 1, 3] = zz, 1.0
        return sparse.csr_matrix(found.reshape(-1, 4))

    def _follow(self) -> None:
        """Update the active points, which rarely change."""
        problem, active = self._problem, self._problem.active
        if active is self._active:
            return
        self._active = active
        rows = np.arange(problem.points.count)[active.rows]
        self._by_motion = self._strain[(4 * rows[:, None] + np.arange(4)).ravel()]
        # Points of the deviator's rule contribute the deviator, those of the other the mean stress.
        mean = np.outer(ONE, MEAN)
        first = active.deviator_points
        shares = (active.volume[:first], np.eye(4) - mean), (active.volume[first:], mean)
        parts = [sparse.kron(sparse.diags(volume), part) for volume, part in shares if len(volume)]
        weighted = sparse.block_diag(parts, "csr") if parts else sparse.csr_matrix((0, 0))
        self._work = (weighted @ self._by_motion).T.tocsr()

    def strains(self, motion: Array, generalized_strains: Array) -> Array:
        """Strain at the active points from motions (dofs, k) and (4, k): (k, n, 4)."""
        self._follow()
        every = np.concatenate([motion, generalized_strains]).T.copy()
        # One vector after the other: many at once take longer, since rows of k numbers are short.
        found = np.array([self._by_motion @ one for one in every])
        return found.reshape(len(every), -1, 4)

    def of_stress(self, stress: Array) -> tuple[Array, Array]:
        """Forces of stresses at the active points (k, n, 4), Pa (collective).

        Returns:
            Forces at this rank's nodes, including ghosts (dofs, k), N/m; work on each generalized
            strain (4, k).
        """
        self._follow()
        found = np.array([self._work @ one.ravel() for one in stress]).T
        return found[:-4], reductions.totals(self._problem.section.comm, found[-4:])

    def of_pressure(self, pressure: Array) -> tuple[Array, Array]:
        """The same for ferrostatic pressure at all points of the mean stress (n, k), Pa."""
        weighted = self._problem.points.mean.volume[:, None] * pressure
        work = np.zeros((4, pressure.shape[1]))
        work[3] = -weighted.sum(axis=0)
        comm = self._problem.section.comm
        return -np.asarray(self._dilation.T @ weighted), reductions.totals(comm, work)

    def of_held_liquid(self, pressure: Array) -> Array:
        """Forces (owned, k), N/m, of liquid supported from outside.

        Args:
            pressure: Pressure at the owned vertices (vertices, k), Pa (collective).
        """
        assert self._held is not None
        function, form = self._held
        found = np.zeros((self._problem.owned, pressure.shape[1]))
        for number in range(pressure.shape[1]):
            function.x.array[: len(pressure)] = pressure[:, number]
            function.x.scatter_forward()
            found[:, number] = assemble_owned(form, self._problem.owned)
        return found
