"""Errors of the shipped cases that have a closed-form solution.

Writes the table of docs/verification.md.
"""

from __future__ import annotations

from typing import Any

import castfem
from benchmarks.report import ROOT, Output
from castfem.runs.output.summary_file import Summary

CASES = ROOT / "cases" / "verification"
NAMES = ("alloy_similarity", "neumann", "weiner_boley_coarse", "weiner_boley")
BEGUN = {"weiner_boley, to 84 mm": ("weiner_boley", "84 mm")}  # quick to run again: 5 of 21 s
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
    """Return errors of a finished run in the units of the table; None for missing numbers."""
    found = {n: q.shown for n, q in summary.quantities.items()}
    off = {c.reference.quantity: c.shown_difference for c in summary.references}
    return {"case": name, **{key: off.get(key, found.get(key)) for key in SHOWN}} | {
        key: None for key in ("liquidus_depth_mid_face",) if key not in off
    }


def case_of(name: str) -> castfem.Case:
    """Return the case of a row: a shipped case, or its first part."""
    file, length = BEGUN.get(name, (name, None))
    case = castfem.load(CASES / f"{file}.toml")
    return case if length is None else case.with_({"casting.length": length})


def main(output: Output, quick: bool) -> None:
    """Run all cases; write data and table."""
    rows = []
    for name in NAMES[::2] if quick else (*NAMES, *BEGUN):
        case = case_of(name).with_(fields=[])
        if quick:
            case = case.with_({"casting.length": "20 mm"})
        with castfem.run(case) as result:
            rows.append(row_of(name, result.summary))
        print(f"  {rows[-1]}", flush=True)
    output.csv("verification", rows)
    show(output)


def _parted(name: str) -> tuple[str, str]:
    """Split the name of a row into its file and the remainder."""
    file, comma, length = name.partition(",")
    return file, comma + length


def show(output: Output) -> None:
    """Write the table from the data."""
    rows = output.rows("verification")
    shown = [row | {"case": "`verification/{}`{}".format(*_parted(row["case"]))} for row in rows]
    forms = {key: FORMS.get(key, "+.2g") for key in SHOWN}
    head = {"case": "case"} | {key: (text, forms[key]) for key, text in SHOWN.items()}
    output.table("verification", shown, head)
