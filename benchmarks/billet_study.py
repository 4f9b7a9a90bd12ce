"""The billet of thesis V.2 in its six moulds, beside the thesis.

Writes a table of docs/billet.md. All runs are those of `cases/billet125`, run in memory, one at
a time.
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
    """The numbers of the thesis that its case holds, in the units of the tables."""
    found = {}
    for reference in load_case(CASES / f"{mould}.toml").reference:
        found[reference.quantity] = from_si(reference.si, reference.unit)
    return found


SIGNS = {"value": "", "at_least": "> ", "at_most": "< "}


def signs(mould: str) -> dict[str, str]:
    """What stands before the numbers of `thesis`: nothing, or the sign of a bound."""
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


OF_THE_TEXT = {
    "first_solid": 60.0,
    "closed_solid": 85.0,
    "taper_mid_face": -0.53,
    "taper_corner": 0.57,
}
"""What V.2.1 says of the idealised mould beyond the exit, as MORE has it."""


FACES = {"taper_1": "8 to 10", "taper_3": "10 to 12"}
"""Stress along the faces, MPa, as V.2.2.3 gives it."""


def at_the_exit(found: Found, ideal: Found | None) -> dict[str, Any]:
    """What the tables of moulds show of a run; its heat also as a share of the ideal mould's."""
    values: dict[str, Any] = dict(found.values)
    if ideal is not None:
        values["share"] = 100.0 * values["heat_removed"] / ideal.values["heat_removed"]
    values["axial_strain"] *= 100.0
    values["taper_mid_face"] = 100.0 * (125.0 / values["size_mid_face"] - 1.0) / 0.6
    values |= {"newton": found.newton, "seconds": found.seconds}
    return {k: values.get(k) for k in (*SHOWN, *MORE)}


def moulds(output: Output, changes: Sequence[str]) -> None:
    """The six moulds at the shipped defaults, beside the thesis."""
    found = {name: run(name, changes) for name in MOULDS}
    ideal = found["idealised"]
    rows = [{"mould": NAMES[n], **at_the_exit(one, ideal)} for n, one in found.items()]
    output.csv("billet_moulds", rows)


def told(mould: str) -> dict[str, str]:
    """What the thesis says of a mould, as the tables write it."""
    before, found = signs(mould), thesis(mould)
    if mould == "idealised":
        found |= OF_THE_TEXT
    words = {}
    for key, value in found.items():
        said = format(value, ".4g" if key not in ("size_corner",) else ".2f")
        sign = before.get(key, "")
        words[key] = "0" if sign == "< " and value == 0.0 else sign + said
    if "von_mises_mid_face" in words:
        words["von_mises_mid_face"] = FACES[mould]
    return words


def show(output: Output) -> None:
    """The six moulds beside the thesis, from the data."""
    rows = output.rows("billet_moulds")
    expected = {name: told(name) for name in MOULDS}
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
    """The six moulds."""
    moulds(output, COARSE if quick else ())
    show(output)
