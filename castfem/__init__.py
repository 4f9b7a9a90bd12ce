"""Continuous casting of steel: one slice of the strand followed from the meniscus.

`load`, `run` and `Result` are for scripts (docs/scripting.md); they are imported at first use, so
that `import castfem` costs nothing.
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
