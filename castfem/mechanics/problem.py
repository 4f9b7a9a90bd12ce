"""Equilibrium of the slice at the end of a step, solved by SNES.

Unknowns are the displacement and the free generalized strains (`castfem.mechanics.planes`).  The
latter are scaled to lengths, so that all unknowns have one unit, all residuals another, and nothing
in the solution depends on the units chosen.
"""

from __future__ import annotations

from typing import Literal

from petsc4py import PETSc

import numpy as np
from dolfinx import fem, la

from castfem.constitutive.base import Response, turned
from castfem.contact.wall_contact import WallContact
from castfem.fem import dof_values, reductions
from castfem.fem.bordered_system import BorderedSystem
from castfem.fem.dolfinx_compat import assemble_into, create_matrix
from castfem.fem.part_matrix import matrix_of_nodes
from castfem.fem.section import Section
from castfem.fem.snes import Options, SnesSolver, SolveResult
from castfem.mechanics.convergence import Criteria
from castfem.mechanics.definition import Slice
from castfem.mechanics.fields import Fields
from castfem.mechanics.interactions import Interactions
from castfem.mechanics.kinematics import LargeStrain, SmallStrain
from castfem.mechanics.line_search import step_share
from castfem.mechanics.liquid import FedLiquid
from castfem.mechanics.material_points import FedPoints, Material
from castfem.mechanics.options import split_options
from castfem.mechanics.plane_equations import PlaneEquations
from castfem.mechanics.planes import check_strains
from castfem.mechanics.quadrature import ActivePoints, Integration, Points, displacement_element
from castfem.mechanics.residual_state import ResidualState
from castfem.mechanics.scaling import Scales
from castfem.mechanics.state import MechanicalState
from castfem.mechanics.supports import SPRING, Constraints, symmetry_supports
from castfem.mechanics.surface_loads import SurfaceLoads
from castfem.support.stopwatch import Stopwatch
from castfem.values.types import Array

AXIAL = np.array([0.0, 0.0, 1.0, 0.0])  # Mandel
NEAR = 1e4  # times the tolerance: how near the solution contacts become free to open
STAND_IN = 30.0  # modulus of fed liquid in cells that carry stress, over its pressure
LEAST_YOUNG = 1e-6  # the same over that of the solid at the solidus, where nothing presses
NEARLY = 1e-2  # of the square of the imbalance: what leaves less of it has not overshot, whatever
# its work: along a correction that is no longer than rounding that may have any sign
PATIENCE = 8  # Newton iterations in which contact may overshoot


