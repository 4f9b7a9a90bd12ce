"""The billet of thesis V.2 in its moulds: beside the thesis, and what its numbers hang on.

Writes tables of docs/billet.md. All runs are those of `cases/billet125`, run in memory, one at
a time.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.billet_inputs import variants
from benchmarks.billet_run import CASES, COARSE, MOULDS, NAMES, SHOWN, Found, every, mesh, run
from benchmarks.report import Output, table
from castfem.case import load_case
from castfem.output.summary import from_si

# (a) The six moulds.


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
    "newton": ("Newton iterations an interval", ".1f"),
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


def moulds(output: Output, changes: Sequence[str]) -> None:
    """The six moulds at the shipped defaults, beside the thesis."""
    found = {name: run(name, changes) for name in MOULDS}
    rows = []
    for name, one in found.items():
        values = dict(one.values)
        values["share"] = 100.0 * values["heat_removed"] / found["idealised"].values["heat_removed"]
        values["axial_strain"] = 100.0 * values["axial_strain"]
        values["taper_mid_face"] = 100.0 * (125.0 / values["size_mid_face"] - 1.0) / 0.6
        values |= {"newton": one.newton / 100.0, "seconds": one.seconds}
        rows.append({"mould": NAMES[name], **{k: values.get(k) for k in (*SHOWN, *MORE)}})
    output.csv("billet_moulds", rows)


def show_moulds(output: Output) -> None:
    """The six moulds beside the thesis, from the data."""
    rows = output.rows("billet_moulds")
    expected = {name: thesis(name) for name in MOULDS}
    expected["idealised"] |= OF_THE_TEXT
    before = {name: signs(name) for name in MOULDS}
    lines = []
    for key, (label, form) in {**SHOWN, **MORE}.items():
        cells: dict[str, Any] = {"what": label}
        for name, row in zip(MOULDS, rows, strict=True):
            ours = row[key]
            text = "" if ours is None or not np.isfinite(ours) else format(ours, form)
            theirs = expected[name].get(key)
            if theirs is not None:
                said = format(theirs, ".4g" if key not in ("size_corner",) else ".2f")
                sign = before[name].get(key, "")
                said = "0" if sign == "< " and theirs == 0.0 else sign + said
                if key == "von_mises_mid_face":
                    said = FACES[name]
                text += f" ({said})"
            cells[name] = text
        lines.append(cells)
    output.insert("billet moulds", table(lines, {"what": "at the exit of the mould", **NAMES}, {}))


# (b) What the numbers hang on.

STUDIED = ("idealised", "taper_3", "taper_1", "taper_0", "taper_minus_1")
LIQUID_ALONE = "taper_minus_1"  # where the wall goes away all hangs on how the strand follows it


def sensitivity(output: Output, quick: bool) -> None:
    """Change one input at a time, on a coarse mesh."""
    with tempfile.TemporaryDirectory() as name:
        chosen = variants(Path(name))
        for mould in STUDIED:
            base = run(mould, COARSE)
            rows = [{"input": "as shipped, coarse", **picked(base)}]
            for one in chosen[:: 6 if quick else 1]:
                if one.moulds and mould not in one.moulds:
                    continue
                if mould == LIQUID_ALONE and not one.liquid:
                    continue
                found = run(mould, (*COARSE, *one.changes))
                rows.append({"input": one.label, **picked(found)})
            output.csv(f"billet_inputs_{mould}", rows)


PEAKED = ("idealised", "taper_1", "taper_3")  # moulds of which the thesis has the peak stress
PEAKS = (
    "as shipped, coarse",
    "flow stress 20 % higher",
    "flow stress 30 % higher",
    "friction 0.3 (Coulomb)",
    "flow stress 20 % higher and friction 0.3",
    "flow stress 30 % higher and friction 0.3",
)


def peaks(output: Output) -> None:
    """Peak and face stress with what moves them, alone and together, beside the thesis."""
    found = {mould: output.rows(f"billet_inputs_{mould}") for mould in PEAKED}
    by_input = {m: {r["input"]: r for r in found[m]} for m in PEAKED}
    lines: list[dict[str, Any]] = []
    for label in PEAKS:
        line: dict[str, Any] = {"input": label}
        for mould in PEAKED:
            # The ideal mould has no friction.
            alone = label.removesuffix(" and friction 0.3")
            bare = PEAKS[0] if label.startswith("friction") else alone
            row = by_input[mould].get(bare if mould == "idealised" else label)
            for key in ("von_mises_max", "von_mises_mid_face"):
                line[f"{mould} {key}"] = None if row is None else row[key]
        lines.append(line)
    expected = {m: thesis(m) for m in PEAKED}
    lines.append(
        {"input": "thesis"} | {f"{m} von_mises_max": expected[m]["von_mises_max"] for m in PEAKED}
    )
    lines[-1] |= {f"{m} von_mises_mid_face": said for m, said in FACES.items()}
    head = {"input": "peak stress [MPa]"}
    head |= {f"{m} von_mises_max": NAMES[m] for m in PEAKED}
    head |= {f"{m} von_mises_mid_face": f"mid-face, {NAMES[m]}" for m in PEAKED[1:]}
    output.insert("billet peaks", table(lines, head, dict.fromkeys(head, ".1f")))


def picked(found: Found) -> dict[str, Any]:
    """Results of a run that are shown."""
    keys = (*SHOWN, "gap_max", "penetration")
    chosen: dict[str, Any] = {k: found.values.get(k) for k in keys}
    work = {"cells": found.cells, "cut": found.cut, "newton": found.newton}
    return {**chosen, **work, "failure": found.failure, "seconds": found.seconds}


def columns(first: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Headings of a table of runs."""
    head = {first: first, **{k: label for k, (label, _) in SHOWN.items()}}
    if rows[0]["gap_max"] is not None:
        head["gap_max"] = "gap [mm]"
    return head


