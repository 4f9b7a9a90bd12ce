"""The linearised equations of a stage: factored once, solved for each parameter.

With y = dtheta/dH dH/dp, the derivative of the conduction integral, the matrix is symmetric,

    A y = r,     A = diag(M / (dtheta/dH) + tau w dq/dT / k) + tau L,

and positive wherever the stage has one solution.  Where freezing is isothermal dtheta/dH = 0: there
y = 0, and the balance of the vertex gives its enthalpy.
"""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.bordered_system import factorise
from castfem.physics.materials.curve import CurvePoint
from castfem.physics.thermal.problem import ThermalProblem


class StageTangent:
    """The matrix of a stage at its solution.

    Args:
        problem: The heat balance.

    Attributes:
        matrix: That was factored last.
        solver: With its factor.
    """

    def __init__(self, problem: ThermalProblem) -> None:
        self._problem = problem
        self.matrix = problem.new_matrix()
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._diagonal = self.matrix.createVecLeft()
        self._sides: tuple[PETSc.Mat, PETSc.Mat] | None = None
        alone = problem.section.comm.size == 1
        self.solver = PETSc.KSP().create(problem.section.comm)
        self.solver.setOperators(self.matrix)
        self.solver.setType("preonly")
        pc = self.solver.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("petsc" if alone else "mumps")
        if alone:
            pc.setFactorOrdering("nd")
        self._slope: Array = np.zeros(0)
        self._tau = 0.0
        self._held: npt.NDArray[np.intp] = np.zeros(0, np.intp)
        self._any_held = self._given = False

    def factor(self, point: CurvePoint, slope: Array, tau: float) -> None:
        """Factor the matrix at a solution (collective).

        Args:
            point: What belongs to the enthalpies of the solution.
            slope: Of the heat that leaves each vertex through the surface, d/dT (owned,), W/(m K).
            tau: Coefficient of the stage, s.

        Raises:
            RunFailure: It cannot be factored.
        """
        problem, matrix = self._problem, self.matrix
        held = point.conduction_slope <= 0.0
        held[problem.fixed] = True
        self._held, self._slope, self._tau = np.flatnonzero(held), point.conduction_slope, tau
        problem.conduction_matrix(tau, matrix)
        safe = np.where(held, 1.0, self._slope) if len(self._held) else self._slope
        self._diagonal.setArray((problem.volume + tau * slope * point.temperature_slope) / safe)
        matrix.setDiagonal(self._diagonal, addv=PETSc.InsertMode.ADD_VALUES)
        comm = problem.section.comm
        self._any_held = reductions.any_of(comm, bool(len(self._held)))
        self._given = reductions.any_of(comm, bool(len(problem.fixed)))
        if self._any_held:
            first = matrix.getOwnershipRange()[0]
            matrix.zeroRowsColumns((self._held + first).astype(np.int32), diag=1.0)
        self.solver.setOperators(matrix)
        if why := factorise(self.solver, matrix):
            raise RunFailure(f"the derivative of a stage cannot be solved for: {why}")

    def solve(self, right: Array, fixed: Array) -> Array:
        """DH/dp (parameters, owned); a back substitution each, all at once (collective).

        Args:
            right: Right-hand sides (parameters, owned), J/m.
            fixed: DH/dp of the vertices whose temperature is given (parameters, n), J/m3.
        """
        if not (self._any_held or self._given):
            return np.asarray(self._conduction(right) / self._slope)
        problem, held, open_ = self._problem, self._held, right.copy()
        known = np.zeros_like(right)  # y where it is known
        known[:, problem.fixed] = self._slope[problem.fixed] * fixed
        if self._given:
            open_ -= self._tau * self._conducted(known)
        open_[:, held] = known[:, held]
        conduction = self._conduction(open_)
        found = conduction / np.where(self._slope > 0.0, self._slope, 1.0)
        left = right - self._tau * self._conducted(conduction)
        found[:, held] = left[:, held] / problem.volume[held]
        found[:, problem.fixed] = fixed
        return np.asarray(found)

    def _conducted(self, conduction: Array) -> Array:
        """Heat that leaves each vertex by conduction (parameters, owned), W/m."""
        return np.array([self._problem.conducted(one) for one in conduction])

    def _conduction(self, right: Array) -> Array:
        """Solutions y (parameters, owned) for right-hand sides (collective)."""
        if self._sides is None:
            sizes = self.matrix.getSizes()[0], (None, len(right))
            pair = [PETSc.Mat().createDense(sizes, comm=self.matrix.comm) for _ in range(2)]
            for one in pair:
                one.setUp()
                one.assemble()
            self._sides = pair[0], pair[1]
        given, found = self._sides
        given.getDenseArray()[:] = right.T
        given.assemble()
        self.solver.matSolve(given, found)
        return np.array(found.getDenseArray().T)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self.solver, self.matrix, self._diagonal, *(self._sides or ())):
            thing.destroy()
