"""The creeping strip as a plane continuum that its rolls move along, beside the strip of beams.

A pitch of the shell, or several, length by thickness, in DOLFINx (triangles of second order),
which repeat themselves at their ends; the strip is bent along the strand alone and stretched freely
in both directions.  From step to step the rolls that bear its surface go on by a cell, against the
casting direction, and the law of castfem is integrated at the quadrature points: neither plane
sections nor a moment are taken for granted.  Writes a table of docs/slab_bulging.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from scipy import sparse
from scipy.sparse.linalg import splu

from benchmarks.report import Output, table
from castfem.base.types import Array
from castfem.fem import compat
from castfem.physics.constitutive import ThermoElastic, load_elasticity, load_law
from castfem.physics.constitutive.base import Law, MaterialStep, Response
from castfem.physics.machine.bulging import Bulge, CreepingStrip, Rolls, Shell, Span, over_rolls

DEGREE = 2  # three points a triangle: creep does not lock
ITERATIONS, TOLERANCE = 40, 1e-7
LEAST_MOVE = 1e-3
SPEED = 0.02
LOADING = 1e-6  # s: the pressure comes on


@dataclass(frozen=True, slots=True)
class Profile:
    """Deflection from the roll on, of the steady state.

    Attributes:
        z: From the roll, m, (n,).
        surface: Outwards, m.
        middle: Of the middle of the shell, from where it is over the roll: without the dent.
    """

    z: Array
    surface: Array
    middle: Array


class MovingStrip:
    """What repeats itself of the shell, and its equilibrium.

    Args:
        law: Of the steel.
        shell: The shell.
        span: All of it.
        cells: Along and through the thickness.
        rolls: By how many cells they are beyond the first.
    """

    def __init__(
        self, law: Law, shell: Shell, span: Span, cells: tuple[int, int],
        rolls: tuple[int, ...] = (0,),
    ) -> None:  # fmt: skip
        self.law, self.span, self.steps, self.rolls = law, span, cells[0], rolls
        corners = [[0.0, 0.0], [span.length, shell.thickness]]
        kind = dmesh.CellType.triangle
        mesh = dmesh.create_rectangle(MPI.COMM_SELF, corners, cells, kind)
        space = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
        strain, weight, depth = _points(mesh, space)
        self.weight = np.repeat(weight, 4)
        self._constrain(space, shell, strain)
        heat = np.asarray(shell.temperature(depth)) + np.zeros_like(depth)
        self.heat, self.coefficients = heat, law.coefficients(heat, heat)
        self.load = self.free.T @ _pressure(mesh, space, shell.thickness, span.pressure)
        self.stress = np.zeros((len(depth), 4))
        self.state = law.initial_state(len(depth))
        self.moved = np.zeros(self.strain.shape[1])
        self.last = np.zeros_like(self.moved)
        self.out = Response.empty(len(depth), len(law.state_names))

    def _constrain(self, space: Any, shell: Shell, strain: Any) -> None:
        """Unknowns: of the nodes but those at the far end, the stretch along, and that across."""
        x = space.tabulate_dof_coordinates()
        length, count = self.span.length, len(x)
        far = np.isclose(x[:, 0], length)
        kept = np.flatnonzero(~far)
        near = kept[np.isclose(x[kept, 0], 0.0)]
        near, gone = (k[np.argsort(x[k, 1])] for k in (near, np.flatnonzero(far)))
        source = np.arange(count)
        source[gone] = near
        number = np.full(count, -1)
        number[kept] = np.arange(len(kept))
        rows = np.arange(2 * count)
        columns = 2 * number[source[rows // 2]] + rows % 2
        nodes = sparse.csr_matrix((np.ones(2 * count), (rows, columns)), (2 * count, 2 * len(kept)))
        along = np.zeros(2 * count)
        along[2 * gone] = length
        across = np.tile([0.0, 0.0, 1.0, 0.0], strain.shape[0] // 4)
        stretched = sparse.csr_matrix(along[:, None])
        none = sparse.csr_matrix((2 * count, 1))
        self.free = sparse.hstack([nodes, stretched, none]).tocsr()
        last = sparse.csr_matrix(
            (across, (np.arange(len(across)), np.full(len(across), self.free.shape[1] - 1))),
            (len(across), self.free.shape[1]),
        )
        self.strain = (strain @ self.free + last).tocsr()
        places = x[kept]
        top, middle = (
            np.flatnonzero(np.isclose(places[:, 1], y)) for y in (0.0, 0.5 * shell.thickness)
        )
        self.top, self.middle = (k[np.argsort(places[k, 0])] for k in (top, middle))
        self.along = np.sort(places[self.top, 0])
        # The node a cell's length on, from which the next increment is guessed.
        pitch, size = 2 * self.steps, length / (2 * self.steps)
        column = np.rint(places[:, 0] / size).astype(int)
        row = np.rint(places[:, 1] / places[:, 1].max() * 1e4).astype(int)
        there = {key: k for k, key in enumerate(zip(column, row, strict=True))}
        self.next = np.array([there[(c + 2) % pitch, r] for c, r in zip(column, row, strict=True)])

    def step(self, roll: int, dt: float) -> None:
        """A step of some time, at whose end the first roll is at the end of a cell."""
        held = 2 * self.top[[2 * ((roll + more) % self.steps) for more in self.rolls]] + 1
        fixed = [2 * self.top[0], *held]
        move = self._guess()
        move[held] = -self.moved[held]
        least = np.delete(np.arange(len(move)), fixed)
        none = np.zeros_like(self.heat)
        taken, share, before = np.zeros_like(move), 1.0, np.inf
        for _ in range(ITERATIONS):
            increment = (self.strain @ move).reshape(-1, 4)
            step = MaterialStep(increment, none, self.heat, self.heat, dt)
            out = self.law.integrate(
                step, self.stress, self.state, coefficients=self.coefficients, out=self.out
            )
            rest = self.load - self.strain.T @ (self.weight * out.stress.ravel())
            missing = float(np.abs(rest[least]).max())
            if missing <= TOLERANCE * float(np.abs(self.load).max()):
                break
            if missing < before or share < LEAST_MOVE:
                tangent = sparse.bsr_matrix(
                    (out.tangent * self.weight.reshape(-1, 4)[:, :1, None],
                     np.arange(len(increment)), np.arange(len(increment) + 1))
                )  # fmt: skip
                matrix = (self.strain.T @ (tangent @ self.strain)).tocsc()[least][:, least]
                taken[:] = 0.0
                taken[least] = splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(rest[least])
                before, share = missing, 1.0
                move = move + taken
            else:
                share *= 0.5
                move = move - share * taken
        else:
            raise RuntimeError(f"no equilibrium: {missing:.1e} N/m are left")
        self.stress, self.state = out.stress.copy(), out.state.copy()
        self.moved, self.last = self.moved + move, move

    def _guess(self) -> Array:
        """The last increment, a cell's length on."""
        guess = self.last.copy()
        nodes = guess[:-2].reshape(-1, 2)
        nodes[:] = nodes[self.next]
        nodes[:, 0] -= nodes[self.top[0], 0]
        return guess

    def profile(self, roll: int) -> Profile:
        """Deflections from the roll on."""
        at = 2 * roll
        surface, middle = (np.roll(-self.moved[2 * k + 1], -at) for k in (self.top, self.middle))
        return Profile(self.along, surface, middle - middle[0])

    def steady(self, change: float = 3e-3, most: int = 30) -> Profile:
        """Pass after pass until it repeats itself."""
        before: Profile | None = None
        self.step(0, LOADING)
        self.last[:] = 0.0
        for _ in range(most):
            for k in range(self.steps):
                roll = (-k - 1) % self.steps
                self.step(roll, self.span.length / self.steps / self.span.speed)
            found = self.profile(roll)
            top = float(np.abs(found.middle).max())
            if before is not None:
                off = float(np.abs(found.middle - before.middle).max())
                if off < change * top:
                    return found
            before = found
        raise RuntimeError(f"no pitch that repeats itself within {most}")


