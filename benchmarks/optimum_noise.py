"""Scatter of results between neighbours of the 125 mm billet, by its taper and windows.

Five runs a thousandth of the search's range apart, about straight lines, as `castfem optimise`
measures it; beside it what 0.1 %/m changes, by two further runs. Would replay of one run's windows
in the others make a search better?
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Output, table
from castfem.api import load
from castfem.studies.optimisation import Evaluation, Evaluator

_APART, _AWAY = 0.004, 0.1  # %/m
_TAPERS = (1.0, 0.59, 0.0, -1.0)
CHANGES: dict[str, Any] = {}
"""Of the case, in all runs."""
WINDOWS = {"0.2 s": {}, "1 s, cut for their error": {"coupling.interval": "0.5 s"}}  # at coarse
_RESULTS = {"von_mises_max": ("stress", 1e-6), "heat_removed": ("heat", 1e-3),
            "mould_gap_max": ("gap", 1e6)}  # fmt: skip
SHOWN = {
    "taper": "taper [%/m]",
    "windows": "windows",
    "counts": "windows, thermal steps of the five",
    "stress": "peak stress: noise [MPa]",
    "stress_step": "by 0.1 %/m [MPa]",
    "heat": "heat: noise [kJ/m]",
    "heat_step": "by 0.1 %/m [kJ/m]",
    "gap": "largest gap: noise [µm]",
    "gap_step": "by 0.1 %/m [µm]",
    "as_taper": "noise of the heat as taper [%/m]",
}


def main(output: Output, quick: bool) -> None:
    """Run and write; quick: at one taper."""
    root = Path(os.environ.get("CASTFEM_RUNS", "results/optimum")) / "noise"
    rows = []
    case = load("billet125/optimum_single").with_(CHANGES)
    with Evaluator(case, root, processes=2) as evaluator:
        for words, changes in WINDOWS.items():
            for taper in _TAPERS[:1] if quick else _TAPERS:
                tapers = [taper + k * _APART for k in range(-2, 3)]
                tapers += [taper - _AWAY, taper + _AWAY]
                wanted = [{**changes, "mould.taper": f"{round(t, 6):g} %/m"} for t in tapers]
                found = evaluator.many(wanted, "coarse")
                rows.append(_row(words, taper, np.array(tapers[:5]), found))
                print(f"  {rows[-1]}", flush=True)
                output.csv("optimum_noise", rows)
    show(output)


def _row(words: str, taper: float, tapers: Any, found: list[Evaluation]) -> dict[str, Any]:
    row: dict[str, Any] = {"taper": taper, "windows": words, "counts": _counts(found[:5])}
    for name, (short, factor) in _RESULTS.items():
        values = factor * np.array([one[name] for one in found])
        line = np.polynomial.Polynomial.fit(tapers, values[:5], 1)
        rest = values[:5] - line(tapers)
        row[short] = float(np.sqrt(np.sum(rest**2) / 3.0))
        row[f"{short}_step"] = float(values[6] - values[5]) * 0.5
    row["as_taper"] = 0.1 * row["heat"] / abs(row["heat_step"])
    return row


def _counts(found: list[Evaluation]) -> str:
    """The counts of windows and steps that there were."""
    pairs = []
    for one in found:
        assert one.folder is not None
        steps = json.loads((one.folder / "summary.json").read_text(encoding="utf-8"))["steps"]
        pairs.append((int(steps["coupling windows"]), int(steps["accepted"])))
    return "; ".join(f"{windows}, {steps}" for windows, steps in sorted(set(pairs)))


def show(output: Output) -> None:
    """The table from the data."""
    forms = {"taper": "+g", "stress": ".1g", "stress_step": ".2g", "heat": ".1g",
             "heat_step": ".2g", "gap": ".1g", "gap_step": ".2g", "as_taper": ".1g"}  # fmt: skip
    output.insert("optimum noise", table(output.rows("optimum_noise"), SHOWN, forms))
