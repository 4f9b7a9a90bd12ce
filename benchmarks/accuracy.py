"""Error against run time by time scheme, cell, mesh and step; the reference is converged."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from benchmarks import reference as converged
from benchmarks.billet import CASE, LATE, LENGTHS, Result, Settings, run
from benchmarks.reference import Reference, load
from benchmarks.report import Output, front, table
from castfem.base.types import Array
from castfem.model import load_case

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEVELS = ((1.0, 0.2), (0.3, 0.06), (0.1, 0.02))
"""Error levels: K at mid-face and in the corner, % of the heat removed."""

GRADED = Settings(
    surface_size=0.4, corner_size=0.4, face_size=4.0, core_size=4.0, surface_depth=5.0,
    core_depth=20.0,
)  # fmt: skip
"""The cheapest grading: fine cells to the depth of the shell, then quickly growing ones."""

SIZES = {"quadrilateral": (1.2, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2), "triangle": (0.8, 0.6, 0.4)}
FIXED = {"sdirk2": (0.5, 0.25, 0.1, 0.05), "backward_euler": (0.5, 0.1, 0.05, 0.02, 0.01)}
ADAPTIVE = {"sdirk2": (10.0, 5.0, 2.0, 0.5), "backward_euler": (5.0, 0.5)}

NAMES = {
    ("quadrilateral", "sdirk2"): "quadrilaterals, SDIRK2",
    ("quadrilateral", "backward_euler"): "quadrilaterals, backward Euler",
    ("triangle", "sdirk2"): "triangles, SDIRK2",
    ("triangle", "backward_euler"): "triangles, backward Euler",
}


class History(Protocol):
    """Results of any program at the instants of comparison."""

    @property
    def mid_face(self) -> Array:
        """Surface temperature at mid-face (n,), degC."""
        ...

    @property
    def corner(self) -> Array:
        """Surface temperature in the corner (n,), degC."""
        ...

    @property
    def heat(self) -> Array:
        """Heat removed from the whole section (n,), MJ/m."""
        ...


def errors(result: History, reference: Reference) -> dict[str, float]:
    """Return the errors of a run at the mould exit (10 s) and the largest from 5 s on; K and %."""
    mid = result.mid_face - reference.values["mid_face"]
    corner = result.corner - reference.values["corner"]
    heat = 100.0 * (result.heat / reference.values["heat"] - 1.0)
    return {
        "mid_face_exit_K": float(mid[-1]),
        "corner_exit_K": float(corner[-1]),
        "heat_exit_percent": float(heat[-1]),
        "mid_face_late_K": float(np.abs(mid[LATE]).max()),
        "corner_late_K": float(np.abs(corner[LATE]).max()),
        "heat_late_percent": float(np.abs(heat[LATE]).max()),
    }


def worst(row: dict[str, Any]) -> float:
    """Return the largest temperature error from 5 s on, K."""
    return float(max(row["mid_face_late_K"], row["corner_late_K"]))


def row_of(result: Result, reference: Reference) -> dict[str, Any]:
    """Return the row of a run in the table."""
    s = result.settings
    return {
        "variant": s.corner,
        "cell": s.cell,
        "scheme": s.scheme,
        "surface_size_mm": s.surface_size,
        "surface_depth_mm": s.surface_depth,
        "core_size_mm": s.core_size,
        "stepping": s.stepping,
        "vertices": result.vertices,
        "steps": result.steps,
        "newton": result.newton,
        "seconds": result.wall,
        **errors(result, reference),
    }


def sweep(corner: str, quick: bool = False) -> Iterable[Settings]:
    """Yield the settings of all runs of a variant."""
    # At a sharp corner the shell is twice as thick along the diagonal.
    base = replace(GRADED, corner=corner, surface_depth=5.0 if corner == "rounded" else 10.0)
    for cell, sizes in SIZES.items():
        if corner == "sharp" and cell == "triangle":
            continue  # halved rectangles: the same equations except at the corner's vertex
        for size in sizes[:3] if quick else sizes:
            mesh = replace(base, cell=cell, surface_size=size, corner_size=size)
            for scheme in ("sdirk2", "backward_euler"):
                if scheme == "backward_euler" and (corner == "sharp" or size in sizes[3:6:2]):
                    continue
                for step in FIXED[scheme][: 2 if quick else None]:
                    yield replace(mesh, scheme=scheme, step=step)
                for tolerance in ADAPTIVE[scheme][: 1 if quick else None]:
                    yield replace(mesh, scheme=scheme, tolerance=tolerance)


def cheapest(
    rows: list[dict[str, Any]], level: tuple[float, float], **like: Any
) -> dict[str, Any] | None:
    """Return the fastest run within a level among the rows that have the values `like`."""
    good = [
        r
        for r in rows
        if worst(r) <= level[0]
        and r["heat_late_percent"] <= level[1]
        and all(r[k] == v for k, v in like.items())
    ]
    return min(good, key=lambda r: r["seconds"]) if good else None


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Draw temperature and heat errors over run time, with the front of each scheme and cell."""
    from castfem.post.plots.style import look, new_figure

    colours = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
    with look():
        figure = new_figure(9.0, 3.9)
        axes = figure.subplots(1, 2)
        panels = (("worst_K", "temperature error [K]"), ("heat_late_percent", "heat error [%]"))
        for axis, (key, label) in zip(axes, panels, strict=True):
            for (kind, name), colour in zip(NAMES.items(), colours, strict=True):
                own = [r for r in rows if (r["cell"], r["scheme"]) == kind]
                axis.plot(
                    [r["seconds"] for r in own],
                    [r[key] for r in own],
                    ".",
                    color=colour,
                    alpha=0.25,
                    markersize=5,
                )
                axis.step(*front(own, key), where="post", color=colour, label=name)
            axis.set(xscale="log", yscale="log", xlabel="run time [s]", ylabel=label)
        for number, level in enumerate(LEVELS):
            for axis, y in zip(axes, level, strict=True):
                axis.axhline(y, color="#555555", linewidth=0.8, linestyle=(0, (2, 3 - number)))
        axes[0].legend(loc="lower left")
        axes[0].set_title("largest of mid-face and corner, 5 s to 10 s")
        axes[1].set_title("heat removed, 5 s to 10 s")
    return figure


