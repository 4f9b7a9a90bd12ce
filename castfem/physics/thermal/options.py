"""PETSc options of the thermal solver."""

from __future__ import annotations

# Newton's full step on the enthalpy needs no line search.
NEWTON = {"snes_linesearch_type": "basic", "snes_max_it": 100}
# The Jacobian is a symmetric positive matrix with its columns scaled, and as well conditioned as a
# time step makes it: a few iterations on an incomplete factorisation of each rank's own part
# solve it to the accuracy that Newton's method can use, at any size (docs/benchmarks.md).
ITERATIVE = {"ksp_type": "bcgs", "ksp_rtol": 1e-9, "ksp_max_it": 300}
# Where they do not, which a step a thousand times too long can bring about, it is factored.
DIRECT = {"ksp_type": "preonly", "pc_type": "lu"}
SERIAL_LU = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "nd"}
PARALLEL_LU = {"pc_factor_mat_solver_type": "mumps"}


def default_options(ranks: int) -> dict[str, object]:
    """Solver options on so many ranks."""
    incomplete = {"pc_type": "ilu"} if ranks == 1 else {"pc_type": "bjacobi", "sub_pc_type": "ilu"}
    return {**NEWTON, **ITERATIVE, **incomplete}


def direct_options(ranks: int) -> dict[str, object]:
    """Options of the solver that takes over where the iterative one fails."""
    return {**NEWTON, **DIRECT, **(SERIAL_LU if ranks == 1 else PARALLEL_LU)}
