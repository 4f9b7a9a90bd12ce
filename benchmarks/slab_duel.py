"""The thermal slab by castfem and by the plain scikit-fem script: error against run time, one run.

Half the slab of cases/slab1200/sprays.toml from the meniscus through its first rolls, sprays and
run-off water.  Both get the same lengths for their meshes, and the script the best of its options;
of every combination the quicker of two runs counts, which take turns.  Times are those of the
processor.  Writes a table and a figure of docs/benchmarks.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from time import process_time
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import ROOT, Output, front, table
from benchmarks.slab_line import SlabLine
from castfem.base.constants import ZERO_CELSIUS
from castfem.model import Case, load_case
from castfem.model.build.simulation import Simulation, build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from benchmarks.slab_opponent import Slab, Steel

FOLDER = ROOT / "cases" / "slab1200"
QUIET = ("output.figures=false", "output.fields=[]", "output.every=1000 s")
TO = 4.0  # m, through 14 rolls
AT = np.arange(0.82, TO - 1e-9, 0.005)  # m, where surfaces are compared
MID_FACE, CORNER = "mid_face_intrados", "corner_intrados"
DEPTH, FACE, CORE = 10.0, 30.0, 24.0  # mm; the case has 12 in the core
SIZES = (3.0, 2.0, 1.0, 0.5)  # mm
OURS = ((2.0, 24.0), (1.0, 24.0), (1.0, 12.0), (0.5, 24.0))
"""castfem's tolerances, K, and cells of the core, mm."""
THEIRS: tuple[tuple[str, str, float, float | None], ...] = (
    ("cg", "sdirk2", 0.5, 0.05), ("cg", "sdirk2", 0.25, 0.02), ("cg", "sdirk2", 0.25, None),
    ("cg", "sdirk2", 0.1, None), ("cg", "bdf2", 0.1, None), ("cg", "backward_euler", 0.1, None),
    ("splu", "sdirk2", 0.5, 0.05),
)  # fmt: skip
"""The script's linear solver and scheme, its largest step and that after each change, s."""
CASTFEM = "castfem"
KINDS = (CASTFEM, "scikit-fem, even steps", "scikit-fem, growing steps")
LEVELS = (4.0, 2.0, 1.0)
"""Errors asked for: rms of mid-face and of corner, K."""
HEAT = 0.05  # %, for each kelvin of a level
FINE = (0.25, 0.1)  # mm, K: of the reference


class Listener:
    """Keeps what is compared at the end of each step, where a run would write its files."""

    def __init__(self) -> None:
        self.kept: list[tuple[float, ...]] = []

    def step(self, run: RunState, sample: Sample) -> None:
        """Keep the sample."""
        surfaces = (sample.profiles[p].temperature[0] - ZERO_CELSIUS for p in (MID_FACE, CORNER))
        self.kept.append((sample.position, *surfaces, 1e-6 * sample.removed))


def lengths(size: float, core: float = CORE, face: float = FACE) -> tuple[str, ...]:
    """Keys of a mesh with cells of a size at the surface, in the core, along the faces, mm."""
    return (
        f"mesh.surface_size={size:g} mm", f"mesh.corner_size={size:g} mm",
        f"mesh.surface_depth={DEPTH:g} mm", f"mesh.face_size={face:g} mm",
        f"mesh.core_size={core:g} mm",
    )  # fmt: skip


def slab(*keys: str, end: float = TO) -> Case:
    """The case, to `end`, m."""
    return load_case(FOLDER / "sprays.toml", (*QUIET, f"casting.length={end:g} m", *keys))


def follow(case: Case) -> SlabLine:
    """Castfem's way, without files."""
    simulation, listener = build(case, MPI.COMM_SELF), Listener()
    start = process_time()
    TimeLoop(simulation, listener).run()
    seconds = process_time() - start
    vertices = simulation.section.vertex_space.dofmap.index_map.size_global
    newton = simulation.problem.iterations
    simulation.destroy()
    return SlabLine(*np.array(listener.kept).T, vertices, newton, seconds)