HEADINGS = {
    "level": "target",
    "kind": "cell, scheme",
    "surface_size_mm": "surface size [mm]",
    "stepping": "step",
    "vertices": "vertices",
    "steps": "steps",
    "mid_face_late_K": "mid-face [K]",
    "corner_late_K": "corner [K]",
    "heat_late_percent": "heat [%]",
    "mid_face_exit_K": "mid-face, exit [K]",
    "corner_exit_K": "corner, exit [K]",
    "seconds": "time loop [s]",
}
FORMATS = {
    "mid_face_late_K": ".3f",
    "corner_late_K": ".3f",
    "heat_late_percent": ".4f",
    "mid_face_exit_K": "+.3f",
    "corner_exit_K": "+.3f",
    "seconds": ".2f",
}


def levels_table(rows: list[dict[str, Any]], variant: str) -> str:
    """Return the table of the cheapest settings for each level by cell and scheme."""
    lines = []
    for level in LEVELS:
        for (cell, scheme), name in NAMES.items():
            if not any(r["cell"] == cell and r["scheme"] == scheme for r in rows):
                continue
            found = cheapest(rows, level, cell=cell, scheme=scheme, variant=variant)
            target = f"{level[0]:g} K, {level[1]:g} %"
            lines.append({"level": target, "kind": name, **(found or {"stepping": "not reached"})})
    return table(lines, HEADINGS, FORMATS)


def default_settings() -> Settings:
    """Return mesh and time stepping of the shipped case."""
    case = load_case(CASE)
    mesh, time = case.mesh, case.thermal.time
    adaptive = time.adaptive
    lengths = {n: getattr(mesh, n) for n in LENGTHS}
    return Settings(
        cell=mesh.cell,
        scheme=time.scheme,
        step=time.step,
        tolerance=None if adaptive is None else adaptive.tolerance,
        largest=0.5 if adaptive is None else adaptive.largest,
        **{n: 1e3 * v for n, v in lengths.items() if v is not None},
    )


def main(output: Output, quick: bool = False) -> None:
    """Run the sweep of both variants; write tables, CSV and figure."""
    references = load()
    rows: list[dict[str, Any]] = []
    for corner, reference in references.items():
        for settings in sweep(corner, quick):
            result = run(settings, repeats=1 if quick else 3)
            rows.append(row_of(result, reference))
        done = [r for r in rows if r["variant"] == corner]
        print(f"accuracy, {corner}: {len(done)} runs")
    output.csv("accuracy", rows)
    rounded = [r | {"worst_K": worst(r)} for r in rows if r["variant"] == "rounded"]
    output.figure("accuracy", draw(rounded))
    defaults = []
    for name, corner, depth in (("as shipped", "rounded", None), ("sharp corner", "sharp", 10.0)):
        settings = replace(default_settings(), corner=corner)
        if depth is not None:
            settings = replace(settings, surface_depth=depth)
        result = run(settings, repeats=2 if quick else 7, patience=3.0)
        defaults.append({"level": name, **row_of(result, references[corner])})
    output.csv("accuracy_defaults", defaults)
    show(output)


def show(output: Output) -> None:
    """Write the tables from the data."""
    converged.show(output)
    rows = output.rows("accuracy")
    for corner in dict.fromkeys(r["variant"] for r in rows):
        done = [r for r in rows if r["variant"] == corner]
        output.insert(f"levels {corner}", levels_table(done, corner))
    headings = {k: v for k, v in HEADINGS.items() if k != "kind"} | {"level": "case"}
    output.insert("defaults", table(output.rows("accuracy_defaults"), headings, FORMATS))
