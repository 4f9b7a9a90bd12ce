"""Error against run time of the slab: cells, coupling windows, bulging, tolerances.

Runs cases/slab1200/slab.toml with each setting into results/benchmarks/slab_error (finished runs
are not repeated). The reference is the run in equal windows of 50 mm plus its changes by finer
cells and by shorter windows. Writes tables and a figure of docs/slab_error.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Columns, Output, errors_over_time
from castfem.model import Case, load_case
from castfem.model.build.simulation import build, build_mesh
from castfem.runs import loop
from castfem.runs.output.summary_file import Summary

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CASES = ROOT / "cases" / "slab1200"
FOLDER = ROOT / "results" / "benchmarks" / "slab_error"
QUIET = ("output.fields=[]", "output.figures=false")


@dataclass(frozen=True)
class Setting:
    """Settings of a run of the slab."""

    size: float  #: cells at the wide faces, mm; all others in proportion
    window: float  #: length of strand between two exchanges of temperature and mechanics, mm
    what: str = ""  #: description of `keys`
    keys: tuple[str, ...] = ()  #: other changes of the case

    @property
    def name(self) -> str:
        """Name of the folder of the run."""
        return f"{self.size:g}_{self.window:g}" + "".join(
            c if c.isalnum() else "_" for c in self.what
        )

    @property
    def changes(self) -> tuple[str, ...]:
        """Assignments to keys of the case."""
        scale = self.size / 5.0
        return (
            f"mesh.surface_size={self.size:g} mm", f"mesh.corner_size={10 * scale:g} mm",
            f"mesh.face_size={75 * scale:g} mm", f"mesh.core_size={24 * scale:g} mm",
            f"coupling.interval={self.window:g} mm", EVEN, *self.keys,
        )  # fmt: skip


EVEN = "coupling.growth=1"
EVENLY = Setting(5.0, 50.0)
FINE_CELLS, FINE_WINDOWS = Setting(2.5, 50.0), Setting(5.0, 25.0)
AS_THESIS = Setting(5.0, 5.0)  # steps of the thesis, on about its number of cells
GROWING = "coupling.growth=8"
SHIPPED = Setting(5.0, 25.0, "growing, 3e-5", (GROWING, "coupling.strain_error=3e-5"))
SETTINGS = (
    Setting(7.5, 100.0),
    Setting(7.5, 50.0),
    Setting(5.0, 100.0),
    EVENLY,
    FINE_WINDOWS,
    FINE_CELLS,
    AS_THESIS,
    Setting(5.0, 25.0, "growing", (GROWING, "coupling.strain_error=1e-5")),
    SHIPPED,
)
LENGTH = 18.44  # casting length of the shipped case, m
_FINE = ("coupling.interval=5 mm", EVEN, "casting.length=1.8 m")
THICK = (
    'casting.start={ at = "mould_exit", profile = { depth = [0, 20, 50, 80, 110], '
    'depth_unit = "mm", value = [930, 1100, 1320, 1488, 1522], unit = "degC" } }'
)
STEPS = {"as it leaves the mould": _FINE, "the shell that it has at #50": (*_FINE, THICK)}
ROLLS = {"bender": (8, 15), "straightener": (49, 57)}
FACES = ("mid_face_intrados", "corner_intrados", "corner_extrados")

COMPARED = {
    "bending_I1": ("I1, bending", "MPa", ".2f"),
    "straightening_I1": ("I1, straightening", "MPa", ".2f"),
    "bending_I2": ("I2, bending", "1e-5 1/s", ".2f"),
    "straightening_I2": ("I2, straightening", "1e-5 1/s", ".2f"),
    "bending_stress": ("stress, extrados corner, bending", "MPa", ".2f"),
    "straightening_stress": ("stress, intrados corner, straightening", "MPa", ".2f"),
    "surface": ("surface, mid-face intrados, rms from roll to roll", "K", ".2f"),
    "corner": ("surface, corner intrados, rms", "K", ".2f"),
    "shell": ("shell, mid-face, rms", "mm", ".2f"),
    "bulge": ("bulge of the pitches, rms", "um", ".2f"),
    "bulge_7": ("bulge below #7", "um", ".1f"),
    "axis_bender": ("neutral axis, mean in the bender", "mm", ".2f"),
    "axis_straightener": ("neutral axis, mean in the straightener", "mm", ".2f"),
    "moment": ("moment at #15", "kN m", ".2f"),
    "effort": ("axial force at #15", "kN", ".2f"),
    "work": ("work of bending", "kJ/m", ".3f"),
    "thickness": ("thickness at mid-face, at the end", "mm", ".3f"),
    "width": ("width, at the end", "mm", ".2f"),
    "slice": ("thickness of the slice", "%", ".4f"),
    "roll_force": ("force on #47", "kN/m", ".1f"),
    "heat": ("heat removed", "MJ/m", ".2f"),
    "peak": ("largest von Mises stress", "MPa", ".2f"),
}
"""Compared results: description, unit and format; those in `ALONG` are lines along the strand."""
ALONG = {"surface": "surface_temperature_mid_face_intrados",
         "corner": "surface_temperature_corner_intrados", "shell": "shell_mid_face_intrados",
         "bulge": "bulge_pitch"}  # fmt: skip
SHORT = {"bending_I1": "I1 bending, MPa", "straightening_I1": "I1 straightening, MPa",
         "bending_I2": "I2 bending", "straightening_I2": "I2 straightening",
         "straightening_stress": "stress straightening, MPa", "surface": "surface, K",
         "shell": "shell, mm", "bulge": "bulge, um", "axis_straightener": "neutral axis, mm",
         "moment": "moment, kN m", "effort": "axial force, kN",
         "slice": "slice, %"}  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Run all settings; write the results after each."""
    rows: list[dict[str, Any]] = []
    length = ("casting.length=1.1 m",) if quick else ()
    folder = output.folder if quick else FOLDER
    case = load_case(CASES / "slab.toml", (*QUIET, *SHIPPED.changes))
    build(case, MPI.COMM_SELF).destroy()  # compiles before times are measured
    for setting in (Setting(10.0, 100.0), Setting(10.0, 50.0)) if quick else SETTINGS:
        rows.append(_row(setting, folder / setting.name, length))
        print(f"  {setting.name}: {rows[-1]['seconds']:.0f} s {rows[-1]['failure']}", flush=True)
        output.csv("slab_error", rows)
    if not quick:
        output.csv("slab_speed", _speed(folder))
    show(output)
    if runs := _runs_with_errors(output):
        output.figure("slab_error", draw(runs))


