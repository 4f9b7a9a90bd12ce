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

from castfem.errors import RunFailure
from castfem.fem import factorisation, reductions
from castfem.materials.curve import CurvePoint
from castfem.thermal.problem import ThermalProblem
from castfem.values.types import Array


class StageTangent:
    """The matrix of a stage at its solution.

    Args:
        problem: The heat balance.
    """

    def __init__(self, problem: ThermalProblem) -> None:
        self._problem = problem
        self._matrix = problem.new_matrix()
        self._matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._right, self._found = self._matrix.createVecLeft(), self._matrix.createVecRight()
        alone = problem.section.comm.size == 1
        self._ksp = PETSc.KSP().create(problem.section.comm)
        self._ksp.setOperators(self._matrix)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
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
        problem, matrix = self._problem, self._matrix
        held = point.conduction_slope <= 0.0
        held[problem.fixed] = True
        self._held, self._slope, self._tau = np.flatnonzero(held), point.conduction_slope, tau
        problem.conduction_matrix(tau, matrix)
        safe = np.where(held, 1.0, self._slope)
        self._right.setArray((problem.volume + tau * slope * point.temperature_slope) / safe)
        matrix.setDiagonal(self._right, addv=PETSc.InsertMode.ADD_VALUES)
        comm = problem.section.comm
        self._any_held = reductions.any_of(comm, bool(len(self._held)))
        self._given = reductions.any_of(comm, bool(len(problem.fixed)))
        if self._any_held:
            first = matrix.getOwnershipRange()[0]
            matrix.zeroRowsColumns((self._held + first).astype(np.int32), diag=1.0)
        self._ksp.setOperators(matrix)
        if why := factorisation.set_up(self._ksp, matrix):
            raise RunFailure(f"the derivative of a stage cannot be solved for: {why}")

    def solve(self, right: Array, fixed: Array) -> Array:
        """DH/dp (owned,); one back substitution (collective).

        Args:
            right: Right-hand side (owned,), J/m.
            fixed: DH/dp of the vertices whose temperature is given (n,), J/m3.
        """
        problem, held = self._problem, self._held
        known = np.zeros_like(right)  # y where it is known
        known[problem.fixed] = self._slope[problem.fixed] * fixed
        open_ = right
        if self._given:
            open_ = right - self._tau * problem.conducted(known)
        if len(held):
            open_ = open_.copy()
            open_[held] = known[held]
        self._right.setArray(open_)
        self._ksp.solve(self._right, self._found)
        conduction = self._found.getArray()
        if not self._any_held:
            return np.asarray(conduction / self._slope)
        found = conduction / np.where(self._slope > 0.0, self._slope, 1.0)
        left = right - self._tau * problem.conducted(conduction.copy())
        found[held] = left[held] / problem.volume[held]
        found[problem.fixed] = fixed
        return np.asarray(found)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._ksp, self._matrix, self._right, self._found):
            thing.destroy()
