"""Stated errors of `castfem sensitivity` compared with differences of whole runs.

Derivatives of a billet in its mould and of a slab, by parameters that move the front and by the
taper, are compared with central differences at two distances.
Writes a table of docs/sensitivity.md.
"""

from __future__ import annotations

import math
from typing import Any

from mpi4py import MPI

from benchmarks.billet_run import CASES, QUIET
from benchmarks.report import Output
from castfem.base.shown_quantity import from_si, unit_of_difference
from castfem.model import Case, load_case
from castfem.studies.mould_fit.follow import follow
from castfem.studies.sensitivity.parameters import Parameter
from castfem.studies.sensitivity.result import Sensitivity
from castfem.studies.sensitivity.run import sensitivity

DISTANCES = (0.01, 0.1)
"""Changes to either side, relative to the parameter."""
FRONT = ("cooling.mould.coefficient", "casting.speed", "casting.superheat")
OF_BILLET = (
    "heat_removed", "shell_mid_face", "shell_corner", "surface_temperature_mid_face",
    "surface_temperature_corner", "von_mises_mid_face", "von_mises_max", "gap_max", "axial_strain",
)  # fmt: skip
OF_SLAB = ("heat_removed", "shell_mid_face_intrados", "surface_temperature_mid_face_intrados")
RUNS: tuple[tuple[str, tuple[str, ...], tuple[str, ...], tuple[str, ...]], ...] = (
    ("billet125/taper_1", (), OF_BILLET, (*FRONT, "mould.taper")),
    ("slab1200/thermal", ("casting.length=800 mm",), OF_SLAB, FRONT[1:]),
)
"""Case, changes, results and parameters."""
QUICK = ("casting.length=50 mm", "mould.length=600 mm", "mesh.surface_size=2 mm")


def main(output: Output, quick: bool) -> None:
    """Run each case with derivatives, and four times for each parameter."""
    rows: list[dict[str, Any]] = []
    for name, changes, of, to in RUNS[: 1 if quick else None]:
        case = load_case(CASES.parent / f"{name}.toml", (*QUIET, *changes, *(QUICK * quick)))
        rows += compared(name, case, of, to[: 1 if quick else None])
    output.csv("sensitivity_errors", rows)
    show(output)


def compared(name: str, case: Case, of: tuple[str, ...], to: tuple[str, ...]) -> list[Any]:
    """Return a row for each result and parameter."""
    found = sensitivity(case, of, to, comm=MPI.COMM_SELF)
    rows = {(row.name, row.parameter.name): row for row in found.rows()}
    table = []
    for parameter in found.parameters:
        near_and_far = [differences(case, parameter, found, share) for share in DISTANCES]
        for result in found.quantities:
            row, per_cent = rows[result, parameter.name], 0.01 * parameter.value
            apart = [per_cent * difference[result] for difference in near_and_far]
            value, error = per_cent * row.value, per_cent * row.error
            table.append(
                {
                    "case": name, "result": result, "parameter": parameter.name,
                    "unit": unit_of_difference(row.quantity.shown_unit),
                    "derivative": value, "error": error, "near": apart[0], "far": apart[1],
                    "within": within(value, error, apart),
                }
            )  # fmt: skip
    return table


def within(value: float, error: float, apart: list[float]) -> str:
    """Return "yes" if all differences of runs are within the error of a derivative."""
    if math.isnan(error):
        return "error unknown"
    return "yes" if all(abs(x - value) <= error for x in apart) else "no"


def differences(
    case: Case, parameter: Parameter, found: Sensitivity, share: float
) -> dict[str, float]:
    """Return central differences of runs: unit of the result over that of the parameter."""
    step = share * parameter.value
    ends = []
    for sign in (1.0, -1.0):
        value = f"{parameter.value + sign * step!r} {parameter.unit}"
        ends.append(follow(case.with_({parameter.name: value}), MPI.COMM_SELF))
    return {
        name: from_si((ends[0].value(name) - ends[1].value(name)) / (2.0 * step),
                      unit_of_difference(quantity.shown_unit))
        for name, quantity in found.quantities.items()
    }  # fmt: skip


def show(output: Output) -> None:
    """Write the table from the data."""
    head = {
        "case": "case", "result": "result", "parameter": "by", "unit": "unit",
        "derivative": ("derivative", "+.3g"), "error": ("±", ".2g"),
        "near": ("runs ± 1 %", "+.3g"), "far": ("runs ± 10 %", "+.3g"), "within": "within",
    }  # fmt: skip
    output.table("sensitivity errors", output.rows("sensitivity_errors"), head)