class MechanicalProblem:
    """Equilibrium of a section, one step at a time.

    Args:
        section: The distributed section.
        slice_: Material, supports and loads.
        options: PETSc options that win over the defaults.
        tolerance: Out-of-balance stress left, relative to the stress there is.
        watch: Charged with the time spent here.
        springs: What takes away the motions that nothing holds: springs of this stiffness over
            Young's modulus, points held rigidly (None), or what its interactions ask for: springs
            where one of them holds the section, points where none does.

    Attributes:
        space: Space of the displacement. points: Quadrature points. scales: Sizes.
        interactions: What acts on the surface.
        owned: This rank's own displacement unknowns. free: Free generalized strains.
        liquid: Where the liquid is fed; None where it is an elastic body.
        planes: Equilibrium along the free generalized strains.
        iterations: Newton iterations since the start.

    Raises:
        InputError: If a motion of the planes is excluded by symmetry, a group does not exist, or
            PETSc refuses an option.
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
        self.section, self.slice = section, slice_
        self.watch = watch if watch is not None else Stopwatch()
        check_strains(slice_.planes.free, section.groups)
        self.free = len(slice_.planes.free)
        self.space = fem.functionspace(section.mesh, displacement_element(section.cell))
        self.owned = dof_values.owned_of(self.space)
        rules = slice_.integration or Integration.of(section.cell, section.order)
        self.points = Points(section, self.space, rules)
        self.scales = Scales(self.points, self.space)
        if springs == "as held":
            springs = SPRING if any(one.holds for one in slice_.interactions) else None
        self._build_forms(springs)
        self._criteria = Criteria(section.comm, self.scales, self.constraints, tolerance)
        self._target = np.zeros_like(self.fields.u.x.array)
        self._work = fem.Function(self.space)
        self._material = Material(slice_.law, self.active)
        self._build_solver(options or {})
        self.iterations: int = 0
        self._slack, self._layer = 1.0, -1
        self._rest_forces = np.zeros_like(self._target)
        self._rest_stress: Array = np.zeros(2)
        self.residual_state: ResidualState | None = None
        self._integrated: Array | None = None

    def _build_forms(self, springs: float | None) -> None:
        section, slice_ = self.section, self.slice
        pressed = slice_.ferrostatic is not None
        self.fields = Fields.on(section, self.space, self.points, pressed)
        held_outside = slice_.ferrostatic is not None and slice_.ferrostatic.outside == "held"
        self._loads = SurfaceLoads.on(section, list(slice_.loads), held_outside)
        self.interactions = Interactions(section, slice_.interactions, slice_, self.fields)
        kind = LargeStrain if slice_.large_strain else SmallStrain
        self.kinematics = kind(
            section, self.points, self.fields, self._loads, self.free > 0, self.interactions,
            slice_.law.symmetric,
        )  # fmt: skip
        held = [*symmetry_supports(section.groups), *slice_.held]
        self.constraints = Constraints(
            section, self.space, held, slice_.pin, springs, self.interactions.always_held()
        )
        self.planes = PlaneEquations(
            slice_.planes, self.fields, self.kinematics, self.interactions, self.scales
        )
        self.liquid: FedLiquid | None = None
        if slice_.liquid == "fed":
            supports = self.constraints.conditions
            self.liquid = FedLiquid(section, self.space, self.points, supports)

    def _build_solver(self, options: Options) -> None:
        """SNES on displacement and scalars."""
        symmetric = self.kinematics.symmetric
        nonlinear, linear = split_options(options, symmetric)
        self._whole = self._matrix = create_matrix(self.kinematics.forms.stiffness)
        if symmetric:
            self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        prefix = "mechanical_"
        shorten = None if "snes_linesearch_type" in options else self.shorten
        self.bordered = BorderedSystem(self._matrix, self.free, prefix, linear)
        vector, operator = self.bordered.vector(), self.bordered.operator
        self.solver = SnesSolver(
            self, vector, operator, prefix, nonlinear, self.watch, shorten, options
        )
        self.bordered.use_with(self.solver.snes.getKSP())
        vector.destroy()

    @property
    def active(self) -> ActivePoints:
        """Points of the cells that have stress in the step that was begun."""
        return self.kinematics.active

    @property
    def response(self) -> Response:
        """Of the law, at the active points."""
        return self._material.response

    @property
    def contact(self) -> WallContact | None:
        """Contact with the wall of a mould; None without one."""
        return self.interactions.wall

    def at_points(self, temperature: Array) -> Array:
        """Temperatures at the points from those of the owned vertices."""
        local = dof_values.with_ghosts(self.section.vertex_space, temperature)
        return np.asarray(self.points.vertex @ local)

    def begin(self, old: MechanicalState, time: float, temperature: Array) -> None:
        """Prepare a step from the committed state `old` to `time` and new temperatures."""
        fields, slice_ = self.fields, self.slice
        before, after = self.at_points(old.temperature), self.at_points(temperature)
        self.old, self.dt = old, time - old.time
        fed = None if self.liquid is None else self._feed(self.liquid, after, time)
        self.kinematics.volume.begin()
        with self.watch.section("law"):
            rows, strain = self.active.rows, slice_.thermal_strain
            thermal = np.asarray(strain(after[rows])) - np.asarray(strain(before[rows]))
            stiff = self.points.stiffness_temperature
            self._material.begin(stiff(before)[rows], stiff(after)[rows], thermal, self.dt, fed)
            self._stress_old, self._internal_old = old.stress[rows], old.internal[rows]
        fields.u_old.x.array[:] = old.displacement
        fields.generalized_strains_old.value[:] = old.generalized_strains
        self.planes.begin(old, time)
        self.pressure: Array = np.zeros(0)
        if slice_.ferrostatic is not None and fields.pressure is not None:
            self.pressure = slice_.ferrostatic.pressure(after[self.points.deviator_points :], time)
            fields.take_pressure(self.points, self.pressure)
            if (liquid := self._loads.liquid) is not None:
                pressure = slice_.ferrostatic.pressure(temperature, time)
                liquid.x.array[: self.section.owned] = pressure
                liquid.x.scatter_forward()
        self.interactions.begin(old, time, temperature)
        added = self.interactions.axial_strain(self.points.position)
        self._added = None if added is None else added[rows]
        self._loads.set(time)
        self.constraints.set(time, self._target)
        if self.liquid is not None:
            self._prescribe(self.liquid, old.displacement)
        if (springs := self.constraints.springs) is not None:
            young = slice_.law.elasticity.moduli(after)[2]
            springs.begin(old.displacement, reductions.largest(self.section.comm, young))
        self._take_rest()
        self.residual_state, self._integrated, self._first = None, None, 0.0

    def _act_on(self, liquid: FedLiquid) -> None:
        """Let the cells down to the innermost that has some shell make up the equations.

        All others are deep liquid: none of their nodes moves in the step, and their pressure is
        known.  Whole layers are taken, so that the equations seldom change.
        """
        cells, space = liquid.cells_to(liquid.layer), self.space
        if self._layer < 0:  # all that may ever be there gets its place
            assemble_into(self._whole, self.kinematics.forms.stiffness, [])
        self.kinematics.act_on(cells)
        self._material = Material(self.slice.law, self.active)
        before = self._matrix
        self._matrix, nodes = matrix_of_nodes(self._whole, space, liquid.nodes_of(cells))
        if self.kinematics.symmetric:
            self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.bordered.restrict(self._matrix, nodes)
        if before is not self._whole:
            before.destroy()
        self._layer = liquid.layer

    def _take_rest(self) -> None:
        """What the pressure of the cells that have no stress does, the same throughout a step."""
        if self.kinematics.rest is None:
            return
        forces, work = self.kinematics.rest
        self._rest_forces[:] = 0.0
        with self.watch.section("assembly"):
            fem.assemble_vector(self._rest_forces, forces)
            self.planes.take_rest(work)
        self._rest_stress = self.scales.beside(self.active, self.pressure)

    def solve(self, guesses: list[tuple[Array, Array]]) -> SolveResult:
        """Solve from the best of some guesses; what holds there is in `residual_state`.

        Args:
            guesses: Displacement (owned,), m, and free scalars (the same on every rank) of each.
        """
        starts = [self._start(*guess) for guess in guesses]
        if len(starts) > 1:
            sizes = [self._imbalance(start) for start in starts]
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
        """Come near the solution with all contacts of the old state kept closed.

        While the material is far from where it will be, contacts that are free to open and close
        chatter.  Returns the iterations this took; if it leads nowhere, the start stays.
        """
        if not self.interactions.hold(True):
            return 0
        self.residual_state, self._slack = None, NEAR
        result = self.solver.solve()
        self.interactions.hold(False)
        self.residual_state, self._slack = None, 1.0
        if not result.converged:
            self.solver.x.setArray(start)
        return result.iterations

    def _feed(self, liquid: FedLiquid, temperature: Array, time: float) -> FedPoints:
        """Where there is liquid, and what stands in for its stiffness."""
        elasticity, pressing = self.slice.law.elasticity, self.slice.ferrostatic
        solid = elasticity.solidity.weight(temperature) > 0.0
        liquid.begin(solid)
        if self.kinematics.constant and liquid.layer != self._layer:
            self._act_on(liquid)
        rows = self.active.rows
        head = 0.0 if pressing is None else pressing.head(time)
        young = float(elasticity.young(np.array([elasticity.solidity.solidus]))[0])
        self.planes.hold(0.0 if liquid.bears else young)
        least = max(STAND_IN * head, LEAST_YOUNG * young)
        return FedPoints(liquid.carries[rows], ~solid[rows], least)

    def _prescribe(self, liquid: FedLiquid, old: Array) -> None:
        """Leave the deep liquid where it was: it follows when the shell is in equilibrium."""
        self.constraints.hold_too(liquid.deep, liquid.held)
        self._target[liquid.deep] = old[liquid.deep]

    def _start(self, guess: Array, scalars: Array) -> Array:
        """Local unknowns of a guess."""
        if self.liquid is not None:
            guess = guess.copy()
            guess[self.liquid.deep] = self._target[self.liquid.deep]
        return self.bordered.join(guess, scalars / self.planes.scaled.scaling)

    def _imbalance(self, local: Array) -> float:
        """Size of the residual at local unknowns."""
        residual = self._residual(local)
        return reductions.total(self.section.comm, float(residual @ residual))

    def _known(self, local: Array) -> bool:
        """Whether `residual_state` belongs to these unknowns (collective)."""
        known = self.residual_state
        return self._same(local, None if known is None else known.local)

    def _same(self, local: Array, known: Array | None) -> bool:
        """Whether local unknowns are those that are known, on all ranks (collective).

        A rank whose own stay may have the planes, or its neighbours' nodes, move.
        """
        same = known is not None and np.array_equal(local, known)
        return not reductions.any_of(self.section.comm, not same)

    def free_scalars(self, local: Array) -> Array:
        """Free scalars, on every rank, of the local unknowns."""
        return np.asarray(self.bordered.share(local) * self.planes.scaled.scaling)

    def _evaluate(self, local: Array) -> ResidualState:
        """Stress and forces at a set of unknowns."""
        fields, response = self.fields, self.response
        fields.u.x.array[: self.owned] = local[: self.owned]
        fields.u.x.scatter_forward()
        scalars = self.bordered.share(local)
        generalized_strains = self.planes.scaled.generalized_strains(scalars)
        fields.generalized_strains.value[:] = generalized_strains
        # Contacts that are let go of change nothing of what the law has said.
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
            forces = self._assemble(self.kinematics.forms.work, self._rest_forces).copy()
            balance = self.planes.balance(scalars)
        scale = self.scales.stress(
            self.active, parts, response, local[: self.owned], self._first, noise,
            self._rest_stress,
        )  # fmt: skip
        self._first = self._first or scale.typical
        return ResidualState(local.copy(), generalized_strains, forces, balance, scale)

    def _integrate(self) -> None:
        """Integrate the law at the displacement and the generalized strains the fields hold."""
        with self.watch.section("kinematics"):
            strain, angle = self.kinematics.increments()
            if self._added is not None:
                strain = strain + np.outer(self._added, AXIAL)
        with self.watch.section("law"):
            stress_old, internal = self._stress_old, self._internal_old
            if angle is not None:
                stress_old = turned(stress_old, angle)
                internal = self.slice.law.turned(internal, angle)
            self._material.integrate(strain, stress_old, internal)

    def _assemble(self, form: fem.Form, beside: Array | float = 0.0) -> Array:
        """Assembled linear form and what stands beside it at the local unknowns, ghosts included.

        Returns:
            Entries of this rank's own unknowns (valid until the next).
        """
        vector = self._work.x
        vector.array[:] = beside
        fem.assemble_vector(vector.array, form)
        vector.scatter_reverse(la.InsertMode.add)
        return vector.array[: self.owned]

    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Forces that are not in equilibrium, N/m."""
        local = x.getArray(readonly=True)
        out.setArray(self._residual(local))

    def _residual(self, local: Array) -> Array:
        """The same for local unknowns; what the line search left behind is not computed again."""
        if not self._known(local):
            self.residual_state = self._evaluate(local)
        assert self.residual_state is not None
        nodal, dofs = self.residual_state.forces.copy(), self.constraints.fixed
        if self.constraints.moving:
            self._lift(nodal, local[dofs] - self._target[dofs])
        dofs = self.constraints.prescribed
        nodal[dofs] = local[dofs] - self._target[dofs]
        if (springs := self.constraints.springs) is not None:
            nodal[springs.dofs] += springs.force(local)
        return self.bordered.join(nodal, self.residual_state.balance)

    def shorten(self, x: PETSc.Vec, correction: PETSc.Vec) -> bool:
        """Scale Newton's correction where a full one would overshoot by far."""
        local, step = x.getArray(readonly=True), correction.getArray(readonly=True)
        dofs = self.constraints.fixed
        missing = np.abs(local[dofs] - self._target[dofs]).max(initial=0.0)
        comm = self.section.comm
        if self.constraints.moving and reductions.largest(comm, np.array([missing])) > 0.0:
            return False  # supports must get to where they belong first

        first, before = self._along(local, step)
        base = self.interactions.evaluated()

        def work(share: float) -> float:
            found, left = self._along(local - share * step, step)
            if share == 1.0 and left < NEARLY * before:
                return 0.0
            if share < 1.0 or self.solver.snes.getIterationNumber() >= PATIENCE:
                return found
            # Points that come into contact make a kink, no overshoot: full steps find them.
            return found + self.interactions.kink(base)

        share = step_share(first, work)
        if share < 1.0:
            correction.scale(share)
        return share < 1.0

    def _along(self, local: Array, step: Array) -> tuple[float, float]:
        """Work of what is out of balance along a step, and the square of its size (collective)."""
        residual = self._residual(local)
        sums = [float(residual @ step), float(residual @ residual)]
        work, square = reductions.totals(self.section.comm, sums)
        return float(work), float(square)

    def _lift(self, nodal: Array, missing: Array) -> None:
        """Add the forces by which supports, on their way to where they belong, move the rest."""
        if reductions.largest(self.section.comm, np.abs(missing)) == 0.0:
            return
        form, vector = self.kinematics.forms.stiffness, self._work.x
        with self.watch.section("assembly"):
            self._take_tangent()
            vector.array[:] = 0.0
            vector.array[self.constraints.fixed] = -missing
            vector.scatter_forward()
            vector.array[:] = self.kinematics.volume.forces(vector.array)
            for condition in self.constraints.conditions:
                fem.apply_lifting(
                    vector.array, [form], [[condition]], x0=[self.fields.u.x.array], alpha=-1.0
                )
            vector.scatter_reverse(la.InsertMode.add)
        nodal += vector.array[: self.owned]

    def _take_tangent(self) -> None:
        """Hand the tangent of the law to the forms, the bulk modulus to what stands beside them."""
        self.kinematics.volume.take(self.fields.take_tangent(self.active, self.response))

    def jacobian(self, x: PETSc.Vec, out: PETSc.Mat) -> None:
        """Derivative of the residual at the unknowns integrated last."""
        compiled = self.kinematics.forms
        with self.watch.section("assembly"):
            self._take_tangent()
            assemble_into(self._matrix, compiled.stiffness, self.constraints.every)
            self.kinematics.volume.add_to(self._matrix, self.constraints.free)
            if self.constraints.springs is not None:
                self.constraints.springs.add_to(self._matrix)
            self.planes.fill(self.bordered, self._assemble, self.constraints.prescribed)

    def norms(self, x: PETSc.Vec, f: PETSc.Vec) -> dict[str, float]:
        """What is out of balance, over what may be, for each kind of unknown: see `Criteria`."""
        assert self.residual_state is not None
        residual = f.getArray(readonly=True)
        sizes = self._criteria.sizes(self.residual_state, residual, self.planes.scaled.load)
        return {name: size / self._slack for name, size in sizes.items()}

    def destroy(self) -> None:
        """Free the PETSc objects; safe to call twice."""
        self.solver.destroy()
        self.bordered.close()
        self.kinematics.volume.destroy()
        if self.liquid is not None:
            self.liquid.destroy()
        self._matrix.destroy()
        self._whole.destroy()
