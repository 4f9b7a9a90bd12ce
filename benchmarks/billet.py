"""The thermal benchmark: the quarter of the 125 mm billet in its idealised mould, for 10 s.

The case is `cases/billet125/thermal.toml`; what is varied is the corner (rounded as in the case,
or sharp), the mesh, and the time stepping.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np

from castfem.base.constants import ZERO_CELSIUS, same_instant
from castfem.base.stopwatch import Stopwatch
from castfem.base.types import Array
from castfem.model import Case, from_document, load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample

if TYPE_CHECKING:
    from castfem.runs.recorder import Recorder


CASE = Path(__file__).parents[1] / "cases" / "billet125" / "thermal.toml"
RADIUS = {"rounded": 5.0, "sharp": 0.0}  # mm
EVERY = 0.5  # s between the instants at which results are compared; every scheme hits them exactly
END = 10.0  # s, the exit of the mould
INSTANTS = np.arange(1, round(END / EVERY) + 1) * EVERY
LATE = INSTANTS >= 0.5 * END - 1e-9
"""The instants errors are judged at: the second half of the mould."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What a run is made with; lengths in mm, times in s."""

    corner: str = "rounded"  #: "rounded" (5 mm, as in the case) or "sharp"
    cell: str = "quadrilateral"  #: "quadrilateral" or "triangle"
    #: and the other lengths of [mesh]; None leaves the optional ones to castfem
    surface_size: float = 0.5
    corner_size: float | None = None
    face_size: float | None = None
    core_size: float = 8.0
    surface_depth: float | None = None
    core_depth: float | None = None
    scheme: str = "sdirk2"  #: "sdirk2" or "backward_euler"
    step: float | None = None  #: fixed step, s; None for adaptive stepping
    tolerance: float | None = None  #: of adaptive stepping, K; None for a fixed step
    largest: float = 0.5  #: its largest step, s
    solver: dict[str, Any] = field(default_factory=dict, hash=False)  #: PETSc options

    @property
    def stepping(self) -> str:
        """The step in words: "0.1 s" or "2 K"."""
        return f"{self.step:g} s" if self.step is not None else f"{self.tolerance:g} K"


LENGTHS = (
    "surface_size",
    "corner_size",
    "face_size",
    "core_size",
    "surface_depth",
    "core_depth",
)


def base_document() -> dict[str, Any]:
    """The tables of the case file, resolved."""
    return load_case(CASE).document()


def time_table(settings: Settings) -> dict[str, Any]:
    """[thermal.time] of `settings`."""
    table: dict[str, Any] = {"scheme": settings.scheme}
    if settings.step is not None:
        return table | {"step": f"{settings.step:.17g} s"}
    adaptive = {
        "tolerance": f"{settings.tolerance:.17g} K",
        "first": "1 ms",
        "smallest": "0.001 ms",
        "largest": f"{settings.largest:.17g} s",
    }
    return table | {"adaptive": adaptive}


def billet_case(settings: Settings) -> Case:
    """The case with `settings` in place of its own mesh and time stepping."""
    document = base_document()
    document.pop("reference", None)
    document["section"]["corner_radius"] = f"{RADIUS[settings.corner]:g} mm"
    mesh: dict[str, Any] = {"cell": settings.cell, "order": 1}
    for name in LENGTHS:
        value = getattr(settings, name)
        if value is not None:
            mesh[name] = f"{value:.17g} mm"
    document["mesh"] = mesh
    thermal = document.setdefault("thermal", {})
    thermal["time"] = time_table(settings)
    if settings.solver:
        thermal["solver"] = settings.solver
    # Output times are milestones; the benchmark listens in place of the files.
    document["output"] = {"fields": ["temperature"], "every": f"{EVERY:g} s", "figures": False}
    return from_document(document, "benchmark")


class Listener:
    """Keeps the samples at the instants of comparison, where a run would write its files."""

    def __init__(self) -> None:
        self.kept: list[Sample] = []

    def step(self, run: RunState, sample: Sample) -> None:
        """Keep `sample` if it falls on an instant."""
        nearest = round(sample.time / EVERY) * EVERY
        if nearest > 0.0 and same_instant(sample.time, nearest, END):
            self.kept.append(sample)