def _points(mesh: Any, space: Any) -> tuple[Any, Array, Array]:
    """Strain at the quadrature points by displacements (4 n, dofs), their weights and depths."""
    rule = {"quadrature_rule": "default", "quadrature_degree": DEGREE}
    dx = ufl.Measure("dx", domain=mesh, metadata=rule)
    element = basix.ufl.quadrature_element(mesh.basix_cell(), (4,), "default", DEGREE)
    points = fem.functionspace(mesh, element)
    u, q = ufl.TrialFunction(space), ufl.TestFunction(points)
    g = ufl.grad(u)
    root = np.sqrt(0.5)
    strain = ufl.as_vector([g[0, 0], g[1, 1], 0.0 * g[0, 0], root * (g[0, 1] + g[1, 0])])
    form = compat.compile_form(ufl.inner(strain, q) * dx)
    assembled = fem_petsc.assemble_matrix(form)
    assembled.assemble()
    start, columns, values = assembled.getValuesCSR()
    matrix = sparse.csr_matrix((values, columns, start), assembled.getSize())
    assembled.destroy()
    place = ufl.SpatialCoordinate(mesh)

    def read(value: Any) -> Array:
        form = compat.compile_form(value * q[0] * dx)
        return np.array(fem.assemble_vector(form).array)[::4]

    weight = read(1.0)
    by_strain = sparse.diags(np.repeat(1.0 / weight, 4)) @ matrix
    return by_strain.tocsr(), weight, read(place[1]) / weight


