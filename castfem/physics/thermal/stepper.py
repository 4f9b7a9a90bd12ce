"""Time stepping of the heat balance: backward Euler and a second-order L-stable scheme.

Both use differences of the enthalpy over the step, so that heat is conserved to rounding at any
step.

For a mode that decays x times as fast as the step is long SDIRK2 leaves R = (1 - (sqrt(2) - 1) x) /
(1 + GAMMA x)^2: from x = 2.4 on it overshoots its equilibrium, by up to a fifth, and comes back in
the next step. Such modes are excited by jumps of the cooling, and by a front in coarse cells. So a
step is checked before it is accepted: if a vertex would come back after it, it is repeated with
backward Euler in equal parts, with which no vertex overshoots.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.materials.curve import CurvePoint, Side, ThermalCurve
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stage import Stage
from castfem.physics.thermal.unique_root import Branch

# Alexander's two-stage, stiffly accurate, L-stable scheme (SIAM J. Numer. Anal. 14 (1977) 1006).
GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
# Weights of the interpolatory quadrature on (0, GAMMA, 1) minus those of the scheme, (0, 1 - GAMMA,
# GAMMA).
DEFECT = (
    (3 * GAMMA - 1) / (6 * GAMMA),
    1 / (6 * GAMMA * (1 - GAMMA)) - (1 - GAMMA),
    (2 - 3 * GAMMA) / (6 * (1 - GAMMA)) - GAMMA,
)


@dataclass(frozen=True, slots=True)
class RangeLimits:
    """Allowed excess of temperatures beyond the bounds from old temperatures and surroundings."""

    # fraction of the range: a sheared mesh satisfies the maximum principle only up to this
    sheared: float = 0.01
    # heat generated inside, relative to its warming at the reference heat capacity
    warmer: float = 2.0
    # fraction of the range by which a mesh without the maximum principle may leave it
    stray: float = 5e-3
    stray_sheared: float = 2e-2  # the same for a sheared mesh
    rounding: float = 1e-6  # K, for rounding
    solver: float = 10.0  # multiple of the tolerance of a vertex, for the solver


@dataclass(frozen=True, slots=True)
class Damping:
    """Conditions for repeating a second-order step with backward Euler.

    An overshooting mode comes back by at most 0.52 of the error of its step's rates; a vertex that
    truly reverses (steel that still cools below a surface that warms again) by more than 0.9, since
    its rates are small where it reverses.
    """

    parts: int = 4  # number of backward Euler steps
    rebound: float = 0.2  # K by which a vertex may come back after a step
    comes_back: float = 0.75  # fraction of the error of its rates up to which this is an overshoot
    controlled: float = 1.0  # K: with a smaller estimated error none has been observed to come back


RANGE, DAMPING = RangeLimits(), Damping()


@dataclass(frozen=True, slots=True)
class ThermalState:
    """The committed thermal state."""

    time: float  #: time since the meniscus, s
    enthalpy: Array  #: H (owned,), J/m3
    rate: Array  #: dH/dt (owned,), W/m3
    point: CurvePoint  #: T(H) with its slopes
    removed: float  #: heat removed since the meniscus from the modelled part, J/m
    extremes: tuple[float, float]  #: coldest and hottest vertex of the section, K
    generated: float  #: heat generated inside the modelled part since the meniscus, J/m
    next_rate: Array  #: dH/dt expected at the start of the next step (owned,), W/m3
    #: lowest and highest temperature allowed by the data since the meniscus, K; None before the
    #: first step
    allowed: tuple[float, float] | None = None
    #: volume of the vertices' steel, relative to the undeformed one (owned,); empty if nothing
    #: moves
    filled: Array = field(default_factory=lambda: np.zeros(0))
    #: heat brought along by fed liquid (negative: colder than poured), J/m
    fed: float = 0.0
    #: whether the cooling has changed at this time, so that both rates are those before
    cooling_changed: bool = False


@dataclass(frozen=True, slots=True)
class StepResult:
    """Result of one attempted step."""

    converged: bool  #: whether the solver succeeded; if not, `state` is the old one
    state: ThermalState  #: the new state
    error: float  #: estimated temperature error of the step, K (largest vertex)
    newton: int  #: Newton iterations
    #: whether the second-order step left the physical bounds, or would have come back, and was
    #: replaced by backward Euler
    limited: bool
    reason: str  #: reason given by the solver
    balance: float  #: (heat out + change of enthalpy - heat generated) over the largest of them
    #: stages of the new state: two of the second-order scheme, or parts of backward Euler
    stages: tuple[Stage, ...] = ()


class ThermalStepper:
    """Advances a `ThermalState` by one step; its only state is that of the problem.

    Args:
        problem: The heat balance.
        scheme: "sdirk2" or "backward_euler".
        estimate: Whether to estimate the error of each step (for adaptive stepping).
    """

    def __init__(
        self, problem: ThermalProblem, scheme: str = "sdirk2", estimate: bool = False
    ) -> None:
        self.problem, self.scheme, self.estimate = problem, scheme, estimate
        self.comm = problem.section.comm
        self._branch = Branch(problem)
        self._slack = max(RANGE.rounding, RANGE.solver * problem.tolerance)

    def initial(self, temperature: float) -> ThermalState:
        """State of the slice at a uniform temperature (K) at the meniscus."""
        curve, area = self.problem.curve, self.problem.area
        enthalpy = np.broadcast_to(curve.enthalpy(temperature), area.shape).copy()
        return self.state_from(0.0, enthalpy, np.zeros_like(area), 0.0)

    def state_from(
        self,
        time: float,
        enthalpy: Array,
        rate: Array,
        removed: float,
        generated: float = 0.0,
        next_rate: Array | None = None,
        filled: Array | None = None,
        fed: float = 0.0,
        allowed: tuple[float, float] | None = None,
    ) -> ThermalState:
        """Build a state from its stored arrays (checkpoint); `next_rate` defaults to `rate`."""
        point = self.problem.curve.at(enthalpy)
        next_rate = rate if next_rate is None else next_rate
        if filled is None:
            filled = np.zeros(0) if self.problem.shape is None else np.ones_like(enthalpy)
        return ThermalState(
            time, enthalpy, rate, point, removed, self._extremes(point), generated, next_rate,
            allowed, filled, fed,
        )  # fmt: skip

    def feed(self, old: ThermalState) -> ThermalState:
        """Let liquid flow to where the shape of the problem now has room for it (collective).

        It has the temperature that is there, so that moving changes no temperature; the heat it
        brings along is recorded.
        """
        problem = self.problem
        if problem.shape is None:
            return old
        filled = problem.shape.filled(old.filled, old.point.temperature)
        problem.fill(filled)
        heat = float((problem.area * (filled - old.filled)) @ old.enthalpy)
        return replace(old, filled=filled, fed=old.fed + reductions.total(self.comm, heat))

    def _extremes(self, point: CurvePoint) -> tuple[float, float]:
        """Coldest and hottest vertex over all ranks, K."""
        t = point.temperature
        ends = [-t.min(initial=np.inf), t.max(initial=-np.inf)]
        low, high = ends if self.comm.size == 1 else reductions.largest_of(self.comm, ends)
        return -float(low), float(high)

    def step(self, old: ThermalState, time: float) -> StepResult:
        """Advance `old` to `time` (s); `old` is unchanged."""
        dt = time - old.time
        newton = self.problem.iterations
        bounds = self._bounds(old, time)
        within = self._enthalpies(bounds)
        second_order = self.scheme == "sdirk2"
        tried = stages = (self._sdirk2 if second_order else self._euler)(old, dt, within)
        limited, next_rate, error = False, None, 0.0
        if self.estimate and tried[-1].result.converged:
            error = self._error(old, tried, dt)
        if second_order and tried[-1].result.converged:
            coldest, hottest = self._extremes(tried[-1].point)
            limited = coldest < bounds[0] - self._slack or hottest > bounds[1] + self._slack
            if not limited and (error > DAMPING.controlled or not self.estimate):
                limited, next_rate = self._look_ahead(old, tried, dt, within)
            if limited:
                stages, next_rate = self._euler(old, dt, within, DAMPING.parts), None
        newton = self.problem.iterations - newton
        reason = stages[-1].result.reason
        if not stages[-1].result.converged:
            reason = stages[-1].result.describe()
            return StepResult(False, old, np.inf, newton, limited, reason, 0.0)
        state, balance = self._commit(old, stages, time, next_rate)
        if limited and self.estimate:
            apart = np.abs(tried[-1].point.temperature - state.point.temperature)
            error = reductions.largest(self.comm, apart)
        return StepResult(True, state, error, newton, limited, reason, balance, tuple(stages))

    def _look_ahead(
        self, old: ThermalState, stages: list[Stage], dt: float, within: tuple[float, float]
    ) -> tuple[bool, Array | None]:
        """Whether vertices would come back after a second-order step; the rate of the next step.

        The rates at its end indicate this for single vertices, but also for modes so fast that they
        do not matter: where rates reverse, the first stage of an equal step is solved. The next
        step reuses it, if nothing changes until then. (Collective.)
        """
        last, tau = stages[-1], GAMMA * dt
        moved, kelvin = last.enthalpy - old.enthalpy, last.point.temperature_slope
        rates = (old.rate, *(s.rate for s in stages))
        error = dt * kelvin * sum(abs(d) * np.abs(r) for d, r in zip(DEFECT, rates, strict=True))
        # No vertex comes back faster than the rate at its end, nor by more than its error.
        most = np.minimum(tau * kelvin * np.abs(last.rate), DAMPING.comes_back * error)
        turning = (moved * last.rate < 0.0) & (most > DAMPING.rebound)
        if not reductions.any_of(self.comm, bool(turning.any())):
            return False, None
        guess = self._guess(last.enthalpy, last.rate, tau, within)
        after = self.problem.solve_stage(last.enthalpy, guess, tau, old.time + dt + tau)
        if not after.result.converged:
            return False, None
        back = after.point.temperature - last.point.temperature
        size, most = np.abs(back), DAMPING.comes_back * error
        found = (back * moved < 0.0) & (size > DAMPING.rebound) & (size < most)
        return reductions.any_of(self.comm, bool(found.any())), after.rate

    def _taken_too_much(self, new: ThermalState) -> str:
        """Say where more heat is removed than there is, and how to fix it (collective)."""
        places = self.problem.section.vertex_space.tabulate_dof_coordinates()
        owned = places[: len(new.point.temperature), :2]
        _, x, y = reductions.peak(self.comm, -new.point.temperature, owned)
        return (
            "more heat is taken than there is: the temperature is below absolute zero at "
            f"x = {1e3 * x:.4g} mm, y = {1e3 * y:.4g} mm; a prescribed flux does not decrease as "
            'the steel cools: reduce it there or end it earlier (law = "flux", over position), or '
            "use a law with an ambient temperature (contact, convection, spray)"
        )

    def stray(self, new: ThermalState) -> str:
        """Reason why a new state is outside the range allowed by the data; "" if it is inside.

        This is the range of all temperatures so far, of the surroundings and of the heat generated
        inside, and above absolute zero. A mesh that satisfies the maximum principle only
        approximately may leave it slightly.
        """
        assert new.allowed is not None
        low, high = new.allowed
        share = RANGE.stray if self.problem.shape is None else RANGE.stray_sheared
        slack = self._slack + (share * (high - low) if np.isfinite(high - low) else 0.0)
        coldest, hottest = new.extremes
        if coldest <= 0.0:
            return self._taken_too_much(new)
        kind, end = ("hotter", high) if hottest > high + slack else ("colder", low)
        if coldest >= low - slack and hottest <= high + slack:
            return ""
        found = hottest if kind == "hotter" else coldest
        return (
            f"{found - ZERO_CELSIUS:.5g} degC, though there is nothing {kind} than "
            f"{end - ZERO_CELSIUS:.5g} degC"
        )

    def longest(self, old: ThermalState, new: ThermalState) -> float:
        """Longest step from old to new whose stages each have a single solution, s."""
        share = GAMMA if self.scheme == "sdirk2" else 1.0
        asked = share * (new.time - old.time)
        return self._branch.longest_stage(old.point, new.point, new.time, asked) / share

    def _bounds(self, old: ThermalState, time: float) -> tuple[float, float]:
        """Bounds of the new temperatures from old temperatures and surroundings, K.

        L-stable second-order schemes have no maximum principle at large steps; backward Euler has
        one.
        """
        low, high = self._reached(old.extremes, old, time)
        if self.problem.shape is not None:
            low, high = low - RANGE.sheared * (high - low), high + RANGE.sheared * (high - low)
        return low, high

    def _reached(
        self, so_far: tuple[float, float], old: ThermalState, time: float
    ) -> tuple[float, float]:
        """Range of temperatures so far, extended by surroundings and heat generated, K."""
        low, high = self.problem.cooling.ambient_range(time)
        low, high = min(low, so_far[0]), max(high, so_far[1])
        return low, high + RANGE.warmer * self.problem.warming * (time - old.time)

    def _enthalpies(self, bounds: tuple[float, float]) -> tuple[float, float]:
        """Enthalpies that correspond to temperature bounds, K, J/m3."""
        curve = self.problem.curve
        low, high = (min(max(t, curve.knots[0]), curve.knots[-1]) for t in bounds)
        return _enthalpy(curve, low, "left"), _enthalpy(curve, high, "right")

    @staticmethod
    def _guess(old: Array, rate: Array, tau: float, within: tuple[float, float]) -> Array:
        """Enthalpy extrapolated by its rate, within a range, as start of Newton's method."""
        lowest, highest = within
        return np.minimum(np.maximum(old + tau * rate, lowest), highest)

    def _commit(
        self, old: ThermalState, stages: list[Stage], time: float, next_rate: Array | None
    ) -> tuple[ThermalState, float]:
        """The new state, and the error of its heat balance, from solved stages."""
        last, dt = stages[-1], time - old.time
        alike = (dt / len(stages),) * len(stages)
        weights = ((1 - GAMMA) * dt, GAMMA * dt) if len(stages) == 2 else alike
        gone, made = (
            sum(w * getattr(s, name) for w, s in zip(weights, stages, strict=True))
            for name in ("out", "generated")
        )
        change = float(self.problem.volume @ (last.enthalpy - old.enthalpy))
        sums = reductions.totals(self.comm, [gone, change, made])
        out, gained, generated = (float(value) for value in sums)
        removed = old.removed + out
        # A step with almost no change is measured relative to all heat so far.
        size = max(abs(out), abs(gained), abs(generated), 1e-6 * abs(removed), 1e-300)
        balance = (out + gained - generated) / size
        generated += old.generated
        allowed = self._reached(old.allowed or old.extremes, old, time)
        rate = last.rate.copy()
        rate[self.problem.fixed] = 0.0  # a stage has there what its base is off after a jump
        state = self.state_from(
            time, last.enthalpy, rate, removed, generated, next_rate, old.filled, old.fed, allowed
        )  # fmt: skip
        return state, balance

    def _euler(
        self, old: ThermalState, dt: float, within: tuple[float, float], parts: int = 1
    ) -> list[Stage]:
        stages: list[Stage] = []
        enthalpy, rate, tau = old.enthalpy, old.next_rate, dt / parts
        for part in range(1, parts + 1):
            guess = self._guess(enthalpy, rate, tau, within)
            stage = self.problem.solve_stage(enthalpy, guess, tau, old.time + part * tau)
            stages.append(stage)
            if not stage.result.converged:
                break
            enthalpy, rate = stage.enthalpy, stage.rate
        return stages

    def _sdirk2(self, old: ThermalState, dt: float, within: tuple[float, float]) -> list[Stage]:
        tau = GAMMA * dt
        guess = self._guess(old.enthalpy, old.next_rate, tau, within)
        first = self.problem.solve_stage(old.enthalpy, guess, tau, old.time + tau)
        if not first.result.converged:
            return [first]
        base = old.enthalpy + (1 - GAMMA) * dt * first.rate
        guess = self._guess(base, first.rate, tau, within)
        return [first, self.problem.solve_stage(base, guess, tau, old.time + dt)]

    def _error(self, old: ThermalState, stages: list[Stage], dt: float) -> float:
        """Estimated temperature error of the step at the worst vertex, K.

        The rates at the start, the first stage and the end form a quadrature of third order; its
        difference to the second-order step is the estimate. The rates have the error of the first
        stage themselves: of a vertex that decays exponentially the true error is up to 6.8 times as
        large. For backward Euler the trapezoidal rule is used instead.
        """
        if len(stages) == 2:
            rates = (old.rate, *(s.rate for s in stages))
            change = sum(d * rate for d, rate in zip(DEFECT, rates, strict=True))
        else:
            change = 0.5 * (stages[0].rate - old.rate)
        kelvin = np.abs(dt * change * stages[-1].point.temperature_slope)
        kelvin[self.problem.fixed] = 0.0  # a prescribed temperature is exact, even if it jumps
        return reductions.largest(self.comm, kelvin)


@lru_cache(maxsize=16)  # bounds are the same over many steps, above all the lower one
def _enthalpy(curve: ThermalCurve, kelvin: float, side: Side) -> float:
    """H at a temperature, J/m3; see `ThermalCurve.enthalpy`."""
    return float(curve.enthalpy(kelvin, side))