def steel_of(simulation: Simulation, spacing: float = 0.25) -> Steel:
    """The tables of the steel that the script gets; spacing in K."""
    from benchmarks.slab_opponent import Steel

    start = simulation.start_temperature
    kelvin = np.arange(300.0, start + 1.0, spacing)
    curve = simulation.problem.curve
    enthalpy = curve.enthalpy(kelvin)
    return Steel(
        kelvin - ZERO_CELSIUS, enthalpy, curve.at(enthalpy).conduction,
        simulation.steel.emissivity(kelvin), start - ZERO_CELSIUS,
    )  # fmt: skip


def errors(found: SlabLine, reference: SlabLine) -> dict[str, float]:
    """Rms of both surfaces, K, and largest error of the heat, %."""
    off = {}
    for name in ("mid_face", "corner", "heat"):
        ours, theirs = (np.interp(AT, r.position, getattr(r, name)) for r in (found, reference))
        off[name] = ours - theirs if name != "heat" else 100.0 * (ours / theirs - 1.0)
    return {
        "mid_face_K": float(np.sqrt(np.mean(off["mid_face"] ** 2))),
        "corner_K": float(np.sqrt(np.mean(off["corner"] ** 2))),
        "heat_percent": float(np.abs(off["heat"]).max()),
    }


def castfem_runs(size: float, reference: SlabLine, quick: bool) -> Iterator[dict[str, Any]]:
    """All runs of castfem on one mesh, as rows."""
    for kelvin, core in OURS[: 1 if quick else None]:
        keys = (*lengths(size, core), f"thermal.time.adaptive.tolerance={kelvin:g} K")
        how = {
            "code": "castfem", "how": f"{core:g} mm in the core", "scheme": "sdirk2",
            "steps": f"{kelvin:g} K",
        }  # fmt: skip
        yield _row(how, size, follow(slab(*keys)), reference)


def script_runs(
    problems: Mapping[str, Slab], size: float, reference: SlabLine, quick: bool
) -> Iterator[dict[str, Any]]:
    """All runs of the script on one mesh, as rows."""
    from benchmarks import slab_opponent

    for linear, scheme, largest, first in THEIRS[: 1 if quick else None]:
        problem = problems[linear]
        found = slab_opponent.advance(problem, problem.instants(largest, first), scheme)
        words = f"{largest:g} s" if first is None else f"{first:g} to {largest:g} s"
        how = {"code": "scikit-fem", "how": linear, "scheme": scheme, "steps": words}
        yield _row(how, size, found, reference)


def _row(how: dict[str, Any], size: float, found: SlabLine, reference: SlabLine) -> dict[str, Any]:
    row = how | {
        "surface_size_mm": size, "vertices": found.vertices, "taken": len(found.position),
        "newton": found.newton, "seconds": found.seconds,
    }  # fmt: skip
    row |= errors(found, reference)
    print("  ", *row.values(), flush=True)
    return row


