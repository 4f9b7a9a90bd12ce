"""Derivatives of a billet in its mould beside differences of runs that are far apart.

A run with mechanics answers in small steps as its shell grows cell by cell: what
`castfem sensitivity` finds is the slope between two of them, a difference over per cents of a
parameter has them in it. Runs of the temperature alone have no such steps, and stand beside them.
Writes two tables of docs/sensitivity.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

from benchmarks.report import Output, table
from castfem.api import load, run
from castfem.model import Case
from castfem.studies.sensitivity.run import sensitivity

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

    def in_case(self, case: Case, sign: float) -> Case:
        """The case with the number moved to one side."""
        return case.with_({self.key: f"{self.value * (1.0 + sign * self.by)!r} {self.unit}"})


MOVED = (
    _Moved("mould.taper", "mould.taper", 0.4, "%/m", 0.1, 0.4),
    _Moved("cooling.mould.gap_conductivity", "cooling.mould.surface.0.gap_conductivity", 0.15,
           "W/(m K)", 0.1, 0.15),
    _Moved("casting.superheat", "casting.superheat", 40.0, "K", 0.2, 40.0),
    _Moved("casting.speed", "casting.speed", 3.6, "m/min", 0.05, 3.6),
    _Moved("steel.conductivity", "steel.overrides.conductivity.value", 30.0, "W/(m K)", 0.05,
           100.0),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked of one case.

    Attributes:
        case: As it is. changes: Its keys here. cells: Of each of its meshes, mm.
        results: Names. moved: Its numbers.
    """

    case: str
    changes: dict[str, Any]
    cells: tuple[float, ...]
    results: tuple[str, ...]
    moved: tuple[_Moved, ...]

    def rows(self, quick: bool) -> list[dict[str, Any]]:
        """Derivatives and wide differences, as per cent of the result by a per cent."""
        rows: list[dict[str, Any]] = []
        for size in self.cells[: 1 if quick else None]:
            mesh = {"mesh.surface_size": f"{size} mm", "mesh.corner_size": f"{size} mm"}
            case = load(self.case).with_(self.changes | mesh)
            base, names = self._results(case), [one.name for one in self.moved]
            slopes = sensitivity(case, self.results, names, comm=MPI.COMM_SELF).gradient
            for one in self.moved:
                above, below = (self._results(one.in_case(case, sign)) for sign in (1.0, -1.0))
                row: dict[str, Any] = {"size": size, "parameter": one.name, "by": 100.0 * one.by}
                for name in self.results:
                    row[name] = slopes[name][one.name] * one.shown / base[name]
                    wide = (above[name] - below[name]) / (2.0 * one.by)
                    row[f"{name}_wide"] = wide / base[name]
                rows.append(row)
        return rows

    def _results(self, case: Case) -> dict[str, float]:
        with run(case) as result:
            return {name: result.summary.quantities[name].value for name in self.results}


IN_MOULD = _Asked(CASE, CHANGES, CELLS, RESULTS, MOVED)
ALONE = _Asked(
    "billet125/thermal",
    {"output.fields": [], "output.figures": False, "output.every": "10 s", "reference": []},
    (2.0, 0.8), ("heat_removed", "surface_temperature_mid_face", "surface_temperature_corner"),
    (replace(MOVED[2], by=0.5), *MOVED[3:]),
)  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Both cases."""
    output.csv("sensitivity_apart", IN_MOULD.rows(quick))
    output.csv("sensitivity_apart_alone", ALONE.rows(quick))
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    words = {
        "heat_removed": "heat", "axial_strain": "axial strain", "von_mises_max": "peak stress",
        "gap_max": "gap", "surface_temperature_mid_face": "mid-face",
        "surface_temperature_corner": "corner",
    }  # fmt: skip
    for name, asked in (("apart", IN_MOULD), ("apart alone", ALONE)):
        head = {"size": "cells, mm", "parameter": "by", "by": "runs apart by ±, %"}
        forms: dict[str, str] = {"by": ".0f"}
        for result in asked.results:
            head |= {result: f"{words[result]}: derivative", f"{result}_wide": "of runs"}
            form = "+.3f" if asked is IN_MOULD else "+.4f"
            forms |= {result: form, f"{result}_wide": form}
        rows = output.rows("sensitivity_" + name.replace(" ", "_"))
        output.insert(name, table(rows, head, forms))
