"""The billet of thesis V.2 in its moulds: beside the thesis, what it hangs on, and its error.

Writes docs/billet.md. All runs are those of `cases/billet125`, marched in memory, one at a time.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks import billet_figure
from benchmarks.billet_inputs import variants
from benchmarks.report import ROOT, Output, table
from castfem.case import load_case
from castfem.errors import CastfemError
from castfem.march import March
from castfem.measure import Reading
from castfem.output.summary import from_si
from castfem.report import quantities
from castfem.scene import build_scene

CASES = ROOT / "cases" / "billet125"
MOULDS = ("idealised", "taper_3", "taper_1", "taper_0", "taper_minus_1", "taper_minus_3")
NAMES = dict(
    zip(MOULDS, ("idealised", "+3 %/m", "+1 %/m", "0 %/m", "-1 %/m", "-3 %/m"), strict=True)
)
PATIENCE = 90.0  # s of processor time, after which a run is given up

SHOWN = {
    "heat_removed_slice": ("heat [kJ]", ".2f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_mid_face": ("surface, mid-face [°C]", ".0f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
    "von_mises_mid_face": ("stress, mid-face [MPa]", ".2f"),
    "size_mid_face": ("width [mm]", ".3f"),
    "size_corner": ("diagonal [mm]", ".3f"),
}
"""Quantities of the tables: heading and format."""

# Where a trend is wanted, not a digit.
COARSE = (
    "mesh.surface_size=1.2 mm",
    "mesh.corner_size=1.2 mm",
    "mesh.face_size=8 mm",
    "mesh.core_size=12 mm",
    "coupling.interval=0.2 s",
)
QUIET = ("output.fields=[]", "output.figures=false", "output.checkpoint_every=0")


class Late(CastfemError):
    """A run has taken too long."""


@dataclass
class Listener:
    """Sits where a recorder does: looks at the clock and at every interval.

    Attributes:
        deadline: When to give up, s of `process_time`. penetration: Largest of all intervals, m.
        lost: Position where contact is first lost, m. unbalanced: Largest error of the forces.
    """

    deadline: float
    penetration: float = 0.0
    lost: float = np.nan
    unbalanced: float = 0.0

    def step(self, march: March, reading: Reading) -> None:
        """Look at a committed interval.

        Raises:
            Late: The time is over.
        """
        if process_time() > self.deadline:
            raise Late(f"given up at {reading.time:.2f} s")
        strained = reading.mechanics
        if strained is None or strained.balance is None:
            return
        self.unbalanced = max(self.unbalanced, strained.balance.forces_error)
        if strained.contact is not None:
            self.penetration = max(self.penetration, strained.contact.penetration)
            if np.isnan(self.lost) and strained.contact.gap > 1e-6:
                self.lost = reading.position


@dataclass(frozen=True)
class Found:
    """One run.

    Attributes:
        values: Results at the exit of the mould by name, in the units of the tables.
        seconds: Processor time of the march. cells: Of the mesh.
        failure: Why it has not come to its end, empty if it has.
        cut: Intervals that were tried in vain. newton: Mechanical iterations.
    """

    values: Mapping[str, float]
    seconds: float
    cells: int
    failure: str = ""
    cut: int = 0
    newton: int = 0


def run(mould: str, changes: Iterable[str] = ()) -> Found:
    """March one billet with some keys changed."""
    case = load_case(CASES / f"{mould}.toml", (*QUIET, *changes))
    scene = build_scene(case, MPI.COMM_SELF)
    listener = Listener(process_time() + PATIENCE)
    march = March(scene, listener)  # type: ignore[arg-type]
    start, failure = process_time(), ""
    try:
        march.run()
    except CastfemError as error:
        failure = str(error)
    seconds = process_time() - start
    assert march.reading is not None
    values = {n: from_si(q.value, q.unit) for n, q in quantities(march, march.reading).items()}
    values |= {"penetration": 1e6 * listener.penetration, "unbalanced": listener.unbalanced}
    values["lost"] = 1e3 * listener.lost
    cells = scene.section.mesh.topology.index_map(2).size_global
    iterations = 0 if scene.mechanics is None else scene.mechanics.problem.iterations
    scene.destroy()
    found = Found(values, seconds, cells, failure, march.counts.cut_back, iterations)
    print(f"  {mould} {' '.join(changes)}: {seconds:.1f} s {failure}", flush=True)
    return found


# (a) The six moulds.


def thesis(mould: str) -> dict[str, float]:
    """The numbers of the thesis that its case holds, in the units of the tables."""
    found = {}
    for reference in load_case(CASES / f"{mould}.toml").reference:
        found[reference.quantity] = from_si(reference.si, reference.unit)
    return found


MORE = {
    "share": ("heat, % of idealised", ".1f"),
    "gap_max": ("largest gap [mm]", ".3f"),
    "lost": ("contact lost from [mm]", ".0f"),
    "contact_share": ("surface in contact [%]", ".0f"),
    "contact_pressure_max": ("highest contact pressure [MPa]", ".2f"),
    "axial_strain": ("axial strain [%]", ".3f"),
    "penetration": ("largest penetration [µm]", ".3f"),
    "newton": ("Newton iterations an interval", ".1f"),
    "seconds": ("processor time [s]", ".0f"),
}


def moulds(output: Output, changes: Sequence[str]) -> None:
    """The six moulds at the shipped defaults, beside the thesis."""
    found = {name: run(name, changes) for name in MOULDS}
    rows = []
    for name, one in found.items():
        values = dict(one.values)
        values["share"] = 100.0 * values["heat_removed"] / found["idealised"].values["heat_removed"]
        values["axial_strain"] = 100.0 * values["axial_strain"]
        values |= {"newton": one.newton / 100.0, "seconds": one.seconds}
        rows.append({"mould": NAMES[name], **{k: values.get(k) for k in (*SHOWN, *MORE)}})
    output.csv("billet_moulds", rows)
    expected = {name: thesis(name) for name in MOULDS}
    written = {"taper_1": "8 to 10", "taper_3": "10 to 12"}
    lines = []
    for key, (label, form) in {**SHOWN, **MORE}.items():
        cells: dict[str, Any] = {"what": label}
        for name, row in zip(MOULDS, rows, strict=True):
            ours = row[key]
            text = "" if ours is None or not np.isfinite(ours) else format(ours, form)
            theirs = expected[name].get(key)
            if theirs is not None:
                said = format(theirs, ".4g" if key not in ("size_corner",) else ".2f")
                if key == "heat_removed_slice" and name != "idealised":
                    said = ("< " if name == "taper_0" else "> ") + said
                if key == "von_mises_mid_face":
                    said = written[name]
                text += f" ({said})"
            cells[name] = text
        lines.append(cells)
    output.insert("billet moulds", table(lines, {"what": "at the exit of the mould", **NAMES}, {}))


# (b) What the numbers hang on.

STUDIED = ("idealised", "taper_1", "taper_0", "taper_minus_1")
LIQUID_ALONE = "taper_minus_1"  # where the wall goes away all hangs on how the strand follows it


def sensitivity(output: Output, quick: bool) -> None:
    """Change one input at a time, on a coarse mesh."""
    with tempfile.TemporaryDirectory() as name:
        chosen = variants(Path(name))
        for mould in STUDIED:
            base = run(mould, COARSE)
            rows = [{"input": "as shipped, coarse", **_picked(base)}]
            for one in chosen[:: 6 if quick else 1]:
                if one.moulds and mould not in one.moulds:
                    continue
                if mould == LIQUID_ALONE and not one.liquid:
                    continue
                found = run(mould, (*COARSE, *one.changes))
                rows.append({"input": one.label, **_picked(found)})
            output.csv(f"billet_inputs_{mould}", rows)
            output.insert(
                f"billet inputs {mould}", table(_changes(rows, "input"), _head("input", rows), {})
            )


def _picked(found: Found) -> dict[str, Any]:
    """Results of a run that are shown."""
    keys = (*SHOWN, "gap_max", "penetration")
    chosen: dict[str, Any] = {k: found.values.get(k) for k in keys}
    work = {"cells": found.cells, "cut": found.cut, "newton": found.newton}
    return {**chosen, **work, "failure": found.failure, "seconds": found.seconds}


def _head(first: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
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


# (c) The error of the shipped default.


def mesh(size: float) -> tuple[str, ...]:
    """Cells of `size` mm at the surface, the others in proportion to those shipped."""
    scale = size / 0.8
    return (
        f"mesh.surface_size={size:g} mm",
        f"mesh.corner_size={size:g} mm",
        f"mesh.face_size={6 * scale:g} mm",
        f"mesh.core_size={8 * scale:g} mm",
    )


def touch(method: str, factor: float) -> str:
    """Contact by a method with a factor."""
    return f'mould.contact={{method="{method}",factor={factor}}}'


Choice = Callable[[Any], tuple[str, ...]]
CONVERGENCE: dict[str, tuple[tuple[Any, ...], Choice, Any]] = {
    "mesh [mm]": (
        (1.2, 0.8, 0.5, 0.35), lambda v: (*mesh(v), "coupling.interval=0.2 s"), 0.8,
    ),
    "interval [s]": (
        (0.4, 0.2, 0.1, 0.05, 0.025), lambda v: (*mesh(1.2), f"coupling.interval={v} s"), 0.1,
    ),
    "gap settled to [K]": (
        (1000, 1, 0.1, 0.01),
        lambda v: (*COARSE, f"coupling.settled={v} K", "coupling.passes=20"), 1,
    ),
    "penalty, factor": ((1, 10, 100, 1000), lambda v: (*COARSE, touch("penalty", v)), 10),
    "Nitsche, factor": ((10, 100, 1000), lambda v: (*COARSE, touch("nitsche", v)), 10),
}  # fmt: skip
"""What is refined -> its values, the last the reference; keys of a value; the shipped one."""


def convergence(output: Output, quick: bool) -> None:
    """Refine one thing at a time, and add up what is left of each at the shipped default."""
    drawn: dict[str, list[dict[str, Any]]] = {}
    for mould in ("taper_1", "taper_0"):
        rows = drawn[NAMES[mould]] = []
        for name, (values, changes, _) in CONVERGENCE.items():
            for value in values[:2] if quick else values:
                found = run(mould, changes(value))
                rows.append({"refined": f"{name} = {value}", **_picked(found)})
        output.csv(f"billet_convergence_{mould}", rows)
        show_convergence(output, mould, rows)
    output.figure("billet_convergence", billet_figure.draw(drawn))


def show_convergence(output: Output, mould: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the tables of one mould."""
    more = {
        "penetration": "penetration [µm]",
        "cells": "cells",
        "newton": "Newton iterations",
        "cut": "intervals cut back",
        "seconds": "time [s]",
    }
    forms = {k: form for k, (_, form) in SHOWN.items()} | {"gap_max": ".3f", "seconds": ".0f"}
    forms["penetration"] = ".4f"
    lines = [
        {"refined": f"{r['refined']}: {r['failure'][:60]}"} if r["failure"] else r for r in rows
    ]
    text = table(lines, {**_head("refined", rows), **more}, forms)
    output.insert(f"billet convergence {mould}", text)
    errors: list[dict[str, Any]] = []
    for name, (_, _, shipped) in CONVERGENCE.items():
        if name.startswith("Nitsche"):  # the other method is no refinement
            continue
        tried = [r for r in rows if r["refined"].startswith(name)]
        start = [r["refined"] for r in tried].index(f"{name} = {shipped}")
        default, *finer = [r for r in tried[start:] if not r["failure"]]
        # The largest of all differences: the finest may agree by luck where a front has moved.
        error = {
            k: round(max((abs(default[k] - r[k]) for r in finer), default=0.0), 4) for k in SHOWN
        }
        errors.append({"from": name, **error})
    errors.append({"from": "together", **{k: sum(e[k] for e in errors) for k in SHOWN}})
    head = {"from": "error from", **{k: label for k, (label, _) in SHOWN.items()}}
    output.insert(f"billet error {mould}", table(errors, head, dict.fromkeys(SHOWN, ".2g")))


def main(output: Output, quick: bool) -> None:
    """The six moulds, what their numbers hang on, and their error."""
    moulds(output, COARSE if quick else ())
    sensitivity(output, quick)
    convergence(output, quick)
