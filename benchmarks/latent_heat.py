"""Three ways to write the latent heat: enthalpy, effective specific heat, and source.

A strip cools like the mid-face of the billet, by backward Euler with steps from short to long.  The
residuals of the three forms are those of `forms/heat.py`, with the vertex rule; each is solved as
its textbook has it:

* enthalpy (23): castfem's own solver;
* effective specific heat (26)-(28): the capacity is that of the new temperature, found by
  fixed-point iteration;
* source (29): the latent heat released over the step is taken from the iterate before,
  under-relaxed so that the iteration is stable; it stops when no temperature changes by more than
  a tolerance, or after a number of iterations.

The heat that left through the surface is compared with the decrease of the enthalpy (24): what is
missing or too much was lost by the form.  The front is compared with that of very short steps.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from benchmarks.report import Output, table
from castfem import meshes
from castfem.base.types import Array
from castfem.fem.compat import assemble_matrix, assemble_owned
from castfem.fem.section import Section
from castfem.forms import heat
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.thermal.boundary import Cooling, Surface
from castfem.physics.thermal.flux_laws import Convection
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stepper import ThermalStepper

if TYPE_CHECKING:
    from matplotlib.figure import Figure


RHO, C, K, LATENT = 7400.0, 700.0, 30.0, 270e3
LIQUIDUS, START, AMBIENT, H = 1775.65, 1815.65, 433.15, 1600.0  # K, K, K, W/m2K
LENGTH, CELL, END = 0.04, 0.5e-3, 10.0
RANGES = (50.0, 5.0)  # K
STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
FINE = 0.002  # s, step of the reference front
ITERATIONS, CONVERGED = 100, 1e-3  # most iterations of a step; K


@dataclass(frozen=True, slots=True)
class Alloy:
    """Constants of the billet's steel with a freezing range of its own."""

    solidus: float

    def fraction(self, t: Array) -> Array:
        """Solid fraction, linear (12)."""
        return np.asarray(np.clip((LIQUIDUS - t) / (LIQUIDUS - self.solidus), 0.0, 1.0))

    def enthalpy(self, t: Array) -> Array:
        """H (24), J/m3."""
        return np.asarray(RHO * C * t + RHO * LATENT * (1.0 - self.fraction(t)))

    def capacity(self, t: Array) -> Array:
        """Rho c_eff (28), J/m3K."""
        mush = (t > self.solidus) & (t < LIQUIDUS)
        return RHO * C + np.where(mush, RHO * LATENT / (LIQUIDUS - self.solidus), 0.0)


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run.

    Attributes:
        lost: Heat that vanished: the share of the decrease of enthalpy that never left.
        front: Depth of the solidus, m. surface: Temperature there, K.
        solves: Linear systems a step. not_converged: Share of the steps that did not converge.
    """

    lost: float
    front: float
    surface: float
    solves: float
    not_converged: float


class Strip:
    """The strip, the forms on it, and runs by each of them."""

    def __init__(self, alloy: Alloy) -> None:
        self.alloy = alloy
        mesh = meshes.build(
            shape="strip",
            length=LENGTH,
            width=CELL,
            surface_size=CELL,
            core_size=CELL,
            cell="quadrilateral",
            order=1,
        )
        self.section = section = Section(MPI.COMM_SELF, mesh)
        space = section.vertex_space
        self.u = {
            name: fem.Function(space)
            for name in ("temperature", "old", "capacity", "latent", "theta", "flux")
        }
        u, v = self.u, ufl.TestFunction(space)
        self.step = fem.Constant(section.mesh, 1.0)
        dx = heat.slice_measure(section.mesh)
        ds = heat.surface_measure(section.mesh, section.facet_tags)(section.groups.index("surface"))
        common: tuple[Any, ...] = (u["theta"], u["flux"], self.step, v, dx, ds)
        self.effective = fem.form(
            heat.residual_effective_heat(u["temperature"], u["old"], u["capacity"], *common)
        )
        self.source = fem.form(
            heat.residual_source(u["temperature"], u["old"], u["capacity"], u["latent"], *common)
        )
        laplacian = assemble_matrix(fem.form(heat.conduction(ufl.TrialFunction(space), v, dx)))
        self.conduction = csr_matrix(laplacian.getValuesCSR()[::-1], shape=laplacian.getSize())
        laplacian.destroy()
        one = fem.Constant(section.mesh, 1.0)
        self.area = assemble_owned(fem.form(heat.storage(one, v, dx)), section.owned)
        self.edge = assemble_owned(fem.form(heat.surface_heat(one, v, ds)), section.owned)
        self.depth = space.tabulate_dof_coordinates()[: section.owned, 0]

    def residual(self, form: fem.Form, t: Array) -> Array:
        """The form's residual at temperatures `t`; the other coefficients are set already."""
        self.u["temperature"].x.array[:] = t
        self.u["theta"].x.array[:] = K * t
        self.u["flux"].x.array[:] = H * (t - AMBIENT)
        return assemble_owned(form, self.section.owned)

    def matrix(self, capacity: Array, dt: float) -> csc_matrix:
        """Derivative of the residual with the capacity held."""
        return csc_matrix(
            diags(self.area * capacity) + dt * (K * self.conduction + H * diags(self.edge))
        )

    def run(self, advance: Callable[[Array, float], tuple[Array, int, bool]], dt: float) -> Outcome:
        """Advance to END; `advance` gives new temperatures, solves, and whether they converged."""
        t, heat_out, solves, not_converged = np.full(len(self.area), START), 0.0, 0, 0
        steps = round(END / dt)
        self.step.value = dt
        for _ in range(steps):
            t, n, converged = advance(t, dt)
            heat_out += dt * float(self.edge @ (H * (t - AMBIENT)))
            solves += n
            not_converged += not converged
        h0 = float(self.alloy.enthalpy(np.array([START]))[0])
        decrease = float(self.area @ (h0 - self.alloy.enthalpy(t)))
        return Outcome(
            1.0 - heat_out / decrease, *self.read(t), solves / steps, not_converged / steps
        )

    def read(self, t: Array) -> tuple[float, float]:
        """Depth of the solidus, m, and the surface temperature, K."""
        x, first = np.unique(np.round(self.depth, 12), return_index=True)
        line = t[first]
        return float(np.interp(self.alloy.solidus, line, x)), float(line[0])

    def by_effective_heat(self, old: Array, dt: float) -> tuple[Array, int, bool]:
        """One step of (26): fixed-point iteration on the capacity of the new temperature."""
        t = old.copy()
        self.u["old"].x.array[:] = old
        for n in range(1, ITERATIONS + 1):
            capacity = self.alloy.capacity(t)
            self.u["capacity"].x.array[:] = capacity
            change = splu(self.matrix(capacity, dt)).solve(self.residual(self.effective, t))
            t = t - change
            if np.abs(change).max() < CONVERGED:
                return t, n, True
        return t, ITERATIONS, False

    def by_source(self, iterations: int) -> Callable[[Array, float], tuple[Array, int, bool]]:
        """A step of (29) with at most so many iterations."""
        relaxation = 1.0 / (1.0 + LATENT / (C * (LIQUIDUS - self.alloy.solidus)))

        def advance(old: Array, dt: float) -> tuple[Array, int, bool]:
            lu = splu(self.matrix(np.full_like(old, RHO * C), dt))
            t, before = old.copy(), self.alloy.fraction(old)
            fraction = before
            self.u["old"].x.array[:] = old
            self.u["capacity"].x.array[:] = RHO * C
            for n in range(1, iterations + 1):
                fraction = fraction + relaxation * (self.alloy.fraction(t) - fraction)
                self.u["latent"].x.array[:] = RHO * LATENT * (fraction - before)
                change = lu.solve(self.residual(self.source, t))
                t = t - change
                if n > 1 and np.abs(change).max() < CONVERGED:
                    return t, n, True
            return t, iterations, False

        return advance

    def by_enthalpy(self, dt: float, scheme: str = "backward_euler") -> Outcome:
        """The run by castfem's own solver."""
        knots = np.array([300.0, self.alloy.solidus, LIQUIDUS, 2000.0])
        release = np.array([0.0, RHO * LATENT / (LIQUIDUS - self.alloy.solidus), 0.0])
        c, k = np.full(3, RHO * C), np.full(3, K)
        curve = ThermalCurve((knots, c, c, release, np.zeros(4)), (knots, k, k), START)
        problem = ThermalProblem(self.section, curve)
        patch = Surface(self.section).patch([self.section.groups.index("surface")])
        problem.set_cooling(Cooling([(patch, Convection(H, AMBIENT))], []))
        stepper = ThermalStepper(problem, scheme)
        state, steps = stepper.initial(START), round(END / dt)
        for i in range(1, steps + 1):
            result = stepper.step(state, END * i / steps)
            if not result.converged:
                raise RuntimeError(result.reason)
            state = result.state
        decrease = -float(problem.area @ state.enthalpy)  # zero at the start
        found = Outcome(
            1.0 - state.removed / decrease,
            *self.read(state.point.temperature),
            problem.iterations / steps,
            0.0,
        )
        problem.destroy()
        return found


