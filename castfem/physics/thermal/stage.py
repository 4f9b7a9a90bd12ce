"""A stage of the heat balance: its result, where its correction is known, its tolerances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.fem.snes import SolveResult
from castfem.physics.materials.curve import CurvePoint


@dataclass(frozen=True, slots=True)
class BalanceLimits:
    """Tolerances of the heat balance of the whole section."""

    # allowed residual of Newton's method, relative to the heat stored in a stage
    newton: float = 1e-7
    per_kelvin: float = 1e-2  # the same per kelvin, where the tolerance of the vertices allows more
    spread: float = 10.0  # largest correction that closes the heat balance, relative to that
    rounding: float = 64 * np.finfo(float).eps  # rounding, relative to all heat in a sum


LIMITS = BalanceLimits()
TIGHT = 1e-7
"""K: tolerance of a vertex if no accuracy of the time steps is given."""
OF_STEP = 2e-4
"""Fraction of the allowed time step error used as tolerance of a vertex; less gains nothing."""
LOOSEST = 1e-2
"""K: largest tolerance, for steps without an error limit."""


def tolerance_of_steps(error: float) -> float:
    """Tolerance of a vertex (K) for adaptive steps with an allowed error (K)."""
    return min(OF_STEP * error, LOOSEST)


@dataclass(frozen=True, slots=True)
class Stage:
    """Result of one implicit stage."""

    enthalpy: Array  #: H at the owned vertices (owned,), J/m3
    rate: Array  #: dH/dt (owned,), W/m3
    point: CurvePoint  #: temperature and slopes of the solution
    out: float  #: heat through this rank's part of the surface, W/m
    generated: float  #: heat generated in this rank's part of the section, W/m
    result: SolveResult  #: result of the solver
    tau: float  #: coefficient of the stage, s
    time: float  #: time since the meniscus, s


@dataclass(frozen=True, slots=True)
class Held:
    """Where the correction y of the conduction integral is known: isothermal or prescribed."""

    places: npt.NDArray[np.intp]  #: owned vertices
    anywhere: bool  #: whether any rank has some
    divisor: Array  #: dtheta/dH (owned,); 1 at these vertices
