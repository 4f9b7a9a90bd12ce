"""The slab below its mould: cast through its own tapered one, or begun at its exit.

Runs cases/slab1200/slab.toml (cells of 5 mm at the corners, too) from the meniscus through the
mould of `slab_mould` with its stresses, from the mould's exit after a mean coefficient, and from
the temperatures that the own mould leaves in the middle of a wide face. Windows of the own mould
that are 1 % shorter tell what is noise, finer cells in two of the ways what the mesh does. Into
results/benchmarks/slab_downstream (what is finished there is not repeated). Writes tables of
docs/slab_heat.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output, table
from benchmarks.slab_bending import found
from benchmarks.slab_mould import ACROSS, TAPER
from castfem.base.constants import ZERO_CELSIUS
from castfem.model import Case, load_case
from castfem.model.build.simulation import build
from castfem.model.load import from_document
from castfem.runs.loop import TimeLoop
from castfem.runs.output.history import read_history
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample

CASE = ROOT / "cases" / "slab1200" / "slab.toml"
FOLDER = ROOT / "results" / "benchmarks" / "slab_downstream"
KEYS = ("mesh.corner_size=5 mm", "output.figures=false", "output.fields=[]")
EXIT = 0.8  # m
GAP = "0.15 W/(m K)"
DEPTHS = (0, 1, 2, 3, 4, 6, 8, 10, 12, 14, 17, 20, 25, 30, 40, 60, 110)  # mm
ROLLS = {"bender": 8, "bender_end": 15, "straightener": 49, "straightener_end": 57}


@dataclass(frozen=True)
class Way:
    """One way for the slab to come to its rolls.

    Attributes:
        name: In the table. start: "mould", "mean" or "profile".
        keys: Of the case, besides.
    """

    name: str
    start: str
    keys: tuple[str, ...] = ()


OWN = Way("own mould", "mould")
WAYS = (
    OWN,
    Way("windows 1 % shorter", "mould", ("coupling.interval=49.5 mm",)),
    Way("mean coefficient", "mean", ("mechanics.bulging.pull=false",)),
    Way("rolls that pull", "mean"),
    Way("profile", "profile", ("mechanics.bulging.pull=false",)),
)
CELL, FINER = 5.0, (4.0, 3.5)  # mm, at the surface: of all ways, and finer ones of two of them
FINE = tuple(
    Way(f"{way.name}, {size:g} mm", way.start,
        (*way.keys, f"mesh.surface_size={size} mm", f"mesh.corner_size={size} mm"))
    for way, size in zip((OWN, WAYS[2]), FINER, strict=True)
)  # fmt: skip
TOLD = {
    "warm_mid_face": ("surface at #8, mid-face, degC", ".0f"),
    "warm_corner": ("corner", ".0f"),
    "shell_mid_face": ("shell at #8, mid-face, mm", ".1f"),
    "shell_corner": ("corner, along its diagonal", ".1f"),
    "before": ("extrados corner's axial stress before the bender, MPa", ".1f"),
    "bending_stress": ("largest, in the bender", ".1f"),
    "bending_warm": ("its least temperature there, degC", ".0f"),
    "bending_I1": ("I1 in bending, MPa", ".1f"),
    "bending_I1_place": ("", ""),
    "bending_I2": ("I2 in bending, 1e-5 1/s", ".1f"),
    "bending_I2_place": ("", ""),
    "shell_end": ("shell at #15, mid-face, mm", ".1f"),
    "straightening_stress": ("stress, intrados corner, in straightening, MPa", ".1f"),
    "straightening_warm": ("its least temperature there, degC", ".0f"),
    "straightening_I1": ("I1 in straightening, MPa", ".1f"),
    "straightening_I1_place": ("", ""),
    "straightening_I2": ("I2 in straightening, 1e-5 1/s", ".1f"),
    "straightening_I2_place": ("", ""),
    "bulge": ("bulge below #7, mm", ".3f"),
    "work": ("work of bending, kJ/m", ".3f"),
    "slice": ("thickness of the slice at #62, of that at #1, %", ".3f"),
    "thickness": ("thickness of the slab at #62, mm", ".2f"),
    "width": ("width", ".1f"),
    "heat": ("heat removed to #62, MJ/m", ".1f"),
}


class _Nothing:
    """What notes nothing of a run."""

    def step(self, run: RunState, sample: Sample) -> None:
        """See `castfem.runs.recorder`."""


def main(output: Output, quick: bool) -> None:
    """All ways, each in its turn."""
    rows: list[dict[str, Any]] = []
    folder = output.folder if quick else FOLDER
    further = ("casting.length=1.1 m", "mesh.surface_size=10 mm") if quick else ()
    for number, way in enumerate(WAYS[2:3] if quick else (*WAYS, *FINE)):
        rows.append(_row(way, case_of(way, further), folder / f"{number}"))
        print(f"  {way.name}: {rows[-1]['failure'] or 'finished'}", flush=True)
        output.csv("slab_downstream", rows)
    show(output)


def case_of(way: Way, further: tuple[str, ...] = ()) -> Case:
    """The case of a way."""
    case = load_case(CASE, (*KEYS, *way.keys, *further))
    if way.start == "mean":
        return case
    if way.start == "profile":
        own = case_of(OWN, further).document()
        own["casting"]["length"] = f"{EXIT} m"
        document = case.document()
        document["casting"]["start"]["profile"] = _left(from_document(own))
        return from_document(document)
    document = case.document()
    del document["casting"]["start"]
    document["mould"] = {"length": f"{EXIT} m", "taper": TAPER}
    document["cooling"][0]["surface"][0]["gap_conductivity"] = GAP
    document["cooling"][0]["surface"].append(ACROSS)
    document["mechanics"]["liquid"] = "fed"
    return from_document(document)


def _left(case: Case) -> dict[str, Any]:
    """Temperatures that a mould leaves in the middle of a wide face, over the depth."""
    simulation = build(case, MPI.COMM_SELF)
    try:
        through = TimeLoop(simulation, _Nothing())  # type: ignore[arg-type]
        through.run()
        temperature = through.run_state.state.thermal.point.temperature
        profile = simulation.probes.sample(temperature)["mid_face_intrados"]
    finally:
        simulation.destroy()
    found = np.interp(np.array(DEPTHS) * 1e-3, profile.depth, profile.temperature) - ZERO_CELSIUS
    return {
        "depth": list(DEPTHS), "depth_unit": "mm",
        "value": [round(float(one), 2) for one in found], "unit": "degC",
    }  # fmt: skip


def _row(way: Way, case: Case, folder: Path) -> dict[str, Any]:
    """Run a way, unless it is finished, and read what is told of it."""
    summary, failure = finished_run(case, folder)
    assert case.machine is not None
    rolls, history = case.machine.pairs(), read_history(folder / "history.csv")
    assert rolls is not None
    places = np.array([pair.position for pair in rolls.pairs])
    at = history["position"].to_numpy()

    def there(roll: int, column: str, below: float = 0.0) -> float | None:
        position = places[roll - 1] + below
        reached = at[0] <= position <= at[-1]
        return float(np.interp(position, at, history[column].to_numpy())) if reached else None

    row = found(history, summary, places)
    bender, end = ROLLS["bender"], ROLLS["bender_end"]
    quantities = {name: one.value for name, one in summary.quantities.items()}
    first, last = there(1, "slice_thickness_centre", 1e-3), quantities["slice_thickness_centre"]
    return {"name": way.name, "failure": failure} | {name: row.get(name) for name in TOLD} | {
        "warm_mid_face": there(bender, "surface_temperature_mid_face_intrados"),
        "warm_corner": there(bender, "surface_temperature_corner_intrados"),
        "shell_mid_face": there(bender, "shell_mid_face_intrados"),
        "shell_corner": there(bender, "shell_corner_intrados"),
        "shell_end": there(end, "shell_mid_face_intrados"),
        "before": there(bender, "axial_stress_corner_extrados", -1e-3),
        "bulge": there(7, "bulge_pitch", 0.1),
        "work": quantities["bending_work"] / 1e3,
        "slice": None if first is None else 100.0 * last / first,
        "thickness": 1e3 * quantities["size_mid_face_intrados"],
        "width": 1e3 * quantities["size_narrow_face"],
        "heat": quantities["heat_removed"] / 1e6,
    }  # fmt: skip


def show(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("slab_downstream")
    if not rows:
        return
    finer = {way.name for way in FINE}
    known = {row["name"]: row for row in rows}
    if finer <= set(known):
        _show_cells(output, known)
    rows = [row for row in rows if row["name"] not in finer]
    lines = []
    for name, (what, form) in TOLD.items():
        line: dict[str, Any] = {"what": what}
        for row in rows:
            value = row[name]
            line[row["name"]] = format(value, form) if form and value is not None else value
        lines.append(line)
    head = {"what": "slab1200/slab, from"} | {row["name"]: row["name"] for row in rows}
    output.insert("slab downstream", table(lines, head, {}))


def _show_cells(output: Output, rows: dict[str, dict[str, Any]]) -> None:
    """What finer cells and, as noise, shorter windows change in two of the ways."""
    mean, shorter = WAYS[2], WAYS[1]
    lines = []
    for name, (what, form) in TOLD.items():
        if not form:
            continue
        line: dict[str, Any] = {"what": what}
        for way, fine in zip((OWN, mean), FINE, strict=True):
            value = rows[way.name][name]
            line[way.name] = format(value, form)
            line[fine.name] = format(rows[fine.name][name] - value, f"+{form}")
        line["noise"] = format(rows[shorter.name][name] - rows[OWN.name][name], f"+{form}")
        line["apart"] = format(rows[OWN.name][name] - rows[mean.name][name], f"+{form}")
        lines.append(line)
    head = {"what": "slab1200/slab, from"}
    for way, fine, size in zip((OWN, mean), FINE, FINER, strict=True):
        head |= {way.name: way.name, fine.name: f"more with cells of {size:g} mm"}
    head |= {"noise": "own mould, more with windows 1 % shorter", "apart": "own less mean"}
    output.insert("slab downstream cells", table(lines, head, {}))
