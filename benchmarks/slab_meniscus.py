"""The slab from the meniscus in one run: what its mould's history changes downstream.

Runs cases/slab1200/from_meniscus.toml, the same with one thing changed at a time, and slab.toml,
which begins at the mould's exit after a mean coefficient, on the same cells. Into
results/benchmarks/slab_meniscus (what is finished there is not repeated). What decides the corner
at the mould's exit is followed to there alone: what fills the gap, the taper, windows and cells.
Writes tables of docs/slab_heat.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output, table
from benchmarks.slab_bending import found
from castfem.model import Case, load_case
from castfem.model.load import from_document

CASES = ROOT / "cases" / "slab1200"
FOLDER = ROOT / "results" / "benchmarks" / "slab_meniscus"
QUIET = ("output.fields=[]", "output.figures=false")
EXIT = 0.8  # m
TO_EXIT = (f"casting.length={EXIT} m",)
GAS = ("cooling.mould.contact.gap_conductivity=0.15 W/(m K)",)
ACROSS = {"law": "radiation", "ambient": "160 degC"}
BENDER, LAST = 8, 62  # rolls: at which bending begins; to which it is followed


@dataclass(frozen=True)
class Way:
    """One way for the slab to come to its rolls."""

    name: str  #: in the table
    keys: tuple[str, ...] = ()  #: of the case
    case: str = "from_meniscus"  #: which it changes
    radiates: bool = False  #: whether heat crosses the gap by radiation, too


SHIPPED = Way("flux in the gap")
WAYS = (
    SHIPPED,
    Way("windows 1 % shorter", ("coupling.interval=49.5 mm",)),
    Way("no rolls at the narrow faces", (f"machine.rolls={CASES / 'rolls.csv'}",)),
    Way("gas in the gap", GAS, radiates=True),
    Way("mean coefficient", ("mesh.corner_size=5 mm",), "slab"),
)
CORNERS = (
    Way("mean coefficient: no gap", ("mesh.corner_size=5 mm",), "thermal_slab"),
    Way("gas by conduction alone", GAS),
    Way("gas and radiation", GAS, radiates=True),
    Way("mould flux as shipped"),
    Way("the same without taper", ("mould.taper=0 %/m",)),
    Way("narrow faces by 2 %/m", ("mould.taper.narrow_face=2 %/m",)),
    Way("all faces by 2 %/m", ("mould.taper=2 %/m",)),
    Way("shipped with windows of 25 mm", ("coupling.interval=25 mm",)),
    Way("shipped with cells of 2.5 mm", ("mesh.surface_size=2.5 mm", "mesh.corner_size=2.5 mm")),
)
TOLD = {
    "warm_exit": ("corner at the mould's exit, degC", ".0f"),
    "warm": ("corner at #8, degC", ".0f"),
    "shell": ("its shell there, along the diagonal, mm", ".1f"),
    "before": ("axial stress of the extrados corner there, MPa", ".1f"),
    "bending_I1": ("I1 in bending, MPa", ".1f"),
    "bending_I2": ("I2 in bending, 1e-5 1/s", ".1f"),
    "straightening_stress": ("stress of the intrados corner in straightening, MPa", ".1f"),
    "straightening_I1": ("I1 in straightening, MPa", ".1f"),
    "straightening_I2": ("I2 in straightening, 1e-5 1/s", ".1f"),
    "bulged": ("narrow face, furthest out since the mould, mm", ".2f"),
    "edges": ("largest force of its rolls, kN/m", ".1f"),
    "width": ("width of the slab at #62, mm", ".1f"),
    "heat": ("heat removed to #62, MJ/m", ".1f"),
}
AT_EXIT = {
    "corner": ("corner, degC", ".0f"),
    "narrow": ("narrow face, degC", ".0f"),
    "wide": ("wide face, degC", ".0f"),
    "shell": ("shell at the corner, along the diagonal, mm", ".1f"),
    "gap": ("largest gap, mm", ".2f"),
    "heat": ("heat removed, MJ/m", ".1f"),
}


def main(output: Output, quick: bool) -> None:
    """All ways, each in its turn; what is known is written after each."""
    folder = output.folder if quick else FOLDER
    short = ("casting.length=0.9 m", "mesh.corner_size=20 mm", "coupling.interval=100 mm")
    for name, row, ways in (
        ("slab_meniscus_corner", _at_exit, CORNERS[3:4] if quick else CORNERS),
        ("slab_meniscus_way", _row, WAYS[:1] if quick else WAYS),
    ):
        rows: list[dict[str, Any]] = []
        for way in ways:
            end = short if quick else TO_EXIT if row is _at_exit else ()
            case = case_of(way, end)
            rows.append(row(way, case, folder / name / str(len(rows))))
            print(f"  {way.name}: {rows[-1]['failure'] or 'finished'}", flush=True)
            output.csv(name, rows)
    show(output)


def case_of(way: Way, further: tuple[str, ...] = ()) -> Case:
    """The case of a way; that of the temperature alone is the slab without mechanics."""
    thermal = way.case == "thermal_slab"
    name = "slab" if thermal else way.case
    keys = (*QUIET, *way.keys, *further, *(("casting.start.at=meniscus",) if thermal else ()))
    case = load_case(CASES / f"{name}.toml", keys)
    document = case.document()
    if thermal:
        for table_ in ("mechanics", "quality", "coupling"):
            document.pop(table_, None)
        document["machine"].pop("extraction", None)
        document["reference"] = []
    if way.radiates:
        document["cooling"][0]["surface"].append(ACROSS)
    return from_document(document)


def _at_exit(way: Way, case: Case, folder: Path) -> dict[str, Any]:
    """Run a way to the mould's exit, unless it is finished, and read what is told there."""
    run = finished_run(case, folder)
    values = {name: one.value for name, one in run.summary.quantities.items()}
    told = {
        "corner": values["surface_temperature_corner_intrados"] - 273.15,
        "narrow": values["surface_temperature_narrow_face"] - 273.15,
        "wide": values["surface_temperature_mid_face_intrados"] - 273.15,
        "shell": 1e3 * values["shell_corner_intrados"],
        "gap": 1e3 * values["gap_max"] if "gap_max" in values else None,
        "heat": 1e-6 * values["heat_removed"],
    }
    none = dict.fromkeys(told)
    return {"name": way.name, "failure": run.failure} | (none if run.failure else told)


