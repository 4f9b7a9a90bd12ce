"""Mechanics of the slice: generalized plane strain, state at quadrature points, SNES.

A `Slice` defines material, supports and loads of a slice; a `MechanicalProblem` is its equilibrium
at the end of a step; a `MechanicalStepper` takes it from one state to the next.
"""

from __future__ import annotations

from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Ferrostatic, Slice
from castfem.physics.mechanics.state import MechanicalState
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.surface_gap import SurfaceGap

__all__ = [
    "Ferrostatic",
    "MechanicalProblem",
    "MechanicalState",
    "MechanicalStepper",
    "PlainPlanes",
    "Slice",
    "SurfaceGap",
]
