"""The thermal benchmark: a quarter of the 125 mm billet in its idealised mould, for 10 s.

The case is `cases/billet125/thermal.toml`. The corner (rounded as in the case, or sharp), the mesh
and the time stepping are varied.
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
"""Mask of the instants at which errors are computed: the second half of the mould."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a run; lengths in mm, times in s."""

    corner: str = "rounded"  #: "rounded" (5 mm, as in the case) or "sharp"
    cell: str = "quadrilateral"  #: "quadrilateral" or "triangle"
    #: this and the other lengths of [mesh]; for None, castfem chooses the optional ones
    surface_size: float = 0.5
    corner_size: float | None = None
    face_size: float | None = None
    core_size: float = 8.0
    surface_depth: float | None = None
    core_depth: float | None = None
    scheme: str = "sdirk2"  #: "sdirk2" or "backward_euler"
    step: float | None = None  #: fixed step, s; None for adaptive stepping
    tolerance: float | None = None  #: tolerance of adaptive stepping, K; None for a fixed step
    largest: float = 0.5  #: largest adaptive step, s
    solver: dict[str, Any] = field(default_factory=dict, hash=False)  #: PETSc options

    @property
    def stepping(self) -> str:
        """Step as text: "0.1 s" or "2 K"."""
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
    """Return the resolved tables of the case file."""
    return load_case(CASE).document()


def time_table(settings: Settings) -> dict[str, Any]:
    """Return [thermal.time] for `settings`."""
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
    """Return the case with the mesh and time stepping of `settings`."""
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
    # Output times are milestones; the benchmark keeps the samples instead of writing files.
    document["output"] = {"fields": ["temperature"], "every": f"{EVERY:g} s", "figures": False}
    return from_document(document, "benchmark")


class Listener:
    """Keeps the samples at the instants of comparison; replaces the recorder of a run."""

    def __init__(self) -> None:
        self.kept: list[Sample] = []

    def step(self, run: RunState, sample: Sample) -> None:
        """Keep `sample` if its time is an instant of comparison."""
        nearest = round(sample.time / EVERY) * EVERY
        if nearest > 0.0 and same_instant(sample.time, nearest, END):
            self.kept.append(sample)


@dataclass(frozen=True, slots=True)
class Result:
    """Results of one run."""

    settings: Settings  #: its settings
    mid_face: Array  #: surface temperature at mid-face at each of `INSTANTS` (n,), degC
    corner: Array  #: surface temperature in the corner (n,), degC
    heat: Array  #: heat removed from the total section until then (n,), MJ per m of strand
    shell_mid_face: Array  #: depth of the solidus at mid-face (n,), mm
    shell_corner: Array  #: depth of the solidus along the diagonal (n,), mm
    vertices: int  #: number of unknowns
    cells: int  #: number of cells
    steps: int  #: number of accepted steps
    rejected: int  #: number of rejected steps
    newton: int  #: number of Newton iterations
    #: shortest time of the time loop without output, s: processor time; wall time on several ranks
    wall: float
    sections: dict[str, float]  #: time of the shortest run by section of the stopwatch, s


def strip_case(length: float, size: float, step: float) -> Case:
    """Return a strip of equal cells with the cooling of mid-face; lengths in mm, step in s."""
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
        settings: Corner, mesh and time stepping.
        repeats: Number of runs; the shortest time is returned.
        patience: Seconds after which a run is not repeated any more.
        case: Case to run instead of the billet with `settings`.
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
    """Return the surface temperature at a probe, degC; NaN without the probe (a strip)."""
    profile = sample.profiles.get(name)
    return float("nan") if profile is None else float(profile.temperature[0]) - ZERO_CELSIUS


def _as_recorder(listener: Listener) -> Recorder:
    """Return `listener` as a recorder, of which a time loop uses only `step`."""
    return listener  # type: ignore[return-value]


def refined(settings: Settings, factor: float) -> Settings:
    """Return `settings` with every cell size multiplied by `factor`."""
    sizes = ("surface_size", "corner_size", "face_size", "core_size")
    values = {name: getattr(settings, name) for name in sizes}
    return replace(settings, **{name: v * factor for name, v in values.items() if v is not None})
