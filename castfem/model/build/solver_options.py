"""Whether PETSc takes the options of a case's solvers, without a problem to solve."""

from __future__ import annotations

from castfem.fem.snes import Options, try_options


def try_solver(table: str, options: Options) -> None:
    """Try the options of `thermal.solver` or `mechanics.solver`, merged over ours of one rank.

    Args:
        table: "thermal" or "mechanics".
        options: The user's.

    Raises:
        InputError: An option is of no family PETSc knows, or PETSc refuses its value.
    """
    if table == "thermal":
        from castfem.physics.thermal.options import default_options

        try_options("thermal_", {**default_options(1), **options})
        return
    from castfem.physics.mechanics.options import split_options

    nonlinear, linear = split_options(options, symmetric=False)
    try_options("mechanical_", {**nonlinear, **linear})
