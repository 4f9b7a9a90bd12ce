"""What the numbers of the billet in its moulds hang on: one input changed at a time.

Writes tables of docs/billet.md, on cells of 1.2 mm and coupling windows of 0.2 s.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.billet_inputs import AS_THESIS, PEAKED, variants
from benchmarks.billet_run import COARSE, NAMES, SHOWN, run
from benchmarks.billet_study import FACES, columns, picked, thesis
from benchmarks.report import Output, table

STUDIED = ("idealised", "taper_3", "taper_1", "taper_0", "taper_minus_1")
LIQUID_ALONE = "taper_minus_1"  # where the wall goes away all hangs on how the strand follows it


def sensitivity(output: Output, quick: bool, moulds: Sequence[str] = STUDIED) -> None:
    """Change one input at a time, on a coarse mesh."""
    with tempfile.TemporaryDirectory() as name:
        chosen = variants(Path(name))
        for mould in moulds:
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


PEAKS = (
    "as shipped, coarse",
    "liquid elastic, as in the ideal mould",
    "modulus of the mushy zone linear in the solid",
    AS_THESIS,
    f"{AS_THESIS}, flow stress 20 % higher",
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
            # The ideal mould has no friction, and its liquid is elastic as it is shipped.
            alone = label.removesuffix(" and friction 0.3")
            bare = PEAKS[0] if label.startswith(("friction", "liquid elastic, ")) else alone
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


def main(output: Output, quick: bool) -> None:
    """All inputs in all moulds that are studied."""
    sensitivity(output, quick)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    for mould in STUDIED:
        rows = output.rows(f"billet_inputs_{mould}")
        text = table(_changes(rows, "input"), columns("input", rows), {})
        output.insert(f"billet inputs {mould}", text)
    if {r["input"] for r in output.rows(f"billet_inputs_{PEAKED[1]}")} >= set(PEAKS):
        peaks(output)  # a quick run has not got its inputs
