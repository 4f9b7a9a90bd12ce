"""Derivatives of the temperatures, through the stages of each thermal step.

A stage solves, for the enthalpies H of the vertices (`castfem.physics.thermal.problem`),

    M (H - H_base) + tau F(H, t, p) = 0,     F = L theta(H, p) + w q(T(H, p), t, p) - M s.

Its derivative by a parameter p is one linear equation with the matrix of Newton's method,

    J dH/dp = M dH_base/dp - d(tau F)/dp at held H,     J = M + tau dF/dH,

and that of the base follows from the scheme. The last term is the change of the laws alone: a
central difference at the present enthalpies between simulations of the case on both sides of p,
with their own times, including tau. Laws are linear or smooth in p, and the quotient is accurate to
about 1e-9 (docs/sensitivity.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.factorisation import factorise
from castfem.model.build.simulation import Simulation
from castfem.model.build.start import starting_enthalpy
from castfem.physics.materials.curve import CurvePoint
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stage import Stage
from castfem.physics.thermal.stepper import GAMMA, StepResult, ThermalState
from castfem.studies.sensitivity.perturbed_simulation import Variation
from castfem.studies.sensitivity.shape_change import Feedback


class StageTangent:
    """The matrix of a stage at its solution: factored once, used for each parameter.

    With y = dtheta/dH dH/dp, the derivative of the conduction integral, it is symmetric,

        A y = r,     A = diag(M / (dtheta/dH) + tau w dq/dT / k) + tau L,

    and positive if the stage has one solution. With isothermal freezing dtheta/dH = 0: there y = 0,
    and the balance of the vertex gives its enthalpy.

    Attributes:
        matrix: The matrix factored last.
        solver: Solver with its factor.
    """

    def __init__(self, problem: ThermalProblem) -> None:
        self._problem = problem
        self.matrix = problem.new_matrix()
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._diagonal = self.matrix.createVecLeft()
        self._sides: tuple[PETSc.Mat, PETSc.Mat] | None = None
        alone = problem.section.comm.size == 1
        self.solver = PETSc.KSP().create(problem.section.comm)
        self.solver.setOperators(self.matrix)
        self.solver.setType("preonly")
        pc = self.solver.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("petsc" if alone else "mumps")
        if alone:
            pc.setFactorOrdering("nd")
        self._slope: Array = np.zeros(0)
        self._tau = 0.0
        self._held: npt.NDArray[np.intp] = np.zeros(0, np.intp)
        self._any_held = self._given = False

    def factor(self, point: CurvePoint, slope: Array, tau: float) -> None:
        """Factor the matrix at a solution (collective).

        Args:
            point: Values for the enthalpies of the solution.
            slope: Derivative of the heat leaving each vertex through the surface by T (owned,),
                W/(m K).
            tau: Coefficient of the stage, s.
        """
        problem, matrix = self._problem, self.matrix
        self._slope, self._tau = point.conduction_slope, tau
        held = problem.stage_matrix(point, slope, tau, matrix, self._diagonal)
        self._held, self._any_held = held.places, held.anywhere
        self._given = reductions.any_of(problem.section.comm, bool(len(problem.fixed)))
        self.solver.setOperators(matrix)
        if why := factorise(self.solver, matrix):
            raise RunFailure(
                f"the linear system for the derivative of a stage cannot be solved: {why}"
            )

    def solve(self, right: Array, fixed: Array) -> Array:
        """dH/dp (parameters, owned), by one back substitution each, all at once (collective).

        Args:
            right: Right-hand sides (parameters, owned), J/m.
            fixed: dH/dp of the vertices with prescribed temperature (parameters, n), J/m3.
        """
        if not (self._any_held or self._given):
            return np.asarray(self._conduction(right) / self._slope)
        problem, held, open_ = self._problem, self._held, right.copy()
        known = np.zeros_like(right)  # y where it is known
        known[:, problem.fixed] = self._slope[problem.fixed] * fixed
        if self._given:
            open_ -= self._tau * self._conducted(known)
        open_[:, held] = known[:, held]
        conduction = self._conduction(open_)
        found = conduction / np.where(self._slope > 0.0, self._slope, 1.0)
        left = right - self._tau * self._conducted(conduction)
        found[:, held] = left[:, held] / problem.volume[held]
        found[:, problem.fixed] = fixed
        return np.asarray(found)

    def _conducted(self, conduction: Array) -> Array:
        """Heat leaving each vertex by conduction (parameters, owned), W/m."""
        return np.array([self._problem.conducted(one) for one in conduction])

    def _conduction(self, right: Array) -> Array:
        """Solutions y (parameters, owned) for right-hand sides (collective)."""
        if self._sides is None:
            sizes = self.matrix.getSizes()[0], (None, len(right))
            pair = [PETSc.Mat().createDense(sizes, comm=self.matrix.comm) for _ in range(2)]
            for one in pair:
                one.setUp()
                one.assemble()
            self._sides = pair[0], pair[1]
        given, found = self._sides
        given.getDenseArray()[:] = right.T
        given.assemble()
        self.solver.matSolve(given, found)
        return np.array(found.getDenseArray().T)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self.solver, self.matrix, self._diagonal, *(self._sides or ())):
            thing.destroy()


class ThermalDerivatives:
    """Derivatives of the committed thermal state by each parameter.

    Attributes:
        enthalpy: dH/dp of each parameter (parameters, owned), J/m3 per unit of it.
        rate: d(dH/dt)/dp of each parameter (parameters, owned), W/m3 per unit of it.
        removed: Derivatives of the heat removed from the modelled part (parameters,), J/m.
        solves: Number of back substitutions.
        feedback: Effects of the mechanics on the thermal steps of a window; None without any.
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
        self.feedback: Feedback | None = None
        self._marked: tuple[Array, Array, Array] = (self.enthalpy, self.rate, self.removed)

    def warming(self, state: ThermalState) -> list[Array]:
        """dT/dp of the vertices at the present state, by each parameter (owned,), K."""
        found = [np.asarray(state.point.temperature_slope * one) for one in self.enthalpy]
        for number, variation in enumerate(self.variations):
            if variation.curves is not None:
                change = variation.curves.temperature(state.enthalpy) / variation.span
                found[number] = found[number] + change
        return found

    def mark(self, state: ThermalState) -> None:
        """Keep the derivatives of a committed state, from which a failed window starts again."""
        self._begun, self._marked = state, (self.enthalpy, self.rate, self.removed)

    def restore(self, enthalpy: Array, rate: Array, removed: Array) -> None:
        """Continue from saved derivatives."""
        self.enthalpy, self.rate, self.removed = enthalpy, rate, removed

    def step(self, old: ThermalState, result: StepResult) -> None:
        """Differentiate an accepted step (collective)."""
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
        self.enthalpy = found
        comm, problem, feedback = self._simulation.section.comm, self._problem, self.feedback
        # Stages close their balance to rounding, so that the loss of the strand is the heat
        # removed.
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
        """dH/dp at the end of a stage from that of its base (parameters, owned)."""
        problem, point, surface = self._problem, stage.point, self._problem.surface_heat
        slope = np.zeros_like(problem.area)
        slope[surface.vertices] = surface.at(point.temperature, stage.time)[1]
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
        """d(tau F)/dp at the enthalpies of a stage (owned,), J/m per unit; None if it is 0.

        If laws and times are those of the run, only the surface temperature changes the heat: by
        `slope` (owned,), W/(m K), times its change.
        """
        problem, point = self._problem, stage.point
        alike = v.above.same_cooling and v.below.same_cooling and self.feedback is None
        if alike and not step.lengthened[number]:
            return None
        share, place = stage.tau / step.span, (stage.time - step.begin) / step.span
        sides = tuple(zip((v.above, v.below), step.own[number], (1.0, -1.0), strict=True))
        weights = [sign * share * span / v.span for _, (_, span), sign in sides]
        mean, longer = 0.5 * (weights[0] - weights[1]), sum(weights)
        # the same heat flow for a longer time
        conduction = longer * point.conduction if longer else None
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
    """A step of the run, and the corresponding steps on both sides of each parameter."""

    begin: float  #: s
    span: float  #: length, s
    #: start and length for each parameter above and below it, s
    own: list[tuple[tuple[float, float], ...]]
    lengthened: Array  #: d span / dp (parameters,), s per unit
    moving: list[int]  #: parameters with a nonzero derivative

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
    """dH/dp of the enthalpies at the start of a run (owned,)."""
    above, below = (
        np.asarray(starting_enthalpy(end.simulation)) for end in (variation.above, variation.below)
    )
    owned = variation.above.simulation.section.owned
    return np.array(np.broadcast_to((above - below) / variation.span, (owned,)))
