"""The shell in three dimensions between its rolls, elastic, beside the strip and the slice.

An eighth of a box under the pressure of its liquid, from a roll to the middle of the pitch, which
all pitches repeat: hexahedra of second order in DOLFINx, the rolls lines on the wide face.  Beside
it the strip, and the slice of castfem on the bed that the strip makes.  Writes a table of
docs/slab_bulging.md.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from benchmarks.report import Columns, Output
from castfem import meshes
from castfem.base.types import Array
from castfem.fem import compat
from castfem.fem.section import Section
from castfem.model.build.bulging import LIMITS
from castfem.physics.constitutive import Elasticity, ThermoElastic
from castfem.physics.contact.roll_support import Bed, GivenFoundation, RollSupport
from castfem.physics.machine.bulging import ElasticStrip, Shell, Span
from castfem.physics.machine.bulging.plate import clamped_deflection
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.supports import SurfacePressure

YOUNG, POISSON = 10e9, 0.3
THICKNESS = 0.22  # of the slab
SHEAR = 5.0 / 6.0  # share of the section of a plate that bears shear
GROUPS = ("symmetry_x", "symmetry_y", "inside", "narrow_face", "wide_face")


@dataclass(frozen=True, slots=True)
class Box:
    """A slab and its pitch."""

    width: float  #: of the slab, m
    shell: float  #: its thickness, m
    pitch: float  #: m
    pressure: float = 0.2e6  #: Pa

    @property
    def bending(self) -> float:
        """D, N m."""
        return YOUNG * self.shell**3 / (12.0 * (1.0 - POISSON**2))

    @property
    def strip(self) -> float:
        """Largest bulge of the strip, m."""
        shell = Shell(self.shell, lambda depth: 1400.0)
        elastic = ElasticStrip(Elasticity.constant(YOUNG, POISSON))
        return elastic.bulge(Span(self.pitch, self.pressure, 0.02), shell).largest

    @property
    def by_shear(self) -> float:
        """What shear adds to it, p L^2/(8 k G h), m."""
        modulus = YOUNG / (2.0 * (1.0 + POISSON))
        return self.pressure * self.pitch**2 / (8.0 * SHEAR * modulus * self.shell)

    @property
    def plate(self) -> float:
        """Largest bulge of the thesis' plate (308), m."""
        return float(
            clamped_deflection(
                self.pressure, self.bending, self.pitch, self.width, 0.5 * self.pitch,
                0.5 * self.width,
            )
        )  # fmt: skip


def graded(end: float, first: float, growth: float, largest: float) -> Array:
    """Distances from 0 to `end`, whose steps grow from `first` to `largest`."""
    places, step = [0.0], first
    while places[-1] < end:
        places.append(places[-1] + step)
        step = min(step * growth, largest)
    return np.asarray(places) * (end / places[-1])


def lines(box: Box, layers: int) -> tuple[Array, Array]:
    """Places of the lines of cells across the section, from its middle: x, y, m."""
    within = box.shell * np.linspace(0.0, 1.0, layers + 1)
    found = []
    for half, largest in ((0.5 * box.width, 0.03), (0.5 * THICKNESS, 0.02)):
        free = half - box.shell
        inner = free - graded(free, 0.5 * box.shell, 1.3, largest)[::-1]
        found.append(np.concatenate([inner[:-1], free + within]))
    return found[0], found[1]


