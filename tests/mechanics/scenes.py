"""Mechanical scenes in memory for the tests: meshes of mapped squares, laws, and steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from castfem import meshes
from castfem.laws.elasticity import Elasticity
from castfem.laws.flow import ThermoElastic
from castfem.mechanics.problem import MechanicalProblem
from castfem.mechanics.slice import Slice
from castfem.mechanics.state import MechanicalResult, MechanicalState
from castfem.mechanics.stepper import MechanicalStepper
from castfem.section import Section

Array = npt.NDArray[np.float64]
Map = Callable[[Array, Array], tuple[Array, Array]]

# Local nodes of quadrilaterals and triangles on a lattice of half steps, in DOLFINx order.
QUAD = ((0, 0), (2, 0), (0, 2), (2, 2), (1, 0), (0, 1), (2, 1), (1, 2), (1, 1))
LOWER = ((0, 0), (2, 0), (2, 2), (2, 1), (1, 1), (1, 0))
UPPER = ((0, 0), (2, 2), (0, 2), (1, 2), (0, 1), (1, 1))


def mapped(
    across: int,
    along: int,
    shape: Map,
    cell: str = "quadrilateral",
    order: int = 1,
    groups: tuple[str, str, str, str] = ("symmetry_x", "symmetry_y", "right", "top"),
) -> meshes.SectionMesh:
    """The unit square (s, t) with `across` x `along` cells, mapped by `shape`.

    `groups` name its sides s = 0, t = 0, s = 1, t = 1.
    """
    patterns = [QUAD[:4] if order == 1 else QUAD]
    if cell == "triangle":
        patterns = [p[: 3 * order] for p in (LOWER, UPPER)]
    i, j = np.meshgrid(2 * np.arange(across), 2 * np.arange(along), indexing="ij")
    rows = [
        np.stack([(i + a) * (2 * along + 1) + j + b for a, b in p], axis=-1).reshape(-1, len(p))
        for p in patterns
    ]
    lattice = np.stack(rows, axis=1).reshape(-1, rows[0].shape[1])
    used, cells = np.unique(lattice, return_inverse=True)
    s, t = used // (2 * along + 1) / (2 * across), used % (2 * along + 1) / (2 * along)
    points = np.column_stack(shape(s, t))
    number = np.full((2 * across + 1) * (2 * along + 1), -1)
    number[used] = np.arange(len(used))
    at = number.reshape(2 * across + 1, 2 * along + 1)[::2, ::2]
    sides = (at[0, ::-1], at[:, 0], at[-1, :], at[::-1, -1])
    facets = [np.column_stack([side[:-1], side[1:]]) for side in sides]
    return meshes.SectionMesh(
        points=points,
        cells=cells.reshape(lattice.shape).astype(np.int64),
        cell=cell,
        order=order,
        facets=np.concatenate(facets),
        facet_group=np.repeat(np.arange(4), [len(f) for f in facets]).astype(np.int32),
        groups=groups,
        probes={},
        multiplicity=1,
        exact_area=np.nan,
    )


def box(width: float, height: float, x0: float = 0.0, y0: float = 0.0) -> Map:
    """Map to a rectangle."""
    return lambda s, t: (x0 + width * s, y0 + height * t)


def skewed(width: float, height: float, strength: float = 0.12) -> Map:
    """Map to a rectangle with distorted cells inside and along the sides."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        bump = strength * np.sin(np.pi * s) * np.sin(np.pi * t)
        slide_s, slide_t = (0.3 * v * (1 - v) for v in (s, t))
        return width * (s + bump + 0.3 * slide_s), height * (t - bump - 0.4 * slide_t)

    return shape


def ring(inner: float, outer: float) -> Map:
    """Map to a quarter of a ring: s is radial, t runs from the x to the y axis."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        radius, angle = inner + (outer - inner) * s, 0.5 * np.pi * t
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        return np.where(t == 1.0, 0.0, x), y

    return shape


RING_GROUPS = ("inner", "symmetry_y", "outer", "symmetry_x")


def elastic(young: float = 200e9, poisson: float = 0.3) -> ThermoElastic:
    """Hooke's law with constant moduli."""
    return ThermoElastic(Elasticity.constant(young, poisson))


def no_thermal_strain(temperature: Array) -> Array:
    return np.zeros_like(temperature)


def expansion(coefficient: float) -> Callable[[Array], Array]:
    """Thermal strain from 0 K on."""
    return lambda temperature: coefficient * temperature


@dataclass
class SliceScene:
    """A section, its equilibrium and the state that has been reached."""

    mesh: meshes.SectionMesh
    law: Any = field(default_factory=elastic)
    thermal: Callable[[Array], Array] = no_thermal_strain
    comm: MPI.Comm = field(default_factory=lambda: MPI.COMM_SELF)
    options: dict[str, Any] = field(default_factory=dict)
    tolerance: float = 1e-8
    extrapolate: bool = True
    given: dict[str, Any] = field(default_factory=dict)
    springs: float | None = None
    judge: bool = False  # closed forms hold of the equations, however large the strain
    start: float | Callable[[Array, Array], Array] = 0.0

    def __post_init__(self) -> None:
        """Build section, problem and stepper."""
        self.section = Section(self.comm, self.mesh if self.comm.rank == 0 else None)
        slice_ = replace(Slice(self.law, self.thermal), **self.given)
        self.problem = MechanicalProblem(
            self.section, slice_, self.options, self.tolerance, springs=self.springs
        )
        self.stepper = MechanicalStepper(self.problem, self.extrapolate, self.judge)
        self.state: MechanicalState = self.stepper.initial(0.0, self.field(self.start))
        self.results: list[MechanicalResult] = []

    @property
    def vertices(self) -> Array:
        """Positions of the owned vertices (owned, 2), m."""
        places = self.section.vertex_space.tabulate_dof_coordinates()
        return np.asarray(places[: self.section.owned, :2])

    def field(self, value: float | Callable[[Array, Array], Array]) -> Array:
        """A number or a function of x and y at the owned vertices."""
        x, y = self.vertices.T
        return np.asarray(value(x, y)) if callable(value) else np.full(len(x), float(value))

    def step(
        self, time: float, temperature: float | Callable[[Array, Array], Array] | None = None
    ) -> MechanicalResult:
        """One step to `time`; it must succeed."""
        new = self.state.temperature if temperature is None else self.field(temperature)
        result = self.stepper.step(self.state, time, new)
        assert result.converged, result.reason
        self.state = result.state
        self.results.append(result)
        return result

    @property
    def stress(self) -> Array:
        """Stress at the points of the deviator (n, 4): the mean one carried over by cell.

        Exact where the mean stress is linear over a cell.
        """
        return self.problem.points.recovered(self.state.stress)

    @property
    def places(self) -> Array:
        """Positions of the deviator's points (n, 2)."""
        return self.problem.points.deviator.position

    def displacement(self, where: Callable[[Array, Array], Array]) -> Array:
        """Displacements (k, 2) of the nodes at positions that `where` picks."""
        places = self.problem.space.tabulate_dof_coordinates()[:, :2]
        u = self.state.displacement.reshape(-1, 2)
        return np.asarray(u[where(*places.T)])
