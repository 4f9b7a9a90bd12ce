"""Errors of all headline numbers of the shipped billets, and of the pressure on the wall.

Writes tables of docs/billet.md. Errors are against runs on finer cells in shorter windows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.billet_run import COARSE, MOULDS, NAMES, Found, every, mesh, run
from benchmarks.report import Output, table
from castfem.runs.results.headline import HEADLINE

FINE = (*mesh(0.35), every(0.05))
PATIENCE = 900.0  # s
DIGITS = {"shell": 2, "surface": 0, "heat": 3, "mould_heat": 3, "mould_contact": 1}
"""Decimals by the beginning of a name; 3 for other lengths, 2 for all other quantities."""


def main_names(runs: Sequence[Found]) -> list[str]:
    """Return the headline quantities of any run; the faces of a square billet count once."""
    return [
        name
        for name in HEADLINE
        if not name.endswith("_narrow_face") and any(name in run.values for run in runs)
    ]


def heading(name: str, runs: Sequence[Found]) -> str:
    """Return the label of a quantity in the summary, without the position of its maximum."""
    run = next(r for r in runs if name in r.labels)
    unit = {"degC": "°C", "percent": "%"}.get(run.units[name], run.units[name])
    return f"{run.labels[name].partition(', at x')[0]} [{unit}]"


def cell(name: str, what: str, default: Mapping[str, Any], finer: Mapping[str, Any]) -> str:
    """Return the shipped value and, in brackets, its difference from the finer run."""
    if default.get(name) is None or finer.get(name) is None:
        return ""
    length = what.endswith("[mm]")
    digits = next((d for k, d in DIGITS.items() if name.startswith(k)), 3 if length else 2)
    value, error = default[name], default[name] - finer[name]
    least = 0.5 * 10.0 ** -(digits + 1)
    text = "0" if abs(error) < least else f"{error:+.{digits + 1}f}"
    return f"{value:.{digits}f} ({text})".replace("-0.000 ", "0.000 ")


def errors(output: Output, quick: bool) -> None:
    """Run all six moulds as shipped and refined; write the results after each."""
    shipped: dict[str, Found] = {}
    finer: dict[str, Found] = {}
    for mould in MOULDS[2:3] if quick else MOULDS:
        shipped[mould] = run(mould, COARSE if quick else (), PATIENCE)
        finer[mould] = run(mould, (*mesh(1.0), every(0.2)) if quick else FINE, PATIENCE)
        show_errors(output, shipped, finer)


def show_errors(output: Output, shipped: Mapping[str, Found], finer: Mapping[str, Found]) -> None:
    """Write the data and the table of the moulds that have been run."""
    runs = list(shipped.values())
    names = main_names(runs)
    rows = []
    for mould in shipped:
        for what, found in (("shipped", shipped[mould]), ("finer", finer[mould])):
            numbers: dict[str, Any] = {name: found.values.get(name) for name in names}
            work = {"cells": found.cells, "seconds": found.seconds, "failure": found.failure}
            rows.append({"mould": mould, "run": what, **numbers, **work})
    output.csv("billet_error", rows)
    output.csv("billet_error_names", [{"name": n, "what": heading(n, runs)} for n in names])
    show_error(output)


def show_error(output: Output) -> None:
    """Write the table of shipped values with their errors from the data."""
    found = {(r["mould"], r["run"]): r for r in output.rows("billet_error")}
    moulds = list(dict.fromkeys(mould for mould, _ in found))
    pairs = {m: (found[m, "shipped"], found[m, "finer"]) for m in moulds}
    lines = []
    for row in output.rows("billet_error_names"):
        cells = {m: cell(row["name"], row["what"], *pair) for m, pair in pairs.items()}
        lines.append({"what": row["what"], **cells})
    sizes = {m: f"{a['cells']} ({b['cells']})" for m, (a, b) in pairs.items()}
    lines.append({"what": "cells", **sizes})
    times = {m: f"{a['seconds']:.0f} ({b['seconds']:.0f})" for m, (a, b) in pairs.items()}
    lines.append({"what": "processor time [s]", **times})
    head = {"what": "shipped (less the finer)", **{m: NAMES[m] for m in moulds}}
    output.insert("billet error", table(lines, head, {}))


# Pressure on the wall

SIZES = {"taper_1": (0.8, 0.5, 0.35), "taper_3": (0.8, 0.5, 0.35)}


def pressures(output: Output, quick: bool) -> None:
    """Compute highest and mean pressure at the exit on several cell sizes."""
    rows: list[dict[str, Any]] = []
    for mould, sizes in SIZES.items():
        for size in (2.0,) if quick else sizes:
            found = run(mould, (*mesh(size), every(0.2)), PATIENCE)
            rows.append(_pressure(mould, size, found))
    output.csv("billet_pressure", rows)


def show_pressures(output: Output) -> None:
    """Write the table of the pressure on the wall from the data."""
    head = {
        "mould": "mould", "size": "surface cells [mm]", "cells": "cells",
        "mean_contact_pressure_max": ("highest mean over 5 mm [MPa]", ".3f"),
        "contact_pressure_max": ("at a point [MPa]", ".2f"), "place": "at x, y [mm]",
        "pressure_mid_face": ("at mid-face [MPa]", ".4f"),
        "pressure_mean": ("mean of a face [MPa]", ".4f"),
        "force": ("force on half a face [kN/m]", ".2f"), "heat_removed_slice": ("heat [kJ]", ".2f"),
        "von_mises_max": ("peak stress [MPa]", ".2f"),
    }  # fmt: skip
    output.table("billet pressure", output.rows("billet_pressure"), head)


def _pressure(mould: str, size: float, found: Found) -> dict[str, Any]:
    """Return a row of the table of pressures."""
    label = found.labels.get("contact_pressure_max", "")
    place = label.partition(", at x = ")[2].removesuffix(" mm").replace(" y = ", " ")
    keys = (
        "mean_contact_pressure_max", "contact_pressure_max", "pressure_mid_face", "pressure_mean",
        "force",
    )  # fmt: skip
    values: Mapping[str, Any] = {k: found.values.get(k) for k in keys}
    more = {k: found.values[k] for k in ("heat_removed_slice", "von_mises_max")}
    row = {"mould": NAMES[mould], "size": size, "cells": found.cells, **values, "place": place}
    return {**row, **more, "seconds": found.seconds}


def main(output: Output, quick: bool) -> None:
    """Compute both tables."""
    errors(output, quick)
    pressures(output, quick)
    show(output)


def show(output: Output) -> None:
    """Write both tables from the data."""
    show_error(output)
    show_pressures(output)
