"""The shipped cases with a closed form, run as they are: how far off they end.

Writes the table of docs/verification.md.
"""

from __future__ import annotations

from typing import Any

import castfem
from benchmarks.report import ROOT, Output, table
from castfem.output.summary import Summary

CASES = ROOT / "cases" / "verification"
NAMES = ("alloy_similarity", "neumann", "weiner_boley_coarse", "weiner_boley")
SHOWN = {
    "error_temperature": "temperature, rms [mK]",
    "error_temperature_max": "temperature, worst [mK]",
    "error_stress": "stress, rms [% of 20 MPa]",
    "shell_mid_face": "solidus [mm]",
    "liquidus_depth_mid_face": "liquidus [mm]",
    "heat_flux_mid_face": "heat flux [kW/m²]",
}
FORMS = {"error_temperature": ".3g", "error_temperature_max": ".3g", "error_stress": ".2f"}


def row_of(name: str, summary: Summary) -> dict[str, Any]:
    """Errors of a finished run in the units of the table; None where it has no such number."""
    found = {n: q.shown for n, q in summary.quantities.items()}
    off = {c.reference.quantity: c.shown_difference for c in summary.references}
    return {"case": name, **{key: off.get(key, found.get(key)) for key in SHOWN}} | {
        key: None for key in ("liquidus_depth_mid_face",) if key not in off
    }


def main(output: Output, quick: bool) -> None:
    """Run them all."""
    rows = []
    for name in NAMES[::2] if quick else NAMES:
        case = castfem.load(CASES / f"{name}.toml").with_(fields=[])
        if quick:
            case = case.with_(length="20 mm")
        with castfem.run(case) as result:
            rows.append(row_of(name, result.summary))
        print(f"  {rows[-1]}", flush=True)
    output.csv("verification", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("verification")
    signs = dict.fromkeys(list(SHOWN)[3:], "+.2g")
    shown = [row | {"case": f"`verification/{row['case']}`"} for row in rows]
    output.insert("verification", table(shown, {"case": "case", **SHOWN}, FORMS | signs))
