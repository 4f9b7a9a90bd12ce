"""The billet of thesis V.2 in its six moulds, compared with the thesis.

Writes a table of docs/billet.md. The cases of `cases/billet125` are run in memory, one at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.billet_run import CASES, COARSE, MOULDS, NAMES, SHOWN, Found, run
from benchmarks.report import Output, table
from castfem.base.shown_quantity import from_si
from castfem.model import load_case


def thesis(mould: str) -> dict[str, float]:
    """Return the thesis' numbers in the case of a mould, in the units of the tables."""
    references = load_case(CASES / f"{mould}.toml").reference
    return {reference.quantity: from_si(reference.si, reference.unit) for reference in references}


SIGNS = {"value": "", "at_least": "> ", "at_most": "< "}


def signs(mould: str) -> dict[str, str]:
    """Return the signs before the numbers of `thesis`: "", or that of a bound."""
    references = load_case(CASES / f"{mould}.toml").reference
    return {reference.quantity: SIGNS[reference.kind] for reference in references}


MORE = {
    "share": ("heat, % of idealised", ".1f"),
    "gap_max": ("largest gap [mm]", ".3f"),
    "lost": ("contact lost from [mm]", ".0f"),
    "first_mush": ("liquidus reached in the corner [mm]", ".0f"),
    "first_solid": ("first solid in the corner [mm]", ".0f"),
    "closed_mush": ("liquidus reached all round [mm]", ".0f"),
    "closed_solid": ("closed shell from [mm]", ".0f"),
    "taper_mid_face": ("taper of the width (302) [%/m]", ".2f"),
    "taper_corner": ("taper of the diagonal (303) [%/m]", ".2f"),
    "contact_share": ("surface in contact [%]", ".0f"),
    "contact_pressure_max": ("highest contact pressure [MPa]", ".2f"),
    "force": ("force of the wall on half a face [kN/m]", ".2f"),
    "axial_strain": ("axial strain [%]", ".3f"),
    "penetration": ("largest penetration [µm]", ".3f"),
    "newton": ("Newton iterations", "g"),
    "seconds": ("processor time [s]", ".0f"),
}


IN_THE_TEXT = {
    "first_solid": 60.0,
    "closed_solid": 85.0,
    "taper_mid_face": -0.53,
    "taper_corner": 0.57,
}
"""Numbers of the idealised mould in the text of V.2.1, in the units of MORE."""


FACES = {"taper_1": "8 to 10", "taper_3": "10 to 12"}
"""Range of the stress along the faces in V.2.2.3, MPa."""


def at_the_exit(found: Found, ideal: Found | None) -> dict[str, Any]:
    """Return the results of a run for the table; its heat also in % of the idealised mould's."""
    values: dict[str, Any] = dict(found.values)
    if ideal is not None:
        values["share"] = 100.0 * values["heat_removed"] / ideal.values["heat_removed"]
    values["axial_strain"] *= 100.0
    values["taper_mid_face"] = 100.0 * (125.0 / values["size_mid_face"] - 1.0) / 0.6
    values |= {"newton": found.newton, "seconds": found.seconds}
    return {k: values.get(k) for k in (*SHOWN, *MORE)}


def moulds(output: Output, changes: Sequence[str]) -> None:
    """Run the six moulds and write their results."""
    runs = {name: run(name, changes) for name in MOULDS}
    ideal = runs["idealised"]
    rows = [{"mould": NAMES[name], **at_the_exit(found, ideal)} for name, found in runs.items()]
    output.csv("billet_moulds", rows)


def thesis_cells(mould: str) -> dict[str, str]:
    """Return the thesis' numbers of a mould as text for the table."""
    before, numbers = signs(mould), thesis(mould)
    if mould == "idealised":
        numbers |= IN_THE_TEXT
    cells = {}
    for key, value in numbers.items():
        text = format(value, ".4g" if key not in ("size_corner",) else ".2f")
        sign = before.get(key, "")
        cells[key] = "0" if sign == "< " and value == 0.0 else sign + text
    if "von_mises_mid_face" in cells:
        cells["von_mises_mid_face"] = FACES[mould]
    return cells


def show(output: Output) -> None:
    """Write the table of the six moulds and the thesis from the data."""
    rows = output.rows("billet_moulds")
    expected = {name: thesis_cells(name) for name in MOULDS}
    lines = []
    for key, (label, form) in {**SHOWN, **MORE}.items():
        cells: dict[str, Any] = {"what": label}
        for name, row in zip(MOULDS, rows, strict=True):
            ours = row[key]
            text = "" if ours is None or not np.isfinite(ours) else format(ours, form)
            if key in expected[name]:
                text += f" ({expected[name][key]})"
            cells[name] = text
        lines.append(cells)
    output.insert("billet moulds", table(lines, {"what": "at the exit of the mould", **NAMES}, {}))


def main(output: Output, quick: bool) -> None:
    """Run the six moulds and write their table."""
    moulds(output, COARSE if quick else ())
    show(output)
