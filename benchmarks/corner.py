"""Corner of a peritectic billet: does it converge, in cells and coupling windows?

Writes tables of docs/coupling.md. `billet180/peritectic` to its mould's exit with the skeleton of
the mushy zone and without one, the errors that follow from these runs, and the billets of the
thesis with both mushy zones.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from mpi4py import MPI

import numpy as np

import castfem
from benchmarks.billet_run import CASES, COARSE, NAMES, QUIET
from benchmarks.optimum import folder
from benchmarks.probe import launch
from benchmarks.report import Columns, Output, table
from castfem.model import load_case
from castfem.studies.accuracy.estimate import estimate
from castfem.studies.optimisation import Evaluator, Study

CELLS = {
    "1.94": ("1.94", "1.94", "15.5", "19.4"),
    "1.4": ("1.4", "1.4", "11.2", "14"),
    "1": ("1", "1", "8", "10"),
    "0.7": ("0.7", "0.7", "5.6", "7"),
    "0.5": ("0.5", "0.5", "4", "5"),
    "0.35": ("0.35", "0.35", "2.8", "3.5"),
}
"""Sizes of the cells at the surface, at the corner, at mid-face and in the core, mm."""
KEYS = ("surface_size", "corner_size", "face_size", "core_size")
AS_SHIPPED, TWO_RANKS = "as shipped", "two ranks"
WINDOWS = ("0.2", "0.05", "0.025")
TOGETHER = {"0.5": "0.05"}
"""Cells, mm, with windows, s."""
MIDDLE = 0.2
"""A place on the way at which results are read besides the mould's exit, m."""
KINDS: dict[str, dict[str, tuple[str, ...]]] = {
    "skeleton": {
        **{f"cells {size} mm": () for size in CELLS},
        AS_SHIPPED: (),
        **{f"windows {w} s": (f"coupling.interval={w} s",) for w in WINDOWS},
        **{
            f"cells {c} mm, windows {w} s": (f"coupling.interval={w} s",)
            for c, w in TOGETHER.items()
        },
        "windows 0.2 s, mechanics 0.05 s": (
            "coupling.interval=0.2 s",
            "coupling.mechanical_step=0.05 s",
        ),
        "triangles": ("mesh.cell=triangle",),
        "Nitsche": ("mould.contact=nitsche",),
        TWO_RANKS: (),
    },
    "none": {f"cells {size} mm": () for size in (*CELLS,)[:3]},
}
"""What is varied with each mushy zone; the windows and kinds of the case as shipped."""
COLUMNS = {
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "gap_corner": ("gap, corner [mm]", ".2f"),
    "von_mises_max": ("peak stress [MPa]", ".1f"),
    "mean_contact_pressure_max": ("wall pressure over 5 mm [MPa]", ".2f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
}
"""Columns of the history: heading and format."""
LADDERS = {
    "cells": ({"cells 1.4 mm": 2.0, "cells 1 mm": 1.0 / 0.7, "cells 0.7 mm": 1.0,
               "cells 0.5 mm": 0.5 / 0.7},
              "cells 0.35 mm"),
    "windows": ({"windows 0.2 s": 2.0, AS_SHIPPED: 1.0, "windows 0.05 s": 0.5}, "windows 0.025 s"),
}  # fmt: skip
"""Runs from which `castfem error` would tell an error, by relative size; and one that is finer."""
MOULDS = ("taper_3", "taper_1", "taper_0", "taper_minus_1", "taper_minus_3")
THESIS = {
    "heat_removed": ("heat, modelled part [kJ/m]", ".0f"),
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "gap_corner": ("gap, corner [mm]", ".3f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
}

TAPER: Columns = {
    "mush": "mush",
    "best": ("best [%/m]", ".2f"),
    "low": ("cannot be distinguished from [%/m]", ".2f"),
    "high": ("to [%/m]", ".2f"),
    "stress": ("peak stress [MPa]", ".2f"),
    "stress_error": ("its numerical error [MPa]", ".2f"),
    "heat_error": ("error of the heat beyond the bound [MJ/m]", ".3f"),
}


def cells(size: str) -> tuple[str, ...]:
    """Keys that make cells of `size` mm at the surface."""
    return tuple(f"mesh.{key}={length} mm" for key, length in zip(KEYS, CELLS[size], strict=True))


def run(
    case: str, changes: Sequence[str], columns: Iterable[str], at: float | None = None
) -> list[dict[str, float]]:
    """Results of a case with some keys changed: at `at` (m), if given, and at its end."""
    found = load_case(CASES.parent / f"{case}.toml", changes)
    with castfem.run(found) as result:
        table = result.history
    position = table["position"].to_numpy()
    places = [position[-1]] if at is None else [at, position[-1]]
    return [{n: float(np.interp(z, position, table[n])) for n in columns} for z in places]


def corner(mush: str, kind: str) -> list[dict[str, Any]]:
    """Rows of the table: one thing varied, on the way and at the mould's exit."""
    size = kind.removeprefix("cells ").partition(" mm")[0]
    changes = (*KINDS[mush][kind], *(cells(size) if size in CELLS else ()))
    # With its fields, as users run it: coupling windows end where they are written.
    keys = (*QUIET[1:], f"mechanics.mush={mush}", *changes)
    asked = "billet180/peritectic", keys, ("position", *COLUMNS), MIDDLE
    if kind == TWO_RANKS:
        found = launch("benchmarks.corner", {"asked": asked}, 2)["rows"]
    else:
        found = run(*asked)
    return [
        {"mush": mush, "varied": kind, **row, "position": round(1e3 * row["position"])}
        for row in found
    ]


def best_taper(mush: str) -> dict[str, Any]:
    """The search of `billet125/optimum_single` with one of the mushy zones: %/m, MPa, MJ/m."""
    case = load_case(CASES / "optimum_single.toml", (f"mechanics.mush={mush}",))
    with Evaluator(case, folder(f"single_{mush}"), processes=2) as evaluator:
        found = Study(case, evaluator=evaluator).solve()
    (taper,), (heat,) = found.values, found.constraints
    assert found.objective is not None
    return {
        "mush": mush, "best": taper.value, "low": taper.low, "high": taper.high,
        "stress": 1e-6 * found.objective.value, "stress_error": 1e-6 * found.objective.numerical,
        "heat_error": 1e-6 * heat.error,
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """All cells, windows and kinds, and billets of the thesis."""
    rows: list[dict[str, Any]] = []
    for mush, kinds in KINDS.items():
        for kind in [*kinds][: 1 if quick else None]:
            rows += corner(mush, kind)
            print(f"  {rows[-1]}", flush=True)
    output.csv("corner", rows)
    billets: list[dict[str, Any]] = []
    for mould in MOULDS[: 1 if quick else None]:
        for mush in KINDS:
            keys = (*QUIET, *COARSE, f"mechanics.mush={mush}")
            (found,) = run(f"billet125/{mould}", keys, THESIS)
            found["heat_removed"] /= 1e3
            billets.append({"mould": NAMES[mould], "mush": mush, **found})
            print(f"  {billets[-1]}", flush=True)
    output.csv("corner_thesis", billets)
    if not quick:
        output.csv("corner_taper", [best_taper(mush) for mush in ("none", "skeleton")])
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    output.table("corner taper", output.rows("corner_taper"), TAPER)
    for name, first, columns in (
        ("corner", {"mush": "mush", "varied": "varied", "position": "at [mm]"}, COLUMNS),
        ("corner_thesis", {"mould": "mould", "mush": "mush"}, THESIS),
    ):
        head = first | {key: heading for key, (heading, _) in columns.items()}
        forms = {key: form for key, (_, form) in columns.items()}
        output.insert(name.replace("_", " "), table(output.rows(name), head, forms))
    show_errors(output)


def show_errors(output: Output) -> None:
    """Errors as `castfem error` estimates them, beside what finer runs change; "" if not run."""
    found = [row for row in output.rows("corner") if row["mush"] == "skeleton"]
    head = {"at": "at [mm]", "result": "result"}
    rows = []
    for position in sorted({row["position"] for row in found}):
        at = {row["varied"]: row for row in found if row["position"] == position}
        for name, (heading, form) in COLUMNS.items():
            digits = f".{int(form[1]) + 1}f"
            rows.append({"at": format(position, "g"), "result": heading.replace("°C", "K")})
            for kind, (sizes, finest) in LADDERS.items():
                head |= {kind: f"{kind}: estimated", finest: f"{finest}: found"}
                if not sizes.keys() <= at.keys():
                    continue
                values = {size: at[run][name] for run, size in sizes.items()}
                rows[-1][kind] = format(estimate(values).error, digits)
                if finest in at:
                    rows[-1][finest] = format(abs(at[finest][name] - values[1.0]), digits)
    output.insert("corner error", table(rows, head, {}))


if __name__ == "__main__":
    case_name, case_keys, *rest = json.loads(sys.argv[1])["asked"]
    if MPI.COMM_WORLD.rank == 0:
        print("RESULT", json.dumps({"rows": run(case_name, case_keys, *rest)}))
    else:  # rank 0 alone has the history
        castfem.run(load_case(CASES.parent / f"{case_name}.toml", case_keys)).close()
