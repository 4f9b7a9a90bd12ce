"""A run in memory that records heat flux and outline of the strand's surface."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from castfem.base.types import Array
from castfem.fem.rank_zero import on_root
from castfem.model.build.simulation import Simulation, build
from castfem.runs.loop import TimeLoop
from castfem.runs.output.surface_maps import SurfaceLine
from castfem.runs.results.summary import summarise
from castfem.runs.results.wall_flux import surface_flux

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.runs.output.summary_file import Summary
    from castfem.runs.results.run_state import RunState
    from castfem.runs.results.sample import Sample


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """The surface of a strand from the meniscus to the end of the run; equal on all ranks."""

    line: SurfaceLine  #: its vertices
    positions: Array  #: positions of the samples (p,), m
    flux: Array  #: heat flux out of the surface (p, n), W/m2
    outline: Array
    """Positions of its vertices (p, n, 2), m; constant in a run without mechanics."""
    summary: Summary  #: summary of the run

    def value(self, name: str) -> float:
        """Return a result of the run, SI; NaN if there is none of that name."""
        found = self.summary.quantities.get(name)
        return float("nan") if found is None else float(found.value)


@dataclass
class _Follower:
    """Records flux and outline of every committed step."""

    simulation: Simulation
    line: SurfaceLine
    positions: list[float] = field(default_factory=list)
    flux: list[Array] = field(default_factory=list)
    outline: list[Array] = field(default_factory=list)

    def step(self, run: RunState, sample: Sample) -> None:
        """See `castfem.runs.loop.StepRecord`."""
        self.positions.append(sample.position)
        self.flux.append(self._on_line(surface_flux(self.simulation, run.state)))
        moved: Array = np.zeros((len(self.line.nodes), 2))
        mechanics = run.sampler.mechanics
        if mechanics is not None and run.state.mechanical is not None:
            strained = run.state.mechanical
            owned = mechanics.strained.points.moved(
                strained.displacement, strained.generalized_strains
            )
            moved = np.stack([self._on_line(part) for part in owned.T], axis=1)
        self.outline.append(self.line.place + moved)

    def _on_line(self, owned: Array) -> Array:
        """Return vertex values at the vertices of the surface, on all ranks (collective)."""
        section = self.simulation.section
        whole = section.gather(np.ascontiguousarray(owned))
        return np.asarray(section.comm.bcast(None if whole is None else whole[self.line.nodes]))


def follow(case: Case, comm: MPI.Comm) -> Followed:
    """Run a case in memory and return the history of its surface (collective).

    Raises:
        InputError: The case cannot be run.
        RunFailure: The run failed.
    """
    simulation = build(case, comm)
    try:
        source = simulation.section.source
        line = comm.bcast(on_root(comm, lambda: _line_of(source)))
        follower = _Follower(simulation, line)
        loop = TimeLoop(simulation, follower)
        loop.run()
        summary = summarise(loop.run_state, "finished")
    finally:
        simulation.destroy()
    return Followed(
        line,
        np.array(follower.positions),
        np.array(follower.flux),
        np.array(follower.outline),
        summary,
    )


def _line_of(source: object) -> SurfaceLine:
    from castfem.meshes import SectionMesh

    assert isinstance(source, SectionMesh)
    return SurfaceLine.of(source)
