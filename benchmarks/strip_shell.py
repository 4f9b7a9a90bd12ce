"""Which shell the strip of a pitch has: that where it enters, or that in its middle.

The heat alone of cases/slab1200/slab.toml to the end of the bender gives the shell everywhere.
The strip with the shell of a pitch's middle is compared with those of other places, with shells
foreseen from there, and, elastic, with a beam whose shell grows on its way.  Then the case itself
with several lengths of window, into results/benchmarks/strip_shell (a run that is finished there
is not repeated).  Writes tables of docs/slab_bulging.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output, table
from castfem.base.types import Array
from castfem.fem.line_probes import Profile
from castfem.model import Case, load_case
from castfem.model.build.shell_prediction import ShellAhead
from castfem.model.build.simulation import build
from castfem.model.load import from_document
from castfem.physics.constitutive import load_elasticity, load_law
from castfem.physics.constitutive.base import Law
from castfem.physics.machine.bulging import CreepingStrip, ElasticStrip, Shell, Span
from castfem.physics.machine.bulging.shell import stiffness
from castfem.physics.machine.rolls import Rolls
from castfem.physics.materials import Steel
from castfem.runs.loop import TimeLoop
from castfem.runs.output.history import read_history

CASE = ROOT / "cases" / "slab1200" / "slab.toml"
FOLDER = ROOT / "results" / "benchmarks" / "strip_shell"
TO_ARC = "casting.length=4.4 m"
KEYS = (TO_ARC, "output.figures=false", "output.fields=[]")
FINE = ("mesh.surface_size=2 mm", "mesh.corner_size=4 mm", "mesh.core_size=2.5 mm")
CELLS = {"fine": FINE, "as shipped": ()}
PLACES = (0.0, 0.01, 0.025, 0.05, 0.1)  # m below the roll
WINDOWS = (100, 50, 25, 10)  # mm
SHOWN = (1, 2, 4, 7, 8, 11, 15)
ROLLS, SPEED, WEIGHT = 15, 0.02, 7000.0 * 9.81  # m/s, N/m3
NODES, BETWEEN = 129, 8  # of a beam that grows, and how many of them have one stiffness each
PROBE = "mid_face_extrados"


class _Heat:
    """Notes the profile under the middle of a wide face, step by step."""

    def __init__(self) -> None:
        self.position: list[float] = []
        self.temperature: list[Array] = []
        self.depth: Array = np.zeros(0)

    def step(self, run: object, sample: Any) -> None:
        """See `castfem.runs.recorder`."""
        profile = sample.profiles[PROBE]
        self.position.append(sample.position)
        self.temperature.append(profile.temperature)
        self.depth = profile.depth

    def at(self, position: float) -> Profile:
        """The profile at a position, m."""
        i = int(np.clip(np.searchsorted(self.position, position), 1, len(self.position) - 1))
        one, other = self.position[i - 1 : i + 1]
        share = (position - one) / (other - one)
        mean = (1.0 - share) * self.temperature[i - 1] + share * self.temperature[i]
        return Profile(self.depth, np.asarray(mean))


def heat_alone(keys: Sequence[str]) -> tuple[_Heat, Steel, Rolls]:
    """The slab of the case without its mechanics, its steel and its rolls."""
    document = load_case(CASE, (*KEYS, *keys)).document()
    for name in ("mechanics", "coupling", "reference"):
        document.pop(name)
    document["machine"].pop("extraction")
    case = from_document(document)
    assert case.machine is not None
    rolls, noted = case.machine.pairs(), _Heat()
    assert rolls is not None
    simulation = build(case, MPI.COMM_SELF)
    try:
        TimeLoop(simulation, noted).run()  # type: ignore[arg-type]
    finally:
        simulation.destroy()
    return noted, simulation.steel, rolls


def shell_of(profile: Profile, steel: Steel) -> Shell:
    """The shell of a profile."""
    heat, depth = profile.temperature, profile.depth
    return Shell(profile.isotherm_depth(steel.solidus), lambda d: np.interp(d, depth, heat))


def growing(law: Law, span: Span, shells: Sequence[Shell]) -> float:
    """Largest bulge of an elastic strip between clamped ends whose shell grows, m.

    The shells are those at equal distances from the first to the last roll.
    """
    z = np.linspace(0.0, span.length, NODES)
    bending = [stiffness(law.elasticity, one.points()).bending for one in shells]
    soft = 1.0 / np.interp(z, np.linspace(0.0, span.length, len(shells)), bending)
    load = 0.5 * span.pressure * z * (span.length - z)
    matrix = [[np.trapezoid(f * g * soft, z) for g in (1.0, z)] for f in (1.0, span.length - z)]
    rest = [-np.trapezoid(f * load * soft, z) for f in (1.0, span.length - z)]
    first, shear = np.linalg.solve(np.array(matrix), np.array(rest))
    curvature = (first + shear * z + load) * soft
    slope = -np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * z[1])])
    w = np.concatenate([[0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) * z[1])])
    return float(w.max())


def by_place(cells: str) -> list[dict[str, Any]]:
    """Bulges of the pitches with shells of other places, in % of that with the middle's."""
    noted, steel, rolls = heat_alone(CELLS[cells])
    law = load_law("kozlowski_zhu_signed", load_elasticity(), carbon=0.1)
    strip, elastic, ahead = CreepingStrip(law), ElasticStrip(law.elasticity), ShellAhead(steel)
    places = [pair.position for pair in rolls.pairs]
    rows = []
    for roll in range(1, ROLLS + 1):
        start, length = places[roll - 1], places[roll] - places[roll - 1]
        span = Span(length, WEIGHT * (start + 0.5 * length), SPEED)
        middle = shell_of(noted.at(start + 0.5 * length), steel)
        bulge = strip.bulge(span, middle).largest
        row: dict[str, Any] = {
            "cells": cells, "roll": roll, "position": start, "pitch": 1e3 * length,
            "shell": 1e3 * middle.thickness, "bulge": 1e3 * bulge,
        }  # fmt: skip
        for place in PLACES:
            now = noted.at(start + place)
            later = ahead.later(now, (0.5 * length - place) / SPEED)
            for name, profile in (("at", now), ("from", later)):
                found = strip.bulge(span, shell_of(profile, steel)).largest
                row[f"{name}_{1e3 * place:g}"] = 100.0 * (found / bulge - 1.0)
        along = np.linspace(start, start + length, (NODES - 1) // BETWEEN + 1)
        exact = growing(law, span, [shell_of(noted.at(z), steel) for z in along])
        row["growing"] = 100.0 * (elastic.bulge(span, middle).largest / exact - 1.0)
        rows.append(row)
    return [*rows, _rms(rows)]


def _rms(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Root mean squares of the errors."""
    found: dict[str, Any] = {name: None for name in rows[0]}
    for name in rows[0]:
        if name.startswith(("at_", "from_", "growing")):
            found[name] = float(np.sqrt(np.mean([row[name] ** 2 for row in rows])))
    return found | {"cells": rows[0]["cells"], "roll": "rms"}


def by_window(folder: Path) -> list[dict[str, Any]]:
    """What the case has with windows of several lengths."""
    rows, bulges = [], []
    for window in WINDOWS:
        case: Case = load_case(CASE, (*KEYS, f"coupling.interval={window} mm"))
        assert case.machine is not None
        rolls = case.machine.pairs()
        assert rolls is not None
        summary, failure = finished_run(case, folder / f"{window}")
        assert not failure, failure
        history = read_history(folder / f"{window}" / "history.csv")
        places = np.array([pair.position for pair in rolls.pairs[:ROLLS]])
        rows_at = np.searchsorted(history["position"].to_numpy(), places + 1e-6)
        bulges.append(history["bulge_pitch"].to_numpy()[rows_at])
        rows.append(
            {
                "window": window,
                "force": float(history["roll_force"].to_numpy()[rows_at[-1]]),
                "I1": summary.quantities["bending_I1_max"].value / 1e6,
                "I2": 1e5 * summary.quantities["bending_I2_max"].value,
            }
        )
    for row, bulge in zip(rows, bulges, strict=True):
        for roll in (1, 7, 15):
            row[f"bulge_{roll}"] = float(bulge[roll - 1])
        row["off"] = 100.0 * float(np.sqrt(np.mean((bulge / bulges[-1] - 1.0) ** 2)))
    return rows


def main(output: Output, quick: bool) -> None:
    """Shells by place, and windows."""
    output.csv("strip_shell", [row for cells in CELLS for row in by_place(cells)])
    if not quick:
        output.csv("strip_windows", by_window(FOLDER))
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    rows = output.rows("strip_shell")
    head = {"cells": "cells", "roll": "below roll", "pitch": "pitch, mm", "shell": "shell, mm",
            "bulge": "bulge, mm"}  # fmt: skip
    head |= {f"at_{z}": f"shell {z} mm below the roll, %" for z in (0, 50, 100)}
    head |= {f"from_{z}": f"foreseen from {z} mm, %" for z in (0, 50)}
    head |= {"growing": "elastic, against a growing shell, %"}
    forms = dict.fromkeys(head, "+.1f") | {"pitch": ".0f", "shell": ".1f", "bulge": ".3f"}
    shown = [r for r in rows if r["roll"] == "rms" or (r["cells"] == "fine" and r["roll"] in SHOWN)]
    for row in shown:
        row["roll"] = str(row["roll"])
    if shown:
        output.insert("strip shell", table(shown, head, forms))
    head = {"window": "windows, mm", "bulge_1": "bulge below #1, mm", "bulge_7": "#7",
            "bulge_15": "#15", "off": "all, off 10 mm (rms), %", "force": "force on #15, kN/m",
            "I1": "I1 bending, MPa", "I2": "I2 bending, 1e-5 1/s"}  # fmt: skip
    forms = dict.fromkeys(head, ".4f") | {"window": "g", "off": ".1f", "force": ".2f"}
    forms |= {"I1": ".2f", "I2": ".2f"}
    if rows := output.rows("strip_windows"):
        output.insert("strip windows", table(rows, head, forms))
