"""Continuous casting of steel: one slice of the strand followed from the meniscus.

`load`, `run` and `Result` are for scripts (docs/scripting.md); they are imported at first use, so
that `import castfem` costs nothing.

What there is, upstream first; nothing knows what comes after it (tests/test_layers.py):

    errors log closing stopwatch wording    what everything uses
    units quantities table                  numbers with units, and tables of them
    compat reductions parallel nodal        DOLFINx' versions, and work over the ranks
    section probes snes timestep            mesh over the ranks, lines in it, solver, step control
    forms/ meshes/                          weak forms in UFL; sections as plain arrays
    materials/ laws/                        steels, and what strains them
    thermal/ mould/ contact/ mechanics/     the problems, one step at a time
    case/ catalogue former                  case files, checked; those that are shipped
    zones mechanical_law mechanical_scene   from a case to its cooling and its mechanics
    substeps coupling                       steps within an interval; intervals
    output/ tabulated                       files of a run, and pictures made of them alone
    scene                                   all of it, built from a case
    measure mechanical_measure passage      what is read off the slice
    report columns recorder restart         ... and written
    march                                   from the meniscus to the end
    api sweep/ compare/ cli/                what users call
    verification verified tensile_run       closed forms, how far off a run is; a tensile test
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from castfem.api import Result, Snapshot, load, run
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
