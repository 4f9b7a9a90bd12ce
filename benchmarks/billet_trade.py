"""Error against run time of the coupled billet: cells, coupling windows, iterations, contact.

Writes tables and a figure of docs/billet.md. All runs of a mould are compared with the finer run
of `billet_error`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from benchmarks.billet_run import NAMES, every, mesh, run, touch
from benchmarks.report import PAGE, Output, errors_over_time

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOULDS = ("taper_1", "taper_0")
SIZES = (1.2, 0.8, 0.5)  # mm
WINDOWS = (0.2, 0.1, 0.05)  # s
ITERATIONS = 8  # limit of the default
PATIENCE = 900.0  # s
FACTOR = 10

COMPARED = {
    "heat_removed": ("heat [MJ/m]", 0.01),
    "shell_mid_face": ("shell, mid-face [mm]", 0.05),
    "shell_corner": ("shell, corner [mm]", 0.05),
    "surface_temperature_corner": ("surface, corner [K]", 2.0),
    "von_mises_max": ("peak stress [MPa]", 0.1),
    "von_mises_mid_face": ("stress, mid-face [MPa]", 0.1),
    "size_corner": ("diagonal [mm]", 0.01),
}
"""Compared quantities: heading, and the unit in which `worst` counts the error."""


@dataclass(frozen=True)
class Setting:
    """Settings of a run: cells [mm], coupling window [s], iterations, method of contact."""

    size: float
    window: float
    iterations: int = ITERATIONS
    contact: str = "penalty"

    @property
    def keys(self) -> tuple[str, ...]:
        """Assignments to keys of the case."""
        passes = f"coupling.passes={self.iterations}"
        return (*mesh(self.size), every(self.window), passes, touch(self.contact, FACTOR))

    @property
    def kind(self) -> str:
        """Kind of the run, which sets its colour in the figure."""
        return f"{self.contact}, {'1 iteration' if self.iterations == 1 else 'converged'}"


DEFAULT = Setting(0.8, 0.2)


def reference(mould: str) -> dict[str, float]:
    """Return the results of the finer run of `billet_error` for a mould."""
    rows = {(r["mould"], r["run"]): r for r in Output(PAGE.parent).rows("billet_error")}
    return {name: rows[mould, "finer"][name] for name in COMPARED}


def settings(quick: bool) -> Iterator[Setting]:
    """Yield all cells with all windows; Nitsche's method and one iteration near the default."""
    sizes = (2.0,) if quick else SIZES
    windows = (0.5,) if quick else WINDOWS
    for size in sizes:
        for window in windows:
            yield Setting(size, window)
            if (size, window) == (DEFAULT.size, DEFAULT.window):
                yield Setting(size, window, contact="nitsche")
            if size == DEFAULT.size and window >= DEFAULT.window:
                yield Setting(size, window, iterations=1)


def errors(values: Mapping[str, float], exact: Mapping[str, float]) -> dict[str, float]:
    """Return the errors of the compared quantities, and their largest in its unit as `worst`."""
    found = {name: abs(values[name] - exact[name]) for name in COMPARED}
    return found | {"worst": max(found[name] / unit for name, (_, unit) in COMPARED.items())}


def measure(mould: str, quick: bool) -> list[dict[str, Any]]:
    """Run all settings of a mould; return a row of results for each."""
    rows = []
    for setting in settings(quick):
        found = run(mould, setting.keys, PATIENCE)
        rows.append(
            {
                "kind": setting.kind, "size": setting.size, "window": setting.window,
                "cells": found.cells, "newton": found.newton, "cut": found.cut,
                "seconds": found.seconds, **{k: found.values[k] for k in COMPARED},
                "default": setting == DEFAULT, "failure": found.failure,
            }
        )  # fmt: skip
    return sorted(rows, key=lambda r: r["seconds"])


COLOURS = {
    "penalty, converged": "#0072b2",
    "penalty, 1 iteration": "#009e73",
    "nitsche, converged": "#d55e00",
}
MARKERS = {0.5: "v", 0.2: "v", 0.1: "o", 0.05: "^"}
DRAWN = ("worst", "von_mises_max")


def draw(runs: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    """Draw error against processor time; the default ringed, the runs that none beats joined."""
    labels = {"worst": "largest error, in units of the text", "von_mises_max": "peak stress [MPa]"}
    panels = []
    for mould, results in runs.items():
        rows = [
            {key: row[key] for key in (*DRAWN, "seconds", "default")}
            | {"colour": COLOURS[row["kind"]], "marker": MARKERS[row["window"]]}
            | {"size": 3.0 + 2.5 / row["size"]}
            for row in results
        ]
        panels.append([(mould, rows, key, labels[key]) for key in DRAWN])
    legend = [(kind, "s", colour) for kind, colour in COLOURS.items()]
    legend += [(f"{window:g} s", MARKERS[window], "#777777") for window in WINDOWS]
    return errors_over_time(panels, legend)


def show(output: Output) -> None:
    """Write the tables from the data."""
    for mould in MOULDS:
        show_mould(output, mould, output.rows(f"billet_trade_{mould}"))


def show_mould(output: Output, mould: str, rows: Sequence[dict[str, Any]]) -> None:
    """Write the table of one mould from rows with errors."""
    lines = [r | {"kind": f"**{r['kind']}**"} if r["default"] else r for r in rows]
    head: dict[str, Any] = {
        "kind": "contact, gap", "size": "cells [mm]", "window": "window [s]",
        "newton": "Newton iterations", "cut": "cut back", "seconds": ("time [s]", ".1f"),
    }  # fmt: skip
    head |= {k: (label, ".2g") for k, (label, _) in COMPARED.items()}
    output.table(f"billet trade {mould}", lines, head | {"worst": ("largest", ".1f")})


def main(output: Output, quick: bool) -> None:
    """Run both moulds; write data, tables and figure."""
    found = {mould: measure(mould, quick) for mould in MOULDS}
    drawn = {}
    for mould, rows in found.items():
        exact = reference(mould)
        drawn[NAMES[mould]] = [r | errors(r, exact) for r in rows]
        output.csv(f"billet_trade_{mould}", drawn[NAMES[mould]])
    show(output)
    output.figure("billet_trade", draw(drawn))
