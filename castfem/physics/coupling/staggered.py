"""Staggered coupling of temperature and mechanics, one coupling window after the other.

Nothing here has a state of its own: each step leads from a committed state to a new one, or leaves
the old one unchanged.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.coupling.relaxation import Relaxation
from castfem.physics.coupling.step_control import LIMITS as STEP_LIMITS
from castfem.physics.coupling.step_control import NO_STEP, StepLength
from castfem.physics.coupling.subcycling import MechanicalSteps, SubSteps, ThermalSteps
from castfem.physics.thermal.stepper import ThermalState

if TYPE_CHECKING:
    from castfem.physics.mechanics.state import MechanicalResult, MechanicalState
    from castfem.physics.mechanics.surface_gap import SurfaceGap


@dataclass(frozen=True, slots=True)
class CouplingLimits:
    """Parameters of the error estimate of a coupling window."""

    #: error of the surface temperature from holding the gap at its mean, relative to the effect of
    #: the change of flux: the flux is linear over a window
    share: float = 1.0 / 6.0
    order: float = 1.5  #: order of this error in the length of the window
    allowed: float = 2.0  #: default for that error, K
    #: multiple of the allowed error at which the window is shortened before the gap has converged
    beyond: float = 4.0
    #: largest relative change of the rate of displacement for which the gap at the end of a window
    #: is extrapolated
    steady: float = 0.5
    #: lowest extrapolated temperature, K: a straight line may fall below absolute zero
    coldest: float = 100.0


LIMITS = CouplingLimits()


@dataclass(frozen=True, slots=True)
class StrandState:
    """The committed state of the slice, all at one time."""

    thermal: ThermalState  #: thermal state
    mechanical: MechanicalState | None  #: mechanical state; None without mechanics
    #: heat of the viscoplastic work of the last window, released in the next, at the owned vertices
    #: (owned,), J/m3; empty without
    heating: Array
    #: rate of temperature in the last window (owned,), K/s, with which mechanics that go first
    #: extrapolate; otherwise empty
    trend: Array = field(default_factory=lambda: np.zeros(0))
    #: rate of the generalized strains a0, a1, a2 in the last window (3,), 1/s, 1/(m s), for
    #: comparison with the next one; empty unless windows grow
    strain_rate: Array = field(default_factory=lambda: np.zeros(0))
    #: length of the next thermal step; window: of the next window. `NO_STEP` if none follows
    step: StepLength = NO_STEP
    window: StepLength = NO_STEP

    @property
    def time(self) -> float:
        """Time since the meniscus, s."""
        return self.thermal.time

    @property
    def strained(self) -> MechanicalState | None:
        """The mechanical state at this time; None without mechanics, and after their end."""
        state = self.mechanical
        return None if state is None or state.time < self.thermal.time else state


@dataclass(frozen=True, slots=True)
class CouplingWindow:
    """One attempted coupling window."""

    converged: bool  #: whether both solvers converged
    state: StrandState  #: the new state, or the old one
    substeps: SubSteps  #: the thermal steps
    mechanical: MechanicalResult  #: the mechanical steps
    iterations: int  #: coupling iterations; 1 if the window was not iterated
    #: whether the gap converged, if it was iterated
    gap_converged: bool = True
    #: error of the surface temperature at its end, K, from holding the gap at its mean; 0 if the
    #: window is not iterated
    error: float = 0.0
    cut_for_error: int = 0  #: number of longer windows tried before whose error was too large

    def before(self, after: CouplingWindow) -> CouplingWindow:
        """The result of repeating the window: `after`, with the work of both."""
        mechanical = replace(after.mechanical, newton=self.newton + after.newton)
        substeps = replace(after.substeps, newton=self.substeps.newton + after.substeps.newton)
        return replace(
            after,
            substeps=substeps,
            mechanical=mechanical,
            iterations=self.iterations + after.iterations,
        )

    @property
    def newton(self) -> int:
        """Newton iterations of the mechanics."""
        return self.mechanical.newton


class CooledSurface(Protocol):
    """The cooled surface, as far as the coupling needs it."""

    def perimeter_share(self) -> Array:
        """Length of surface of each owned vertex (owned,), m."""

    def set_gap(self, gap: Array) -> None:
        """Set the gaps that heat crosses from now on, as from `SurfaceGap.crossed`, m."""

    def flux_across(self, gap: Array, temperature: Array, time: float) -> Array:
        """Flux at the owned vertices (owned,), W/m2, across these gaps at given temperatures, K."""

    def follow_shape(self) -> None:
        """Cool the surface at its present position."""


class CouplingObserver:
    """Follows the windows of a coupling; this one does nothing."""

    def begins(self, old: StrandState, end: float) -> None:
        """A window from a committed state to `end`, s, is tried."""

    def shaped(self, state: MechanicalState) -> None:
        """From now on heat is computed on the deformed slice of this state."""

    def expects(self, old: MechanicalState, ahead: MechanicalState) -> None:
        """The gap is the mean of a committed state and an extrapolated one."""

    def iterates(self, gap: Array | None) -> None:
        """An iteration begins, with these gaps, m."""

    def iterated(self, old: StrandState, new: StrandState) -> None:
        """An iteration has converged."""

    def relaxed(self, relaxation: Relaxation) -> None:
        """The gap of the next iteration has been computed."""


class StaggeredCoupling:
    """Staggered coupling, thermal first (thesis IV): in each window the slice cools, then strains.

    The mechanics pass to the thermal problem of the next window the deformed section, the gap to
    the wall and the dissipated work. With more than one iteration a window is repeated with the
    mean of the gaps at its start and end until that converges; if it does not, the window is
    shortened, since the gap then changes less.

    Args:
        thermal: Thermal steps. mechanics: Mechanical steps.
        dissipation: Fraction of the viscoplastic work that heats the next window.
        surface: Receives the gaps. gap: Computes them; None without a mould.
        window: Length of a window that is not shortened, s.
        max_iterations: Largest number of coupling iterations in one window.
        tolerance: The gap has converged when the newly computed one would change the surface
            temperature by less, K.
        strain_error: Error of the axial strain allowed in a window that has grown.
        reach: Largest |x| and |y| of the section, m; None if windows do not grow.
        order: "thermal_first", or "mechanics_first": the strain is computed first, with cooling
            extrapolated from the previous window, in the first window with constant temperature
            (297)-(299), Fig. 84.

    Attributes:
        observer: Called in each part of a window; used for derivatives of a run.
    """

    def __init__(
        self,
        thermal: ThermalSteps,
        mechanics: MechanicalSteps,
        dissipation: float,
        surface: CooledSurface,
        gap: SurfaceGap | None,
        window: float,
        max_iterations: int = 1,
        tolerance: float = 1.0,
        order: str = "thermal_first",
        strain_error: float = STEP_LIMITS.strain,
        reach: tuple[float, float] | None = None,
    ) -> None:
        self.thermal, self.mechanics, self.dissipation = thermal, mechanics, dissipation
        self.surface, self.gap, self.window = surface, gap, window
        self.max_iterations, self.tolerance, self.order = max_iterations, tolerance, order
        self.strain_error, self.reach = strain_error, reach
        self.observer = CouplingObserver()

    def take(self, old: StrandState, end: float, allowed: float = np.inf) -> CouplingWindow:
        """Take one window from `old` to `end` (s); `old` is unchanged.

        Args:
            old: State at its start.
            end: End of the window, s.
            allowed: Allowed error, K. A window far above it is not iterated further.

        Raises:
            RunFailure: No thermal step is short enough.
        """
        assert old.mechanical is not None
        self.observer.begins(old, end)
        if self.dissipation:
            self.thermal.stepper.problem.set_source(np.asarray(old.heating / (end - old.time)))
        self._follow_shape(old.mechanical)
        strained, begun = old.mechanical, self.gap_of(old.mechanical)
        given, old = old, replace(old, thermal=self.thermal.stepper.feed(old.thermal))
        repeats = begun is not None and self.order == "thermal_first"
        gap = begun
        if begun is not None and repeats and self.max_iterations > 1:
            gap = self._expected_gap(strained, begun, end)
        perimeter = self.surface.perimeter_share()
        perimeter = perimeter if self.gap is None else self.gap.shares(perimeter)
        relaxation = Relaxation(self.mechanics.comm, perimeter)
        taken = self._iterate(old, end, gap)
        while taken.converged and repeats:
            assert begun is not None and gap is not None and taken.state.mechanical is not None
            ended = self.gap_of(taken.state.mechanical)
            assert ended is not None
            mean = 0.5 * (begun + ended)
            if self.max_iterations > 1:
                error = LIMITS.share * self._misjudged(old.time, taken.state, begun, ended)
                taken = replace(taken, error=error)
            if taken.error > LIMITS.beyond * allowed:
                break
            if self._misjudged(old.time, taken.state, gap, mean) <= self.tolerance:
                break
            if taken.iterations == self.max_iterations:
                kept = replace(taken.state, step=old.step)
                taken = replace(taken, gap_converged=False, state=kept)
                break
            gap = relaxation(gap, mean)
            self.observer.relaxed(relaxation)
            taken = taken.before(self._iterate(old, end, gap))
        return taken if taken.converged else replace(taken, state=given)

    def _expected_gap(self, old: MechanicalState, begun: Array, end: float) -> Array:
        """Mean gaps of a window if the slice keeps moving as before (gaps,), m (collective).

        The gap at its start if the slice moved differently in the step before the last.

        Args:
            old: State at the start of the window.
            begun: Its gaps (gaps,), m.
            end: End of the window, s.
        """
        if not old.unsteadiness < LIMITS.steady:
            return begun
        ahead = self.mechanics.stepper.going_on(old, end)
        ended = self.gap_of(ahead)
        assert ended is not None
        self.observer.expects(old, ahead)
        return np.asarray(0.5 * (begun + ended))

    def _iterate(self, old: StrandState, end: float, gap: Array | None) -> CouplingWindow:
        """One coupling iteration, with a constant gap at each vertex."""
        assert old.mechanical is not None
        self.observer.iterates(gap)
        first, instants = None, self.mechanics.instants(old.time, end)
        if self.order == "mechanics_first":
            expected = [(time, self._expected(old, time)) for time in instants]
            first = self.mechanics.through(old.mechanical, expected)
            if first.converged and gap is not None:
                gap = self.gap_of(first.state)
        if gap is not None:
            self.surface.set_gap(gap)
        substeps, moments = self.thermal.through(old.thermal, old.step, instants)
        result = first or self.mechanics.through(old.mechanical, moments)
        if not result.converged:
            return CouplingWindow(False, old, substeps, result, 1)
        duration = end - old.time
        trend: Array = np.zeros(0)
        if first is not None:
            cooled = substeps.state.point.temperature - old.thermal.point.temperature
            trend = np.asarray(cooled / duration)
        rate: Array = np.zeros(0)
        if self.reach is not None:
            moved = result.state.generalized_strains - old.mechanical.generalized_strains
            rate = np.asarray(moved[:3] / duration)
        state = StrandState(
            substeps.state, result.state, self._heating(result), trend, rate, substeps.length,
            old.window,
        )  # fmt: skip
        self.observer.iterated(old, state)
        return CouplingWindow(True, state, substeps, result, 1)

    def _follow_shape(self, state: MechanicalState) -> None:
        """Compute heat on the deformed slice from now on, unless the case excludes it."""
        problem = self.thermal.stepper.problem
        if problem.shape is not None:
            problem.shape.take(state.displacement, state.generalized_strains)
            self.surface.follow_shape()
            problem.follow_shape()
            self.observer.shaped(state)

    def _expected(self, old: StrandState, end: float) -> Array:
        """Temperatures at `end` if the slice keeps cooling as before (owned,), K."""
        found = old.thermal.point.temperature + (end - old.time) * old.trend
        return np.maximum(found, LIMITS.coldest)

    def gap_of(self, state: MechanicalState) -> Array | None:
        """Gaps that heat crosses (gaps,), m; None without a wall (collective)."""
        return None if self.gap is None else self.gap.crossed(state)

    def _misjudged(self, begun: float, state: StrandState, taken: Array, found: Array) -> float:
        """Error of the surface temperature, K, from the difference of assumed and computed gap.

        The difference of the fluxes cools a semi-infinite body of the local steel for the length of
        the window (Carslaw and Jaeger, Conduction of Heat in Solids, 2.9). (Collective.)
        """
        point, surface = state.thermal.point, self.surface
        fluxes = [surface.flux_across(gap, point.temperature, begun) for gap in (taken, found)]
        slope = point.temperature_slope  # 1 / (rho c); that of conduction is k / (rho c)
        effusivity = np.sqrt(np.maximum(point.conduction_slope, 1e-300)) / np.maximum(slope, 1e-300)
        duration = state.time - begun
        cooled = np.abs(fluxes[1] - fluxes[0]) * np.sqrt(4.0 / np.pi * duration) / effusivity
        return reductions.largest(self.mechanics.comm, cooled)

    def _heating(self, result: MechanicalResult) -> Array:
        """Heat of the viscoplastic work of a window (owned,), J/m3."""
        if not self.dissipation:
            return np.zeros(0)
        problem = self.thermal.stepper.problem
        work = self.mechanics.stepper.problem.points.to_vertices(result.dissipation)
        return np.asarray(self.dissipation * work / problem.area)

    def release(self, state: StrandState) -> ThermalState:
        """Return the thermal state after the mechanics, in the shape they have left.

        (Collective.)

        Args:
            state: State at the end of the mechanics, or later.
        """
        assert state.mechanical is not None
        if self.dissipation:
            self.thermal.stepper.problem.set_source(np.zeros_like(state.heating))
        self._follow_shape(state.mechanical)
        fed = state.strained is None
        return state.thermal if fed else self.thermal.stepper.feed(state.thermal)

    def curved(self, old: StrandState, new: StrandState) -> float:
        """Deviation of the axial strain of a window from linearity, over the allowed one.

        Half of the deviation from continuing as in the previous window, which is the error of a
        backward step, at the worst corner of the section.
        """
        if self.reach is None or not old.strain_rate.size:
            return 0.0
        changes = np.abs(new.strain_rate - old.strain_rate)
        off = float(changes @ np.array([1.0, *self.reach])) * (new.time - old.time)
        return 0.5 * off / self.strain_error

    def start(self, thermal: ThermalState, window: StepLength) -> StrandState:
        """Return the initial slice, undeformed and stress-free, with a first window length."""
        mechanical = self.mechanics.stepper.initial(thermal.time, thermal.point.temperature)
        owned = len(thermal.enthalpy) if self.dissipation else 0
        trend = np.zeros(len(thermal.enthalpy) if self.order == "mechanics_first" else 0)
        step = self.thermal.control.first
        return StrandState(thermal, mechanical, np.zeros(owned), trend, step=step, window=window)
