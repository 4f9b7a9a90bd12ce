"""The slab at and beyond the edge of the model: which cases end, where, and which run through.

Each is cases/slab1200/slab.toml on coarse cells (10 to 40 mm, windows of 200 mm) with one change.
Into results/benchmarks/slab_extremes (what is finished there is not repeated). Writes a table of
docs/slab_limits.md.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import ROOT, Output, table
from castfem.base.errors import RunFailure
from castfem.model import Case, load_case
from castfem.model.load import from_document
from castfem.runs import loop
from castfem.runs.output.history import read_history
from castfem.runs.output.summary import Summary

CASE = ROOT / "cases" / "slab1200" / "slab.toml"
FOLDER = ROOT / "results" / "benchmarks" / "slab_extremes"
KEYS = (
    "mesh.surface_size=10 mm", "mesh.corner_size=10 mm", "mesh.face_size=80 mm",
    "mesh.core_size=40 mm", "coupling.interval=200 mm", "casting.length=6 m",
    "output.figures=false", "output.fields=[]",
)  # fmt: skip
FAR, BENDER = "casting.length=18 m", "casting.length=5 m"
Document = dict[str, Any]


def defect(**given: object) -> Callable[[Document], None]:
    """A defect of the machine."""

    def changed(document: Document) -> None:
        document["machine"]["defect"] = [given]

    return changed


def speed(*points: tuple[float, float]) -> Callable[[Document], None]:
    """A casting speed over time, s and m/min."""
    time, value = zip(*points, strict=True)

    def changed(document: Document) -> None:
        table = {"time": list(time), "time_unit": "s", "value": list(value), "unit": "m/min"}
        document["casting"]["speed"] = table

    return changed


def without_water(faces: tuple[str, ...]) -> Callable[[Document], None]:
    """No water on some faces from #8 to #15, 2 m: there the steel loses next to nothing."""

    def changed(document: Document) -> None:
        zone = next(one for one in document["cooling"] if one["name"] == "bender")
        spray = next(one for one in zone["surface"] if one["law"] == "convection")
        wet = [one for one in spray["on"] if one not in faces]
        dry = spray | {"on": list(faces), "coefficient": "5 W/(m^2 K)"}
        zone["surface"] = [one for one in zone["surface"] if one is not spray] + [dry]
        if wet:
            zone["surface"].append(spray | {"on": wet})

    return changed


def machine(places: np.ndarray, radii: list[str] | None = None) -> Callable[[Document], None]:
    """Rolls of 130 mm at positions, m, whose drives are left out."""

    def changed(document: Document) -> None:
        pairs = {"position": [f"{z:.4f} m" for z in places], "diameter": ["130 mm"] * len(places)}
        if radii is not None:
            pairs["radius_extrados"] = radii
        document["machine"] = {"rolls": pairs}
        planes = document["mechanics"].get("planes", {})
        planes.pop("force_contains_bending", None)

    return changed


def _tight() -> Callable[[Document], None]:
    """R = 3 m: 1/R linear from 2.2 to 3.7 m."""
    places = 0.87 + 0.2 * np.arange(40)
    bent = np.clip((places - 2.2) / 1.5, 0.0, 1.0) / 3.0
    return machine(places, ["inf" if not k else f"{1.0 / k:.5f} m" for k in bent])


@dataclass(frozen=True)
class Extreme:
    """A case.

    Attributes:
        name: In the table. keys: Of the case. change: Of its document, besides.
    """

    name: str
    keys: tuple[str, ...] = ()
    change: Callable[[Document], None] | None = None