@dataclass(frozen=True, slots=True)
class Result:
    """One run."""

    settings: Settings  #: what it was made with
    mid_face: Array  #: surface temperature at mid-face at each of `INSTANTS` (n,), degC
    corner: Array  #: the same in the corner
    heat: Array  #: heat removed from the whole section until then (n,), MJ per m of strand
    shell_mid_face: Array  #: depth of the solidus (n,), mm
    shell_corner: Array  #: the same along the diagonal
    vertices: int  #: unknowns
    cells: int  #: cells
    steps: int  #: steps taken
    rejected: int  #: steps tried in vain
    newton: int  #: Newton iterations
    #: shortest time of the time loop, s, without output: of the processor; on ranks, by the clock
    wall: float
    sections: dict[str, float]  #: time of the shortest run by section of the stopwatch, s


def strip_case(length: float, size: float, step: float) -> Case:
    """The same cooling of a strip of even cells: what mid-face sees; mm and s."""
    document = billet_case(Settings(step=step)).document()
    document["section"] = {"shape": "strip", "length": f"{length} mm", "width": f"{size:.17g} mm"}
    document["mesh"] = {"surface_size": f"{size:.17g} mm", "core_size": f"{size:.17g} mm"}
    return from_document(document, "strip")


def run(
    settings: Settings,
    repeats: int = 1,
    patience: float = 1.0,
    case: Case | None = None,
    comm: MPI.Comm = MPI.COMM_SELF,
) -> Result:
    """Run the billet and time its time loop.

    Args:
        settings: What to run.
        repeats: How often to run; the shortest time counts.
        patience: Seconds after which a run is not repeated any more.
        case: What to run instead of the billet with `settings`.
        comm: Ranks to run on; with several, `patience` has no effect.
    """
    case = billet_case(settings) if case is None else case
    best: Result | None = None
    spent = 0.0
    for _ in range(repeats):
        found = _once(case, settings, comm)
        spent += found.wall
        if best is None or found.wall < best.wall:
            best = found
        if comm.size == 1 and spent > patience:
            break
    assert best is not None
    return best


def _once(case: Case, settings: Settings, comm: MPI.Comm) -> Result:
    clock = process_time if comm.size == 1 else perf_counter
    simulation = build(case, comm, Stopwatch(clock))
    listener = Listener()
    try:
        before = dict(simulation.watch.seconds)
        time_loop = TimeLoop(simulation, _as_recorder(listener))
        comm.Barrier()
        start = clock()
        with simulation.watch.section("time loop"):
            time_loop.run()
        wall = clock() - start
        sections = {n: t - before.get(n, 0.0) for n, t in simulation.watch.seconds.items()}
        cells = simulation.section.mesh.topology.index_map(2).size_global
        vertices = simulation.section.vertex_space.dofmap.index_map.size_global
    finally:
        simulation.destroy()
    kept = listener.kept
    return Result(
        settings,
        *(np.array([_surface(r, name) for r in kept]) for name in ("mid_face", "corner")),
        np.array([1e-6 * r.removed for r in kept]),
        *(np.array([1e3 * r.shell.get(n, np.nan) for r in kept]) for n in ("mid_face", "corner")),
        vertices,
        cells,
        time_loop.run_state.counts.steps,
        time_loop.run_state.counts.rejected,
        simulation.problem.iterations,
        wall,
        {n: t for n, t in sections.items() if t > 0.0 and not n.startswith("setup")},
    )


def _surface(sample: Sample, name: str) -> float:
    """Surface temperature at the start of a probe, degC; nan where there is none (a strip)."""
    profile = sample.profiles.get(name)
    return float("nan") if profile is None else float(profile.temperature[0]) - ZERO_CELSIUS


def _as_recorder(listener: Listener) -> Recorder:
    """A time loop asks of its recorder no more than `step`."""
    return listener  # type: ignore[return-value]


def refined(settings: Settings, factor: float) -> Settings:
    """The same mesh with every size multiplied by `factor`."""
    sizes = ("surface_size", "corner_size", "face_size", "core_size")
    values = {name: getattr(settings, name) for name in sizes}
    return replace(settings, **{name: v * factor for name, v in values.items() if v is not None})
