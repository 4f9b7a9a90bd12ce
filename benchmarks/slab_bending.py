"""The coarse slab that its rolls bend: what its windows and its start make of it.

Runs cases/slab1200/bending.toml with each change, into results/benchmarks/slab_bending (a run that
is finished there is not repeated).  One has windows that are 1 % shorter: what it differs by is the
noise of all the others.  Writes tables of docs/slab_heat.md, slab_bending.md and
slab_cracks.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output, table
from castfem.model import Case, load_case
from castfem.runs.output.summary_file import Summary

if TYPE_CHECKING:
    import pandas as pd

CASE = ROOT / "cases" / "slab1200" / "bending.toml"
FOLDER = ROOT / "results" / "benchmarks" / "slab_bending"
QUIET = ("output.fields=[]", "output.figures=false")
TO_ARC = "casting.length=4.2 m"
EXIT = "casting.start.at=mould_exit"
MOULD, SHELL = 0.8, 1.0  # m: its end; where the slice has one shell
ROLLS = {"bending": (8, 15), "straightening": (49, 57)}
_SLACK = 1e-6  # m


@dataclass(frozen=True)
class Change:
    """A run that differs from the shipped case."""

    name: str  #: of its folder
    keys: tuple[str, ...] = ()  #: of the case


SHIPPED, SHORTER = Change("as shipped"), Change("1 % shorter", ("coupling.interval=99 mm",))
HALF = Change("windows of 50 mm", ("coupling.interval=50 mm",))
FROM_EXIT = Change("from the mould's exit", (EXIT, TO_ARC))
FROM_EXIT_SHORTER = Change(
    "from the mould's exit, 1 % shorter", (EXIT, TO_ARC, "coupling.interval=99 mm")
)
CHANGES = (SHIPPED, SHORTER, FROM_EXIT, FROM_EXIT_SHORTER, HALF)


def main(output: Output, quick: bool) -> None:
    """All runs, each in its turn; what is known is written after each."""
    rows: list[dict[str, Any]] = []
    for change in (SHIPPED, FROM_EXIT) if quick else CHANGES:
        case = changed(change, ("casting.length=1.1 m",) if quick else ())
        rows.append(_row(change, case, (output.folder if quick else FOLDER) / change.name))
        print(f"  {change.name}: {rows[-1]['failure'] or 'finished'}", flush=True)
        output.csv("slab_bending", rows)
    show(output)


def changed(change: Change, further: tuple[str, ...] = ()) -> Case:
    """The case of a run."""
    return load_case(CASE, (*QUIET, *change.keys, *further))


def _row(change: Change, case: Case, folder: Path) -> dict[str, Any]:
    """Run a case, unless it is finished, and read what is told of it."""
    run = finished_run(case, folder)
    return {"name": change.name, "failure": run.failure} | found(
        run.history, run.summary, _places()
    )


def _places() -> np.ndarray:
    """Positions of the rolls, m."""
    machine = load_case(CASE).machine
    rolls = None if machine is None else machine.pairs()
    assert rolls is not None
    return np.array([pair.position for pair in rolls.pairs])


def found(history: pd.DataFrame, summary: Summary, places: np.ndarray) -> dict[str, Any]:
    """What is told of a run, as far as it has come."""
    at = history["position"].to_numpy()

    def there(position: float, column: str) -> float:
        known = column in history and position <= at[-1] + _SLACK
        return float(np.interp(position, at, history[column].to_numpy())) if known else np.nan

    def within(low: float, high: float, column: str) -> np.ndarray:
        rows = (at > low + _SLACK) & (at < high + _SLACK)
        values = history[column].to_numpy()[rows] if column in history else np.zeros(0)
        return values[np.isfinite(values)]

    begins, ends = (places[i - 1] for i in ROLLS["bending"])
    row = {
        "strain_shell": 100.0 * there(SHELL, "axial_strain"),
        "strain_bender": 100.0 * there(begins, "axial_strain"),
        "corner_mould": there(MOULD, "axial_stress_corner_extrados"),
        "corner_before": there(begins - 1e-3, "axial_stress_corner_extrados"),
        "corner_after": there(ends, "axial_stress_corner_extrados"),
        "moment": there(ends, "bending_moment"),
        "mould_I1": within(0.0, MOULD, "I1_max").max(initial=0.0),
        "mould_I2": 1e5 * within(0.0, MOULD, "I2_mechanical_max").max(initial=0.0),
        "slice_mould": there(MOULD, "slice_thickness_centre"),
        "slice_end": there(at[-1], "slice_thickness_centre"),
    }
    before = 0.0
    for phase, corner in (("bending", "corner_extrados"), ("straightening", "corner_intrados")):
        low, high = (places[i - 1] for i in ROLLS[phase])
        row[f"{phase}_stress"] = within(low, high, f"axial_stress_{corner}").max(initial=-np.inf)
        warm = within(low, high, f"surface_temperature_{corner}")
        row[f"{phase}_warm"] = warm.min(initial=np.inf)
        axis = within(low, high, "neutral_axis")
        row[f"{phase}_axis_most"], row[f"{phase}_axis_least"] = (
            (axis.max(), axis.min()) if len(axis) else (np.nan, np.nan)
        )
        work = there(high, "bending_work")
        row[f"{phase}_work"], before = work - before, work
        for index, scale in (("I1", 1e-6), ("I2", 1e5), ("I2_pitch", 1e5)):
            known = summary.quantities.get(f"{phase}_{index}_max")
            row[f"{phase}_{index}"] = np.nan if known is None else scale * known.value
            label = "" if known is None else known.label.partition(f", {phase}, ")[2]
            row[f"{phase}_{index}_place"] = ", ".join(label.split(", ")[:-2])
    return {k: v if isinstance(v, str) or np.isfinite(v) else None for k, v in row.items()}


START = {
    "strain_shell": ("axial strain at 1 m, %", ".2f"),
    "strain_more": ("from there to the bender, %", ".2f"),
    "corner_mould": ("extrados corner's axial stress as it leaves the mould, MPa", ".1f"),
    "corner_before": ("before the bender", ".1f"),
    "bending_stress": ("largest, in the bender", ".1f"),
    "corner_after": ("at its end", ".1f"),
    "bending_work": ("work of bending, kJ/m", ".3f"),
}
COARSE = {
    "bending_stress": ("largest axial stress, extrados corner, in bending, MPa", ".1f", "26.7"),
    "straightening_stress": ("intrados corner, in straightening, MPa", ".1f", "41.1"),
    "bending_axis": ("neutral axis in bending, mm", "", "centre to intrados"),
    "straightening_axis": ("in straightening, mm", "", ""),
    "moment": ("moment at the end of the bender, kN m", ".2f", ""),
    "bending_work": ("work of bending, kJ/m", ".3f", ""),
    "straightening_work": ("work of straightening, kJ/m", ".3f", ""),
    "strain_bender": ("axial strain at the bender, %", ".2f", ""),
}  # fmt: skip
CRACKS = {
    "bending_I1": ("I1 in bending, MPa", ".1f", "26.7"),
    "bending_I1_place": ("", "", "extrados, corner, end of bending"),
    "bending_I2": ("I2 in bending, 1e-5 1/s", ".1f", "18"),
    "bending_I2_place": ("", "", ""),
    "straightening_I1": ("I1 in straightening, MPa", ".1f", "41.1"),
    "straightening_I1_place": ("", "", "intrados, corner, #55 to #57"),
    "straightening_I2": ("I2 in straightening, 1e-5 1/s", ".1f", "22"),
    "straightening_I2_place": ("", "", ""),
    "bending_I2_pitch": ("I2, mean over a pitch, bending, 1e-5 1/s", ".1f", ""),
    "straightening_I2_pitch": ("the same, straightening", ".1f", ""),
    "mould_I1": ("I1 in the mould, MPa", ".1f", ""),
    "mould_I2": ("its mechanical I2 in the mould, 1e-5 1/s", ".1f", ""),
    "slice_mould": ("thickness of the slice at the mould's exit", ".4f", "1 (start)"),
    "slice_end": ("at the end", ".4f", "1.001"),
}


def show(output: Output) -> None:
    """The tables, from the data."""
    rows = {row["name"]: _drawn(row) for row in output.rows("slab_bending")}
    if {SHIPPED.name, SHORTER.name, HALF.name, FROM_EXIT_SHORTER.name} <= set(rows):
        columns = {
            SHIPPED: "meniscus",
            SHORTER: "with windows 1 % shorter",
            FROM_EXIT: "mould's exit",
            FROM_EXIT_SHORTER: "with windows 1 % shorter",
        }
        heat, cracks = (replace(output, name=f"slab_{name}.md") for name in ("heat", "cracks"))
        heat.insert("slab start", _table(rows, "begun at the", columns, START))
        columns = {SHIPPED: "windows of 100 mm", SHORTER: "99 mm", HALF: "50 mm"}
        output.insert("slab coarse", _table(rows, "slab1200/bending", columns, COARSE))
        cracks.insert("slab cracks", _table(rows, "slab1200/bending", columns, CRACKS))


def _drawn(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row with what is put together of others."""
    strains = [row["strain_bender"], row["strain_shell"]]
    more = {"strain_more": None if None in strains else strains[0] - strains[1]}
    for phase in ROLLS:
        most, least = row[f"{phase}_axis_most"], row[f"{phase}_axis_least"]
        more[f"{phase}_axis"] = None if most is None else f"{most:.1f} to {least:.1f}"
    return {**row, **more}


def _table(
    rows: Mapping[str, Mapping[str, Any]],
    first: str,
    columns: Mapping[Change, str],
    told: Mapping[str, tuple[str, ...]],
) -> str:
    """A line for each number; columns are the runs, and the thesis where it tells something."""
    lines = []
    for name, (what, form, *thesis) in told.items():
        line: dict[str, Any] = {"what": what} | dict(zip(("thesis",), thesis, strict=False))
        for change in columns:
            value = rows[change.name][name]
            line[change.name] = value if value is None or not form else format(value, form)
        lines.append(line)
    head = {"what": first} | {change.name: text for change, text in columns.items()}
    if any("thesis" in line for line in lines):
        head["thesis"] = "thesis"
    return table(lines, head, {})