def _changes(rows: Sequence[Mapping[str, Any]], first: str) -> list[dict[str, Any]]:
    """The first row as it is, the others as differences to it; nothing where nothing moves."""
    forms = {**{k: form for k, (_, form) in SHOWN.items()}, "gap_max": ".3f"}
    lines = []
    for row in rows:
        cells: dict[str, Any] = {first: row[first]}
        for key, form in forms.items():
            value, base = row[key], rows[0][key]
            if value is None:
                continue
            if row is rows[0]:
                cells[key] = format(value, form)
            else:
                text = format(value - base, "+" + form)
                cells[key] = "" if not float(text) else text
        if row["failure"]:
            cells = {first: f"{row[first]}: {row['failure'][:60]}"}
        lines.append(cells)
    return lines


# (c) Where the shell begins.

STARTS: dict[str, tuple[str, ...]] = {
    "as shipped": (),
    "cells of 0.35 mm, intervals of 0.02 s": (*mesh(0.35), every(0.02)),
    "cells of 2 mm": mesh(2.0),
    "solidus 20 K lower": ('steel.overrides.solidus.value="1432 degC"',),
    "superheat 60 K": ("casting.superheat=60 K",),
    "h - 20 %": ("cooling.mould.surface.0.coefficient=1280 W/(m^2 K)",),
    "conducts 10 % better": ('steel.overrides.conductivity.value="33 W/(m K)"',),
    "specific heat 10 % higher": ('steel.overrides.specific_heat.value="770 J/(kg K)"',),
    "latent heat 10 % higher": ('steel.overrides.latent_heat.value="297 kJ/kg"',),
}
STARTS["these three together"] = sum(list(STARTS.values())[-3:], ())


def beginnings(output: Output, quick: bool) -> None:
    """Where the solidus is first passed in the corner and at mid-face of the idealised mould."""
    rows = []
    for label, changes in list(STARTS.items())[:: 9 if quick else 1]:
        found = run("idealised", ("casting.length=150 mm", *changes))
        keys = ("first_solid", "closed_solid")
        rows.append({"input": label, **{k: found.values[k] for k in keys}})
    rows.append({"input": "thesis", **{k: OF_THE_TEXT[k] for k in ("first_solid", "closed_solid")}})
    output.csv("billet_start", rows)


def show_beginnings(output: Output) -> None:
    """Where the shell begins, from the data."""
    rows = output.rows("billet_start")
    head = {"input": "input", **{k: MORE[k][0] for k in ("first_solid", "closed_solid")}}
    output.insert("billet start", table(rows, head, dict.fromkeys(head, ".0f")))


def main(output: Output, quick: bool) -> None:
    """The six moulds, and what their numbers hang on."""
    moulds(output, COARSE if quick else ())
    beginnings(output, quick)
    sensitivity(output, quick)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    show_moulds(output)
    show_beginnings(output)
    for mould in STUDIED:
        rows = output.rows(f"billet_inputs_{mould}")
        text = table(_changes(rows, "input"), columns("input", rows), {})
        output.insert(f"billet inputs {mould}", text)
    if {r["input"] for r in output.rows(f"billet_inputs_{PEAKED[1]}")} >= set(PEAKS):
        peaks(output)  # a quick run has not got its inputs
