"""Mechanics of the slice: generalized plane strain, state at quadrature points, SNES.

A `Slice` says what a slice is made of, how it is held and what acts on it; a `MechanicalProblem` is
its equilibrium at the end of a step, a `MechanicalStepper` takes it from one state to the next.
"""

from __future__ import annotations

from castfem.mechanics.definition import Slice
from castfem.mechanics.ferrostatic import Ferrostatic
from castfem.mechanics.planes import PlainPlanes
from castfem.mechanics.problem import MechanicalProblem
from castfem.mechanics.state import MechanicalState
from castfem.mechanics.stepper import MechanicalStepper
from castfem.mechanics.surface_gap import SurfaceGap

__all__ = [
    "Ferrostatic",
    "MechanicalProblem",
    "MechanicalState",
    "MechanicalStepper",
    "PlainPlanes",
    "Slice",
    "SurfaceGap",
]
