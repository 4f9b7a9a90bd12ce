"""Stress error against run time on Weiner and Boley's solidifying half-space."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.report import Output, front, table
from benchmarks.slices import CoolingSlice, Heat
from castfem import meshes
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.physics.closed_forms.half_space import (
    DIFFUSIVITY,
    POISSON,
    SURFACE,
    YIELD,
    YOUNG,
    HalfSpace,
)
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.parameters import load_law
from castfem.physics.materials import load_steel
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.supports import PrescribedDisplacement
from castfem.physics.thermal.flux_laws import PrescribedTemperature

if TYPE_CHECKING:
    from matplotlib.figure import Figure


EXACT = HalfSpace()
POURED = 1495.0  # degC
LENGTH, DEPTH = 30.0, 16.0  # mm: of the strip, and the shell at the end
INSTANTS = (5.0, 21.0)  # s
AROUND = 1.0  # s: while the front passes a few cells the error goes up and down
EVERY = 0.5  # s between the instants in this time; every step hits them
LEVELS = (5.0, 2.0, 1.0)  # % of 20 MPa
RATIO = 1e-6  # stiffness of the liquid


@dataclass(frozen=True, slots=True)
class Settings:
    """What a run is made with."""

    size: float  #: of the cells (of those of the shell where they are graded), mm
    step: float  #: s
    cell: str = "quadrilateral"  #: kind
    scheme: str = "sdirk2"  #: "sdirk2", "backward_euler", or "exact": the closed form's temperature
    #: "even"; "core": `size` as deep as the shell gets, then growing to 2 mm; "shell": growing from
    #: `size` at the surface to four times as much at the end of the shell
    grading: str = "even"


def mesh_of(settings: Settings) -> meshes.SectionMesh:
    """The strip, one cell wide."""
    size = 1e-3 * settings.size
    given = {
        "even": {"core_size": size},
        "core": {"core_size": 2e-3, "surface_depth": 1e-3 * DEPTH},
        "shell": {"core_size": 4 * size, "core_depth": 1e-3 * DEPTH},
    }[settings.grading]
    return meshes.build(
        "strip", length=1e-3 * LENGTH, width=size, surface_size=size, cell=settings.cell, **given
    )


def exact_temperature(places: Array, time: float) -> Array:
    """Of the closed form, K; the melt as it was poured."""
    z = places[:, 0] / (2.0 * np.sqrt(DIFFUSIVITY * time))
    return np.where(z < EXACT.front, EXACT.temperature(z), POURED) + ZERO_CELSIUS


def strip(settings: Settings, options: dict[str, Any] | None = None) -> CoolingSlice:
    """The strip: it may strain uniformly along y and z, as the shell of a half-space does."""
    steel = load_steel("weiner_boley")
    elasticity = Elasticity.constant(YOUNG, POISSON, Solidity.of(steel, stiffness_ratio=RATIO))
    slice_ = Slice(
        load_law("weiner_boley", elasticity),
        steel.thermal_strain,
        PlainPlanes(("a0", "across")),
        (
            PrescribedDisplacement(("side_low",), 1),
            PrescribedDisplacement(("side_high",), 1),
            PrescribedDisplacement(("surface",), 0),
        ),
        pin=False,
    )
    exact = settings.scheme == "exact"
    heat = Heat(
        steel,
        POURED + ZERO_CELSIUS,
        (1200.0, 1800.0),
        {"surface": PrescribedTemperature(SURFACE + ZERO_CELSIUS)},
        "sdirk2" if exact else settings.scheme,
        exact_temperature if exact else None,
    )
    return CoolingSlice(mesh_of(settings), heat, slice_, options=options)


def profile(slice_: CoolingSlice) -> tuple[Array, Array, Array]:
    """Depth (m), sigma_zz (Pa) and area (m2) of the points in the shell, by rising depth."""
    points = slice_.problem.points
    depth = points.deviator.position[:, 0]
    inside = np.flatnonzero(depth < EXACT.shell(slice_.state.time))
    inside = inside[np.argsort(depth[inside], kind="stable")]
    stress = points.recovered(slice_.state.stress)[:, 2]
    return depth[inside], stress[inside], points.deviator.volume[inside]


def error(slice_: CoolingSlice) -> float:
    """Rms difference of sigma_zz over the shell, % of 20 MPa."""
    depth, stress, area = profile(slice_)
    squares = (stress - EXACT.stress(depth, slice_.state.time)) ** 2
    return float(100.0 * np.sqrt(area @ squares / area.sum()) / YIELD)


def run(settings: Settings) -> dict[str, Any]:
    """One run past the last of the instants, as a row."""
    slice_, errors = strip(settings), {}
    for middle in INSTANTS:
        begin = middle - AROUND
        for time in begin + EVERY * np.arange(round(2 * AROUND / EVERY) + 1):
            errors[middle, float(time)] = error(slice_.advance(float(time), settings.step))
    row: dict[str, Any] = {
        "cell": settings.cell,
        "scheme": settings.scheme,
        "grading": settings.grading,
        "size_mm": settings.size,
        "step_s": settings.step,
        "cells": slice_.section.mesh.topology.index_map(2).size_global,
        "steps": len(slice_.newton),
        "newton": float(np.mean(slice_.newton)),
        "seconds": slice_.seconds,
        "mechanics_s": sum(slice_.times),
    }
    for middle in INSTANTS:
        own = [e for (m, _), e in errors.items() if m == middle]
        row[f"error_{middle:g}s_percent"] = errors[middle, middle]
        row[f"least_{middle:g}s_percent"] = min(own)
        row[f"worst_{middle:g}s_percent"] = max(own)
    row["worst_percent"] = max(errors.values())
    slice_.destroy()
    return row


STEPS = {
    1.0: (0.5, 0.25, 0.1, 0.05, 0.02),
    0.5: (0.5, 0.25, 0.1, 0.05, 0.02),
    0.25: (0.5, 0.25, 0.1, 0.05, 0.02),
    0.1: (0.5, 0.25, 0.1, 0.05),
    0.05: (0.5, 0.25, 0.1),
}


def sweep(quick: bool) -> Iterable[Settings]:
    """The settings of all runs."""
    for size, steps in STEPS.items():
        if quick and size < 0.25:
            continue
        for step in steps[:3] if quick else steps:
            yield Settings(size, step)
    if quick:
        return
    others = ((0.5, 0.5), (0.5, 0.1), (0.25, 0.5), (0.25, 0.1), (0.1, 0.25), (0.1, 0.1))
    for size, step in others:
        yield Settings(size, step, scheme="backward_euler")
        yield Settings(size, step, cell="triangle")
    for grading in ("core", "shell"):
        for size, step in ((0.5, 0.25), (0.25, 0.25), (0.25, 0.1), (0.1, 0.25), (0.1, 0.1)):
            yield Settings(size, step, grading=grading)
    for size in (1.0, 0.5, 0.25, 0.1):
        yield Settings(size, 0.1, scheme="exact")
    for size in (1.0, 0.5, 0.25):
        yield Settings(size, 0.02, scheme="exact")


def orders(rows: list[dict[str, Any]], **like: Any) -> list[dict[str, Any]]:
    """Errors by size of runs that are alike otherwise, and the order of the largest ones."""
    found: list[dict[str, Any]] = []
    own = [r for r in rows if all(r[k] == v for k, v in like.items())]
    for row in sorted(own, key=lambda r: -r["size_mm"]):
        line = dict(row)
        for at in INSTANTS:
            least, most = (row[f"{k}_{at:g}s_percent"] for k in ("least", "worst"))
            line[f"range_{at:g}s"] = f"{least:.2f} to {most:.2f}"
            if found:
                ratio = np.log(found[-1]["size_mm"] / row["size_mm"])
                line[f"order_{at:g}s"] = np.log(found[-1][f"worst_{at:g}s_percent"] / most) / ratio
        found.append(line)
    return found


NAMES = {
    ("quadrilateral", "sdirk2", "even"): "quadrilaterals, SDIRK2",
    ("quadrilateral", "backward_euler", "even"): "quadrilaterals, backward Euler",
    ("triangle", "sdirk2", "even"): "triangles, SDIRK2",
    ("quadrilateral", "sdirk2", "core"): "fine to 16 mm, SDIRK2",
    ("quadrilateral", "sdirk2", "shell"): "growing through the shell, SDIRK2",
    ("quadrilateral", "exact", "even"): "exact temperature",
}
COLOURS = ("#0072b2", "#d55e00", "#cc79a7", "#009e73", "#e69f00", "#555555")


def draw(rows: list[dict[str, Any]]) -> Figure:
    """The largest error against run time, with the front of each kind."""
    from castfem.post.plots.style import look, new_figure

    with look():
        figure = new_figure(6.4, 5.2)
        axis = figure.subplots()
        for (kind, name), colour in zip(NAMES.items(), COLOURS, strict=True):
            own = [r for r in rows if (r["cell"], r["scheme"], r["grading"]) == kind]
            x, y = ([r[k] for r in own] for k in ("seconds", "worst_percent"))
            axis.plot(x, y, ".", color=colour, alpha=0.45, markersize=6)
            style = "--" if kind[1] == "exact" else "-"
            best = front(own, "worst_percent")
            axis.step(*best, where="post", color=colour, linestyle=style, label=name)
        for level in LEVELS:
            axis.axhline(level, color="#555555", linewidth=0.8, linestyle=":")
        axis.set(
            xscale="log", yscale="log", xlabel="time of the run, 22 s of casting [s]",
            ylabel="rms stress error [% of 20 MPa]",
        )  # fmt: skip
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def draw_profiles() -> Figure:
    """Stress over depth at both instants against the closed form."""
    from castfem.post.plots.style import look, new_figure

    runs = [(0.5, 0.1, "#e69f00", "o"), (0.1, 0.1, "#0072b2", ".")]
    slices = [strip(Settings(size, step)) for size, step, *_ in runs]
    with look():
        figure = new_figure(9.0, 3.7)
        axes = figure.subplots(1, 2, sharey=True)
        for axis, time in zip(axes, INSTANTS, strict=True):
            x: Array = np.linspace(0.0, EXACT.shell(time), 2000, dtype=np.float64)
            axis.plot(1e3 * x, 1e-6 * EXACT.stress(x, time), color="k", label="closed form")
            for slice_, (size, step, colour, mark) in zip(slices, runs, strict=True):
                depth, stress, _ = profile(slice_.advance(time, step))
                axis.plot(
                    1e3 * depth, 1e-6 * stress, mark, color=colour, markersize=3.5, mew=0.7,
                    markerfacecolor="none", label=f"{size:g} mm: {error(slice_):.1f} %",
                )  # fmt: skip
            axis.set(xlabel="depth below the surface [mm]", title=f"{time:g} s")
            axis.legend(loc="lower right")
        axes[0].set_ylabel("stress along and across [MPa]")
    for slice_ in slices:
        slice_.destroy()
    return figure


HEADINGS = {
    "level": "target",
    "kind": "cells, scheme",
    "size_mm": "size [mm]",
    "step_s": "step [s]",
    "cells": "cells",
    "steps": "steps",
    "newton": "Newton a step",
    "worst_5s_percent": "4 to 6 s [%]",
    "worst_21s_percent": "20 to 22 s [%]",
    "seconds": "run [s]",
}
SIZES = {
    "temperature": "temperature",
    "size_mm": "size [mm]",
    "step_s": "step [s]",
    "error_5s_percent": "5 s [%]",
    "range_5s": "4 to 6 s [%]",
    "order_5s": "order",
    "error_21s_percent": "21 s [%]",
    "range_21s": "20 to 22 s [%]",
    "order_21s": "order",
}
FORMATS = {
    "newton": ".1f", "error_5s_percent": ".2f", "error_21s_percent": ".2f", "seconds": ".2f",
    "worst_5s_percent": ".2f", "worst_21s_percent": ".2f", "order_5s": ".1f", "order_21s": ".1f",
}  # fmt: skip
WORDS = {"sdirk2": "SDIRK2", "backward_euler": "backward Euler", "exact": "exact"}


def levels_table(rows: list[dict[str, Any]]) -> str:
    """The cheapest run of each kind for each level; the cheapest of all in bold."""
    lines: list[dict[str, Any]] = []
    for level in LEVELS:
        own = []
        for (cell, scheme, grading), name in NAMES.items():
            kind = {"cell": cell, "scheme": scheme, "grading": grading}
            good = [
                r
                for r in rows
                if r["worst_percent"] <= level and all(r[k] == v for k, v in kind.items())
            ]
            if good and scheme != "exact":
                best = min(good, key=lambda r: r["seconds"])
                own.append({"level": f"{level:g} %", "kind": name, **best})
        if own:
            least = min(own, key=lambda r: r["seconds"])
            least["kind"] = f"**{least['kind']}**"
        lines += own
    return table(lines, HEADINGS, FORMATS)


def sizes_table(rows: list[dict[str, Any]]) -> str:
    """Even quadrilaterals by size, with the temperature solved for and with the exact one."""
    lines: list[dict[str, Any]] = []
    for scheme, step in (("sdirk2", 0.1), ("sdirk2", 0.02), ("exact", 0.1), ("exact", 0.02)):
        like = {"scheme": scheme, "step_s": step, "grading": "even", "cell": "quadrilateral"}
        lines += [r | {"temperature": WORDS[scheme]} for r in orders(rows, **like)]
    return table(lines, SIZES, FORMATS)


def main(output: Output, quick: bool = False) -> None:
    """Run the sweep; tables, CSV and figures."""
    strip(Settings(1.0, 0.5)).advance(1.0, 0.5).destroy()  # compiles forms and law
    rows = [run(settings) for settings in sweep(quick)]
    output.csv("weiner_boley", rows)
    output.figure("weiner_boley", draw(rows))
    output.figure("weiner_boley_profiles", draw_profiles())
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    rows = output.rows("weiner_boley")
    output.insert("weiner boley levels", levels_table(rows))
    output.insert("weiner boley sizes", sizes_table(rows))
