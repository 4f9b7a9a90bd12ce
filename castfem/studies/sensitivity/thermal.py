"""Derivatives of the temperatures, carried through the stages of each thermal step.

A stage solves, for the enthalpies H of the vertices (`castfem.physics.thermal.problem`),

    M (H - H_base) + tau F(H, t, p) = 0,     F = L theta(H, p) + w q(T(H, p), t, p) - M s.

Its derivative by a parameter p is one linear equation with the matrix of Newton's method,

    J dH/dp = M dH_base/dp - d(tau F)/dp at held H,     J = M + tau dF/dH,

and that of the base follows from the scheme.  The last term is the change of the laws alone: a
central difference of them, at the enthalpies that are there, between simulations of the case on
both sides of p; they have their own times, tau among them.  What p does to a law is linear or
smooth, and the quotient is right to 1e-9 of it or so (docs/sensitivity.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.model.build.simulation import Simulation
from castfem.model.build.start import starting_enthalpy
from castfem.physics.thermal.problem import Stage
from castfem.physics.thermal.stepper import GAMMA, StepResult, ThermalState
from castfem.studies.sensitivity.feedback import Feedback
from castfem.studies.sensitivity.linear import StageTangent
from castfem.studies.sensitivity.perturbed_simulation import Variation, surface_heat


class ThermalDerivatives:
    """Derivatives of the committed thermal state by each parameter.

    Args:
        simulation: The run.
        variations: Its parameters.

    Attributes:
        enthalpy: dH/dp of each parameter (parameters, owned), J/m3 per unit of it.
        rate: d(dH/dt)/dp likewise, W/m3.
        removed: Derivatives of the heat removed from the modelled part (parameters,), J/m.
        solves: Back substitutions so far. reached: State they belong to; None before a step.
        feedback: Of the mechanics on the thermal steps of a window; None without any.
    """

    def __init__(self, simulation: Simulation, variations: Sequence[Variation]) -> None:
        self._simulation, self.variations = simulation, tuple(variations)
        self._problem = simulation.problem
        self._tangent = StageTangent(self._problem)
        self._zone = -1
        self._cooled: npt.NDArray[np.intp] = np.zeros(0, np.intp)
        shape = (len(self.variations), simulation.section.owned)
        self.enthalpy: Array = np.zeros(shape)
        self.rate: Array = np.zeros(shape)
        for i, variation in enumerate(self.variations):
            self.enthalpy[i] = _of_start(variation)
        self._start = self.enthalpy.copy()
        self.removed: Array = np.zeros(len(self.variations))
        self.solves = 0
        self._begun: ThermalState | None = None
        self.reached: ThermalState | None = None
        self.feedback: Feedback | None = None
        self._marked: tuple[Array, Array, Array] = (self.enthalpy, self.rate, self.removed)

    def warming(self, number: int, state: ThermalState) -> Array:
        """DT/dp of the vertices at the state these are of (owned,), K per unit."""
        variation = self.variations[number]
        found = state.point.temperature_slope * self.enthalpy[number]
        if variation.curves is not None:
            found = found + variation.curves.temperature(state.enthalpy) / variation.span
        return np.asarray(found)

    def mark(self, state: ThermalState) -> None:
        """Keep the derivatives of a committed state: a window that fails begins there again."""
        self._begun, self._marked = state, (self.enthalpy, self.rate, self.removed)

    def restore(self, enthalpy: Array, rate: Array, removed: Array) -> None:
        """Go on from derivatives that have been saved."""
        self.enthalpy, self.rate, self.removed = enthalpy, rate, removed

    def step(self, old: ThermalState, result: StepResult) -> None:
        """Carry the derivatives through a step that has been kept (collective).

        Raises:
            RunFailure: A matrix cannot be factored.
        """
        if self._begun is not None and old.time == self._begun.time:
            self.enthalpy, self.rate, self.removed = self._marked
        self._enter(old.time)
        step = _Step.of(old.time, result.state.time, self.variations)
        second_order = len(result.stages) == 2
        base, started = self.enthalpy, self.enthalpy
        for number, stage in enumerate(result.stages):
            found = self._stage(stage, step, base)
            rate = np.asarray((found - base) / stage.tau, dtype=np.float64)
            for i in step.moving:
                rate[i] -= step.lengthened[i] / step.span * stage.rate
            self.rate = rate
            base = found
            if second_order and number == 0:
                gained = step.span * self.rate
                for i in step.moving:
                    gained[i] += step.lengthened[i] * stage.rate
                base = started + (1.0 - GAMMA) * gained
        self.enthalpy, self.reached = found, result.state
        comm, problem, feedback = self._simulation.section.comm, self._problem, self.feedback
        # What the strand has lost has been removed: stages close their balance to rounding.
        if feedback is None:
            self.removed = reductions.totals(comm, (self._start - found) @ problem.volume)
            return
        share, change = step.span / feedback.duration, result.state.enthalpy - old.enthalpy
        lost = (started - found) @ problem.volume + feedback.gained(share, change, problem)
        self.removed = self.removed + reductions.totals(comm, lost)

    def _enter(self, time: float) -> None:
        """Follow the cooling of the run into the zone of a step that begins at `time` (s)."""
        zone = self._simulation.zones.index(time)
        if zone != self._zone:
            cooling = self._simulation.zones.cooling(zone)
            dofs = [patch.dofs for patch, _ in cooling.laws]
            self._cooled = np.unique(np.concatenate(dofs)) if dofs else np.zeros(0, np.intp)
            for variation in self.variations:
                for end in (variation.below, variation.above):
                    end.enter(zone)
                    end.compare(cooling)
            self._zone = zone

    def _stage(self, stage: Stage, step: _Step, base: Array) -> Array:
        """DH/dp at the end of a stage from that of its base (parameters, owned)."""
        problem, point = self._problem, stage.point
        slope = surface_heat(problem.cooling, point.temperature, stage.time)[1]
        self._tangent.factor(point, slope, stage.tau)
        right = problem.volume * base
        if self.feedback is not None:
            right += self.feedback.of_stage(stage, problem)
        fixed = np.zeros((len(base), len(problem.fixed)))
        for i, v in enumerate(self.variations):
            change = self._change(v, stage, step, i, slope)
            if change is not None:
                right[i] -= change
            if not fixed.size:
                continue
            above, below = (end.simulation.problem for end in (v.above, v.below))
            fixed[i] = (above.fixed_enthalpy - below.fixed_enthalpy) / v.span
        self.solves += len(base)
        return self._tangent.solve(right, fixed)

    def _change(
        self, v: Variation, stage: Stage, step: _Step, number: int, slope: Array
    ) -> Array | None:
        """D(tau F)/dp at the enthalpies of a stage (owned,), J/m per unit; None if it is 0.

        Where laws and times are those of the run, heat crosses the surface by another temperature
        alone: `slope` (owned,), W/(m K), times its change.
        """
        problem, point = self._problem, stage.point
        alike = v.above.same_cooling and v.below.same_cooling and self.feedback is None
        if alike and not step.lengthened[number]:
            return None
        share, place = stage.tau / step.span, (stage.time - step.begin) / step.span
        sides = tuple(zip((v.above, v.below), step.own[number], (1.0, -1.0), strict=True))
        weights = [sign * share * span / v.span for _, (_, span), sign in sides]
        mean, longer = 0.5 * (weights[0] - weights[1]), sum(weights)
        conduction = longer * point.conduction if longer else None  # the same heat for longer
        if v.curves is not None:
            by_curve = mean * v.curves.conduction(stage.enthalpy)
            conduction = by_curve if conduction is None else conduction + by_curve
        if conduction is None:
            change = np.zeros_like(point.conduction)
        else:
            change = problem.conducted(conduction)
        if self.feedback is None and v.above.same_laws and v.below.same_laws:
            if v.curves is not None:
                warmer = v.curves.temperature(stage.enthalpy[self._cooled])
                change[self._cooled] += mean * slope[self._cooled] * warmer
            return change
        for (end, (begin, span), _), weight in zip(sides, weights, strict=True):
            end.add_surface(stage, begin + place * span, weight, change)
        return change

    def destroy(self) -> None:
        """Free the PETSc objects."""
        self._tangent.destroy()


@dataclass(frozen=True, slots=True)
class _Step:
    """A step of the run, and what it is on both sides of each parameter.

    Attributes:
        begin: s. span: Its length, s.
        own: Begin and length of each parameter above and below it, s.
        lengthened: D span / dp (parameters,), s per unit. moving: Parameters of which it is not 0.
    """

    begin: float
    span: float
    own: list[tuple[tuple[float, float], ...]]
    lengthened: Array
    moving: list[int]

    @classmethod
    def of(cls, begin: float, end: float, variations: Sequence[Variation]) -> _Step:
        """The step from begin to end of the run, s."""
        span = end - begin
        own = []
        for v in variations:
            met = [side.step(begin) for side in (v.above, v.below)]
            own.append(tuple((first, pace * span) for first, pace in met))
        longer = [(o[0][1] - o[1][1]) / v.span for o, v in zip(own, variations, strict=True)]
        moving = [i for i, one in enumerate(longer) if one]
        return cls(begin, span, own, np.array(longer), moving)


def _of_start(variation: Variation) -> Array:
    """DH/dp of the enthalpies with which a run begins (owned,)."""
    above, below = (
        np.asarray(starting_enthalpy(end.simulation)) for end in (variation.above, variation.below)
    )
    owned = variation.above.simulation.section.owned
    return np.array(np.broadcast_to((above - below) / variation.span, (owned,)))
