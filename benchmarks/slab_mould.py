"""The slab at its mould's exit: by a mean coefficient alone, and cast through a tapered mould.

The first is how `casting.start.at = "mould_exit"` begins; the second has a gap where the shell
leaves the wall, and stresses.  Heat crosses that gap by conduction and radiation; by conduction
alone hardly any does where the corner is millimetres off the wall.  What this means for the corner
on finer cells is a second table.  Runs into results/benchmarks/slab_mould (what is finished there
is not repeated).  Writes tables of docs/slab_heat.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output, table
from castfem.model import Case, load_case
from castfem.model.load import from_document

CASE = ROOT / "cases" / "slab1200" / "base.toml"
FOLDER = ROOT / "results" / "benchmarks" / "slab_mould"
CELLS = (
    "mesh.face_size=40 mm", "mesh.core_size=24 mm", "mesh.core_depth=60 mm",
    "casting.length=800 mm",
    "output.figures=false", "output.fields=[]",
)  # fmt: skip
TAPER = {"narrow_face": "1 %/m", "wide_face": "0.3 %/m"}


BY_CELLS = {
    "heat_removed": ("heat, MJ/m", 1e-6, ".1f", 0.0),
    "shell_corner_intrados": ("corner's shell, mm", 1e3, ".1f", 0.0),
    "surface_temperature_corner_intrados": ("surface, degC", 1.0, ".0f", -273.15),
    "gap_max": ("gap, mm", 1e3, ".2f", 0.0),
}
"""Of the second table: heading, factor, form and what is added."""


@dataclass(frozen=True)
class Way:
    """One way through the mould.

    Attributes:
        name: In the table. window: Coupling window, mm; None for temperature alone.
        radiates: Whether heat crosses the gap by radiation, too. cell: At the surface, mm.
    """

    name: str
    window: float | None = 50.0
    radiates: bool = True
    cell: float = 5.0


WAYS = (
    Way("mean coefficient", window=None),
    Way("tapered mould"),
    Way("windows of 25 mm", window=25.0),
    Way("by conduction alone", radiates=False),
)
SIZES = (10.0, 7.5, 5.0, 4.0, 3.5, 3.0)  # mm
CELLS_WAYS = tuple(
    Way(f"{size:g} mm{'' if radiates else ', by conduction alone'}", cell=size, radiates=radiates)
    for radiates in (True, False)
    for size in SIZES
)
ACROSS = {"law": "radiation", "ambient": "160 degC"}
"""What crosses the gap beside conduction, by the steel's emissivity."""
TOLD = {
    "heat_removed": ("heat removed, MJ/m", 1e-6, ".1f"),
    "shell_mid_face_intrados": ("shell, mid-face, mm", 1e3, ".1f"),
    "shell_narrow_face": ("narrow face", 1e3, ".1f"),
    "shell_corner_intrados": ("corner, along its diagonal", 1e3, ".1f"),
    "surface_temperature_mid_face_intrados": ("surface, mid-face, degC", 1.0, ".0f"),
    "surface_temperature_narrow_face": ("narrow face", 1.0, ".0f"),
    "surface_temperature_corner_intrados": ("corner", 1.0, ".0f"),
    "gap_max": ("largest gap, mm", 1e3, ".2f"),
    "axial_strain": ("axial strain, %", 1e2, ".2f"),
    "axial_stress_mid_face_intrados": ("axial stress, mid-face, MPa", 1e-6, ".1f"),
    "axial_stress_corner_intrados": ("corner", 1e-6, ".1f"),
    "size_narrow_face": ("width, mm", 1e3, ".1f"),
    "size_mid_face_intrados": ("thickness, mm", 1e3, ".1f"),
}


def case_of(way: Way, further: tuple[str, ...] = ()) -> Case:
    """The case of a way."""
    cells = [f"mesh.{place}_size={way.cell:g} mm" for place in ("surface", "corner")]
    document = load_case(CASE, (*CELLS, *cells, *further)).document()
    document["cooling"] = document["cooling"][:1]
    if way.window is not None:
        document["cooling"][0]["surface"][0]["gap_conductivity"] = "0.15 W/(m K)"
        if way.radiates:
            document["cooling"][0]["surface"].append(ACROSS)
        document["mould"] = {"length": document["casting"]["length"], "taper": TAPER}
        document["mechanics"] = {
            "law": "kozlowski_zhu_signed", "liquid": "fed", "ferrostatic": "full",
        }  # fmt: skip
        document["coupling"] = {"interval": f"{way.window:g} mm"}
    return from_document(document)


def main(output: Output, quick: bool) -> None:
    """All ways, and the corner on all cells."""
    further = ("casting.length=100 mm", "mesh.surface_size=10 mm") if quick else ()
    folder = output.folder if quick else FOLDER
    for table_, ways in (("slab_mould", WAYS), ("slab_mould_cells", CELLS_WAYS)):
        rows: list[dict[str, Any]] = []
        for way in ways[:2] if quick else ways:
            rows.append(_row(way, case_of(way, further), folder / f"{table_}_{len(rows)}"))
            print(f"  {way.name}: {rows[-1]['failure'] or 'finished'}", flush=True)
            output.csv(table_, rows)
    show(output)


def _row(way: Way, case: Case, folder: Path) -> dict[str, Any]:
    """Run a way, unless it is finished, and read what is told of it at the mould's exit."""
    summary, failure = finished_run(case, folder)
    found = {} if failure else summary.quantities
    told = {name: found[name].value if name in found else None for name in TOLD}
    return {"name": way.name, "failure": failure} | told


def show(output: Output) -> None:
    """The tables, from the data."""
    _show_cells(output)
    rows = output.rows("slab_mould")
    if not rows:
        return
    lines = []
    for name, (what, scale, form) in TOLD.items():
        line: dict[str, Any] = {"what": what}
        for row in rows:
            value = row[name]
            shift = -273.15 if name.startswith("surface_temperature") else 0.0
            line[row["name"]] = None if value is None else format(scale * value + shift, form)
        lines.append(line)
    head = {"what": "slab1200 at the mould's exit"} | {row["name"]: row["name"] for row in rows}
    output.insert("slab mould", table(lines, head, {}))


def _show_cells(output: Output) -> None:
    """The slab on finer and finer cells, with radiation and without."""
    rows = {row["name"]: row for row in output.rows("slab_mould_cells")}
    if not rows.keys() >= {way.name for way in CELLS_WAYS}:
        return
    lines, head = [], {"size": "cells, mm"}
    for size in SIZES:
        line: dict[str, Any] = {"size": f"{size:g}"}
        for way in CELLS_WAYS:
            if way.cell != size:
                continue
            for name, (what, scale, form, shift) in BY_CELLS.items():
                key, value = f"{name} {way.radiates}", rows[way.name][name]
                line[key] = "ends" if value is None else format(scale * value + shift, form)
                head[key] = what
        lines.append(line)
    for radiates, how in ((True, "with radiation"), (False, "by conduction alone")):
        head[f"{next(iter(BY_CELLS))} {radiates}"] += f", {how}"
    output.insert("slab mould cells", table(lines, head, {}))
