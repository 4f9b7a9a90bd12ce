"""Thermal problems in memory for the tests: steel, mesh, cooling and steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from castfem import meshes
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.section import Section
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.thermal.boundary import Cooling, Surface
from castfem.physics.thermal.deformed_section import Shape
from castfem.physics.thermal.flux_laws import PrescribedTemperature, SurfaceLaw
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stage import VERTEX
from castfem.physics.thermal.stepper import StepResult, ThermalState, ThermalStepper

LOWER, UPPER = 200.0, 2600.0


def constant_steel(
    solidus: float,
    liquidus: float,
    *,
    latent: float = 272e3,
    rho: float = 7200.0,
    c: float = 700.0,
    k: float | tuple[float, float] = 30.0,
    datum: float | None = None,
) -> ThermalCurve:
    """Return T(H) of constant properties; k may differ in solid and liquid; any freezing range."""
    ks, kl = (k, k) if isinstance(k, float) else k
    if liquidus > solidus:
        knots = np.array([LOWER, solidus, liquidus, UPPER])
        release = np.array([0.0, rho * latent / (liquidus - solidus), 0.0])
        jump = np.zeros(4)
        conductivity = (knots, np.array([ks, ks, kl]), np.array([ks, kl, kl]))
    else:
        knots = np.array([LOWER, solidus, UPPER])
        release = np.zeros(2)
        jump = np.array([0.0, rho * latent, 0.0])
        conductivity = (knots, np.array([ks, kl]), np.array([ks, kl]))
    capacity = np.full(len(knots) - 1, rho * c)
    return ThermalCurve((knots, capacity, capacity, release, jump), conductivity, datum)


@dataclass
class ThermalSetup:
    """A section, its heat balance and its current state."""

    mesh: meshes.SectionMesh
    curve: ThermalCurve
    start: float
    scheme: str = "sdirk2"
    comm: MPI.Comm = field(default_factory=lambda: MPI.COMM_SELF)
    options: dict[str, object] = field(default_factory=dict)
    moves: bool = False
    solidus: float = 0.0
    tolerance: float = VERTEX.tight

    def __post_init__(self) -> None:
        self.section = Section(self.comm, self.mesh if self.comm.rank == 0 else None)
        shape = None
        if self.moves:
            self.displacement = fem.Function(
                fem.functionspace(self.section.mesh, ("Lagrange", 2, (2,)))
            )
            space = self.displacement.function_space
            shape = Shape(self.section, space, self.solidus)
        self.problem = ThermalProblem(
            self.section, self.curve, self.options, self.tolerance, shape=shape
        )
        self.surface = Surface(self.section, shape)
        self.stepper = ThermalStepper(self.problem, self.scheme, estimate=True)
        self.state: ThermalState = self.stepper.initial(self.start)
        self.results: list[StepResult] = []
        self.low = self.high = self.start

    def cool(self, *laws: tuple[str, SurfaceLaw | PrescribedTemperature]) -> ThermalSetup:
        """Cool the groups whose names begin with `name` by a law; laws on one group add up."""
        cooling = Cooling([], [])
        for name, law in laws:
            tags = [
                t
                for t in self.section.matching([name])
                if self.section.groups[t] in self.section.outer_groups
            ]
            patch = self.surface.patch(tags)
            if isinstance(law, PrescribedTemperature):
                cooling.prescribed.append((patch, law))
            else:
                cooling.laws.append((patch, law))
        self.problem.set_cooling(cooling)
        return self

    def move(self, displacement: Callable[[Array], Array], axial: float = 0.0) -> ThermalSetup:
        """Displace the points x (3, n) by a function (2, n) and stretch the slice."""
        self.displacement.interpolate(displacement)
        generalized_strains = np.array([axial, 0.0, 0.0, 0.0])
        self.problem.shape.take(self.displacement.x.array, generalized_strains)
        self.surface.follow_shape()
        self.problem.follow_shape()
        return self

    def advance(
        self, end: float, step: float, each: Callable[[], None] | None = None
    ) -> ThermalSetup:
        """Advance to `end` by equal steps not longer than `step`."""
        begin = self.state.time
        n = max(int(np.ceil((end - begin) / step - 1e-9)), 1)
        for i in range(n):
            result = self.stepper.step(self.state, begin + (end - begin) * (i + 1) / n)
            assert result.converged, result.reason
            self.state = result.state
            self.results.append(result)
            temperature = self.state.point.temperature
            self.low = min(self.low, reductions.smallest(self.comm, temperature))
            self.high = max(self.high, reductions.largest(self.comm, temperature))
            if each is not None:
                each()
        return self

    @property
    def worst_balance(self) -> float:
        """Return the largest relative heat balance error of the steps so far."""
        return max(abs(r.balance) for r in self.results)

    @property
    def nodes(self) -> Array:
        """Return the positions of the owned vertices (owned, 2), m; on one rank only."""
        return np.asarray(self.mesh.points[self.section.node_of_owned])

    def along_x(self) -> tuple[Array, Array]:
        """Return positions and temperatures on the lower side of a strip, sorted by x."""
        x, y = self.nodes.T
        lower = np.flatnonzero(y < y.min() + 1e-9)
        order = lower[np.argsort(x[lower])]
        return x[order], self.state.point.temperature[order]


def strip(length: float, cells: int) -> meshes.SectionMesh:
    """Mesh a strip of equal square cells, one cell wide."""
    size = length / cells
    return meshes.build(
        shape="strip",
        length=length,
        width=size,
        surface_size=size,
        core_size=size,
        cell="quadrilateral",
        order=1,
    )
