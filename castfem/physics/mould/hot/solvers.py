"""Linear solvers of the tube: direct for small systems, multigrid for large ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from petsc4py import PETSc

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.fem.snes import SolverOptions

Method = Literal["auto", "direct", "multigrid"]
DIRECT = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
}
HEAT = {"ksp_type": "cg", "ksp_rtol": 1e-10, "ksp_max_it": 500}
HYPRE = {**HEAT, "pc_type": "hypre", "pc_hypre_type": "boomeramg",
         "pc_hypre_boomeramg_strong_threshold": 0.5}  # fmt: skip
GAMG = {**HEAT, "pc_type": "gamg"}
# Smoothed aggregation meets a zero pivot with three cells through the wall (a node left as an
# aggregate of its own is too small for six rigid body modes), and needs twice the iterations on
# these long, flat cells. Instead, the first-order displacement on them, an eighth of the unknowns,
# is factored.
ELASTIC = {
    "ksp_type": "cg",
    "ksp_rtol": 1e-9,
    "ksp_max_it": 1000,
    "pc_type": "mg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 2,
    "mg_levels_pc_type": "sor",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "cholesky",
    "mg_coarse_pc_factor_mat_solver_type": "mumps",
}


@dataclass(frozen=True, slots=True)
class Solved:
    """Statistics of a linear solve."""

    method: str  #: "direct" or "multigrid"
    unknowns: int  #: number of unknowns
    iterations: int  #: Krylov iterations; 0 for a direct solver


def chosen(method: Method, unknowns: int) -> Literal["direct", "multigrid"]:
    """Return the given method, or for "auto" one by the number of unknowns.

    A thin wall is nearly two-dimensional, so that factors grow little faster than its unknowns
    (docs/hot_mould.md); memory sets the limit, 10 kB per unknown.
    """
    if method != "auto":
        return method
    return "direct" if unknowns <= 250_000 else "multigrid"


def heat_options(method: str) -> Mapping[str, Any]:
    """Return the options of the conduction: hypre's multigrid if PETSc has it."""
    if method == "direct":
        return DIRECT
    return HYPRE if PETSc.Sys.hasExternalPackage("hypre") else GAMG


def elastic_options(method: str) -> Mapping[str, Any]:
    """Return the options of the elasticity."""
    return DIRECT if method == "direct" else ELASTIC


@dataclass(frozen=True, slots=True, eq=False)
class CoarseLevel:
    """The same problem with fewer unknowns, for the coarse-grid correction."""

    matrix: PETSc.Mat  #: assembled matrix
    #: interpolation of its unknowns to the finer level; zero where either is fixed
    interpolation: PETSc.Mat

    def destroy(self) -> None:
        """Free both matrices."""
        self.matrix.destroy()
        self.interpolation.destroy()


class LinearSolver:
    """A symmetric, positive definite system with one matrix.

    Args:
        matrix: Assembled matrix; its owner frees it.
        prefix: Prefix of its options in PETSc's database, ends in an underscore.
        options: Options without the prefix.
        coarse: Coarser level of multigrid, if `options` use PETSc's "mg"; its owner frees it.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        prefix: str,
        options: Mapping[str, Any],
        coarse: CoarseLevel | None = None,
    ) -> None:
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._prefix, self._options = prefix, SolverOptions(prefix, options, asked=())
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOperators(matrix)
        self._ksp.setOptionsPrefix(prefix)
        if coarse is not None:
            coarse.matrix.setOption(PETSc.Mat.Option.SPD, True)
            levels = self._ksp.getPC()
            levels.setType("mg")
            levels.setMGLevels(2)
            levels.setMGInterpolation(1, coarse.interpolation)
            levels.getMGCoarseSolve().setOperators(coarse.matrix)
        self._options.apply(self._ksp)
        self._x, self._b = matrix.createVecs()

    def solve(self, right: Array) -> tuple[Array, int]:
        """Return the solution (owned,) and the number of iterations (collective).

        Raises:
            RunFailure: The solver does not converge.
        """
        self._b.setArray(right)
        with self._options.given():
            self._ksp.solve(self._b, self._x)
        reason = self._ksp.getConvergedReason()
        direct = self._ksp.getType() == "preonly"
        if reason < 0:
            mend = (
                "a coarser tube needs less memory"
                if direct
                else 'solver = "direct" of [mould.tube] needs no iterations, and some 10 kB of '
                "memory an unknown"
            )
            raise RunFailure(
                f"hot mould: the {self._prefix.strip('_')} solver does not converge (PETSc's "
                f"reason {reason} after {self._ksp.getIterationNumber()} iterations, of its "
                f"preconditioner {self._ksp.getPC().getFailedReason()}); {mend}"
            )
        return self._x.getArray().copy(), 0 if direct else self._ksp.getIterationNumber()

    def destroy(self) -> None:
        """Free the PETSc objects except the matrix."""
        for thing in (self._ksp, self._x, self._b):
            thing.destroy()