def compare(
    ranges: tuple[float, ...] = RANGES, steps: tuple[float, ...] = STEPS, fine: float = FINE
) -> list[dict[str, Any]]:
    """Every form at every step and range: rows of the table."""
    rows: list[dict[str, Any]] = []
    for freezing in ranges:
        strip = Strip(Alloy(LIQUIDUS - freezing))
        exact = strip.by_enthalpy(fine, "sdirk2")
        ways: dict[str, Callable[[float], Outcome]] = {
            "enthalpy": strip.by_enthalpy,
            "effective specific heat": lambda dt, s=strip: s.run(s.by_effective_heat, dt),
            "source, 10 iterations": lambda dt, s=strip: s.run(s.by_source(10), dt),
            "source, to 0.001 K": lambda dt, s=strip: s.run(s.by_source(ITERATIONS), dt),
        }
        for name, run in ways.items():
            for dt in steps:
                found = run(dt)
                rows.append(
                    {
                        "form": name,
                        "freezing_range_K": freezing,
                        "step_s": dt,
                        "heat_lost_percent": 100 * found.lost,
                        "front_error_mm": 1e3 * (found.front - exact.front),
                        "surface_error_K": found.surface - exact.surface,
                        "solves_per_step": found.solves,
                        "not_converged_percent": 100 * found.not_converged,
                    }
                )
    return rows


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Lost heat and error of the front against the step, for each freezing range."""
    from castfem.post.plots.style import look, new_figure

    colours = ("#0072b2", "#d55e00", "#cc79a7", "#009e73")
    names = list(dict.fromkeys(r["form"] for r in rows))
    ranges = list(dict.fromkeys(r["freezing_range_K"] for r in rows))
    panels = (
        ("heat_lost_percent", "heat lost [%]", 1e-3),
        ("front_error_mm", "error of the front [mm]", 1e-3),
    )
    with look():
        figure = new_figure(8.4, 5.6)
        axes = figure.subplots(2, len(ranges), squeeze=False, sharex=True, sharey="row")
        for column, freezing in enumerate(ranges):
            for line, (key, label, least) in enumerate(panels):
                axis = axes[line, column]
                for name, colour in zip(names, colours, strict=True):
                    own = [
                        r for r in rows if (r["form"], r["freezing_range_K"]) == (name, freezing)
                    ]
                    axis.plot(
                        [r["step_s"] for r in own],
                        [max(abs(r[key]), least) for r in own],
                        "o-",
                        markersize=3.5,
                        color=colour,
                        label=name,
                    )
                axis.set(xscale="log", yscale="log")
                if column == 0:
                    axis.set_ylabel(label)
            axes[0, column].set_title(f"freezing range {freezing:g} K")
            axes[1, column].set_xlabel("step [s]")
        axes[0, 0].legend(loc="center left", bbox_to_anchor=(0.0, 0.42))
    return figure


def main(output: Output, quick: bool = False) -> None:
    """Run the comparison; table, CSV and figure."""
    rows = compare(steps=(0.1, 1.0), fine=0.01) if quick else compare()
    output.csv("latent_heat", rows)
    output.figure("latent_heat", draw(rows))
    print(f"latent heat: {len(rows)} runs")
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("latent_heat")
    shown = [r for r in rows if r["step_s"] in (0.01, 0.1, 1.0)]
    headings = {
        "freezing_range_K": "freezing range [K]",
        "form": "form",
        "step_s": "step [s]",
        "heat_lost_percent": "heat lost [%]",
        "front_error_mm": "front [mm]",
        "surface_error_K": "surface [K]",
        "solves_per_step": "linear systems a step",
        "not_converged_percent": "steps that did not converge [%]",
    }
    formats = {
        "heat_lost_percent": ".2g",
        "front_error_mm": "+.3f",
        "surface_error_K": "+.2f",
        "solves_per_step": ".1f",
        "not_converged_percent": ".0f",
    }
    output.insert("latent heat", table(shown, headings, formats))
