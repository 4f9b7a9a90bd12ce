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


@dataclass(frozen=True, slots=True)
class VertexLimits:
    """Tolerances of the temperature of a vertex, where a stage is solved for."""

    tight: float = 1e-7  # K: if no accuracy of the time steps is given
    of_step: float = 2e-4  # fraction of the allowed error of a time step; less gains nothing
    loosest: float = 1e-2  # K: the largest, for steps without an error limit


LIMITS = BalanceLimits()
VERTEX = VertexLimits()


def tolerance_of_steps(error: float) -> float:
    """Tolerance of a vertex (K) for adaptive steps with an allowed error (K)."""
    return min(VERTEX.of_step * error, VERTEX.loosest)


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
    """Vertices with a known correction y of the conduction integral: isothermal or prescribed."""

    places: npt.NDArray[np.intp]  #: owned vertices
    anywhere: bool  #: whether any rank has some
    divisor: Array  #: dtheta/dH (owned,); 1 at these vertices