def _pressure(mesh: Any, space: Any, depth: float, pressure: float) -> Array:
    """Forces of the pressure on the inside, outwards."""
    facets = np.sort(dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[1], depth)))
    tags = dmesh.meshtags(mesh, 1, facets, np.ones(len(facets), np.int32))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(1)
    form = compat.compile_form(-pressure * ufl.TestFunction(space)[1] * ds)
    return np.array(fem.assemble_vector(form).array)


ELASTIC = load_elasticity()
HOT = ThermoElastic(ELASTIC)
AUSTENITE = load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1, delta_share=np.zeros_like)
FRONT = 1490.0
LOST = (0, 1, 2, 3, 5, 6, 7)  # of eight rolls


def shell_of(thickness: float, surface: float) -> Shell:
    """A shell whose temperature is linear from its surface, degC, to 1490 degC."""
    rise = (FRONT - surface) / thickness
    return Shell(thickness, lambda depth: surface + 273.15 + rise * depth)


def by_shear(shell: Shell, span: Span) -> float:
    """What elastic shear adds to the largest deflection, p L^2 / (8 k int G dn), k = 5/6, m."""
    points = shell.points()
    modulus = ELASTIC.moduli(points.temperature)[0]
    return float(span.pressure * span.length**2 / (8.0 * 5.0 / 6.0 * (points.weight @ modulus)))


def single(law: Law, shell: Shell, span: Span, cells: tuple[int, ...]) -> list[Profile]:
    """A pitch that repeats itself, with numbers of cells along it."""
    return [MovingStrip(law, shell, span, (n, 3 + n // 32)).steady() for n in cells]


def lost(law: Law, shell: Shell, span: Span, cells: tuple[int, ...]) -> list[Profile]:
    """Eight pitches of which two are one, since a roll is lost, with cells a pitch."""
    whole = Span(8 * span.length, span.pressure, span.speed)
    return [
        MovingStrip(law, shell, whole, (8 * n, 3), tuple(n * k for k in LOST)).steady()
        for n in cells
    ]


def _row(
    what: str, thickness: float, surface: float, pitch: float, pressure: float,
    found: list[Profile], strip: Bulge, sheared: float | None,
) -> dict[str, Any]:  # fmt: skip
    """A row of the table, mm."""
    tops, lows = ([1e3 * float(pick(one.middle)) for one in found] for pick in (np.max, np.min))
    top, _, low = strip.extremes()
    return {
        "what": what, "shell": 1e3 * thickness, "surface": surface, "pitch": 1e3 * pitch,
        "pressure": pressure / 1e6, "strip": 1e3 * top,
        "sheared": None if sheared is None else 1e3 * (top + sheared),
        "coarse": tops[-2], "fine": tops[-1], "limit": 2.0 * tops[-1] - tops[-2],
        "strip_least": 1e3 * low, "least": 2.0 * lows[-1] - lows[-2],
        "dent": 1e3 * float(found[-1].surface.max()) - tops[-1],
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Elastic, creeping, and with a lost roll."""
    cells = (8, 16) if quick else (32, 64)
    rows = []
    for what, law, *given in (
        ("elastic", HOT, 0.03, 1000.0, 0.25, 0.2e6),
        ("elastic", HOT, 0.085, 940.0, 0.32, 0.75e6),
        ("austenite", AUSTENITE, 0.03, 1100.0, 0.31, 0.2e6),
        ("austenite", AUSTENITE, 0.04, 1000.0, 0.5, 0.25e6),
    ):
        thickness, surface, pitch, pressure = given
        shell, span = shell_of(thickness, surface), Span(pitch, pressure, SPEED)
        found = single(law, shell, span, cells)
        strip = CreepingStrip(law, steps=128, layers=48).bulge(span, shell)
        rows.append(
            _row(what, *given, found, strip, by_shear(shell, span))  # type: ignore[arg-type]
        )
    if not quick:
        given = (0.04, 1000.0, 0.25, 0.25e6)
        shell, span = shell_of(*given[:2]), Span(given[2], given[3], SPEED)
        places = span.length * np.delete(np.arange(10), 4)
        rolls = Rolls(tuple(places), (0.0,) * len(places), span.pressure, SPEED)
        strip = over_rolls(CreepingStrip(AUSTENITE, steps=128, layers=48), rolls, shell)
        found = lost(AUSTENITE, shell, span, (8, 16))
        rows.append(_row("austenite, one roll lost", *given, found, strip, None))
    output.csv("moving_strip", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "what": "strip", "shell": "shell, mm", "surface": "surface, °C", "pitch": "pitch, mm",
        "pressure": "pressure, MPa", "strip": "strip, mm", "sheared": "and elastic shear",
        "fine": "continuum, finest", "limit": "extrapolated",
        "strip_least": "least, strip", "least": "least, continuum",
    }  # fmt: skip
    forms = dict.fromkeys(("strip", "sheared", "fine", "limit", "strip_least", "least"), ".3f")
    output.insert("moving strip", table(output.rows("moving_strip"), head, forms))
