"""Strip and slice compared with a three-dimensional elastic shell between rolls.

The shell was computed once with second-order hexahedra (docs/slab_bulging.md, "The strip against a
shell in three dimensions"). docs/data/shell3d.csv has its largest bulge and the extent of the bulge
across the width, shell3d_face.csv the wide face of a narrow shell in the middle of the pitch.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest

from castfem import meshes
from castfem.base.types import Array
from castfem.fem.section import Section
from castfem.model.build.bulging import LIMITS
from castfem.physics.constitutive import Elasticity, ThermoElastic
from castfem.physics.contact.roll_support import Bed, GivenFoundation, RollSupport
from castfem.physics.machine.bulging import ElasticStrip, Shell, Span
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.supports import SurfacePressure

pytestmark = pytest.mark.slow

DATA = Path(__file__).parents[2] / "docs" / "data"
YOUNG, POISSON = 10e9, 0.3
THICKNESS = 0.22  # of the slab, m
PRESSURE = 0.2e6  # Pa
SHEAR = 5.0 / 6.0  # shear correction factor of a plate
GROUPS = ("symmetry_x", "symmetry_y", "inside", "narrow_face", "wide_face")


@dataclass(frozen=True, slots=True)
class Box:
    width: float  #: of the slab, m
    shell: float  #: thickness of the shell, m
    pitch: float  #: m

    @property
    def strip(self) -> float:
        """Return the largest bulge of the strip, m."""
        shell = Shell(self.shell, lambda depth: 1400.0)
        elastic = ElasticStrip(Elasticity.constant(YOUNG, POISSON))
        return elastic.bulge(Span(self.pitch, PRESSURE, 0.02), shell).largest

    @property
    def by_shear(self) -> float:
        """Return the additional bulge by shear, p L^2/(8 k G h), m."""
        modulus = YOUNG / (2.0 * (1.0 + POISSON))
        return PRESSURE * self.pitch**2 / (8.0 * SHEAR * modulus * self.shell)

    def solved(self) -> pd.Series[float]:
        rows = pd.read_csv(DATA / "shell3d.csv").set_index(["width", "shell", "pitch"])
        return rows.loc[tuple(round(1e3 * x) for x in (self.width, self.shell, self.pitch))]


def graded(end: float, first: float, growth: float, largest: float) -> Array:
    """Return distances from 0 to `end` with steps that grow from `first` to `largest`."""
    places, step = [0.0], first
    while places[-1] < end:
        places.append(places[-1] + step)
        step = min(step * growth, largest)
    return np.asarray(places) * (end / places[-1])


def lines(box: Box, layers: int) -> tuple[Array, Array]:
    """Return the coordinates x and y of the grid lines from the centre of the section, m."""
    within = box.shell * np.linspace(0.0, 1.0, layers + 1)
    found = []
    for half, largest in ((0.5 * box.width, 0.03), (0.5 * THICKNESS, 0.02)):
        free = half - box.shell
        inner = free - graded(free, 0.5 * box.shell, 1.3, largest)[::-1]
        found.append(np.concatenate([inner[:-1], free + within]))
    return found[0], found[1]


def section_of(box: Box, layers: int) -> meshes.SectionMesh:
    """Mesh a quarter of the section of the shell: a lattice without the cells of the liquid."""
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
        for neighbour, pair, outer in (
            ((a - 1, b), (at, at + 1), 0),
            ((a, b - 1), (at, at + ny + 1), 1),
            ((a + 1, b), (at + ny + 1, at + ny + 2), 3),
            ((a, b + 1), (at + 1, at + ny + 2), 4),
        ):
            if neighbour not in taken:
                inside = 0 <= neighbour[0] < nx and 0 <= neighbour[1] < ny
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
    """Outward displacement of a wide face between two rolls."""

    x: Array  #: distance from the centre line, m, (n,)
    moved: Array  #: displacement, m, (n,)

    def half(self, width: float) -> float:
        """Return the distance from the narrow face of half the largest displacement, m."""
        beyond = np.flatnonzero(self.moved < 0.5 * self.moved[0])
        k = int(beyond[0])
        share = (0.5 * self.moved[0] - self.moved[k]) / (self.moved[k - 1] - self.moved[k])
        return float(0.5 * width - self.x[k] + share * (self.x[k] - self.x[k - 1]))


def slice_of(box: Box, layers: int = 2) -> Face:
    """Solve the slice in the middle of the pitch on the foundation of the elastic strip."""
    section = Section(MPI.COMM_SELF, section_of(box, layers))
    stiffness = PRESSURE / max(box.strip, LIMITS.least_bulge)
    bed = Bed(PRESSURE, stiffness, box.strip)
    problem = MechanicalProblem(
        section,
        Slice(
            ThermoElastic(Elasticity.constant(YOUNG, POISSON)),
            np.zeros_like,
            planes=PlainPlanes(()),
            loads=(SurfacePressure(("inside",), lambda time: PRESSURE),),
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


def test_wide_slab_has_the_bulge_of_strip_and_shear() -> None:
    box, thicker = Box(1.2, 0.03, 0.5), Box(1.2, 0.06, 0.5)
    assert box.by_shear / box.strip == pytest.approx(8 * 1.2 / 0.7 * (0.03 / 0.5) ** 2, rel=1e-9)
    found = box.solved()
    assert found.undented == pytest.approx(1e3 * (box.strip + box.by_shear), rel=1e-2)
    assert 0.0 < found.solid - found.undented < 0.01  # indentation by the roll
    undented = thicker.solved().undented
    assert undented == pytest.approx(1e3 * (thicker.strip + thicker.by_shear), rel=3e-2)
    assert undented > 1.15e3 * thicker.strip


def test_slice_includes_the_effect_of_the_narrow_faces() -> None:
    box = Box(0.32, 0.03, 0.25)
    flat, solid, face = slice_of(box), box.solved(), pd.read_csv(DATA / "shell3d_face.csv")
    assert 1e3 * box.strip > 1.3 * solid.solid
    assert 1e3 * flat.moved[0] == pytest.approx(solid.solid, rel=4e-2)
    expected = np.interp(1e3 * flat.x, face.x, face.moved)
    assert np.sqrt(np.mean((1e3 * flat.moved - expected) ** 2)) < 0.03 * solid.solid
    assert 1e3 * flat.half(box.width) == pytest.approx(solid.half_solid, abs=3.0)


def test_cells_are_fine_enough() -> None:
    coarse, fine = (slice_of(Box(0.32, 0.03, 0.25), layers) for layers in (2, 3))
    assert coarse.moved[0] == pytest.approx(fine.moved[0], rel=5e-3)