def _speed(folder: Path) -> list[dict[str, Any]]:
    """Measure windows of 5 mm, the thesis' steps, with a thin shell and with a thick one."""
    rows = []
    for what, keys in STEPS.items():
        case = load_case(CASES / "slab.toml", (*QUIET, *keys))
        build(case, MPI.COMM_SELF).destroy()  # compiles before times are measured
        start = process_time()
        summary = loop.run(case, folder / f"steps_{len(rows)}", comm=MPI.COMM_SELF)
        seconds, windows = process_time() - start, summary.steps["coupling windows"]
        newton = summary.steps["Newton iterations, mechanics"] / windows
        row = {"what": what, "windows": windows, "newton": newton, "ms": 1e3 * seconds / windows}
        way = case.casting.length - 0.8
        row["whole"] = seconds / 60.0 * (LENGTH - 0.8) / way
        rows.append(row)
        print(f"  {row}", flush=True)
    return rows


def _row(setting: Setting, folder: Path, length: Sequence[str]) -> dict[str, Any]:
    """Run a setting, unless it is finished; return the row of its results."""
    case = load_case(CASES / "slab.toml", (*QUIET, *setting.changes, *length))
    run = finished_run(case, folder)
    names = {n: getattr(setting, n) for n in ("name", "size", "window", "what")}
    work = {
        "cells": len(build_mesh(case).cells), "windows": run.summary.steps.get("coupling windows"),
        "newton": run.summary.steps.get("Newton iterations, mechanics"),
        "seconds": run.seconds, "failure": run.failure,
    }  # fmt: skip
    return names | work | _results(run.summary, run.history, case)


