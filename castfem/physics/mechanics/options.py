"""PETSc options of the mechanical solver: the defaults, and what the user's own leave of them."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

from castfem.fem.snes import Options

# A shell that shrinks off its wall lets go of it point by point, an iteration each.
NEWTON: dict[str, Any] = {"snes_linesearch_type": "basic", "snes_max_it": 100}
# PETSc's own factorisation has no pivoting and no parallel form; with it nested dissection pays.
OWN = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "nd"}

# On several ranks the scaling that MUMPS chooses by itself goes round among them before each
# factorisation, to no use in equations of one unit; its ordering, on one rank alone, takes longer
# than minimum degree, and fronts of this size are too small for ScaLAPACK.
SEVERAL_RANKS = {"mat_mumps_icntl_7": 0, "mat_mumps_icntl_8": 1, "mat_mumps_icntl_13": 1}


def split_options(
    user: Options, symmetric: bool, ranks: int = 1
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of SNES, and those of the linear solver.

    Args:
        user: The user's, which win; with a preconditioner or a factorisation of his own nothing of
            the default one is left.
        symmetric: Whether the tangent is.
        ranks: How many share it.
    """
    factor: dict[str, Any] = {}
    if "pc_type" not in user:
        factor["pc_type"] = "cholesky" if symmetric else "lu"
        if "pc_factor_mat_solver_type" not in user:
            has_mumps = PETSc.Sys.hasExternalPackage("mumps")
            factor |= {"pc_factor_mat_solver_type": "mumps"} if has_mumps else OWN
            factor |= SEVERAL_RANKS if has_mumps and ranks > 1 else {}
    chosen = {**NEWTON, "ksp_type": "preonly", **factor, **user}
    nonlinear = {k: v for k, v in chosen.items() if not k.startswith(("ksp_", "pc_", "mat_"))}
    return nonlinear, {k: v for k, v in chosen.items() if k not in nonlinear}