def section_of(box: Box, layers: int) -> meshes.SectionMesh:
    """The quarter of the shell's section: cells of a lattice, those of the liquid left out."""
    x, y = lines(box, layers)
    nx, ny = len(x) - 1, len(y) - 1
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    solid = (x[i] > 0.5 * box.width - 1.001 * box.shell) | (
        y[j] > 0.5 * THICKNESS - 1.001 * box.shell
    )
    i, j = i[solid], j[solid]
    corner = i * (ny + 1) + j
    quads = np.column_stack([corner, corner + ny + 1, corner + 1, corner + ny + 2])
    facets, group = [], []
    taken = set(zip(i.tolist(), j.tolist(), strict=True))
    for a, b in sorted(taken):
        at = a * (ny + 1) + b
        for other, pair, outer in (
            ((a - 1, b), (at, at + 1), 0),
            ((a, b - 1), (at, at + ny + 1), 1),
            ((a + 1, b), (at + ny + 1, at + ny + 2), 3),
            ((a, b + 1), (at + 1, at + ny + 2), 4),
        ):
            if other not in taken:
                inside = 0 <= other[0] < nx and 0 <= other[1] < ny
                facets.append(pair)
                group.append(2 if inside else outer)
    used, cells = np.unique(quads, return_inverse=True)
    number = {int(node): k for k, node in enumerate(used)}
    return meshes.SectionMesh(
        points=np.column_stack([x[used // (ny + 1)], y[used % (ny + 1)]]),
        cells=cells.reshape(quads.shape).astype(np.int64),
        cell="quadrilateral",
        order=1,
        facets=np.array([[number[a], number[b]] for a, b in facets]),
        facet_group=np.array(group, np.int32),
        groups=GROUPS,
        probes={},
        multiplicity=4,
        exact_area=np.nan,
    )


@dataclass(frozen=True, slots=True)
class Face:
    """How far a wide face moves outwards between two rolls."""

    x: Array  #: from the middle, m, (n,)
    moved: Array  #: m, (n,)

    def half(self, width: float) -> float:
        """Where it has moved half as far as in the middle, from the narrow face, m."""
        beyond = np.flatnonzero(self.moved < 0.5 * self.moved[0])
        k = int(beyond[0])
        share = (0.5 * self.moved[0] - self.moved[k]) / (self.moved[k - 1] - self.moved[k])
        return float(0.5 * width - self.x[k] + share * (self.x[k] - self.x[k - 1]))


def slice_of(box: Box, layers: int = 2) -> Face:
    """The slice of castfem in the middle of the pitch, on the bed of the elastic strip."""
    section = Section(MPI.COMM_SELF, section_of(box, layers))
    stiffness = box.pressure / max(box.strip, LIMITS.least_bulge)
    bed = Bed(box.pressure, stiffness, box.strip)
    problem = MechanicalProblem(
        section,
        Slice(
            ThermoElastic(Elasticity.constant(YOUNG, POISSON)),
            np.zeros_like,
            planes=PlainPlanes(()),
            loads=(SurfacePressure(("inside",), lambda time: box.pressure),),
            interactions=(
                RollSupport(("wide_face",), GivenFoundation({"wide_face": lambda time: bed})),
            ),
        ),
        {},
        1e-10,
    )
    stepper = MechanicalStepper(problem, True, False)
    start = stepper.initial(0.0, np.zeros(section.owned))
    result = stepper.step(start, 1.0, start.temperature)
    assert result.converged, result.reason
    places = problem.space.tabulate_dof_coordinates()[:, :2]
    u = result.state.displacement.reshape(-1, 2)
    at = np.flatnonzero(np.isclose(places[:, 1], 0.5 * THICKNESS))
    at = at[np.argsort(places[at, 0])]
    return Face(places[at, 0], u[at, 1])


def solid_of(box: Box, layers: int = 2) -> tuple[Face, float]:
    """The shell in three dimensions.

    Returns:
        Its wide face in the middle of the pitch, and how much farther than over the roll the middle
        of the shell moves there at mid-width, which the dent of the roll is not in, m.
    """
    flat = section_of(box, layers)
    z = graded(0.5 * box.pitch, 0.25 * box.shell, 1.3, 0.04 * box.pitch)
    n, count = len(flat.points), len(z)
    points = np.column_stack([np.tile(flat.points, (count, 1)), np.repeat(z, n)])
    cells = np.concatenate([np.hstack([flat.cells + n * k, flat.cells + n * (k + 1)])
                            for k in range(count - 1)])  # fmt: skip
    mesh = compat.create_mesh(MPI.COMM_SELF, cells, points, "hexahedron", 1)
    space = fem.functionspace(mesh, ("Lagrange", 2, (3,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    bulk = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))

    def stress(w: Any) -> Any:
        strain = ufl.sym(ufl.grad(w))
        return bulk * ufl.tr(strain) * ufl.Identity(3) + 2.0 * shear * strain

    matrix = fem_petsc.assemble_matrix(
        compat.compile_form(ufl.inner(stress(u), ufl.grad(v)) * ufl.dx)
    )
    matrix.assemble()
    x = space.tabulate_dof_coordinates()
    load = _pressure(mesh, space, box)
    top = np.isclose(x[:, 1], 0.5 * THICKNESS)
    held = [
        3 * np.flatnonzero(np.isclose(x[:, 0], 0.0)),
        3 * np.flatnonzero(np.isclose(x[:, 1], 0.0)) + 1,
        3 * np.flatnonzero(np.isclose(x[:, 2], 0.0) | np.isclose(x[:, 2], z[-1])) + 2,
        3 * np.flatnonzero(top & np.isclose(x[:, 2], 0.0)) + 1,
    ]
    rows = np.unique(np.concatenate(held)).astype(np.int32)
    matrix.zeroRowsColumns(rows)
    load[rows] = 0.0
    moved = _solved(matrix, load).reshape(-1, 3)[:, 1]
    at = np.flatnonzero(top & np.isclose(x[:, 2], z[-1]))
    at = at[np.argsort(x[at, 0])]
    middle = np.isclose(x[:, 0], 0.0) & np.isclose(x[:, 1], 0.5 * (THICKNESS - box.shell))
    beneath, over = (moved[middle & np.isclose(x[:, 2], place)] for place in (z[-1], 0.0))
    return Face(x[at, 0], moved[at]), float(beneath[0] - over[0])


def _pressure(mesh: Any, space: Any, box: Box) -> Array:
    """Forces of the pressure on the inside."""
    from dolfinx import mesh as dmesh

    half, depth = 0.5 * box.width - box.shell, 0.5 * THICKNESS - box.shell

    def inside(x: Array) -> Array:
        wide = np.isclose(x[1], depth) & (x[0] < half * (1.0 + 1e-9))
        return np.asarray(wide | np.isclose(x[0], half) & (x[1] < depth * (1.0 + 1e-9)))

    mesh.topology.create_connectivity(2, 3)
    facets = np.sort(dmesh.locate_entities_boundary(mesh, 2, inside))
    tags = dmesh.meshtags(mesh, 2, facets, np.ones(len(facets), np.int32))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(1)
    work = -box.pressure * ufl.dot(ufl.FacetNormal(mesh), ufl.TestFunction(space)) * ds
    return np.array(fem.assemble_vector(compat.compile_form(work)).array)


def _solved(matrix: Any, load: Array) -> Array:
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    solver.setOperators(matrix)
    right = PETSc.Vec().createWithArray(load, comm=MPI.COMM_SELF)
    found = right.duplicate()
    solver.solve(right, found)
    values = np.array(found.array)
    for one in (solver, right, found, matrix):
        one.destroy()
    return values


BOXES = (
    Box(1.2, 0.03, 0.25),
    Box(0.32, 0.03, 0.25),
    Box(1.2, 0.03, 0.5),
    Box(0.32, 0.03, 0.5),
    Box(1.2, 0.085, 0.32, 0.75e6),
)


def row_of(box: Box, layers: int = 2) -> dict[str, Any]:
    """One slab by all of them, mm."""
    (solid, undented), flat = solid_of(box, layers), slice_of(box, layers)
    there = np.interp(flat.x, solid.x, solid.moved)
    off = float(np.sqrt(np.mean((flat.moved - there) ** 2)) / solid.moved[0])
    return {
        "width": 1e3 * box.width, "shell": 1e3 * box.shell, "pitch": 1e3 * box.pitch,
        "strip": 1e3 * box.strip, "sheared": 1e3 * (box.strip + box.by_shear),
        "plate": 1e3 * box.plate, "slice": 1e3 * float(flat.moved[0]),
        "solid": 1e3 * float(solid.moved[0]), "undented": 1e3 * undented,
        "half_slice": 1e3 * flat.half(box.width), "half_solid": 1e3 * solid.half(box.width),
        "off": 100.0 * off,
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """A row for each slab."""
    output.csv("shell3d", [row_of(box, 2 if quick else 3) for box in BOXES[: 2 if quick else None]])
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    lengths = {
        "strip": "strip, mm", "sheared": "strip and shear", "plate": "thesis' plate",
        "slice": "slice on its bed", "solid": "three dimensions", "undented": "without the dent",
    }  # fmt: skip
    head: Columns = {
        "width": "width, mm", "shell": "shell, mm", "pitch": "pitch, mm",
        **{key: (words, ".3f") for key, words in lengths.items()},
        "half_slice": ("half of it, slice", ".0f"),
        "half_solid": ("half of it, three dimensions", ".0f"),
        "off": ("slice off along the face, %", ".0f"),
    }  # fmt: skip
    output.table("shell3d", output.rows("shell3d"), head)
