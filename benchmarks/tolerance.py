"""Tolerance of the mechanics: Newton iterations, time and error of three cases.

Errors are those of the equations alone, against a tolerance of 1e-10 with the same cells and
windows; those of cells and windows are in docs/billet.md and docs/slab_error.md.

    python -m benchmarks tolerance
"""

from __future__ import annotations

from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

from mpi4py import MPI

from benchmarks.report import Output
from castfem.model import load_case, shipped_cases
from castfem.runs import loop

CASES = {
    "billet125/taper_1": "600 mm", "billet125/taper_0": "600 mm",
    "billet180/peritectic": "300 mm", "slab1200/slab": "5 m",
}  # fmt: skip
"""Case and length of strand."""
TOLERANCES = (1e-8, 1e-6, 1e-5, 1e-4, 1e-3)
EXACT = 1e-10
SHOWN = {
    "heat": "heat_removed", "stress": "way_von_mises_max", "strain": "axial_strain",
    "gap": "mould_gap_max", "pressure": "contact_pressure_max", "index": "way_I1_max",
}  # fmt: skip


def run(name: str, length: str, tolerance: float) -> dict[str, Any]:
    """Run a case; return its results, Newton iterations of the mechanics and processor time, s."""
    keys = (
        "output.fields=[]", "output.figures=false", "output.checkpoint_every=0",
        f'casting.length="{length}"', f"mechanics.tolerance={tolerance}",
    )  # fmt: skip
    case = load_case(shipped_cases.find(name), keys)
    with TemporaryDirectory() as folder:
        start = process_time()
        summary = loop.run(case, folder, comm=MPI.COMM_SELF)
        seconds = process_time() - start
    found = {key: summary.quantities.get(name) for key, name in SHOWN.items()}
    values = {key: None if q is None else q.value for key, q in found.items()}
    return values | {
        "newton": summary.steps["Newton iterations, mechanics"], "seconds": seconds,
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Run all cases with all tolerances; write data and table."""
    rows = []
    for name, length in list(CASES.items())[: 1 if quick else None]:
        length = "60 mm" if quick else length
        exact = run(name, length, EXACT)
        for tolerance in TOLERANCES:
            found = run(name, length, tolerance)
            errors = {key: _error(found[key], exact[key]) for key in SHOWN}
            rows.append({"case": name, "tolerance": tolerance, **errors,
                         "newton": found["newton"], "seconds": found["seconds"]})  # fmt: skip
            print(f"  {rows[-1]}", flush=True)
    for row in rows:
        first = next(r for r in rows if r["case"] == row["case"])
        row["time"] = row["seconds"] / first["seconds"]
    output.csv("tolerance", rows)
    show(output)


def _error(value: float | None, exact: float | None) -> float | None:
    """Return the relative error; None without a value, or if the exact value is zero."""
    return None if value is None or not exact else abs(value / exact - 1.0)


def show(output: Output) -> None:
    """Write the table from the data."""
    head = {
        "case": "case", "tolerance": ("tolerance", "g"), "newton": "Newton iterations",
        "time": ("time, of that at 1e-8", ".2f"), "heat": ("error: heat", ".0e"),
        "stress": ("largest stress", ".0e"), "strain": ("axial strain", ".0e"),
        "gap": ("largest gap", ".0e"), "pressure": ("contact pressure", ".0e"),
        "index": ("index I1", ".0e"),
    }  # fmt: skip
    output.table("tolerance", output.rows("tolerance"), head)
