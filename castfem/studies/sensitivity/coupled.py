"""Coupling windows that carry derivatives along, repeated as often as the windows are.

A window is repeated with another gap until it agrees with the one it leads to; each repetition is a
step from the same committed state, and so is its derivative.  What the next one is told, the gap,
is relaxed, and so is its derivative, that of the factor of relaxation included.  The number of
repetitions is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.coupling.staggered import (
    FACTORS,
    CouplingWindow,
    Relaxation,
    StaggeredCoupling,
    StrandState,
)
from castfem.studies.sensitivity.feedback import Feedback
from castfem.studies.sensitivity.mechanical import MechanicalDerivatives
from castfem.studies.sensitivity.moved_state import Slopes, none_of
from castfem.studies.sensitivity.shape_change import ShapeChange
from castfem.studies.sensitivity.thermal import ThermalDerivatives

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.physics.mechanics.state import MechanicalState


class FollowedCoupling(StaggeredCoupling):
    """A staggered coupling whose windows are followed by derivatives.

    Args:
        simulation: The run.
        thermal: Derivatives of its temperatures. mechanical: Of its slice.
    """

    def __init__(
        self, simulation: Simulation, thermal: ThermalDerivatives, mechanical: MechanicalDerivatives
    ) -> None:
        assert simulation.coupling is not None
        vars(self).update(vars(simulation.coupling))  # solvers, surface and settings of the run
        self._derivatives, self._mechanical = thermal, mechanical
        count, owned = len(thermal.variations), simulation.section.owned
        nothing: Array = np.zeros((count, owned))
        self.gap_slopes = self.mean_slopes = self._begun = nothing
        self._ended: tuple[Sequence[Slopes], Array] = (), nothing
        self._warmed = self._warms_now = np.zeros((count, owned if self.dissipation else 0))
        self._filled = self._fed = np.zeros((count, owned))
        self._shape: ShapeChange | None = None
        if simulation.problem.shape is not None:
            self._shape = ShapeChange(simulation.problem, simulation.zones.surface, count)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        if self._shape is not None:
            self._shape.destroy()

    def mark(self, state: StrandState) -> None:
        """Keep the derivatives of a committed state: a window that fails begins there again."""
        self._warmed, self._fed = self._warms_now, self._filled
        assert state.mechanical is not None
        self._mechanical.look(state.mechanical)

    def handed_on(self) -> tuple[Array, Array]:
        """Derivatives of what a committed window hands to the next, by each parameter.

        Returns:
            Of the heat of viscoplastic work (parameters, owned), J/m3, without entries where it is
            left out; of the volume that is filled, over the undeformed one (parameters, owned).
        """
        return self._warmed, self._fed

    def take_up(self, warmed: Array, fed: Array) -> None:
        """Go on from what `handed_on` gave."""
        self._warmed = self._warms_now = warmed
        self._fed = self._filled = fed

    def take(self, old: StrandState, end: float, allowed: float = np.inf) -> CouplingWindow:
        """See `StaggeredCoupling`."""
        assert old.mechanical is not None
        self._old, self._duration = old, end - old.time
        if self.gap is not None:
            self._begun = self.gap_slopes = self._gaps_at_start(old.mechanical)
        return super().take(old, end, allowed)

    def _expected_gap(self, old: MechanicalState, begun: Array, end: float) -> Array:
        """See `StaggeredCoupling`."""
        found = super()._expected_gap(old, begun, end)
        if found is not begun:
            assert self.gap is not None
            ahead = self.mechanics.stepper.going_on(old, end)
            ended = self._mechanical.gaps_of_motion(
                self.gap, self._mechanical.going_on(old, end), ahead
            )
            self.gap_slopes = np.asarray(0.5 * (self._begun + ended))
        return found

    def _gaps_at_start(self, state: MechanicalState) -> Array:
        """Those of a committed state, which the window before has ended with."""
        slopes, gaps = self._ended
        marked = self._mechanical.marked
        if slopes is marked:
            return gaps
        assert self.gap is not None
        if all(marked):
            return self._mechanical.gaps(self.gap, marked, state)
        # Nothing has touched the strand as it begins, but a wall may stand off it.
        none = none_of(state)
        return self._mechanical.gaps_of_motion(self.gap, [its or none for its in marked], state)

    def _iterate(self, old: StrandState, end: float, gap: Array | None) -> CouplingWindow:
        """See `StaggeredCoupling`: one iteration, with its derivatives."""
        if self.gap is not None or self.dissipation or self._shape is not None:
            self._derivatives.feedback = Feedback(self._duration, self._warmed, self._shape)
        if gap is not None:
            for variation, slope in zip(self._derivatives.variations, self.gap_slopes, strict=True):
                by = variation.parameter.step * slope
                variation.above.simulation.zones.set_gap(gap + by)
                variation.below.simulation.zones.set_gap(gap - by)
        taken = super()._iterate(old, end, gap)
        if taken.converged and taken.state.mechanical is not None:
            if self.gap is not None:
                slopes = self._mechanical.slopes
                ended = self._mechanical.gaps(self.gap, slopes, taken.state.mechanical)
                self.mean_slopes = np.asarray(0.5 * (self._begun + ended))
                self._ended = slopes, ended
            if self.dissipation:
                self._warms_now = np.array([self._warms(s) for s in self._mechanical.slopes])
        return taken

    def _warms(self, slopes: Slopes) -> Array:
        """Derivative of the heat of a window's viscoplastic work (owned,), J/m3."""
        points = self.mechanics.stepper.problem.points
        work = points.to_vertices(slopes["dissipation"])
        return np.asarray(self.dissipation * work / self.thermal.stepper.problem.area)

    def _relaxation(self) -> Relaxation:
        return FollowedRelaxation(self)

    def _follow_shape(self, state: MechanicalState) -> None:
        """See `StaggeredCoupling`."""
        super()._follow_shape(state)
        if self._shape is None:
            return
        none = none_of(state)
        known = [slopes or none for slopes in self._mechanical.marked]
        motions, strains = (
            np.array([slopes[name] for slopes in known])
            for name in ("displacement", "generalized_strains")
        )
        thermal, shape = self._old.thermal, self.thermal.stepper.problem.shape
        assert shape is not None
        solid = thermal.point.temperature < shape.solidus
        self._shape.follow(motions, strains, self._fed, solid)
        self._filled = self._shape.filled


