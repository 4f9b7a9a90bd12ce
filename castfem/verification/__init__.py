"""Closed forms that castfem is held against, by its cases, its tests and its benchmarks."""

from castfem.verification.closed_forms import NAMES, ClosedForm, Expected, closed_form
from castfem.verification.half_space import HalfSpace
from castfem.verification.solidification import Neumann, ThreeZones

__all__ = [
    "NAMES",
    "ClosedForm",
    "Expected",
    "HalfSpace",
    "Neumann",
    "ThreeZones",
    "closed_form",
]
