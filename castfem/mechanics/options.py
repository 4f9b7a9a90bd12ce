"""PETSc options of the mechanical solver: the defaults, and what the user's own leave of them."""

from __future__ import annotations

from typing import Any

from castfem.snes import Options

NEWTON: dict[str, Any] = {"snes_linesearch_type": "basic", "snes_max_it": 30}
# On one rank PETSc's own factorisation is the fastest up to some ten thousand unknowns, see
# docs/mechanics.md; on several, MUMPS.
SERIAL = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "nd"}
PARALLEL = {"pc_factor_mat_solver_type": "mumps"}


def split_options(
    user: Options, symmetric: bool, ranks: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of SNES, and those of the linear solver.

    Args:
        user: The user's, which win; with a preconditioner or a factorisation of his own nothing of
            the default one is left.
        symmetric: Whether the tangent is.
        ranks: Number of ranks.
    """
    factor = {"pc_type": "cholesky" if symmetric else "lu"}
    if "pc_type" in user:
        factor = {}
    if not {"pc_type", "pc_factor_mat_solver_type"} & set(user):
        factor |= SERIAL if ranks == 1 else PARALLEL
    chosen = {**NEWTON, "ksp_type": "preonly", **factor, **user}
    nonlinear = {k: v for k, v in chosen.items() if not k.startswith(("ksp_", "pc_", "mat_"))}
    return nonlinear, {k: v for k, v in chosen.items() if k not in nonlinear}
