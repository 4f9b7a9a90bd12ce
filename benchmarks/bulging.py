"""Bulging of the slab between its rolls by three models: pitch by pitch, and what the slice feels.

Runs cases/slab1200/bulging.toml with each, into results/benchmarks/bulging (a run that is finished
there is not repeated), and the strip alone on shells like its own.  Writes tables and a figure of
docs/slab_bulging.md.
"""

from __future__ import annotations

import csv
from pathlib import Path
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import ROOT, Output, table
from castfem.model import Case, load_case
from castfem.physics.constitutive import load_elasticity, load_law
from castfem.physics.machine.bulging import CreepingStrip, Shell, Span
from castfem.runs import loop
from castfem.runs.output.summary import Summary

CASE = ROOT / "cases" / "slab1200" / "bulging.toml"
FOLDER = ROOT / "results" / "benchmarks" / "bulging"
MODELS = ("thesis", "elastic", "creep")
STRAINED = "creep, with its axial strain"
SHOWN = (1, 4, 7, 8, 15, 22, 30, 40, 48, 50, 57)  # rolls at which the table has a row
# Thickness, m; surface, degC; pitch, m; pressure, Pa: from the top of the caster, its straightener,
# and a roll lost at each.
SHELLS = (
    (0.018, 1130.0, 0.18, 0.08e6),
    (0.03, 1050.0, 0.25, 0.2e6),
    (0.085, 940.0, 0.32, 0.75e6),
    (0.03, 1050.0, 0.5, 0.2e6),
    (0.085, 940.0, 0.64, 0.75e6),
)
FINE = {"steps": 256, "layers": 96}


def main(output: Output, quick: bool) -> None:
    """The slab by each model, and the strip alone."""
    length = ["casting.length=1.3 m", "mesh.face_size=150 mm"] if quick else []
    pitches: dict[str, dict[str, Any]] = {}
    runs = []
    for model in ("creep",) if quick else (*MODELS, STRAINED):
        given = f"mechanics.bulging={model}"
        if model == STRAINED:
            given = 'mechanics.bulging={ model = "creep", axial_strain = true }'
        changes = [given, "output.figures=false", "output.fields=[]"]
        case = load_case(CASE, (*changes, *length))
        folder = (output.folder if quick else FOLDER) / model.split(",")[0]
        if model == STRAINED:
            folder = folder.with_name("strained")
        summary = Summary.load(folder)
        if summary is None or summary.status != "finished":
            summary = loop.run(case, folder, comm=MPI.COMM_SELF, resume=folder.exists())
        runs.append({"model": model} | _effects(summary))
        if model == STRAINED:
            continue
        for row in _by_pitch(folder, case):
            kept = pitches.setdefault(str(row["roll"]), row)
            kept[model] = row["largest"]
    rows = [{k: v for k, v in row.items() if k != "largest"} for row in pitches.values()]
    output.csv("bulging_pitches", rows)
    output.csv("bulging_runs", runs)
    output.csv("bulging_strip", [_alone(*given) for given in SHELLS])
    _draw(output, rows)
    show(output)


def _effects(summary: Summary) -> dict[str, float]:
    """What the slice has felt by the end of a run."""
    found = {n: q.value for n, q in summary.quantities.items()}
    return {
        "I1": found.get("way_I1_max", np.nan) / 1e6,
        "I2": 1e5 * found.get("way_I2_max", np.nan),
        "peak": found["way_von_mises_max"] / 1e6,
        "thickness": 1e3 * found["size_mid_face_intrados"],
        "width": 1e3 * found["size_narrow_face"],
        "strain": 100.0 * found["axial_strain"],
        "work": found["bending_work"] / 1e3,
    }


def _by_pitch(folder: Path, case: Case) -> list[dict[str, Any]]:
    """The pitches that a run went through, from its history."""
    assert case.machine is not None
    rolls = case.machine.pairs()
    assert rolls is not None
    with (folder / "history.csv").open(newline="", encoding="utf-8") as file:
        history = [
            {name.split(" [")[0]: value for name, value in row.items()}
            for row in csv.DictReader(file)
        ]
    at = np.array([float(row["position"]) for row in history])
    found = []
    for number, (one, other) in enumerate(zip(rolls.pairs, rolls.pairs[1:], strict=False), 1):
        after = np.flatnonzero(at > one.position + 1e-6)
        if not len(after):
            break
        row = history[after[0]]
        found.append(
            {
                "roll": number,
                "position": one.position,
                "pitch": 1e3 * (other.position - one.position),
                "shell": float(row["shell_mid_face_intrados"]),
                "surface": float(row["surface_temperature_mid_face_intrados"]),
                "force": float(row["roll_force"]),
                "largest": float(row["bulge_pitch"]),
            }
        )
    return found


