"""Equilibrium of the slice at the end of a step, solved by SNES.

Unknowns are the displacement and the free generalized strains
(`castfem.physics.mechanics.generalized_plane_strain`). The latter are scaled to lengths, so that
all unknowns have one unit, all residuals another, and the solution does not depend on the choice of
units.
"""

from __future__ import annotations

from typing import Literal

from petsc4py import PETSc

import numpy as np
from dolfinx import fem, la

from castfem.base.stopwatch import Stopwatch
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.bordered_system import BorderedSystem
from castfem.fem.section import Section
from castfem.fem.snes import Options, SnesSolver, SolveResult, try_options
from castfem.physics.constitutive.base import Response
from castfem.physics.mechanics.equilibrium_parts import SliceParts
from castfem.physics.mechanics.fields import AXIAL
from castfem.physics.mechanics.liquid import FedLiquid
from castfem.physics.mechanics.material_points import FedPoints, Material
from castfem.physics.mechanics.newton import (
    LIMITS,
    Criteria,
    LineSearch,
    ResidualState,
    split_options,
)
from castfem.physics.mechanics.quadrature import ActivePoints
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.state import MechanicalState
from castfem.physics.mechanics.tangent import ActivePart, Tangent


class MechanicalProblem(SliceParts):
    """Equilibrium of a section, one step at a time.

    Args:
        section: The distributed section.
        slice_: Material, supports and loads.
        options: PETSc options, which take precedence over the defaults.
        tolerance: Allowed residual stress, relative to the stress in the section.
        watch: Stopwatch for the time spent here.
        springs: See `SliceParts`.

    Attributes:
        fed: Points of fed liquid in the current step; None for an elastic body.
        iterations: Total Newton iterations.
        farthest: Largest Newton correction, relative to the section's extent; a larger one ends the
            solve.

    Raises:
        InputError: A motion of the planes is excluded by symmetry, a group does not exist, or PETSc
            refuses an option.
    """

    def __init__(
        self,
        section: Section,
        slice_: Slice,
        options: Options | None = None,
        tolerance: float = 1e-8,
        watch: Stopwatch | None = None,
        springs: float | Literal["as held"] | None = "as held",
    ) -> None:
        super().__init__(section, slice_, springs)
        self.watch = watch if watch is not None else Stopwatch()
        self._criteria = Criteria(section.comm, self.scales, self.constraints, tolerance)
        self._target = np.zeros_like(self.fields.u.x.array)
        self._work = fem.Function(self.space)
        self._take_law()
        self._build_solver(options or {})
        self.iterations, self._slack = 0, 1.0
        self.farthest = np.inf
        self.residual_state: ResidualState | None = None
        self._integrated: Array | None = None
        self.fed: FedPoints | None = None

    def _build_solver(self, options: Options) -> None:
        """Set up SNES on displacement and scalars."""
        symmetric = self.kinematics.symmetric
        nonlinear, linear = split_options(options, symmetric, self.section.comm.size)
        if options:
            try_options("mechanical_", {**nonlinear, **linear})
        self._part = ActivePart(self.kinematics, self.space, self.scales)
        self._tangent = Tangent(self.kinematics, self.fields, self.constraints, self._work)
        prefix = "mechanical_"
        shorten = None if "snes_linesearch_type" in options else self.shorten
        self._search = LineSearch(self.section.comm, self.interactions, self._residual)
        self._left = np.inf  # relative residual stress at SNES's last check
        self.bordered = BorderedSystem(self._part.matrix, self.free, prefix, linear, symmetric)
        vector, operator = self.bordered.vector(), self.bordered.operator
        self.solver = SnesSolver(
            self, vector, operator, prefix, nonlinear, self.watch, shorten, options
        )
        self.bordered.use_with(self.solver.snes.getKSP())
        vector.destroy()

    @property
    def active(self) -> ActivePoints:
        """Points of the cells that have stress in the current step."""
        return self.kinematics.active

    @property
    def response(self) -> Response:
        """Response of the law at the active points."""
        return self._material.response

    def _take_law(self) -> None:
        active = self.active
        self._material = Material(self.slice.law, active.count, active.deviator_points)

    def begin(self, old: MechanicalState, time: float, temperature: Array) -> None:
        """Prepare a step from the committed state `old` to `time` and new temperatures."""
        fields, slice_ = self.fields, self.slice
        before, after = self.at_points(old.temperature), self.at_points(temperature)
        self.old, self.dt = old, time - old.time
        self.fed = None if self.liquid is None else self._feed(self.liquid, after, time)
        self.kinematics.volume.begin()
        with self.watch.section("law"):
            rows, strain = self.active.rows, slice_.thermal_strain
            thermal = np.asarray(strain(after[rows])) - np.asarray(strain(before[rows]))
            stiff = self.points.stiffness_temperature
            begun = old.stress[rows], old.internal[rows]
            self._material.begin(
                stiff(before)[rows], stiff(after)[rows], thermal, self.dt, begun, self.fed
            )
        fields.u_old.x.array[:] = old.displacement
        fields.generalized_strains_old.value[:] = old.generalized_strains
        self.planes.begin(old, time)
        self.pressure: Array = np.zeros(0)
        if slice_.ferrostatic is not None and fields.pressure is not None:
            self.pressure = slice_.ferrostatic.pressure(after[self.points.deviator_points :], time)
            fields.take_pressure(self.points, self.pressure)
            if (liquid := self.loads.liquid) is not None:
                pressure = slice_.ferrostatic.pressure(temperature, time)
                liquid.x.array[: self.section.owned] = pressure
                liquid.x.scatter_forward()
        self.interactions.begin(old, time, temperature)
        added = self.interactions.axial_strain(self.points.position)
        self._added = None if added is None else added[rows]
        self.loads.set(time)
        self.constraints.set(time, self._target)
        if self.liquid is not None:
            deep = self.liquid.deep  # fixed for now: follows the shell once that is found
            self.constraints.hold_too(deep, self.liquid.held)
            self._target[deep] = old.displacement[deep]
        if (springs := self.constraints.springs) is not None:
            young = slice_.law.elasticity.moduli(after)[2]
            springs.begin(old.displacement, reductions.largest(self.section.comm, young))
        with self.watch.section("assembly"):
            self.rest = self._part.rest(self.planes, self.pressure)
        self.planes.rest = self.rest.work
        self.residual_state, self._integrated, self._first = None, None, 0.0

    def solve(self, guesses: list[tuple[Array, Array]]) -> SolveResult:
        """Solve from the best of some guesses; the result is in `residual_state`.

        Args:
            guesses: Displacement (owned,), m, and free scalars (equal on every rank) of each.
        """
        starts = [self._start(*guess) for guess in guesses]
        if len(starts) > 1:
            residuals = [self._residual(start) for start in starts]
            squares = [float(residual @ residual) for residual in residuals]
            sizes = [reductions.total(self.section.comm, square) for square in squares]
            starts = [starts[int(np.argmin(np.nan_to_num(sizes, nan=np.inf)))]]
        self.solver.x.setArray(starts[0])
        first = self._approach(starts[0])
        self.bordered.failure = ""
        result = self.solver.solve()
        if not result.converged and self.bordered.failure:
            result.reason += f" ({self.bordered.failure})"
        result.iterations += first
        self.iterations += result.iterations
        solution = self.solver.x.getArray(readonly=True)
        if result.converged and not self._known(solution):
            self.residual_state = self._evaluate(solution)
        if result.converged and self.liquid is not None:
            with self.watch.section("liquid"):
                self.liquid.follow(self.fields.u)
        return result

    def _approach(self, start: Array) -> int:
        """Approach the solution with all contacts of the old state kept closed.

        While the material is far from its solution, contacts that are free to open and close
        chatter. Returns the number of iterations; if this fails, the start is unchanged.
        """
        if not self.interactions.hold(True):
            return 0
        self.residual_state, self._slack = None, max(LIMITS.near / self._criteria.tolerance, 1.0)
        result = self.solver.solve()
        self.interactions.hold(False)
        self.residual_state, self._slack = None, 1.0
        if not result.converged:
            self.solver.x.setArray(start)
        return result.iterations

    def _feed(self, liquid: FedLiquid, temperature: Array, time: float) -> FedPoints:
        """Points of fed liquid, with the stiffness used there."""
        solid = self.slice.law.elasticity.solidity.weight(temperature) > 0.0
        liquid.begin(solid)
        if self._part.follow(liquid, self.bordered):
            self._take_law()
        young, rows = self.slice.young_at_solidus(), self.active.rows
        self.planes.hold(0.0 if liquid.bears else young)
        return FedPoints.of(liquid.carries[rows], ~solid[rows], young, self.slice.head(time))

    def _start(self, guess: Array, scalars: Array) -> Array:
        """Local unknowns from a guess."""
        if self.liquid is not None:
            guess = guess.copy()
            guess[self.liquid.deep] = self._target[self.liquid.deep]
        return self.bordered.join(guess, scalars / self.planes.scaled.scaling)

    def _known(self, local: Array) -> bool:
        """Whether `residual_state` belongs to these unknowns (collective)."""
        known = self.residual_state
        return self._same(local, None if known is None else known.local)

    def _same(self, local: Array, known: Array | None) -> bool:
        """Whether local unknowns equal the known ones, on all ranks (collective).

        Even if a rank's own are unchanged, the planes or its neighbours' nodes may have moved.
        """
        same = known is not None and np.array_equal(local, known)
        return not reductions.any_of(self.section.comm, not same)

    def free_scalars(self, local: Array) -> Array:
        """Free scalars from the local unknowns, on every rank."""
        return np.asarray(self.bordered.share(local) * self.planes.scaled.scaling)

    def _evaluate(self, local: Array) -> ResidualState:
        """Evaluate stress and forces for a set of unknowns."""
        fields, response = self.fields, self.response
        fields.u.x.array[: self.owned] = local[: self.owned]
        fields.u.x.scatter_forward()
        scalars = self.bordered.share(local)
        generalized_strains = self.planes.scaled.generalized_strains(scalars)
        fields.generalized_strains.value[:] = generalized_strains
        # Contacts that are released do not change the response of the law.
        if not self._same(local, self._integrated):
            self._integrated = None
            self._integrate()
            self._integrated = local.copy()
        noise = 0.0
        if self.interactions:
            with self.watch.section("contact"):
                noise = self.interactions.evaluate()
        pressure = self.pressure[self.active.mean] if self.pressure.size else self.pressure
        parts = *fields.take_stress(self.active, response), pressure
        with self.watch.section("assembly"):
            forces = self._assemble(self.kinematics.forms.work, self.rest.forces).copy()
            balance = self.planes.balance(scalars)
        scale = self.scales.stress(
            self.active, parts, response, local[: self.owned], self._first, noise, self.rest.sums
        )
        self._first = self._first or scale.typical
        return ResidualState(local.copy(), generalized_strains, forces, balance, scale)

    def _integrate(self) -> None:
        """Integrate the law for the present displacement and generalized strains."""
        with self.watch.section("kinematics"):
            strain, angle = self.kinematics.increments()
            if self._added is not None:
                strain = strain + np.outer(self._added, AXIAL)
        with self.watch.section("law"):
            self._material.integrate(strain, angle)

    def _assemble(self, form: fem.Form, beside: Array | float = 0.0) -> Array:
        """Assemble a linear form and its additional terms at the local unknowns, including ghosts.

        Returns:
            Entries of this rank's own unknowns (valid until the next call).
        """
        vector = self._work.x
        vector.array[:] = beside
        fem.assemble_vector(vector.array, form)
        vector.scatter_reverse(la.InsertMode.add)
        return vector.array[: self.owned]

    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Residual forces, N/m."""
        local = x.getArray(readonly=True)
        out.setArray(self._residual(local))

    def _residual(self, local: Array) -> Array:
        """The same for local unknowns; reuses what the line search has evaluated."""
        if not self._known(local):
            self.residual_state = self._evaluate(local)
        assert self.residual_state is not None
        nodal, dofs = self.residual_state.forces.copy(), self.constraints.fixed
        missing = self._target[dofs] - local[dofs]
        if self.constraints.moving and self._anywhere(missing):
            with self.watch.section("assembly"):
                nodal += self._tangent.lifted(self.response, missing)
        dofs = self.constraints.prescribed
        nodal[dofs] = local[dofs] - self._target[dofs]
        if (springs := self.constraints.springs) is not None:
            nodal[springs.dofs] += springs.force(local)
        return self.bordered.join(nodal, self.residual_state.balance)

    def shorten(self, x: PETSc.Vec, correction: PETSc.Vec) -> bool | None:
        """Scale Newton's correction if a full one would overshoot far.

        Returns:
            Whether it was scaled; None if it would move the strand beyond `farthest`: the
            tangent does not hold that far, and a solution found from there would not be a shell.
        """
        local, step = x.getArray(readonly=True), correction.getArray(readonly=True)
        dofs = self.constraints.fixed
        if self.constraints.moving and self._anywhere(local[dofs] - self._target[dofs]):
            return False  # first the supports must reach their prescribed positions

        if self.farthest < np.inf:
            far = reductions.largest(self.section.comm, np.abs(step)) / self.scales.length
            if not far <= self.farthest:
                return None
        iteration = self.solver.snes.getIterationNumber()
        share = self._search.share(local, step, iteration, self._left)
        if share < 1.0:
            correction.scale(share)
        return share < 1.0

    def _anywhere(self, missing: Array) -> bool:
        """Whether a support has not reached its position yet, on any rank (collective)."""
        return reductions.largest(self.section.comm, np.abs(missing)) > 0.0

    def jacobian(self, x: PETSc.Vec, out: PETSc.Mat) -> None:
        """Derivative of the residual at the last integrated unknowns."""
        with self.watch.section("assembly"):
            self.linearise()

    def linearise(self) -> None:
        """Compute the consistent tangent at the last solution (collective)."""
        self._tangent.fill(self.response, self._part.matrix)
        self.planes.fill(self.bordered, self._assemble, self.constraints.prescribed)

    def lifted(self, missing: Array) -> Array:
        """Forces of moving supports on the rest at the last solution, N/m (collective).

        Args:
            missing: Motion of the supports, m, at `Constraints.fixed`.
        """
        return self._tangent.lifted(self.response, missing).copy()

    def solve_linearised(self, rights: Array) -> Array | None:
        """Solve with the tangent for right-hand sides (n, local); None if that fails."""
        return self.bordered.solve(rights)

    def norms(self, x: PETSc.Vec, f: PETSc.Vec) -> dict[str, float]:
        """Residuals of each kind of unknown, relative to their tolerance: see `Criteria`."""
        assert self.residual_state is not None
        residual = f.getArray(readonly=True)
        sizes = self._criteria.sizes(self.residual_state, residual, self.planes.scaled.load)
        self._left = max(sizes.values()) * self._criteria.tolerance
        return {name: size / self._slack for name, size in sizes.items()}

    def destroy(self) -> None:
        """Free the PETSc objects; safe to call twice."""
        self.solver.destroy()
        self.bordered.destroy()
        self.kinematics.volume.destroy()
        if self.liquid is not None:
            self.liquid.destroy()
        self._part.destroy()
