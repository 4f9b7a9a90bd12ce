"""Slices that cool and strain, thermal first, with a clock on either half."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import perf_counter, process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from castfem import meshes
from castfem.base.stopwatch import Stopwatch
from castfem.base.types import Array
from castfem.fem.section import Section
from castfem.physics.materials import Steel
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.thermal.boundary import Cooling, Surface
from castfem.physics.thermal.flux_laws import PrescribedTemperature, SurfaceLaw
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stepper import ThermalStepper

Field = Callable[[Array, float], Array]


@dataclass(frozen=True, slots=True)
class Heat:
    """How the slice cools."""

    steel: Steel  #: what it is made of
    start: float  #: temperature at the meniscus, K
    range: tuple[float, float]  #: temperatures that can occur, K
    #: of heat transfer, by groups of the surface (a name covers all that begin with it)
    laws: Mapping[str, SurfaceLaw | PrescribedTemperature] = field(default_factory=dict)
    scheme: str = "sdirk2"  #: "sdirk2" or "backward_euler"
    #: temperatures of vertices (n, 2), m, over time, s: (n,), K, in place of a solution
    given: Field | None = None


class CoolingSlice:
    """A section that cools and strains.

    Args:
        mesh: The section. heat: How it cools. slice_: How it strains.
        comm: Ranks. options: PETSc options of the mechanics.

    Attributes:
        section: On the ranks. problem: The mechanics. state: Where they are. watch: Its sections.
        newton: Newton iterations of each mechanical step. times: Seconds of each mechanical step;
            on one rank those of the processor, which other work on the machine counts little in.
        walls: The same by the clock on the wall.
        heating: Seconds spent on the temperature, like `times`.
    """

    def __init__(
        self,
        mesh: meshes.SectionMesh,
        heat: Heat,
        slice_: Slice,
        comm: MPI.Comm = MPI.COMM_SELF,
        options: dict[str, Any] | None = None,
    ) -> None:
        self.heat, self.comm = heat, comm
        self.section = Section(comm, mesh if comm.rank == 0 else None)
        self._cool(heat)
        self.watch = Stopwatch()
        self.problem = MechanicalProblem(self.section, slice_, options, watch=self.watch)
        self._stepper = MechanicalStepper(self.problem)
        self.state = self._stepper.initial(0.0, self._thermal.point.temperature)
        self.newton: list[int] = []
        self.times: list[float] = []
        self.walls: list[float] = []
        self.heating = 0.0
        self._clock = process_time if comm.size == 1 else perf_counter

    def _cool(self, heat: Heat) -> None:
        """The thermal half."""
        curve = heat.steel.thermal_curve(*heat.range, heat.start)
        problem = ThermalProblem(self.section, curve)
        surface, cooling = Surface(self.section), Cooling([], [])
        for name, law in heat.laws.items():
            tags = self.section.matching([name])
            patch = surface.patch([t for t in tags if "symmetry" not in self.section.groups[t]])
            if isinstance(law, PrescribedTemperature):
                cooling.prescribed.append((patch, law))
            else:
                cooling.laws.append((patch, law))
        problem.set_cooling(cooling)
        self._heating = ThermalStepper(problem, heat.scheme)
        self._thermal = self._heating.initial(heat.start)
        space = self.section.vertex_space
        self._places = space.tabulate_dof_coordinates()[: self.section.owned, :2]

    def _temperature(self, time: float) -> Array:
        """Of the owned vertices at the end of a step."""
        if self.heat.given is not None:
            return self.heat.given(self._places, time)
        result = self._heating.step(self._thermal, time)
        if not result.converged:
            raise RuntimeError(result.reason)
        self._thermal = result.state
        return self._thermal.point.temperature

    def advance(self, end: float, step: float) -> CoolingSlice:
        """Even steps to `end`, s.

        Raises:
            RuntimeError: A step did not converge.
        """
        begin = self.state.time
        count = round((end - begin) / step)
        for time in begin + (end - begin) * np.arange(1, count + 1) / count:
            start = self._clock()
            temperature = self._temperature(float(time))
            self.comm.Barrier()
            between, wall = self._clock(), perf_counter()
            with self.watch.section("step"):
                result = self._stepper.step(self.state, float(time), temperature)
            self.comm.Barrier()
            if not result.converged:
                raise RuntimeError(f"{time:g} s: {result.reason}")
            self.state = result.state
            self.newton.append(result.newton)
            self.times.append(self._clock() - between)
            self.walls.append(perf_counter() - wall)
            self.heating += between - start
        return self

    @property
    def seconds(self) -> float:
        """Time of the steps so far, both halves."""
        return self.heating + sum(self.times)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        self._heating.problem.destroy()
        self.problem.destroy()
