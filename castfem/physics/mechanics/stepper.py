"""Time stepping of the mechanics from one committed state to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.physics.contact.interaction import NOTHING_ADDED, BearsRolls
from castfem.physics.mechanics.generalized_plane_strain import StepTaken, loads_at
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.state import Balance, MechanicalResult, MechanicalState
from castfem.physics.mechanics.validity import NO_SHELL, Validity


class MechanicalStepper:
    """Advances a `MechanicalState` by one step, fully implicitly; has no state of its own.

    Args:
        problem: Equilibrium of the section.
        extrapolate: Start Newton's method from an extrapolation by the last step's rates.
        judge: Refuse states outside the model's range, see `mechanics.validity`; otherwise the
            equations are solved as written, as for closed forms.
    """

    def __init__(
        self, problem: MechanicalProblem, extrapolate: bool = True, judge: bool = True
    ) -> None:
        self.problem, self.extrapolate = problem, extrapolate
        self.comm = problem.section.comm
        self._validity: Validity | None = None
        problem.farthest = np.inf
        if judge:
            law, large = problem.slice.law, problem.slice.large_strain
            # At small strain a slice flowing without hardening converges from farther away.
            problem.farthest = 1.0 if large else np.inf
            self._validity = Validity(
                problem.points, problem.fields, law, large, problem.interactions
            )

    def initial(self, time: float, temperature: Array) -> MechanicalState:
        """Undeformed, stress-free state at temperatures of the owned vertices (owned,), K."""
        problem = self.problem
        points, law = problem.points.count, problem.slice.law
        scalars = np.zeros(problem.free)
        generalized_strains = problem.slice.planes.at(time)[0]
        return MechanicalState(
            time=time,
            displacement=np.zeros_like(problem.fields.u.x.array),
            generalized_strains=generalized_strains,
            scalars=scalars,
            rate=np.zeros(problem.owned),
            scalar_rate=scalars.copy(),
            unsteadiness=np.inf,
            temperature=np.array(temperature),
            stress=np.zeros((points, 4)),
            internal=law.initial_state(points),
            pressure=np.zeros(0),
            interactions=problem.interactions.initial(),
            bending=problem.slice.planes.initial_bending(time),
        )

    def step(self, old: MechanicalState, time: float, temperature: Array) -> MechanicalResult:
        """Advance `old` to `time` (s) and to `temperature` (owned,), K; `old` is unchanged."""
        problem = self.problem
        problem.begin(old, time, temperature)
        if reason := problem.interactions.refusal():
            return replace(self._failed(old, 0, reason, time, temperature), refused=True)
        result = problem.solve(self._guesses(old))
        newton = result.iterations
        if not result.converged:
            return self._failed(old, newton, result.describe(), time, temperature)
        state = self._state(old, time, temperature)
        if self._validity is not None:
            refusal = self._validity.refusal(state, problem.at_points(temperature))
            if refusal:
                failed = self._failed(old, newton, refusal, time, temperature)
                return replace(failed, refused=True)
        active, response = problem.active, problem.response
        volume, flows = active.volume, response.flows
        n = active.deviator_points
        share = reductions.total(self.comm, float(volume[:n] @ flows[:n])) / problem.scales.area
        dissipation = np.zeros(problem.points.deviator_points)
        dissipation[active.deviator] = response.dissipation[:n]
        return MechanicalResult(
            True, state, newton, result.reason, self._balance(), dissipation, share
        )

    def _failed(
        self, old: MechanicalState, newton: int, reason: str, time: float, temperature: Array
    ) -> MechanicalResult:
        """Result of a rejected step; the reason names a missing shell for the loads."""
        unborne = ""
        if self._validity is not None:
            loads = loads_at(self.problem.slice.planes, old.bending, time)
            unborne = self._validity.unborne(loads, self.problem.at_points(temperature))
        message = f"{unborne} ({reason.removesuffix(f'; {NO_SHELL}')})" if unborne else reason
        nothing = np.zeros(self.problem.points.deviator_points)
        return MechanicalResult(
            False, old, newton, message, None, nothing, 0.0, unborne=bool(unborne)
        )

    def going_on(self, state: MechanicalState, time: float) -> MechanicalState:
        """`state` extrapolated to `time` (s) by its last rates; not in equilibrium (collective)."""
        problem, dt = self.problem, time - state.time
        offset, directions, _ = problem.slice.planes.at(time)
        scalars = state.scalars + dt * state.scalar_rate
        moved = dt * dof_values.with_ghosts(problem.space, state.rate)
        return replace(
            state,
            time=time,
            displacement=state.displacement + moved,
            scalars=scalars,
            generalized_strains=np.asarray(offset + directions @ scalars),
        )

    def _guesses(self, old: MechanicalState) -> list[tuple[Array, Array]]:
        """Starts of Newton's method: extrapolated, and the old state unless rates are steady."""
        still = (old.displacement[: self.problem.owned], old.scalars)
        if not self.extrapolate or np.isinf(old.unsteadiness):
            return [still]
        dt = self.problem.dt
        moved = (still[0] + dt * old.rate, still[1] + dt * old.scalar_rate)
        # Largest relative change of the rates for which they are trusted.
        return [moved] if old.unsteadiness < 0.3 else [still, moved]

    def _state(self, old: MechanicalState, time: float, temperature: Array) -> MechanicalState:
        """The state of the problem's solution."""
        problem, residual_state = self.problem, self.problem.residual_state
        assert residual_state is not None
        active, response, points = problem.active, problem.response, problem.points.count
        displacement = problem.fields.u.x.array.copy()
        scalars = problem.free_scalars(residual_state.local)
        owned = slice(0, problem.owned)
        rate = np.asarray((displacement[owned] - old.displacement[owned]) / problem.dt)
        interactions = problem.interactions.states()
        taken = StepTaken(
            time,
            lambda: float(problem.planes.work_on(np.eye(4)[:, 2:3])[0]),
            residual_state.generalized_strains - old.generalized_strains,
            temperature,
            next((s.added for s in interactions if isinstance(s, BearsRolls)), NOTHING_ADDED),
        )
        return MechanicalState(
            time=time,
            displacement=displacement,
            generalized_strains=residual_state.generalized_strains,
            scalars=scalars,
            rate=rate,
            scalar_rate=np.asarray((scalars - old.scalars) / problem.dt),
            unsteadiness=self._unsteadiness(old.rate, rate),
            temperature=np.array(temperature),
            stress=active.spread(response.stress, np.zeros_like(old.stress)),
            internal=active.spread(response.state, problem.slice.law.initial_state(points)),
            pressure=problem.pressure,
            interactions=interactions,
            bending=problem.slice.planes.bending_after(old.bending, taken),
        )

    def _unsteadiness(self, before: Array, now: Array) -> float:
        """Relative change of the displacement rate over a step."""
        change, size = reductions.totals(self.comm, [np.sum((now - before) ** 2), np.sum(now**2)])
        return float(np.sqrt(change / size)) if size > 0.0 else np.inf

    def _balance(self) -> Balance:
        """Forces in the state of the problem's solution."""
        problem, residual_state = self.problem, self.problem.residual_state
        assert residual_state is not None
        axial = problem.planes.work_on(np.eye(4)[:, :3])
        supports = problem.constraints.dofs
        held = residual_state.forces[supports]
        sums = [held[supports % 2 == i].sum() for i in range(2)]
        free = residual_state.forces / problem.scales.force_per_stress
        free[supports] = free[problem.constraints.prescribed] = 0.0
        worst = reductions.largest(self.comm, np.abs(free))
        scale = residual_state.scale
        left = float(np.abs(residual_state.balance).max(initial=0.0)) * problem.scales.length
        return Balance(
            axial=axial,
            axial_error=left / max(scale.total, 1e-300),
            forces_error=worst / max(scale.typical, 1e-300),
            support=reductions.totals(self.comm, sums),
        )
