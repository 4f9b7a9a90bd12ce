"""One run in memory: what the surface of the strand gives off and where it goes, all the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from castfem.base.types import Array
from castfem.fem.root import on_root
from castfem.model.build.simulation import Simulation, build
from castfem.runs.loop import TimeLoop
from castfem.runs.output.surface_maps import SurfaceLine
from castfem.runs.results.summary import summarise
from castfem.runs.results.wall_flux import surface_flux

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.runs.output.summary import Summary
    from castfem.runs.results.run_state import RunState
    from castfem.runs.results.sample import Sample


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """The surface of a strand from the meniscus to the end of the run; the same on all ranks."""

    line: SurfaceLine  #: its vertices
    positions: Array  #: of the samples (p,), m
    flux: Array  #: that it gives off (p, n), W/m2
    outline: Array
    """Where its vertices are (p, n, 2), m; as at the meniscus in a run without mechanics."""
    summary: Summary  #: of the run

    def value(self, name: str) -> float:
        """Return a result of the run, SI; NaN where it has none of that name."""
        found = self.summary.quantities.get(name)
        return float("nan") if found is None else float(found.value)


@dataclass
class _Follower:
    """Takes flux and outline off every committed step."""

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
    """Run a case in memory and return what its surface went through (collective).

    Raises:
        InputError: As a run does.
        RunFailure: The run cannot go on.
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