def _results(summary: Summary, history: pd.DataFrame, case: Case) -> dict[str, Any]:
    """Return the compared results; lines are text with a number per roll."""
    assert case.machine is not None
    rolls = case.machine.pairs()
    assert rolls is not None
    places = np.array([pair.position for pair in rolls.pairs])
    at = history["position"].to_numpy()
    quantities = {name: q.value for name, q in summary.quantities.items()}
    found: dict[str, Any] = {}
    for phase in ("bending", "straightening"):
        found[f"{phase}_I1"] = quantities.get(f"{phase}_I1_max", np.nan) / 1e6
        found[f"{phase}_I2"] = quantities.get(f"{phase}_I2_max", np.nan) * 1e5
    for phase, where, face in (("bending", "bender", "corner_extrados"),
                               ("straightening", "straightener", "corner_intrados")):  # fmt: skip
        low, high = (places[i - 1] for i in ROLLS[where])
        rows = (at > low + 1e-6) & (at < high + 1e-6)
        stress = history[f"axial_stress_{face}"].to_numpy()[rows]
        found[f"{phase}_stress"] = float(stress.max(initial=-np.inf))
        axis, lengths = history["neutral_axis"].to_numpy()[rows], np.diff(at, prepend=0.0)[rows]
        finite = np.isfinite(axis)
        mean = np.average(axis[finite], weights=lengths[finite]) if finite.any() else np.nan
        found[f"axis_{where}"] = float(mean)
    reached = places[places < at[-1]]
    for name, column in ALONG.items():
        line = history[column].to_numpy()
        # The bulge at a roll is that of the pitch below it, which is in the next row.
        rows = np.searchsorted(at, reached + 1e-6)
        values = line[rows] if name == "bulge" else np.interp(reached, at, line)
        found[name] = " ".join(f"{v:.7g}" for v in values)
    found["bulge_7"] = 1e3 * float(found["bulge"].split()[6]) if len(reached) > 6 else np.nan
    for name, column in {"moment": "bending_moment", "effort": "axial_force"}.items():
        found[name] = float(np.interp(places[14], at, history[column].to_numpy()))
    found["roll_force"] = float(np.interp(places[47] - 1e-4, at, history["roll_force"].to_numpy()))
    return found | {
        "work": quantities["bending_work"] / 1e3,
        "thickness": 1e3 * quantities["size_mid_face_intrados"],
        "width": 1e3 * quantities["size_narrow_face"],
        "slice": 100.0 * quantities["slice_thickness_centre"],
        "heat": quantities["heat_removed"] / 1e6,
        "peak": quantities["way_von_mises_max"] / 1e6,
    }


def _values(row: Mapping[str, Any], name: str) -> np.ndarray:
    """Return the value of a result of a run, or its values along a line, in the shown unit."""
    scale = 1e3 if name == "bulge" else 1.0
    return scale * np.array(str(row[name]).split(), float)


def _exact(rows: Mapping[str, Mapping[str, Any]], name: str) -> np.ndarray:
    """Return the reference: equal windows of 50 mm plus changes by finer cells and windows."""
    evenly, cells, windows = (
        _values(rows[setting.name], name) for setting in (EVENLY, FINE_CELLS, FINE_WINDOWS)
    )
    return np.asarray(cells + windows - evenly)


