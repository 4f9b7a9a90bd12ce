"""Billets in moulds for the tests: coarse, in memory or in a folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from mpi4py import MPI

from castfem.model import Case, load_case
from castfem.model.build.simulation import Simulation, build
from castfem.physics.coupling.staggered import StrandState
from castfem.runs import loop
from castfem.runs.loop import TimeLoop
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.runs.results.summary import summarise

CASES = Path(__file__).parents[2] / "cases" / "billet125"
# Tests of steps, files and resuming use elastic liquid. Runs that leave the mould within 100 mm
# (test_mould_end) or load a strand before it has a shell (test_axial_forces) have no solution with
# fed liquid. All others use `shipped`.
ELASTIC = (
    "mechanics.liquid=elastic", "mechanics.mush=geometric", "mechanics.ferrostatic=proportional",
)  # fmt: skip
FED = ("mechanics.liquid=fed", "mechanics.mush=none", "mechanics.ferrostatic=full")


def cells(surface: float, face: float, core: float) -> tuple[str, ...]:
    """Return sizes of cells, mm: at the surface and its corners, along the faces, in the core."""
    sizes = {"surface": surface, "corner": surface, "face": face, "core": core}
    return tuple(f"mesh.{place}_size={size} mm" for place, size in sizes.items())


SILENT = ("output.fields=[]", "output.figures=false")
COARSE = (*cells(2, 10, 14), "coupling.interval=0.25 s", *SILENT)


def billet(name: str, *overrides: str) -> Case:
    """Return a shipped billet on a coarse mesh, with elastic liquid."""
    liquid = () if name == "thermal" else ELASTIC
    return load_case(CASES / f"{name}.toml", (*COARSE, *liquid, *overrides))


def shipped(name: str, *overrides: str) -> Case:
    """Return a shipped billet on a coarse mesh, with the shipped model of the liquid."""
    return load_case(CASES / f"{name}.toml", (*COARSE, *overrides))


def run(case: Case, folder: Path, **options: object) -> Summary:
    """Run into a folder, on one rank."""
    return loop.run(case, folder, comm=MPI.COMM_SELF, **options)  # type: ignore[arg-type]


@contextmanager
def simulated(case: Case, comm: MPI.Comm = MPI.COMM_SELF) -> Iterator[Simulation]:
    """Build the objects of a run, and free their PETSc objects at the end."""
    simulation = build(case, comm)
    try:
        yield simulation
    finally:
        simulation.destroy()


@dataclass
class Kept:
    """Keeps every sample of a run in memory, and its state after each step."""

    samples: list[Sample] = field(default_factory=list)
    states: list[StrandState] = field(default_factory=list)
    summary: Summary | None = None

    def step(self, run: RunState, sample: Sample) -> None:
        self.samples.append(sample)
        self.states.append(run.state)

    def value(self, name: str) -> float:
        """Return a result at the end of the run, SI."""
        return self.summary.quantities[name].value


def run_in_memory(case: Case, comm: MPI.Comm = MPI.COMM_SELF) -> Kept:
    """Run in memory to the end."""
    kept = Kept()
    with simulated(case, comm) as simulation:
        last = TimeLoop(simulation, kept)  # type: ignore[arg-type]
        last.run()
        kept.summary = summarise(last.run_state, "finished")
    return kept