WIDE = ("wide_face_intrados", "wide_face_extrados")
NARROW = 'mechanics.held=[{ on = ["narrow_face"], component = "x" }]'
LONG_PITCH = np.array([0.87, 1.05, 1.25, 1.45, 3.45, 3.7, 4.0, 6.5])
STOP = ((0.0, 1.2), (100.0, 1.2), (101.0, 0.0), (161.0, 0.0), (162.0, 1.2))
EXTREMES = (
    Extreme("as it is"),
    Extreme("three times the speed", ("casting.speed=3.6 m/min",)),
    Extreme("the same, narrow faces held", ("casting.speed=3.6 m/min", NARROW)),
    Extreme("1.5 times the speed", ("casting.speed=1.8 m/min",)),
    Extreme("a quarter of the speed", ("casting.speed=0.3 m/min",)),
    Extreme("a tenth, solid before the bender", ("casting.speed=0.12 m/min",)),
    Extreme("a stop of 60 s", (), speed(*STOP)),
    Extreme("2 m without water", (), without_water(WIDE)),
    Extreme("2 m without water, one face", (), without_water(WIDE[1:])),
    Extreme("a pitch of 2 m", (), machine(LONG_PITCH)),
    Extreme("R = 3 m", (), _tight()),
    Extreme("60 mm thick", ("section.height=60 mm", "mesh.core_size=15 mm",
                            "mesh.core_depth=12 mm")),
    Extreme("400 mm thick", ("section.height=400 mm",)),
    Extreme("400 mm thick, narrow faces held", ("section.height=400 mm", NARROW)),
    Extreme("600 mm wide", ("section.width=600 mm",)),
    Extreme("2600 mm wide", ("section.width=2600 mm",)),
    Extreme("coherency of 0.5", ("mechanics.coherency=0.5", "mechanics.mush=geometric")),
    Extreme("coherency of 0.9", ("mechanics.coherency=0.9", "mechanics.mush=geometric")),
    Extreme("liquid of 1e-3", ("mechanics.liquid_stiffness=1e-3",)),
    Extreme("liquid of 1e-7", ("mechanics.liquid_stiffness=1e-7",)),
    Extreme("windows of 1 m", ("coupling.interval=1 m",)),
    Extreme("#9 lost", (BENDER,), defect(kind="lost", roll=9)),
    Extreme("#12 lost", (BENDER,), defect(kind="lost", roll=12)),
    Extreme("#15 lost", (BENDER,), defect(kind="lost", roll=15)),
    Extreme("#53 lost", (FAR,), defect(kind="lost", roll=53)),
    Extreme("#12 off by 10 mm", (), defect(kind="misaligned", roll=12, by="10 mm")),
    Extreme("#48 off by 10 mm", (FAR,), defect(kind="misaligned", roll=48, by="10 mm")),
    Extreme("pool ends in the straightener", (FAR, "casting.speed=0.85 m/min")),
)  # fmt: skip


def case_of(extreme: Extreme) -> Case:
    """The case of an extreme."""
    case = load_case(CASE, (*KEYS, *extreme.keys))
    if extreme.change is None:
        return case
    document = case.document()
    extreme.change(document)
    return from_document(document)


def _row(extreme: Extreme, folder: Path) -> dict[str, Any]:
    """Run a case, unless that is done, and tell how it went."""
    summary, failure = Summary.load(folder), ""
    if summary is None or summary.status != "finished":
        try:
            summary = loop.run(case_of(extreme), folder, comm=MPI.COMM_SELF, resume=folder.exists())
        except RunFailure as error:
            failure = str(error)
    history = read_history(folder / "history.csv")
    told = failure.partition(": ")[2].partition(";")[0].partition(". That")[0]
    swollen = re.search(r"bulge by ([\d.]+) mm", told)
    return {
        "name": extreme.name,
        "to": float(history["position"].iloc[-1]),
        "end": told or "runs through",
        "swollen": None if swollen is None else float(swollen[1]),
        "bulge": float(history["bulge_pitch"].max()),
    }


def main(output: Output, quick: bool) -> None:
    """All of them, each in its turn."""
    folder = output.folder if quick else FOLDER
    rows = []
    for extreme in EXTREMES[:1] if quick else EXTREMES:
        rows.append(_row(extreme, folder / re.sub(r"\W+", "_", extreme.name)))
        print(f"  {extreme.name}: {rows[-1]['to']:.2f} m, {rows[-1]['end']}", flush=True)
    output.csv("slab_extremes", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {"name": "slab1200/slab, coarse", "to": "comes to, m", "end": "how it ends",
            "bulge": "largest bulge, mm"}  # fmt: skip
    if rows := output.rows("slab_extremes"):
        output.insert("slab extremes", table(rows, head, {"to": ".2f", "bulge": ".2f"}))
