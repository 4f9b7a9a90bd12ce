"""Mechanical problems in memory for the tests: mapped meshes, laws and steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from mpi4py import MPI

import numpy as np

from castfem import meshes
from castfem.base.types import Array
from castfem.fem.section import Section
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.state import MechanicalResult, MechanicalState
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.supports import SurfacePressure

from .mapped import RING_GROUPS as RING_GROUPS
from .mapped import Map as Map
from .mapped import box as box
from .mapped import mapped as mapped
from .mapped import ring as ring
from .mapped import skewed as skewed


def elastic(young: float = 200e9, poisson: float = 0.3) -> ThermoElastic:
    return ThermoElastic(Elasticity.constant(young, poisson))


def no_thermal_strain(temperature: Array) -> Array:
    return np.zeros_like(temperature)


def expansion(coefficient: float) -> Callable[[Array], Array]:
    """Return a thermal strain proportional to the temperature in K."""
    return lambda temperature: coefficient * temperature


@dataclass
class SliceSetup:
    """A section, its equilibrium and its current state; `settings` changes the `Slice`."""

    mesh: meshes.SectionMesh
    law: Any = field(default_factory=elastic)
    thermal: Callable[[Array], Array] = no_thermal_strain
    comm: MPI.Comm = field(default_factory=lambda: MPI.COMM_SELF)
    options: dict[str, Any] = field(default_factory=dict)
    tolerance: float = 1e-8
    extrapolate: bool = True
    settings: dict[str, Any] = field(default_factory=dict)
    springs: float | None = None
    judge: bool = False  # closed forms hold for the equations at any strain
    start: float | Callable[[Array, Array], Array] = 0.0

    def __post_init__(self) -> None:
        self.section = Section(self.comm, self.mesh if self.comm.rank == 0 else None)
        slice_ = replace(Slice(self.law, self.thermal), **self.settings)
        self.problem = MechanicalProblem(
            self.section, slice_, self.options, self.tolerance, springs=self.springs
        )
        self.stepper = MechanicalStepper(self.problem, self.extrapolate, self.judge)
        self.state: MechanicalState = self.stepper.initial(0.0, self.field(self.start))
        self.results: list[MechanicalResult] = []

    @property
    def vertices(self) -> Array:
        """Return the positions of the owned vertices (owned, 2), m."""
        places = self.section.vertex_space.tabulate_dof_coordinates()
        return np.asarray(places[: self.section.owned, :2])

    def field(self, value: float | Callable[[Array, Array], Array]) -> Array:
        """Evaluate a number or a function of x and y at the owned vertices."""
        x, y = self.vertices.T
        return np.asarray(value(x, y)) if callable(value) else np.full(len(x), float(value))

    def step(
        self, time: float, temperature: float | Callable[[Array, Array], Array] | None = None
    ) -> MechanicalResult:
        """Take one step to `time`, which must converge."""
        new = self.state.temperature if temperature is None else self.field(temperature)
        result = self.stepper.step(self.state, time, new)
        assert result.converged, result.reason
        self.state = result.state
        self.results.append(result)
        return result

    @property
    def stress(self) -> Array:
        """Return the stress at the points of the deviator (n, 4).

        The mean stress is interpolated cell by cell: exact if it is linear over a cell.
        """
        return self.problem.points.recovered(self.state.stress)

    @property
    def places(self) -> Array:
        """Return the positions of the points of the deviator (n, 2), m."""
        return self.problem.points.deviator.position

    def displacement(self, where: Callable[[Array, Array], Array]) -> Array:
        """Return the displacements (k, 2) of the nodes selected by `where`, m."""
        places = self.problem.space.tabulate_dof_coordinates()[:, :2]
        u = self.state.displacement.reshape(-1, 2)
        return np.asarray(u[where(*places.T)])


def pressed_tube(
    cells: tuple[int, int], radii: tuple[float, float], law: Any, pressure: Any, **settings: Any
) -> SliceSetup:
    """Set up a quarter of a tube under inner pressure (Pa over time); default: plane strain."""
    cell = settings.pop("cell", "quadrilateral")
    mesh = mapped(*cells, ring(*radii), cell, 2, RING_GROUPS)
    loads = (SurfacePressure(("inner",), pressure),)
    return SliceSetup(mesh, law, settings={"planes": PlainPlanes(()), "loads": loads, **settings})
