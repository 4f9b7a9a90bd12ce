"""What the iron-carbon diagram of a steel changes: shipped cases with curves and straight lines.

Writes a table of docs/materials.md; its runs are kept in results/diagrams.
"""

from __future__ import annotations

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output
from castfem.base.units import convert
from castfem.model import load_case
from castfem.model.shipped_cases import find

DIAGRAMS = ("pascon", "assessed")
RESULTS = {
    "billet180/peritectic": {
        "shell_mid_face": ("shell, mid-face", "mm"),
        "shell_corner": ("shell, corner", "mm"),
        "surface_temperature_mid_face": ("surface, mid-face", "degC"),
        "surface_temperature_corner": ("surface, corner", "degC"),
        "heat_removed": ("heat removed per m", "MJ/m"),
        "gap_corner": ("gap, corner", "mm"),
        "von_mises_max": ("largest von Mises stress", "MPa"),
    },
    "slab1200/thermal": {
        "surface_temperature_mid_face_intrados": ("surface, mid-face", "degC"),
        "heat_removed": ("heat removed per m", "MJ/m"),
        "liquid_end": ("end of the liquid", "m"),
        "metallurgical_length": ("metallurgical length", "m"),
    },
}
"""By case the results that are told, at its end: label and unit by name."""


def main(output: Output, quick: bool) -> None:
    """Run the cases with each diagram."""
    rows = []
    for case, results in list(RESULTS.items())[: 1 if quick else None]:
        found = {}
        for diagram in DIAGRAMS:
            changes = [f"steel.diagram={diagram}", "output.figures=false"]
            if quick:
                changes += ["casting.length=20 mm", "output.fields=[]"]
            loaded = load_case(find(case), changes)
            runs = (output.folder if quick else ROOT / "results") / "diagrams"
            run = finished_run(loaded, runs / f"{case.replace('/', '_')}_{diagram}")
            found[diagram] = run.summary.quantities
        for name, (label, unit) in results.items():
            values = {d: convert(found[d][name].value, found[d][name].unit, unit) for d in DIAGRAMS}
            rows.append({"case": case, "result": label, "unit": unit, **values})
    output.csv("diagrams", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "case": "case", "result": "at the end of the run", "unit": "unit",
        "pascon": ("`pascon`", ".4g"), "assessed": ("`assessed`", ".4g"),
    }  # fmt: skip
    output.table("diagrams", output.rows("diagrams"), head)