def best_of(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The quicker of the runs that are the same but for their time."""
    best: dict[tuple[Any, ...], dict[str, Any]] = {}
    for row in rows:
        key = tuple(row[k] for k in ("code", "how", "scheme", "steps", "surface_size_mm"))
        if key not in best or row["seconds"] < best[key]["seconds"]:
            best[key] = row
    return list(best.values())


def main(output: Output, quick: bool = False) -> None:
    """Both codes on all meshes, twice."""
    try:
        from benchmarks import slab_opponent
    except ModuleNotFoundError as error:
        print(f"slab_opponent: {error.name} is missing; pip install 'castfem[benchmark]'")
        return
    simulation = build(slab(), MPI.COMM_SELF)
    steel = steel_of(simulation)
    simulation.destroy()
    caster = slab_opponent.Caster(FOLDER, steel)
    size, kelvin = (2.0, 2.0) if quick else FINE
    fine = lengths(size) if quick else lengths(size, 6.0, 15.0)
    reference = follow(slab(*fine, f"thermal.time.adaptive.tolerance={kelvin:g} K"))
    rows: list[dict[str, Any]] = []
    for size in SIZES[: 1 if quick else None]:
        millimetres = (size, DEPTH, FACE, CORE)
        mesh = slab_opponent.tensor_mesh(caster, *(1e-3 * x for x in millimetres))
        problems = {s: slab_opponent.Slab(mesh, caster, TO, s) for s in ("cg", "splu")}
        for _ in range(1 if quick else 2):  # by turns: a slow minute hits both alike
            rows += castfem_runs(size, reference, quick)
            rows += script_runs(problems, size, reference, quick)
    output.csv("slab_opponent", best_of(rows))
    show(output)
    output.figure("slab_opponent", draw(output.rows("slab_opponent")))


def worst(row: dict[str, Any]) -> float:
    """The larger of both surfaces' errors, K."""
    return float(max(row["mid_face_K"], row["corner_K"]))


def kind(row: dict[str, Any]) -> str:
    """Whose run it is, and with which steps."""
    steps = "growing" if " to " in row["steps"] else "even"
    return CASTFEM if row["code"] == CASTFEM else f"{row['code']}, {steps} steps"


def verdict(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The cheapest run of each kind for each level, and how many times castfem is faster."""
    lines = []
    for level in LEVELS:
        heat = HEAT * level
        within = [r for r in rows if worst(r) <= level and r["heat_percent"] <= heat]
        ours = min((r["seconds"] for r in within if kind(r) == CASTFEM), default=None)
        for name in KINDS:
            line: dict[str, Any] = {"level": f"{level:g} K, {heat:g} %"}
            own = sorted((r for r in within if kind(r) == name), key=lambda r: r["seconds"])
            line |= own[0] if own else {"how": "not reached"}
            if own and ours and name != CASTFEM:
                line["ratio"] = own[0]["seconds"] / ours
            lines.append(line | {"code": name})
    return lines


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Error against time of every run, and the front of each code."""
    from castfem.post.plots.style import look, new_figure

    rows = [r | {"worst_K": worst(r)} for r in rows]
    with look():
        figure = new_figure(6.0, 4.0)
        axis = figure.subplots()
        for code, colour in {"castfem": "#0072b2", "scikit-fem": "#d55e00"}.items():
            own = [r for r in rows if r["code"] == code]
            x, y = ([r[k] for r in own] for k in ("seconds", "worst_K"))
            axis.plot(x, y, ".", color=colour, alpha=0.35, markersize=5)
            axis.step(*front(own, "worst_K"), where="post", color=colour, label=code)
        for level in LEVELS:
            axis.axhline(level, color="#555555", linewidth=0.8, linestyle=":")
        axis.set(xscale="log", yscale="log", xlabel="processor time [s]")
        axis.set_ylabel("error of the surface, rms [K]")
        axis.legend()
    return figure


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "level": "asked for", "code": "code", "how": "how", "scheme": "scheme",
        "surface_size_mm": "surface size [mm]", "steps": "steps", "taken": "steps taken",
        "vertices": "vertices", "newton": "Newton iterations", "mid_face_K": "mid-face, rms [K]",
        "corner_K": "corner, rms [K]", "heat_percent": "heat [%]", "seconds": "time [s]",
        "ratio": "times castfem's",
    }  # fmt: skip
    forms = {
        "mid_face_K": ".2f", "corner_K": ".2f", "heat_percent": ".3f", "seconds": ".2f",
        "ratio": ".1f",
    }  # fmt: skip
    if rows := output.rows("slab_opponent"):
        output.insert("slab opponent", table(verdict(rows), head, forms))
