"""The slab at its mould's exit: by a mean coefficient alone, and cast through a tapered mould.

The first is how `casting.start.at = "mould_exit"` begins; the second has a gap where the shell
leaves the wall, and stresses.  Runs into results/benchmarks/slab_mould (what is finished there is
not repeated).  Writes a table of docs/slab_heat.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

from benchmarks.report import ROOT, Output, table
from castfem.case import Case, load_case
from castfem.case.load import from_document
from castfem.output.summary import Summary
from castfem.time_loop import loop

CASE = ROOT / "cases" / "slab1200" / "base.toml"
FOLDER = ROOT / "results" / "benchmarks" / "slab_mould"
CELLS = (
    "mesh.surface_size=5 mm", "mesh.corner_size=5 mm", "mesh.face_size=40 mm",
    "mesh.core_size=24 mm", "mesh.core_depth=60 mm", "casting.length=800 mm",
    "output.figures=false", "output.fields=[]",
)  # fmt: skip
TAPER = {"narrow_face": "1 %/m", "wide_face": "0.3 %/m"}


@dataclass(frozen=True)
class Way:
    """One way through the mould.

    Attributes:
        name: In the table and of its folder. coefficient: In contact, W/(m2 K).
        window: Coupling window, mm; None for temperature alone.
    """

    name: str
    coefficient: float
    window: float | None = None


WAYS = (
    Way("mean coefficient", 1200.0),
    Way("tapered mould", 1200.0, 50.0),
    Way("windows of 25 mm", 1200.0, 25.0),
    Way("1450 W/(m2 K) in contact", 1450.0, 50.0),
)
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
    document = load_case(CASE, (*CELLS, *further)).document()
    document["cooling"] = document["cooling"][:1]
    contact = document["cooling"][0]["surface"][0]
    contact["coefficient"] = f"{way.coefficient:g} W/(m^2 K)"
    if way.window is not None:
        contact["gap_conductivity"] = "0.15 W/(m K)"
        document["mould"] = {"length": document["casting"]["length"], "taper": TAPER}
        document["mechanics"] = {
            "law": "kozlowski_zhu_signed", "liquid": "fed", "ferrostatic": "full",
        }  # fmt: skip
        document["coupling"] = {"interval": f"{way.window:g} mm"}
    return from_document(document)


def main(output: Output, quick: bool) -> None:
    """All ways, each in its turn."""
    further = ("casting.length=100 mm", "mesh.surface_size=10 mm") if quick else ()
    rows: list[dict[str, Any]] = []
    for number, way in enumerate(WAYS[:2] if quick else WAYS):
        folder = (output.folder if quick else FOLDER) / f"{number}"
        summary = Summary.load(folder)
        if summary is None or summary.status != "finished":
            summary = loop.run(case_of(way, further), folder, comm=MPI.COMM_SELF)
        found = {name: summary.quantities.get(name) for name in TOLD}
        rows.append(
            {"name": way.name} | {n: None if q is None else q.value for n, q in found.items()}
        )
        print(f"  {way.name}", flush=True)
        output.csv("slab_mould", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
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
