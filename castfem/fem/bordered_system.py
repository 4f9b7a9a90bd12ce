"""Linear systems with a sparse block and a few additional scalar unknowns.

    [ A  U ] [u]   [f]
    [ R  D ] [z] = [g]

A is factored once per Newton step; one solve with U and f as right-hand sides gives the scalars by
their Schur complement, (D - R A^-1 U) z = g - R A^-1 f.  The scalars are stored on the last rank,
after its displacements.
"""

from __future__ import annotations

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from castfem.base.types import Array, Indices
from castfem.fem.factorisation import DirectSolver
from castfem.fem.snes import Options, weakly


class _Context:
    """PETSc callbacks of a bordered system; PETSc does not keep the system itself alive."""

    def __init__(self, system: BorderedSystem) -> None:
        self.mult, self.apply = weakly(system.mult), weakly(system.apply)


class BorderedSystem:
    """The bordered matrix as PETSc matrix and preconditioner in one (python type).

    Args:
        matrix: A; assembled by its owner before each `update`.
        scalars: Number of scalars; without any this is A alone.
        prefix: Option prefix of the solver for A.
        options: Its PETSc options (ksp_, pc_, mat_), without prefix.
        symmetric: Whether A is symmetric.

    Attributes:
        solver: Solver of A.
        operator: The bordered matrix.
        columns: U, this rank's rows (owned, scalars).
        rows: R transposed, this rank's rows (owned, scalars). It may differ from U only in rows of
            prescribed displacements, where U is zero.
        corner: D (scalars, scalars), the same on every rank.
        failure: Why the last solve failed; empty if it did not.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        scalars: int,
        prefix: str,
        options: Options,
        symmetric: bool = False,
    ) -> None:
        self.comm: MPI.Comm = matrix.comm.tompi4py()
        self._matrix, self.scalars = matrix, scalars
        self._rows: Indices | slice = slice(None)
        self.owned = matrix.getLocalSize()[0]
        self._keeper = self.comm.size - 1
        self.columns = np.zeros((self.owned, scalars))
        self.rows = np.zeros((self.owned, scalars))
        self.corner = np.zeros((scalars, scalars))
        self.failure = ""
        self._right, self._solved = (self._dense(scalars + 1) for _ in range(2))
        self._in, self._out = matrix.createVecs()
        self.solver = DirectSolver(matrix, prefix, options, symmetric)
        here = self.owned + (scalars if self.comm.rank == self._keeper else 0)
        whole = matrix.getSize()[0] + scalars
        size = (here, whole)
        self.operator = PETSc.Mat().createPython((size, size), _Context(self), comm=matrix.comm)
        self.operator.setUp()

    def restrict(self, matrix: PETSc.Mat, rows: Indices) -> None:
        """Use `matrix` for some of this rank's unknowns as A, and 1 on the diagonal for the others.

        Args:
            matrix: A; freed by its owner.
            rows: Displacements owned by this rank that it covers (n,).
        """
        for thing in (self._right, self._solved, self._in, self._out):
            thing.destroy()
        self._matrix, self._rows = matrix, rows
        self._right, self._solved = (self._dense(self.scalars + 1) for _ in range(2))
        self._in, self._out = matrix.createVecs()
        self.solver.use(matrix)

    @property
    def ksp(self) -> PETSc.KSP:
        """PETSc's solver of A."""
        return self.solver.ksp

    def _dense(self, columns: int) -> PETSc.Mat:
        rows = (self._matrix.getLocalSize()[0], self._matrix.getSize()[0])
        dense = PETSc.Mat().createDense((rows, (None, columns)), comm=self._matrix.comm)
        dense.setUp()
        dense.assemble()
        return dense

    def vector(self) -> PETSc.Vec:
        """A vector of the bordered layout."""
        return self.operator.createVecRight()

    def share(self, local: Array) -> Array:
        """The scalars of a vector's local part, on every rank."""
        if not self.scalars or self.comm.size == 1:
            return np.array(local[self.owned :])
        return np.asarray(self.comm.bcast(np.array(local[self.owned :]), root=self._keeper))

    def join(self, nodal: Array, scalars: Array) -> Array:
        """Local part of a vector from its nodal entries and the scalars (known on all ranks)."""
        tail = scalars if self.comm.rank == self._keeper else np.zeros(0)
        return np.concatenate([nodal, tail])

    def use_with(self, ksp: PETSc.KSP) -> None:
        """Make `ksp` solve the bordered system exactly."""
        ksp.setType("preonly")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(_Context(self))

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Product with the bordered matrix (used by line searches)."""
        local = x.getArray(readonly=True)
        z, nodal = self.share(local), local[: self.owned]
        self._in.setArray(nodal[self._rows])
        self._matrix.mult(self._in, self._out)
        top = nodal.copy()
        top[self._rows] = self._out.getArray(readonly=True)
        top += self.columns @ z
        bottom = self._total(self.rows.T @ nodal) + self.corner @ z
        y.setArray(self.join(top, bottom))

    def _total(self, values: Array) -> Array:
        if self.comm.size == 1 or not values.size:
            return values
        return np.asarray(self.comm.allreduce(values, op=MPI.SUM))

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Solve for one right-hand side, together with all columns of U."""
        right = x.getArray(readonly=True)[None]
        solution = self._solve(right, self._right, self._solved)
        self.solver.tell_unread()
        if solution is None:
            pc.setFailedReason(PETSc.PC.FailedReason.SUBPC_ERROR)
            y.set(0.0)
        else:
            pc.setFailedReason(PETSc.PC.FailedReason.NOERROR)
            y.setArray(solution[0])  # type: ignore[arg-type]

    def solve(self, rights: Array) -> Array | None:
        """Solve for several right-hand sides at once (collective).

        Args:
            rights: Their local parts (n, local).

        Returns:
            The local parts of the solutions (n, local); None, with `failure` set, if it failed.
        """
        pair = self._dense(self.scalars + len(rights)), self._dense(self.scalars + len(rights))
        found = self._solve(rights, *pair)
        for one in pair:
            one.destroy()
        return found

    def _solve(self, rights: Array, given: PETSc.Mat, found: PETSc.Mat) -> Array | None:
        """Local parts of the solutions for right-hand sides (n, local).

        Args:
            rights: The right-hand sides.
            given: Storage for them after the columns of U.
            found: Storage for the solutions with A for both.

        Returns:
            See `solve`.
        """
        right, count = given.getDenseArray(), self.scalars
        nodal = np.array(rights[:, : self.owned].T)
        right[:, :count] = self.columns[self._rows]
        right[:, count:] = nodal[self._rows]
        given.assemble()
        self.failure = self.solver.solve(given, found)
        if self.failure:
            return None
        solved = found.getDenseArray()
        through = self._total(self.rows[self._rows].T @ solved)
        schur = self.corner - through[:, :count]
        shares = np.array([self.share(one) for one in rights]).T
        try:
            scalars = np.linalg.solve(schur, shares - through[:, count:])
        except np.linalg.LinAlgError:
            self.failure = "a free degree of freedom of the planes meets no stiffness"
            return None
        nodal[self._rows] = solved[:, count:] - solved[:, :count] @ scalars
        pairs = [(nodal[:, i], np.asarray(scalars[:, i])) for i in range(len(rights))]
        return np.array([self.join(*pair) for pair in pairs])

    def updated(self) -> None:
        """Tell PETSc that the blocks have changed."""
        self.operator.assemble()

    def destroy(self) -> None:
        """Free the PETSc objects (the owner frees A)."""
        for thing in (self.solver, self.operator, self._right, self._solved, self._in, self._out):
            thing.destroy()
