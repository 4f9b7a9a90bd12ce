"""Derivatives of a billet in its mould beside differences of runs that are far apart.

A run with mechanics answers in small steps as its shell grows cell by cell: what
`castfem sensitivity` finds is the slope between two of them, a difference over per cents of a
parameter has them in it.
Writes a table of docs/sensitivity.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

from benchmarks.report import Output, table
from castfem.api import load, run
from castfem.case import Case
from castfem.sensitivity.run import sensitivity

CASE = "billet125/taper_0"
# The speed moves steps with it where windows are lengths of the strand, as in the derivatives.
CHANGES: dict[str, Any] = {
    "casting.length": "150 mm", "mould.taper": "0.4 %/m", "coupling.interval": "5 mm",
    "output.fields": [], "output.figures": False, "output.every": "10 s", "reference": [],
}  # fmt: skip
CELLS = (2.0, 0.8, 0.4)  # mm
RESULTS = ("heat_removed", "axial_strain", "von_mises_max", "gap_max")


@dataclass(frozen=True, slots=True)
class _Moved:
    """A number of the case, and how far runs are apart.

    Attributes:
        name: As `castfem sensitivity` knows it. key: As a case does.
        value: In `unit`. by: Its share to both sides.
        shown: What the parameter counts at that value.
    """

    name: str
    key: str
    value: float
    unit: str
    by: float
    shown: float


MOVED = (
    _Moved("mould.taper", "mould.taper", 0.4, "%/m", 0.1, 0.4),
    _Moved("cooling.mould.gap_conductivity", "cooling.mould.surface.0.gap_conductivity", 0.15,
           "W/(m K)", 0.1, 0.15),
    _Moved("casting.superheat", "casting.superheat", 40.0, "K", 0.2, 40.0),
    _Moved("casting.speed", "casting.speed", 3.6, "m/min", 0.05, 3.6),
    _Moved("steel.conductivity", "steel.overrides.conductivity.value", 30.0, "W/(m K)", 0.05,
           100.0),
)  # fmt: skip


def _case(size: float) -> Case:
    mesh = {"mesh.surface_size": f"{size} mm", "mesh.corner_size": f"{size} mm"}
    return load(CASE).with_(CHANGES | mesh)


def _results(case: Case) -> dict[str, float]:
    with run(case) as result:
        return {name: result.summary.quantities[name].value for name in RESULTS}


def main(output: Output, quick: bool) -> None:
    """Derivatives and wide differences, as per cent of the result by a per cent."""
    rows: list[dict[str, Any]] = []
    for size in CELLS[: 1 if quick else len(CELLS)]:
        case = _case(size)
        base = _results(case)
        found = sensitivity(case, RESULTS, [one.name for one in MOVED], comm=MPI.COMM_SELF)
        for one in MOVED:
            sides = [
                _results(case.with_({one.key: f"{one.value * (1.0 + sign * one.by)!r} {one.unit}"}))
                for sign in (1.0, -1.0)
            ]
            row: dict[str, Any] = {"size": size, "parameter": one.name, "by": 100.0 * one.by}
            for name in RESULTS:
                row[name] = found.gradient[name][one.name] * one.shown / base[name]
                row[f"{name}_wide"] = (sides[0][name] - sides[1][name]) / (
                    2.0 * one.by * base[name]
                )
            rows.append(row)
    output.csv("sensitivity_apart", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    words = {
        "heat_removed": "heat", "axial_strain": "axial strain", "von_mises_max": "peak stress",
        "gap_max": "gap",
    }  # fmt: skip
    head = {"size": "cells, mm", "parameter": "by", "by": "runs apart by ±, %"}
    forms: dict[str, str] = {"by": ".0f"}
    for name in RESULTS:
        head |= {name: f"{words[name]}: derivative", f"{name}_wide": "of runs"}
        forms |= {name: "+.3f", f"{name}_wide": "+.3f"}
    output.insert("apart", table(output.rows("sensitivity_apart"), head, forms))