class FollowedRelaxation(Relaxation):
    """Aitken's relaxation of a gap, and of its derivatives.

    Args:
        coupling: Has the derivatives of the gap that was tried, and of the one it led to.
    """

    def __init__(self, coupling: FollowedCoupling) -> None:
        share = coupling.surface.perimeter_share()
        super().__init__(coupling.mechanics.comm, share)
        self._coupling = coupling
        self._slopes: Array | None = None
        self._factor_slopes: Array = np.zeros(len(coupling.gap_slopes))

    def __call__(self, tried: Array, found: Array) -> Array:
        """See `Relaxation`; the coupling is told the derivatives of what comes next."""
        before, factor = self._before, self._factor
        result = super().__call__(tried, found)
        now = self._before
        assert now is not None
        coupling, reached = self._coupling, np.isfinite(tried) & np.isfinite(found)
        slopes = np.where(reached, coupling.mean_slopes - coupling.gap_slopes, 0.0)
        if before is not None and self._slopes is not None:
            self._factor_slopes = self._of_factor(factor, before, now, slopes)
        self._slopes = slopes
        relaxed = np.outer(self._factor_slopes, now) + self._factor * slopes
        coupling.gap_slopes = np.where(reached, coupling.gap_slopes + relaxed, coupling.mean_slopes)
        return result

    def _of_factor(self, factor: float, before: Array, now: Array, slopes: Array) -> Array:
        """Derivatives of the factor - factor before . change / change . change (parameters,)."""
        assert self._slopes is not None
        change, turned = now - before, slopes - self._slopes
        weighted = self._weight * change
        along, size, *rest = reductions.totals(
            self._comm,
            [
                float(before @ weighted), float(change @ weighted), *(self._slopes @ weighted),
                *(turned @ (self._weight * before)), *(turned @ weighted),
            ],
        )  # fmt: skip
        if not size > 0.0 or not FACTORS[0] < -factor * along / size < FACTORS[1]:
            return np.zeros_like(self._factor_slopes) if size > 0.0 else self._factor_slopes
        one, other, third = np.array(rest).reshape(3, -1)
        of_share = (one + other) / size - 2.0 * along * third / size**2
        return np.asarray(-self._factor_slopes * along / size - factor * of_share)
