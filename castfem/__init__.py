"""Continuous casting of steel: one slice of the strand followed from the meniscus.

For scripts (docs/scripting.md); imported at first use, so that `import castfem` costs nothing:

    load, run, Result, Snapshot     a case, a run of it, what it gives
    caster                          a whole strand while speed and water change
    sensitivities                   a run with the derivatives of its results
    comparison                      finished runs side by side
    sweep                           a case with several values of its keys
    error_table                     the error of each result of a case
    optimise                        the best values of a case's keys
    find_section                    the outline at the meniscus for a required section
    quantity                        declares a custom result
    mould_at_work                   thermal distortion of the copper tube of a mould
    InputError, RunFailure          errors; both are a CastfemError

Packages, upstream first; each is independent of those after it (docs/architecture.md):

    base/           numbers with units, tables, files, log, errors
    meshes/ forms/  sections as plain arrays; weak forms in UFL
    fem/            DOLFINx and PETSc, of any physics
    physics/        materials, constitutive laws, machine, mould, thermal, contact, mechanics,
                    coupling, closed_forms: one step of each problem at a time
    model/          case files, checked (checks); model/build: from a case to computing objects
    runs/           output, results, tensile, caster; the time loop from the meniscus to the end
    studies/        several runs: identification, mould_fit, sensitivity, sweep, accuracy,
                    optimisation, calibration
    post/           plots, report, compare, html, watch: figures and reports on runs
    api several_runs    for scripts: one run, several runs
    cli/            the commands
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from castfem.base import libraries

if TYPE_CHECKING:
    from castfem.api import Result, Snapshot, caster, load, run, sensitivities
    from castfem.base.errors import CastfemError, InputError, RunFailure
    from castfem.base.result_registry import quantity
    from castfem.several_runs import (
        comparison,
        error_table,
        find_section,
        mould_at_work,
        optimise,
        sweep,
    )

__version__ = "0.1.0"
__all__ = [
    "CastfemError",
    "InputError",
    "Result",
    "RunFailure",
    "Snapshot",
    "caster",
    "comparison",
    "error_table",
    "find_section",
    "load",
    "mould_at_work",
    "optimise",
    "quantity",
    "run",
    "sensitivities",
    "sweep",
]
libraries.watch()
_STUDIES = ("comparison", "error_table", "find_section", "mould_at_work", "optimise", "sweep")


def __getattr__(name: str) -> Any:
    """Import what scripts use when they use it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    module = "base.errors" if name.endswith(("Error", "Failure")) else "api"
    module = "several_runs" if name in _STUDIES else module
    module = "base.result_registry" if name == "quantity" else module
    found = getattr(import_module(f"castfem.{module}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