def _row(way: Way, case: Case, folder: Path) -> dict[str, Any]:
    """Run a way down its caster, unless it is finished, and read what is told of it."""
    run = finished_run(case, folder)
    assert case.machine is not None
    rolls, history = case.machine.pairs(), run.history
    assert rolls is not None
    places = np.array([pair.position for pair in rolls.pairs])
    at = history["position"].to_numpy()

    def there(position: float, column: str) -> float | None:
        reached = at[0] <= position <= at[-1]
        return float(np.interp(position, at, history[column].to_numpy())) if reached else None

    row = found(history, run.summary, places)
    bender = float(places[BENDER - 1])
    values = {name: one.value for name, one in run.summary.quantities.items()}
    out = history["displacement_narrow_face"].to_numpy()[at > EXIT - 1e-6]
    force = history.get("edge_roll_force")
    ends = at[-1] > places[LAST - 1] - 1e-3
    return {"name": way.name, "failure": run.failure} | {name: row.get(name) for name in TOLD} | {
        "warm_exit": there(EXIT, "surface_temperature_corner_intrados"),
        "warm": there(bender, "surface_temperature_corner_intrados"),
        "shell": there(bender, "shell_corner_intrados"),
        "before": there(bender - 1e-3, "axial_stress_corner_extrados"),
        "bulged": float(np.nanmax(out) - out[0]),
        "edges": None if force is None else float(force.max()),
        "width": 1e3 * values["size_narrow_face"] if ends else None,
        "heat": values["heat_removed"] / 1e6 if ends else None,
    }  # fmt: skip


def show(output: Output) -> None:
    """The tables, from the data."""
    rows = output.rows("slab_meniscus_corner")
    if rows:
        head = {"name": "in the gap of slab1200/from_meniscus"}
        output.table("slab meniscus corner", rows, head | AT_EXIT)
    rows = output.rows("slab_meniscus_way")
    if not rows:
        return
    lines = []
    for name, (what, form) in TOLD.items():
        line: dict[str, Any] = {"what": what}
        for row in rows:
            value = row[name]
            line[row["name"]] = "" if value is None else format(value, form)
        lines.append(line)
    heads = {"what": "slab1200/from_meniscus, with"} | {row["name"]: row["name"] for row in rows}
    output.insert("slab meniscus way", table(lines, heads, {}))
