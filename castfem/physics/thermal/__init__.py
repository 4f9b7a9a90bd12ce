"""The thermal problem: laws of surface cooling, the enthalpy solver, time stepping.

A `Surface` has patches, each cooled by a law; a `ThermalProblem` is the heat balance of a stage; a
`ThermalStepper` takes it from one state to the next. Each is imported at first use: cases know the
laws of cooling without a solver.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from castfem.physics.thermal.boundary import Cooling, Surface
    from castfem.physics.thermal.flux_laws import Contact
    from castfem.physics.thermal.problem import ThermalProblem
    from castfem.physics.thermal.stepper import ThermalState, ThermalStepper

_MODULES = {
    "Contact": "flux_laws",
    "Cooling": "boundary",
    "Surface": "boundary",
    "ThermalProblem": "problem",
    "ThermalState": "stepper",
    "ThermalStepper": "stepper",
}
__all__ = ["Contact", "Cooling", "Surface", "ThermalProblem", "ThermalState", "ThermalStepper"]


def __getattr__(name: str) -> Any:
    """Import a part on first use."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"castfem.physics.thermal.{_MODULES[name]}"), name)
