"""Time stepping of the heat balance: backward Euler and a second-order L-stable scheme.

Both difference the enthalpy over the step, so heat is conserved to rounding at any step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem import reductions
from castfem.materials.curve import CurvePoint
from castfem.thermal.problem import Stage, ThermalProblem

Array = npt.NDArray[np.float64]

# Alexander's two-stage, stiffly accurate, L-stable scheme (SIAM J. Numer. Anal. 14 (1977) 1006).
GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
# Weights of the interpolatory quadrature on (0, GAMMA, 1) less those of the scheme, (0, 1 - GAMMA,
# GAMMA).
DEFECT = (
    (3 * GAMMA - 1) / (6 * GAMMA),
    1 / (6 * GAMMA * (1 - GAMMA)) - (1 - GAMMA),
    (2 - 3 * GAMMA) / (6 * (1 - GAMMA)) - GAMMA,
)
IDLE = 1e-6  # share of the heat removed so far below which a step counts as idle
SHEARED = 0.01  # of the range: a sheared mesh keeps the maximum principle but for its shear
WARMER = 2.0  # heat generated inside, over what it warms at the capacity of reference
BOUND_SLACK = 1e-6  # K, what rounding and the solver's tolerance may add to the physical bounds


@dataclass(slots=True)
class ThermalState:
    """The committed thermal state.

    Attributes:
        time: Since the meniscus, s. enthalpy: H (owned,), J/m3. rate: dH/dt (owned,), W/m3.
        point: T(H) and its companions. removed: Heat removed since the meniscus from the modelled
            part, J/m.
        extremes: Coldest and hottest vertex of the section, K.
        generated: Heat generated inside the modelled part since the meniscus, J/m.
    """

    time: float
    enthalpy: Array
    rate: Array
    point: CurvePoint
    removed: float
    extremes: tuple[float, float]
    generated: float = 0.0


@dataclass(slots=True)
class StepResult:
    """One attempted step.

    Attributes:
        converged: Whether the solver succeeded; if not, `state` is the old one.
        state: The new state. error: Estimated temperature error of the step, K (largest vertex).
        newton: Newton iterations. limited: Whether the second-order step left the physical bounds
            and backward Euler was taken instead. reason: The solver's word.
        balance: (heat out + change of enthalpy - heat generated) over the largest (see IDLE).
    """

    converged: bool
    state: ThermalState
    error: float
    newton: int
    limited: bool
    reason: str
    balance: float


class ThermalStepper:
    """Advances a `ThermalState` by one step; keeps no state of its own but the problem.

    Args:
        problem: The heat balance.
        scheme: "sdirk2" or "backward_euler".
        estimate: Whether to estimate the error of each step (adaptive stepping wants it).
    """

    def __init__(
        self, problem: ThermalProblem, scheme: str = "sdirk2", estimate: bool = False
    ) -> None:
        self.problem, self.scheme, self.estimate = problem, scheme, estimate
        self.comm = problem.section.comm

    def initial(self, temperature: float) -> ThermalState:
        """The slice at one temperature (K) at the meniscus."""
        curve, area = self.problem.curve, self.problem.area
        enthalpy = np.broadcast_to(curve.enthalpy(temperature), area.shape).copy()
        return self.state_from(0.0, enthalpy, np.zeros_like(area), 0.0)

    def state_from(
        self, time: float, enthalpy: Array, rate: Array, removed: float, generated: float = 0.0
    ) -> ThermalState:
        """A state from its stored arrays (checkpoint)."""
        point = self.problem.curve.at(enthalpy)
        extremes = self._extremes(point)
        return ThermalState(time, enthalpy, rate, point, removed, extremes, generated)

    def _extremes(self, point: CurvePoint) -> tuple[float, float]:
        """Coldest and hottest vertex over all ranks, K."""
        t = point.temperature
        ends = [-t.min(initial=np.inf), t.max(initial=-np.inf)]
        low, high = ends if self.comm.size == 1 else reductions.largest_of(self.comm, ends)
        return -float(low), float(high)

    def step(self, old: ThermalState, time: float) -> StepResult:
        """Advance `old` to `time` (s); `old` is left untouched."""
        dt = time - old.time
        newton = self.problem.iterations
        low, high = self._bounds(old, time)
        step = self._sdirk2 if self.scheme == "sdirk2" else self._euler
        stages = step(old, dt, (low, high))
        limited = False
        if self.scheme == "sdirk2" and stages[-1].outcome.converged:
            coldest, hottest = self._extremes(stages[-1].point)
            if coldest < low - BOUND_SLACK or hottest > high + BOUND_SLACK:
                stages, limited = self._euler(old, dt, (low, high)), True
        newton = self.problem.iterations - newton
        if not stages[-1].outcome.converged:
            return StepResult(
                False, old, np.inf, newton, limited, stages[-1].outcome.describe(), 0.0
            )
        return self._commit(old, stages, time, newton, limited)

    def _bounds(self, old: ThermalState, time: float) -> tuple[float, float]:
        """What old temperatures and surroundings allow the new ones to be, K.

        L-stable second-order schemes keep no maximum principle at large steps; backward Euler does.
        """
        low, high = self.problem.cooling.ambient_range(time)
        low, high = min(low, old.extremes[0]), max(high, old.extremes[1])
        high += WARMER * self.problem.warming * (time - old.time)
        if self.problem.shape is not None:
            low, high = low - SHEARED * (high - low), high + SHEARED * (high - low)
        return low, high

    def _guess(self, old: Array, rate: Array, tau: float, bounds: tuple[float, float]) -> Array:
        """Enthalpy extrapolated by its rate, within the bounds: where Newton's method starts."""
        curve = self.problem.curve
        low, high = (np.clip(b, curve.knots[0], curve.knots[-1]) for b in bounds)
        return np.clip(old + tau * rate, curve.enthalpy(low, "left"), curve.enthalpy(high))

    def _commit(
        self, old: ThermalState, stages: list[Stage], time: float, newton: int, limited: bool
    ) -> StepResult:
        """Make the new state and its heat balance from solved stages."""
        last, dt = stages[-1], time - old.time
        weights = (dt,) if len(stages) == 1 else ((1 - GAMMA) * dt, GAMMA * dt)
        gone, made = (
            sum(w * getattr(s, name) for w, s in zip(weights, stages, strict=True))
            for name in ("out", "generated")
        )
        change = float(self.problem.area @ (last.enthalpy - old.enthalpy))
        sums = reductions.totals(self.comm, [gone, change, made])
        out, gained, generated = (float(value) for value in sums)
        removed = old.removed + out
        # A step in which next to nothing happens is measured against all heat so far.
        size = max(abs(out), abs(gained), abs(generated), IDLE * abs(removed), 1e-300)
        balance = (out + gained - generated) / size
        state = self.state_from(time, last.enthalpy, last.rate, removed, old.generated + generated)
        error = self._error(old, stages, dt) if self.estimate else 0.0
        return StepResult(True, state, error, newton, limited, last.outcome.reason, balance)

    def _euler(self, old: ThermalState, dt: float, bounds: tuple[float, float]) -> list[Stage]:
        guess = self._guess(old.enthalpy, old.rate, dt, bounds)
        return [self.problem.solve_stage(old.enthalpy, guess, dt, old.time + dt)]

    def _sdirk2(self, old: ThermalState, dt: float, bounds: tuple[float, float]) -> list[Stage]:
        tau = GAMMA * dt
        guess = self._guess(old.enthalpy, old.rate, tau, bounds)
        first = self.problem.solve_stage(old.enthalpy, guess, tau, old.time + tau)
        if not first.outcome.converged:
            return [first]
        base = old.enthalpy + (1 - GAMMA) * dt * first.rate
        guess = self._guess(base, first.rate, tau, bounds)
        return [first, self.problem.solve_stage(base, guess, tau, old.time + dt)]

    def _error(self, old: ThermalState, stages: list[Stage], dt: float) -> float:
        """Estimated temperature error of the step at the worst vertex, K.

        The rates at the start, the first stage and the end make a quadrature of third order; its
        difference to the second-order step is the estimate.  For backward Euler the trapezoidal
        rule takes its place.
        """
        if len(stages) == 2:
            change = sum(
                d * r for d, r in zip(DEFECT, (old.rate, *(s.rate for s in stages)), strict=True)
            )
        else:
            change = 0.5 * (stages[0].rate - old.rate)
        kelvin = np.abs(dt * change * stages[-1].point.temperature_slope)
        return reductions.largest(self.comm, kelvin)