def _alone(thickness: float, surface: float, length: float, pressure: float) -> dict[str, Any]:
    """The strip of one shell: its bulge, its error and its cost."""
    law = load_law("kozlowski_zhu_signed", load_elasticity(), carbon=0.1)
    rise = (1488.6 - surface) / thickness
    shell = Shell(thickness, lambda depth: surface + 273.15 + rise * depth)
    span = Span(length, pressure, 0.02)
    strip = CreepingStrip(law)
    strip.bulge(span, shell)
    start = process_time()
    found = strip.bulge(span, shell)
    seconds = process_time() - start
    fine = CreepingStrip(law, **FINE).bulge(span, shell)
    top, at, low = found.extremes()
    return {
        "shell": 1e3 * thickness, "surface": surface, "pitch": 1e3 * length,
        "pressure": pressure / 1e6, "largest": 1e3 * top, "at": at / length, "smallest": 1e3 * low,
        "front": 100.0 * float(np.ptp(found.front_strain)),
        "error": 100.0 * (top / fine.largest - 1.0), "seconds": seconds,
    }  # fmt: skip


def _draw(output: Output, rows: list[dict[str, Any]]) -> None:
    """Largest bulge of each pitch down the caster, the counterpart of Fig. 141."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.subplots()
    position = [row["position"] for row in rows]
    looks = {"thesis": ("0.55", "thesis' plate (308)"), "elastic": ("tab:blue", "elastic strip"),
             "creep": ("tab:red", "creeping strip")}  # fmt: skip
    for model in (m for m in looks if m in rows[0]):
        colour, label = looks[model]
        values = [row[model] for row in rows]
        axes.step(position, values, where="post", color=colour, label=label)
    axes.set_xlabel("position below the meniscus [m]")
    axes.set_ylabel("largest bulge of the pitch [mm]")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False)
    output.figure("slab_bulging", figure)


def show(output: Output) -> None:
    """The tables, from the data."""
    head = {
        "roll": "below roll", "position": "at, m", "pitch": "pitch, mm", "shell": "shell, mm",
        "surface": "surface, °C", "thesis": "thesis' plate, mm", "elastic": "elastic strip, mm",
        "creep": "creeping strip, mm", "force": "force on the roll, kN/m",
    }  # fmt: skip
    forms = {"position": ".2f", "pitch": ".0f", "shell": ".1f", "surface": ".0f", "force": ".0f"}
    forms |= dict.fromkeys(MODELS, ".3f")
    rows = [row for row in output.rows("bulging_pitches") if row["roll"] in SHOWN]
    output.insert("bulging pitches", table(rows, head, forms))
    head = {
        "model": "bulging", "I1": "I1, MPa", "I2": "I2, 1e-5 1/s",
        "peak": "largest von Mises stress, MPa", "thickness": "thickness at mid-face, mm",
        "width": "width, mm", "strain": "axial strain, %", "work": "work of bending, kJ/m",
    }  # fmt: skip
    forms = {"I1": ".2f", "I2": ".2f", "peak": ".2f", "thickness": ".3f", "width": ".2f"}
    forms |= {"strain": ".4f", "work": ".3f"}
    output.insert("bulging runs", table(output.rows("bulging_runs"), head, forms))
    head = {
        "shell": "shell, mm", "surface": "surface, °C", "pitch": "pitch, mm",
        "pressure": "pressure, MPa", "largest": "bulge, mm", "at": "at z/L",
        "smallest": "least, mm",
        "front": "swing of the strain at the front, %", "error": "error, %", "seconds": "time, s",
    }  # fmt: skip
    forms = {"largest": ".3f", "at": ".2f", "smallest": ".3f", "front": ".2f", "error": "+.2f",
             "seconds": ".2f"}  # fmt: skip
    output.insert("bulging strip", table(output.rows("bulging_strip"), head, forms))
