"""Closed-form solutions, for comparison in cases, tests and benchmarks."""

from castfem.physics.closed_forms.by_name import NAMES, ClosedForm, Expected, closed_form
from castfem.physics.closed_forms.half_space import HalfSpace
from castfem.physics.closed_forms.solidification import Neumann, ThreeZones

__all__ = ["NAMES", "ClosedForm", "Expected", "HalfSpace", "Neumann", "ThreeZones", "closed_form"]
