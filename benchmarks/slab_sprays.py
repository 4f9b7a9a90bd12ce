"""Temperature of the slab from roll to roll: errors, and heat by mechanism.

Runs cases/slab1200/sprays.toml as shipped, with coarser cells, and with stricter steps down to 6 m,
into results/benchmarks/slab_sprays (finished runs are not repeated). Writes tables of
docs/slab_heat.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.finished_run import Finished, finished_run
from benchmarks.report import ROOT, Output
from castfem.model import Case, load_case
from castfem.post.plots.secondary import faces_met

if TYPE_CHECKING:
    import pandas as pd

    from castfem.physics.machine.rolls import Rolls

CASE = ROOT / "cases" / "slab1200" / "sprays.toml"
FOLDER = ROOT / "results" / "benchmarks" / "slab_sprays"
QUIET = ("output.fields=[]", "output.figures=false")
TO = 6.0  # length of the run with stricter steps, m
RUNS: dict[str, tuple[str, ...]] = {
    "3 mm": ("mesh.surface_size=3 mm", "mesh.corner_size=3 mm"),
    "3 mm, 0.2 K, to 6 m": (
        "mesh.surface_size=3 mm", "mesh.corner_size=3 mm", "thermal.time.adaptive.tolerance=0.2 K",
        "thermal.time.adaptive.largest=0.25 s", f"casting.length={TO:g} m",
    ),
    "2 mm": ("mesh.surface_size=2 mm", "mesh.corner_size=2 mm"),
    "1 mm, as shipped": (),
}  # fmt: skip
SHIPPED = "1 mm, as shipped"
AGAINST = {"3 mm": SHIPPED, "2 mm": SHIPPED, "3 mm, 0.2 K, to 6 m": "3 mm"}
LINES = {"mid_face": "surface_temperature_mid_face", "corner": "surface_temperature_corner"}
SETTLED = 0.02  # distance below the mould from which surfaces are compared, m
SIDES = ("intrados", "extrados")
STRETCHES = {"mould to #15": (None, 15), "mould to #57": (None, 57), "#49 to #57": (49, 57)}


def main(output: Output, quick: bool) -> None:
    """Do all runs; write errors, heat by mechanism, and surface changes in the straightener."""
    runs: dict[str, Finished] = {}
    if quick:
        case = load_case(CASE, (*QUIET, *RUNS["3 mm"], "casting.length=1.2 m"))
        finished_run(case, output.folder / "sprays")
        return
    for name, keys in RUNS.items():
        case = load_case(CASE, (*QUIET, *keys))
        folder = FOLDER / "".join(c if c.isalnum() else "_" for c in name)
        runs[name] = finished_run(case, folder)
        print(f"  {name}: {runs[name].seconds:.0f} s", flush=True)
    output.csv("slab_sprays", [_row(name, runs) for name in RUNS])
    shipped = load_case(CASE)
    assert shipped.machine is not None
    rolls = shipped.machine.pairs()
    assert rolls is not None
    history = runs[SHIPPED].history
    output.csv("slab_sprays_heat", _heat(shipped, rolls, history))
    output.csv("slab_sprays_surface", [{"case": "sprays"} | _surface(shipped, rolls, history)])
    show(output)


def _row(name: str, runs: dict[str, Finished]) -> dict[str, Any]:
    """Return the results of a run and the differences of its surface from the next finer run."""
    run = runs[name]
    summary, history = run.summary, run.history
    heat = summary.balances["heat"]
    row: dict[str, Any] = {
        "name": name,
        "steps": int(summary.steps["accepted"]),
        "rejected": int(summary.steps["rejected"]),
        "seconds": run.seconds,
        "closes": summary.quantities["metallurgical_length"].value
        if "metallurgical_length" in summary.quantities
        else None,
        "heat": summary.quantities["heat_removed"].value / 1e6,
        "balance": next(abs(q.value) for q in heat.values() if "over the run" in q.label),
    }
    against = AGAINST.get(name)
    for line, column in LINES.items():
        row[f"{line}_rms"] = row[f"{line}_largest"] = None
        if against is not None:
            other = runs[against].history
            end = min(history["position"].iloc[-1], other["position"].iloc[-1])
            off = _differences(history, other, f"{column}_intrados", end)
            row[f"{line}_rms"] = float(np.sqrt(np.mean(off**2)))
            row[f"{line}_largest"] = float(np.abs(off).max())
    return row | {"against": against or ""}


def _differences(one: pd.DataFrame, other: pd.DataFrame, column: str, end: float) -> np.ndarray:
    """Return differences of a surface temperature every 5 mm from below the mould on, K."""
    at = np.arange(0.8 + SETTLED, end, 0.005)
    read = [
        np.interp(at, run["position"].to_numpy(), run[column].to_numpy()) for run in (one, other)
    ]
    return np.asarray(read[0] - read[1])


def _heat(case: Case, rolls: Rolls, history: pd.DataFrame) -> list[dict[str, Any]]:
    """Return shares of the heat out of both mid-faces by roll, spray, water and radiation, %."""
    at, time = history["position"].to_numpy(), history["time"].to_numpy()
    faces = faces_met(case, rolls, float(at[-1]))
    found = []
    for name, (first, last) in STRETCHES.items():
        low = 0.8 if first is None else rolls.pairs[first - 1].position
        high = rolls.pairs[last - 1].position
        sums: dict[str, float] = {}
        for face in SIDES:
            flux = history[f"heat_flux_mid_face_{face}"].to_numpy()
            taken = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (flux[1:] + flux[:-1]))])
            for stretch in faces[face]:
                ends = np.clip([stretch.start, stretch.end], low, high)
                heat = float(np.diff(np.interp(ends, at, taken))[0])
                sums[stretch.kind] = sums.get(stretch.kind, 0.0) + heat
        total = sum(sums.values())
        found.append({"where": name} | {kind: 100.0 * heat / total for kind, heat in sums.items()})
    return found


def _surface(case: Case, rolls: Rolls, history: pd.DataFrame) -> dict[str, float]:
    """Return temperature drops of the surface in the straightener and above the bender, K."""
    at = history["position"].to_numpy()
    straightener = tuple(rolls.pairs[i - 1].position for i in (49, 57))
    above = 0.8, rolls.pairs[7].position
    middle = {face: history[f"surface_temperature_mid_face_{face}"].to_numpy() for face in SIDES}
    met = faces_met(case, rolls, float(at[-1]))["intrados"]
    found: dict[str, float] = {}
    for where, (low, high) in {"straightener": straightener, "top": above}.items():
        for kind in ("spray", "contact"):
            falls = []
            for stretch in met:
                if stretch.kind != kind or stretch.start < low or stretch.end > high:
                    continue
                rows = (at >= stretch.start - 1e-6) & (at <= stretch.end + 1e-6)
                if rows.any():
                    begun = float(np.interp(stretch.start, at, middle["intrados"]))
                    falls.append(begun - float(middle["intrados"][rows].min()))
            found[f"{where}_{kind}_least"] = min(falls, default=np.nan)
            found[f"{where}_{kind}_most"] = max(falls, default=np.nan)
    points = np.arange(*straightener, 0.005)
    read = {face: np.interp(points, at, line) for face, line in middle.items()}
    found["extrados_warmer"] = float((read["extrados"] - read["intrados"]).mean())
    corner = np.interp(points, at, history["surface_temperature_corner_intrados"].to_numpy())
    return found | {"corner_least": float(corner.min()), "corner_most": float(corner.max())}


def show(output: Output) -> None:
    """Write the tables from the data."""
    head: dict[str, Any] = {
        "name": "cells at the surface", "steps": "steps", "rejected": "rejected",
        "closes": ("solid throughout, m", ".2f"), "heat": ("heat removed to the end, MJ/m", ".1f"),
        "against": "against", "mid_face_rms": ("mid-face, rms, K", ".1f"),
        "mid_face_largest": ("largest, K", ".1f"), "corner_rms": ("corner, rms, K", ".1f"),
        "corner_largest": ("largest, K ", ".1f"), "seconds": ("time, s", ".0f"),
    }  # fmt: skip
    output.table("slab sprays", output.rows("slab_sprays"), head)
    kinds = {"contact": "rolls", "spray": "sprays", "run_off": "run-off water",
             "shade": "radiation"}  # fmt: skip
    head = {"where": "heat out of the mid-faces, %"} | {k: (w, ".0f") for k, w in kinds.items()}
    output.table("slab sprays heat", output.rows("slab_sprays_heat"), head)