def _off(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Return the difference of two values, or the rms difference of two lines."""
    difference = ours - theirs
    return float(difference[0] if len(difference) == 1 else np.sqrt(np.mean(difference**2)))


def _runs_with_errors(output: Output) -> list[dict[str, Any]]:
    """Return the runs with their errors."""
    rows = {row["name"]: row for row in output.rows("slab_error") if not row["failure"]}
    if not {one.name for one in (SHIPPED, EVENLY, FINE_CELLS, FINE_WINDOWS)} <= set(rows):
        return []
    names = [name for name in COMPARED if all(row.get(name) is not None for row in rows.values())]
    exact = {name: _exact(rows, name) for name in names}
    return [row | {n: _off(_values(row, n), exact[n]) for n in names} for row in rows.values()]


def show(output: Output) -> None:
    """Write the tables from the data."""
    head: Columns = {
        "what": "600 cells, windows of 5 mm", "windows": "windows",
        "newton": ("Newton iterations a window", ".2f"), "ms": ("a window, ms", ".0f"),
        "whole": ("to #62, min", ".1f"),
    }  # fmt: skip
    output.table("slab speed", output.rows("slab_speed"), head)
    runs = _runs_with_errors(output)
    if not runs:
        return
    lines = []
    for row in sorted(runs, key=lambda r: r["seconds"]):
        mark = "**" if row["name"] == SHIPPED.name else ""
        line = {name: f"{mark}{row[name]:g}{mark}" for name in ("size", "window")}
        lines.append(row | line)
    head = {
        "size": "cells, mm", "window": "windows, mm", "what": "otherwise", "cells": "cells",
        "windows": "windows", "newton": "Newton iterations", "seconds": ("time, s", ".0f"),
        **{name: (words, ("" if name in ALONG else "+") + COMPARED[name][2])
           for name, words in SHORT.items()},
    }  # fmt: skip
    output.table("slab trade", lines, head)
    rows = {row["name"]: row for row in output.rows("slab_error")}
    shipped, evenly, cells, windows = (
        rows[one.name] for one in (SHIPPED, EVENLY, FINE_CELLS, FINE_WINDOWS)
    )
    lines = []
    for name, (what, unit, form) in COMPARED.items():
        if name not in runs[0]:
            continue
        base, sign = _values(shipped, name), "" if name in ALONG else "+"
        lines.append(
            {
                "what": f"{what}, {unit}",
                "value": "" if name in ALONG else format(base[0], form),
                "cells": format(_off(_values(cells, name), _values(evenly, name)), sign + form),
                "windows": format(_off(_values(windows, name), base), sign + form),
            }
        )
    head = {
        "what": "slab1200/slab", "value": "as shipped",
        "cells": f"more with cells of {FINE_CELLS.size:g} mm",
        "windows": f"more with even windows of {FINE_WINDOWS.window:g} mm",
    }  # fmt: skip
    output.table("slab error", lines, head)


COLOURS = {7.5: "#d55e00", 5.0: "#0072b2", 2.5: "#009e73"}
MARKERS = {100.0: "v", 50.0: "o", 25.0: "^", 5.0: "D"}
DRAWN = {
    "bending_I1": "I1, bending [MPa]",
    "bending_I2": "I2, bending [1e-5 1/s]",
    "bulge": "bulge [um]",
    "surface": "surface, mid-face [K]",
}


def draw(runs: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw error against processor time; the default ringed, runs that none beats joined."""
    rows = [
        {name: abs(row[name]) for name in DRAWN}
        | {"seconds": row["seconds"], "default": row["name"] == SHIPPED.name, "size": 7.0}
        | {"colour": COLOURS.get(row["size"], "black"), "marker": MARKERS.get(row["window"], "s")}
        for row in runs
    ]
    legend = [(f"{size:g} mm", "s", colour) for size, colour in COLOURS.items()]
    legend += [(f"windows of {w:g} mm", mark, "#777777") for w, mark in MARKERS.items()]
    panels = [[("", rows, key, label) for key, label in list(DRAWN.items())[i : i + 2]]
              for i in (0, 2)]  # fmt: skip
    return errors_over_time(panels, legend, logarithmic=False)
