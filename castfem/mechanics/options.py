"""PETSc options of the mechanical solver: the defaults, and what the user's own leave of them."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

from castfem.fem.snes import Options

# A shell that shrinks off its wall lets go of it point by point, an iteration each.
NEWTON: dict[str, Any] = {"snes_linesearch_type": "basic", "snes_max_it": 100}
# PETSc's own factorisation has no pivoting and no parallel form; with it nested dissection pays.
OWN = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "nd"}


def split_options(user: Options, symmetric: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of SNES, and those of the linear solver.

    Args:
        user: The user's, which win; with a preconditioner or a factorisation of his own nothing of
            the default one is left.
        symmetric: Whether the tangent is.
    """
    factor: dict[str, Any] = {}
    if "pc_type" not in user:
        factor["pc_type"] = "cholesky" if symmetric else "lu"
        if "pc_factor_mat_solver_type" not in user:
            has_mumps = PETSc.Sys.hasExternalPackage("mumps")
            factor |= {"pc_factor_mat_solver_type": "mumps"} if has_mumps else OWN
    chosen = {**NEWTON, "ksp_type": "preonly", **factor, **user}
    nonlinear = {k: v for k, v in chosen.items() if not k.startswith(("ksp_", "pc_", "mat_"))}
    return nonlinear, {k: v for k, v in chosen.items() if k not in nonlinear}
