"""Continuous casting of steel: one slice of the strand followed from the meniscus.

`load`, `run`, `sensitivities` and `Result` are for scripts (docs/scripting.md); they are imported
at first use, so that `import castfem` costs nothing.

What there is, upstream first; nothing knows what comes after it (docs/architecture.md):

    errors values/ support/         numbers with units; what everything uses
    meshes/ forms/ fem/             sections as plain arrays; weak forms in UFL; DOLFINx and PETSc
    materials/ constitutive/        steels, and what strains them
    machine/ mould/                 what the strand meets on its way
    thermal/ contact/ mechanics/    the problems, one step at a time
    verification/ output/           closed forms; the files of a run
    coupling/                       temperature and mechanics in turn
    case/                           case files, checked; those that are shipped
    simulation/                     from a case to all that computes it
    results/                        what is read off the slice, and the summary
    time_loop/                      from the meniscus to the end
    sensitivity/                    derivatives carried along with a run
    tensile/                        a tensile test of a law: a case without a slice
    plots/ report/                  figures and words on a run, from its files alone
    api sweep/ compare/ cli/        what users call
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from castfem.api import Result, Snapshot, load, run, sensitivities
    from castfem.errors import CastfemError, InputError, RunFailure

__version__ = "0.1.0"
__all__ = [
    "CastfemError",
    "InputError",
    "Result",
    "RunFailure",
    "Snapshot",
    "load",
    "run",
    "sensitivities",
]


def __getattr__(name: str) -> Any:
    """Import what scripts use when they use it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    module = "errors" if name.endswith(("Error", "Failure")) else "api"
    found = getattr(import_module(f"castfem.{module}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
