"""One implicit stage of the heat balance, solved for the enthalpy at the vertices by SNES.

With the vertex rule of `forms.heat` the stage reads, for the enthalpies H (J/m3) of the vertices,

    M (H - H_base) + tau [ L theta(H) + w q(T(H)) - M s ] = 0,

with M the vertices' areas, L the Laplacian of the section, w their shares of the perimeter, and s
heat generated inside. L is assembled once, or once per coupling window in a slice that moves.
Newton's correction is solved for as y = dtheta/dH dH, with a symmetric matrix of which only the
diagonal changes between iterations,

    [ diag(M / (dtheta/dH) + tau w dq/dT / k) + tau L ] y = residual;

where freezing is isothermal dtheta/dH = 0: there y = 0, and the balance of the vertex gives dH.
On rectangles and Delaunay triangles, and where the flux grows with the temperature, the Jacobian is
an M-matrix with dominant columns for every step and every freezing range, so the stage has one
solution; where the flux falls (boiling) a long stage may have several, see `unique_root`. Newton's
method on H (not on T) has no difficulty with isothermal freezing. Other quadrilaterals, such as
those along an arc, give L some positive entries off its diagonal, up to 7 % of it, and so does the
shear of the shell, in proportion to its strain; there the maximum principle is violated by
hundredths of a kelvin (docs/thermal.md).

For a moving slice, H is per volume of the steel when it froze, and M the present volume of each
vertex' steel: that of the undeformed slice times `filled`, which follows the shape while there is
liquid to feed it, and is constant in solid (docs/coupling.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from castfem.base import log
from castfem.base.stopwatch import Stopwatch
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.compat import assemble_into
from castfem.fem.section import Section
from castfem.fem.snes import Options, SnesSolver, SolveResult
from castfem.physics.materials.curve import CurvePoint, ThermalCurve
from castfem.physics.thermal.boundary import Cooling
from castfem.physics.thermal.deformed_section import Shape
from castfem.physics.thermal.operators import (
    FACTORED,
    ITERATED,
    REDUCTION,
    Operators,
    direct_options,
    iterative_options,
)
from castfem.physics.thermal.stage import LIMITS, VERTEX, Held, Stage
from castfem.physics.thermal.surface_heat import SurfaceHeat

LINEAR_FAILURE = "DIVERGED_LINEAR_SOLVE"


@dataclass(frozen=True, slots=True)
class _State:
    """Values of `ThermalProblem` for one enthalpy."""

    enthalpy: Array
    point: CurvePoint
    flow: Array  #: heat leaving each vertex (owned,), W/m
    slope: Array  #: its surface part, derivative by T
    out: float  #: heat leaving this rank's surface, W/m
    gross: float  #: the same as a sum of absolute values


class ThermalProblem:
    """Heat balance of the section, one stage at a time.

    Args:
        section: The distributed section.
        curve: T(H) and theta(H) of the steel.
        options: PETSc options, which take precedence over the defaults.
        tolerance: Largest residual of a vertex, as a change of its temperature, K.
        watch: Stopwatch for the time spent here.
        shape: Shape of the slice; None if it does not move.
        operators: Operators of another heat balance on the section; None to make new ones.

    Attributes:
        area: Area of each owned vertex (owned,), m2.
        filled: Volume of its steel, relative to the undeformed slice (owned,).
        volume: Product of both, M (owned,), m2.
        warming: Fastest temperature rise by heat generated inside, K/s.
        cooling: Present cooling. surface_heat: Heat that leaves the surface with it.
        iterations: Total Newton iterations. stages: Number of stages solved.
    """

    def __init__(
        self,
        section: Section,
        curve: ThermalCurve,
        options: Options | None = None,
        tolerance: float = VERTEX.tight,
        watch: Stopwatch | None = None,
        shape: Shape | None = None,
        operators: Operators | None = None,
    ) -> None:
        self.section, self.curve, self.tolerance = section, curve, tolerance
        self._left_open = max(LIMITS.newton, LIMITS.per_kelvin * tolerance)
        self.watch = watch if watch is not None else Stopwatch()
        self.shape = shape
        self._operators = Operators.on(section, shape) if operators is None else operators
        self._laplacian, self.area = self._operators.laplacian, self._operators.area
        self._theta, self._work = self._operators.theta, self._operators.work
        self._scale_operators()
        self.filled, self.volume = np.ones_like(self.area), self.area
        ranks, self._asked = section.comm.size, options or {}
        iterated = iterative_options(ranks, self._asked)
        self._options = {ITERATED: iterated, FACTORED: direct_options(ranks)}
        self._solvers: dict[str, SnesSolver] = {}
        self.iterations: int = 0
        self.stages: int = 0
        self._base, self._tau, self._time = np.zeros_like(self.area), 1.0, 0.0
        self._scale = self.volume + self._stiffness
        self._source, self.warming = np.zeros_like(self.area), 0.0
        self.set_cooling(Cooling([], []))
        self._state = self._evaluate(np.zeros_like(self.area))

    def _solver(self, prefix: str) -> SnesSolver:
        """The solver with a prefix, made on first use."""
        if prefix not in self._solvers:
            iterated = prefix == ITERATED
            eased = iterated and self.tolerance > VERTEX.tight
            asked = self._asked if iterated else ()
            self._solvers[prefix] = SnesSolver(
                self, self._theta, self.new_matrix(), prefix, self._options[prefix], self.watch,
                self._correct, asked, REDUCTION if eased else None,
            )  # fmt: skip
        return self._solvers[prefix]

    def _scale_operators(self) -> None:
        """Update the reference values of the norms."""
        self._laplacian_diagonal = self._laplacian.getDiagonal().getArray().copy()
        self._stiffness = self._laplacian_diagonal * self.curve.reference_diffusivity

    def follow_shape(self) -> None:
        """Conduct on the present deformed slice; `Surface.follow_shape` updates its surface."""
        with self.watch.section("assembly"):
            assert self._operators.conduction is not None
            assemble_into(self._laplacian, self._operators.conduction, [])
        self._scale_operators()
        self.surface_heat = SurfaceHeat(self.cooling)
        self._state = self._evaluate(self._state.enthalpy)

    def fill(self, filled: Array) -> None:
        """Set the volumes of the vertices' steel, relative to the undeformed slice (owned,)."""
        self.filled, self.volume = filled, self.area * filled

    def set_cooling(self, cooling: Cooling) -> None:
        """Cool the surface by `cooling` from now on."""
        self.cooling, self.surface_heat = cooling, SurfaceHeat(cooling)
        given = cooling.prescribed[::-1]  # where two patches meet the later one holds
        dofs = [np.zeros(0, np.int64), *(patch.dofs for patch, _ in given)]
        values = [np.zeros(0), *(np.full(len(patch.dofs), law.value) for patch, law in given)]
        self._fixed, first = np.unique(np.concatenate(dofs), return_index=True)
        self._fixed_value = self.curve.enthalpy(np.concatenate(values)[first])

    @property
    def fixed(self) -> npt.NDArray[np.int64]:
        """Owned vertices with a prescribed temperature."""
        return self._fixed

    @property
    def fixed_enthalpy(self) -> Array:
        """H at these vertices (n,), J/m3."""
        return self._fixed_value

    def set_source(self, source: Array) -> None:
        """Set the heat generated inside: `source` at the owned vertices (owned,), W/m3.

        The plastic dissipation of the mechanics enters here.
        """
        self._source = self.area * source
        hottest = reductions.largest(self.section.comm, np.abs(source))
        self.warming = hottest / self.curve.reference_capacity

    def solve_stage(self, base: Array, guess: Array, tau: float, time: float) -> Stage:
        """Solve M (H - base) + tau (heat that leaves) = 0.

        The heat stored in the stage and the heat through the surface agree to rounding.

        Args:
            base: H_base (owned,), J/m3.
            guess: Start of Newton's method (owned,), J/m3.
            tau: Coefficient of the stage, s.
            time: Time of the stage since the meniscus, s.

        Returns:
            The stage; check `result.converged` first.
        """
        self._base, self._tau, self._time = base, tau, time
        self._scale = self.volume + tau * self._stiffness
        start = guess.copy()
        start[self._fixed] = self._fixed_value
        for prefix in (ITERATED, FACTORED):
            solver = self._solver(prefix)
            solver.x.setArray(start)
            result = solver.solve()
            self.iterations += result.iterations
            if result.reason != LINEAR_FAILURE:
                break
            log.logger.debug("the linear solver of %s has failed", prefix)
        self.stages += 1
        solution = solver.x.getArray(readonly=True)
        # One rank's part may be unchanged while another's is not (a NaN never is); all must agree.
        moved = not np.array_equal(solution, self._state.enthalpy)
        if reductions.any_of(self.section.comm, moved):
            self._state = self._evaluate(solution)
        return self._close(solution, result)

    def _close(self, solution: Array, result: SolveResult) -> Stage:
        """Close the heat balance of the whole section over the solved stage, to rounding.

        The residual of Newton's method is distributed over the vertices in proportion to their
        change. Near a steady state, where almost nothing changes while much heat flows through,
        this is not possible, and the residual remains.
        """
        state, base, tau = self._state, self._base, self._tau
        change = solution - base
        out = state.out
        if len(self._fixed):
            # A prescribed temperature absorbs the residual of its vertices.
            reaction = -(self.volume * change / tau + state.flow)[self._fixed]
            out += float(reaction.sum())
        free = np.abs(change)
        free[self._fixed] = 0.0
        generated = float(self._source.sum())
        open_, size = self.volume @ change + tau * (out - generated), self.volume @ free
        if self.section.comm.size > 1:
            open_, size = reductions.totals(self.section.comm, [open_, size])
        if abs(open_) < LIMITS.spread * self._left_open * size:
            change -= open_ / size * free
        rate = np.asarray(change / tau)
        return Stage(base + change, rate, state.point, out, generated, result, tau, self._time)

    def _evaluate(self, enthalpy: Array) -> _State:
        """Temperatures and heat flows at `enthalpy`."""
        point = self.curve.at(enthalpy)
        with self.watch.section("petsc"):
            self._theta.setArray(point.conduction)
            self._laplacian.mult(self._theta, self._work)
        flow = self._work.getArray() - self._source
        slope = np.zeros_like(flow)
        heat, rise = self.surface_heat.at(point.temperature, self._time)
        cooled = self.surface_heat.vertices
        flow[cooled] += heat
        slope[cooled] = rise
        out, gross = float(heat.sum()), float(np.abs(heat).sum())
        return _State(enthalpy.copy(), point, flow, slope, out, gross)

    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Heat balance of each vertex over the stage, J/m (see the module)."""
        self._state = state = self._evaluate(x.getArray(readonly=True))
        balance = self.volume * (state.enthalpy - self._base) + self._tau * state.flow
        balance[self._fixed] = 0.0
        self._balance = balance
        out.setArray(balance)

    def jacobian(self, x: PETSc.Vec, out: PETSc.Mat) -> None:
        """D residual / dy, y = dtheta/dH dH: the Laplacian and a diagonal, symmetric."""
        point, slope = self._state.point, self._state.slope
        with self.watch.section("petsc"):
            self._held = self.stage_matrix(point, slope, self._tau, out, self._theta)

    def stage_matrix(
        self, point: CurvePoint, slope: Array, tau: float, out: PETSc.Mat, diagonal: PETSc.Vec
    ) -> Held:
        """Write the symmetric matrix of a stage, D residual / dy, to one of `new_matrix`.

        Args:
            point: Values of the curve at the vertices.
            slope: Derivative of the heat leaving each vertex through the surface by T (owned,),
                W/(m K).
            tau: Coefficient of the stage, s.
            out: The matrix.
            diagonal: Work space.

        Returns:
            Vertices with known y (collective).
        """
        held = point.conduction_slope <= 0.0
        held[self._fixed] = True
        places = np.flatnonzero(held)
        divisor = point.conduction_slope
        if len(places):
            divisor = np.where(held, 1.0, divisor)
        anywhere = reductions.any_of(self.section.comm, bool(len(places)))
        self._laplacian.copy(out, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        out.scale(tau)
        diagonal.setArray((self.volume + tau * slope * point.temperature_slope) / divisor)
        out.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD_VALUES)
        if anywhere:
            first = out.getOwnershipRange()[0]
            out.zeroRowsColumns((places + first).astype(np.int32), diag=1.0)
        return Held(places, anywhere, divisor)

    def _correct(self, x: PETSc.Vec, correction: PETSc.Vec) -> bool:
        """Turn Newton's correction y = dtheta/dH dH into dH, in place (collective)."""
        found, held = correction.getArray(), self._held.places
        left: Array = np.zeros(0)
        if self._held.anywhere:
            found[held] = 0.0
            left = self._balance[held] - self._tau * self.conducted(found)[held]
        found /= self._held.divisor
        found[held] = left / self.volume[held]
        found[self._fixed] = 0.0
        return True

    def new_matrix(self) -> PETSc.Mat:
        """Return a matrix with the Laplacian's pattern; the caller destroys it."""
        matrix = self._laplacian.copy()
        matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return matrix

    def conducted(self, conduction: Array) -> Array:
        """Heat leaving each vertex by conduction (owned,), W/m, from theta (owned,), W/m."""
        with self.watch.section("petsc"):
            self._theta.setArray(conduction)
            self._laplacian.mult(self._theta, self._work)
        return self._work.getArray().copy()

    def of_curve(self, curve: ThermalCurve) -> ThermalProblem:
        """The heat balance of another steel on the same mesh, with the present cooling and filling.

        It shares the operators: use the two in turn, and destroy this one last.
        """
        other = ThermalProblem(
            self.section, curve, self._asked, self.tolerance, self.watch, self.shape,
            self._operators,
        )  # fmt: skip
        other.set_cooling(self.cooling)
        other.fill(self.filled)
        return other

    def rate(self, point: CurvePoint, time: float) -> tuple[Array, Array]:
        """Rate of the enthalpy at given temperatures with the present cooling.

        Args:
            point: Values of the curve at the vertices.
            time: Time since the meniscus, s.

        Returns:
            dH/dt (owned,), W/m3, and its rate of decay while the other vertices keep their
            temperatures (owned,), 1/s. Both are 0 where the temperature is prescribed.
        """
        flow, slope = self.conducted(point.conduction) - self._source, np.zeros_like(self.area)
        cooled = self.surface_heat.vertices
        heat, slope[cooled] = self.surface_heat.at(point.temperature, time)
        flow[cooled] += heat
        steeper = (
            self._laplacian_diagonal * point.conduction_slope + slope * point.temperature_slope
        )
        flow[self._fixed] = steeper[self._fixed] = 0.0
        return -flow / self.volume, np.maximum(steeper, 0.0) / self.volume

    def surface_flow(self, point: CurvePoint, rate: Array, time: float) -> Array:
        """Heat leaving the strand at each vertex (owned,), W/m; zero inside.

        With a prescribed temperature it is the residual of the heat balance.
        """
        flow = np.zeros_like(self.area)
        flow[self.surface_heat.vertices] = self.surface_heat.at(point.temperature, time)[0]
        if self.cooling.prescribed:
            self._theta.setArray(point.conduction)
            self._laplacian.mult(self._theta, self._work)
            whole = self._source - self.volume * rate - self._work.getArray(readonly=True)
            flow[self._fixed] = whole[self._fixed]
        return flow

    def norms(self, x: PETSc.Vec, f: PETSc.Vec) -> dict[str, float]:
        """Residuals relative to their tolerance.

        "heat" is the largest residual of a vertex, as the change of its temperature that would
        close it. "balance" is that of the whole section relative to the heat stored in the stage:
        where conduction is much faster than the step, the first alone would let the mean drift.
        """
        state, comm = self._state, self.section.comm
        residual = f.getArray(readonly=True)
        worst = reductions.largest(comm, np.abs(residual) / self._scale)
        sizes = {"heat": worst / self.curve.reference_capacity / self.tolerance}
        if sizes["heat"] <= 1.0:
            # Rounding of sums of this size cannot be removed.
            rounding = self._tau * (
                self._laplacian_diagonal @ np.abs(state.point.conduction) + state.gross
            )
            stored = float(self.volume @ np.abs(state.enthalpy - self._base))
            sums = [float(residual.sum()), stored, stored + rounding]
            if comm.size > 1:
                sums = list(reductions.totals(comm, sums))
            sizes["balance"] = abs(sums[0]) / (
                self._left_open * sums[1] + LIMITS.rounding * sums[2] + 1e-300
            )
        return sizes

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for solver in self._solvers.values():
            solver.destroy()
        for thing in (self._laplacian, self._work, self._theta):
            thing.destroy()
