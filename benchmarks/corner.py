"""Corner of a peritectic billet: does it converge, in cells and coupling windows?

Writes tables of docs/coupling.md. `billet180/peritectic` to its mould's exit with the skeleton of
the mushy zone and without one, and the billets of the thesis with both.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import castfem
from benchmarks.billet_run import CASES, COARSE, NAMES, QUIET
from benchmarks.report import Output, table
from castfem.case import load_case

CELLS = {
    "1.94": ("1.94", "1.94", "15.5", "19.4"),
    "1.4": ("1.4", "1.4", "11.2", "14"),
    "1": ("1", "1", "8", "10"),
    "0.7": ("0.7", "0.7", "5.6", "7"),
    "0.5": ("0.5", "0.5", "4", "5"),
}
"""Sizes of the cells at the surface, at the corner, at mid-face and in the core, mm."""
KEYS = ("surface_size", "corner_size", "face_size", "core_size")
WINDOWS = {"skeleton": ("0.2", "0.05", "0.025"), "none": ("0.2", "0.05")}
OTHERS = {
    "triangles": ("mesh.cell=triangle",),
    "Nitsche": ("mould.contact=nitsche",),
}
MUSHES = {"skeleton": (*CELLS,), "none": (*CELLS,)[:4]}
"""Cells that each mushy zone is run with."""
COLUMNS = {
    "shell_corner": ("shell, corner [mm]", ".1f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "gap_corner": ("gap, corner [mm]", ".2f"),
    "von_mises_max": ("peak stress [MPa]", ".1f"),
    "mean_contact_pressure_max": ("wall pressure over 5 mm [MPa]", ".1f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
}
"""Columns of the history: heading and format."""
MOULDS = ("taper_3", "taper_1", "taper_0", "taper_minus_1")
THESIS = {
    "heat_removed": ("heat, modelled part [kJ/m]", ".0f"),
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "gap_corner": ("gap, corner [mm]", ".3f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
}


def cells(size: str) -> tuple[str, ...]:
    """Keys that make cells of `size` mm at the surface."""
    return tuple(f"mesh.{key}={length} mm" for key, length in zip(KEYS, CELLS[size], strict=True))


def run(case: str, changes: Sequence[str], columns: Iterable[str]) -> dict[str, float]:
    """The last row of the history of a case with some keys changed."""
    found = load_case(CASES.parent / f"{case}.toml", changes)
    with castfem.run(found) as result:
        last = result.history.iloc[-1]
        return {name: float(last[name]) for name in columns}


def main(output: Output, quick: bool) -> None:
    """All cells, windows and kinds, and billets of the thesis."""
    rows: list[dict[str, Any]] = []
    for mush, sizes in MUSHES.items():
        kinds = {f"cells {size} mm": cells(size) for size in sizes[: 1 if quick else None]}
        if not quick:
            kinds |= {f"windows {w} s": (f"coupling.interval={w} s",) for w in WINDOWS[mush]}
            kinds |= OTHERS if mush == "skeleton" else {}
        for kind, changes in kinds.items():
            # With its fields, as users run it: coupling windows end where they are written.
            keys = (*QUIET[1:], f"mechanics.mush={mush}", *changes)
            found = run("billet180/peritectic", keys, COLUMNS)
            rows.append({"mush": mush, "varied": kind, **found})
            print(f"  {rows[-1]}", flush=True)
    output.csv("corner", rows)
    billets: list[dict[str, Any]] = []
    for mould in MOULDS[: 1 if quick else None]:
        for mush in MUSHES:
            found = run(f"billet125/{mould}", (*QUIET, *COARSE, f"mechanics.mush={mush}"), THESIS)
            found["heat_removed"] /= 1e3
            billets.append({"mould": NAMES[mould], "mush": mush, **found})
            print(f"  {billets[-1]}", flush=True)
    output.csv("corner_thesis", billets)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    for name, first, columns in (
        ("corner", {"mush": "mush", "varied": "varied"}, COLUMNS),
        ("corner_thesis", {"mould": "mould", "mush": "mush"}, THESIS),
    ):
        head = first | {key: heading for key, (heading, _) in columns.items()}
        forms = {key: form for key, (_, form) in columns.items()}
        output.insert(name.replace("_", " "), table(output.rows(name), head, forms))
