"""Draw a section mesh: all of it and a close view of a corner, boundary groups in colour."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np

from castfem.meshes.section_mesh import SectionMesh

_COLOURS = (
    "#c1272d", "#0b6fb8", "#e08a00", "#2a8f4a", "#7b3fa0", "#0f8f94",
    "#d0488f", "#7a6a00", "#4a5fd0", "#8c4a2f", "#5f8f00", "#9a3d5f",
)  # fmt: skip
_GREY = "#8a9099"


def draw(
    mesh: SectionMesh,
    path: str | os.PathLike[str],
    *,
    zoom: float | None = None,
    focus: str | None = None,
) -> None:
    """Draw a mesh to a picture file.

    The whole mesh, and beside or below it a close view round the surface end of a probe. Outer
    groups are thick and coloured, lines of symmetry grey and dashed.

    Args:
        mesh: The mesh.
        path: Picture; its ending gives the format (png, pdf, svg).
        zoom: Side of the close view, m; by default chosen from the cells there.
        focus: Name of the probe the close view is at; by default the corner.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    width, height = (high - low).tolist()
    legend = 0.28 * math.ceil(len(mesh.outer_groups) / 6) + 0.35  # inches at the foot
    flat = height < 0.55 * width
    if flat:
        whole = max(11.5 * height / width, 1.3)
        figure = Figure(figsize=(13.0, whole + 6.6 + legend), dpi=130, layout="constrained")
        axes = figure.subplots(2, 1, height_ratios=(whole, 5.2))
    else:
        whole = 8.0 * min(width / height, 1.4)
        figure = Figure(figsize=(whole + 9.2, 9.0 + legend), dpi=130, layout="constrained")
        axes = figure.subplots(1, 2, width_ratios=(whole, 8.0))
    FigureCanvasAgg(figure)
    left, bottom, right, top = _close_view(mesh, zoom, focus, 2.2 if flat else 1.0)
    # Hair lines where cells are many: the mesh must not turn into a black area.
    fineness = math.sqrt(len(mesh.cells) * min(width, height) / max(width, height))
    for ax, line in ((axes[0], min(max(18.0 / fineness, 0.12), 0.7)), (axes[1], 0.6)):
        _cells(ax, mesh, line)
        _boundary(ax, mesh)
        ax.set_aspect("equal")
        ax.set_xlabel("x [mm]")
        ax.set_ylabel("y [mm]")
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=9)
    margin = 0.02e3 * max(width, height)
    axes[0].set_xlim(1e3 * low[0] - margin, 1e3 * high[0] + margin)
    axes[0].set_ylim(1e3 * low[1] - margin, 1e3 * high[1] + margin)
    axes[1].set_xlim(1e3 * left, 1e3 * right)
    axes[1].set_ylim(1e3 * bottom, 1e3 * top)
    _caption(figure, axes[0], mesh)
    figure.savefig(path)


def _close_view(
    mesh: SectionMesh, zoom: float | None, focus: str | None, stretch: float
) -> tuple[float, float, float, float]:
    """Left, bottom, right and top of the close view, m.

    It shows the surface end of a probe and the cells below it; it is `zoom` high and `stretch`
    times that wide.
    """
    names = (focus,) if focus else ("corner", "diagonal", "mid_face")
    name = next((n for n in names if n in mesh.probes), None)
    if name is None:
        raise ValueError(f"focus = {focus!r} is no probe; choose one of {', '.join(mesh.probes)}")
    start, end = mesh.probes[name]
    away = np.hypot(*(mesh.points - start).T)
    if zoom is None:
        centres = np.sort(np.hypot(*(mesh.points[mesh.vertices].mean(axis=1) - start).T))
        # About 400 cells round the corner, within limits that keep the surface in the picture.
        extent = float(np.ptp(mesh.points, axis=0).min())
        near = 1.4 * float(centres[min(400, len(centres) - 1)])
        zoom = min(max(near, 0.05 * extent), 0.3 * extent)
        if name == "mid_face" and not focus:  # a strip
            zoom = 1.2 * extent
    low, high = np.zeros(2), np.zeros(2)
    inward = np.sign(np.round(end - start, 12))
    close = mesh.points[away <= max(0.55 * zoom, float(away.min()))]
    for axis, size in enumerate((stretch * zoom, zoom)):
        if inward[axis] < 0:
            high[axis] = close[:, axis].max() + 0.04 * zoom
            low[axis] = high[axis] - size
        elif inward[axis] > 0:
            low[axis] = close[:, axis].min() - 0.04 * zoom
            high[axis] = low[axis] + size
        else:
            low[axis], high[axis] = start[axis] - 0.5 * size, start[axis] + 0.5 * size
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _cells(ax: Any, mesh: SectionMesh, line: float) -> None:
    """Draw the sides between cells; only those on the boundary can be curved."""
    from matplotlib.collections import LineCollection

    from castfem.meshes.quality import pair_up

    pairs, _, sides = pair_up(mesh.vertices, mesh.cell)
    inner = 1e3 * mesh.points[sides[pairs[:, 0]]]
    lines = LineCollection(list(inner), colors="#30363d", linewidths=line, zorder=1)
    lines.set_snap(False)  # else each side is rounded to pixels by itself and lines break
    ax.add_collection(lines)


def _boundary(ax: Any, mesh: SectionMesh) -> None:
    outer = [name for name in mesh.groups if name in mesh.outer_groups]
    for name, polyline in mesh.outline():
        x, y = 1e3 * polyline.T
        if name in outer:
            colour = _COLOURS[outer.index(name) % len(_COLOURS)]
            ax.plot(x, y, color=colour, lw=2.4, label=name, zorder=3, solid_capstyle="butt")
        else:
            ax.plot(x, y, color=_GREY, lw=1.6, ls=(0, (5, 2)), label=name, zorder=2)


def _caption(figure: Any, ax: Any, mesh: SectionMesh) -> None:
    """Legend of the groups and one line of numbers."""
    handles, labels = ax.get_legend_handles_labels()
    found = dict(zip(labels, handles, strict=True))
    inner = [name for name in mesh.groups if name not in mesh.outer_groups]
    shown = {name: found[name] for name in mesh.outer_groups}
    if inner:
        shown[", ".join(sorted(inner))] = found[inner[0]]
    figure.legend(
        shown.values(),
        shown.keys(),
        loc="outside lower center",
        ncols=min(len(shown), 6),
        frameon=False,
        fontsize=9,
    )
    q = mesh.quality()
    plural = {"quadrilateral": "quadrilaterals", "triangle": "triangles"}[mesh.cell]
    part = {1: "whole section", 2: "half", 4: "quarter"}[mesh.multiplicity]
    part = "strip" if "core_end" in mesh.groups else part
    figure.suptitle(
        f"{part}: {q.cells} {plural} of order {mesh.order}, {q.points} points; sizes "
        f"{1e3 * q.smallest_size:.3g} to {1e3 * q.largest_size:.3g} mm, angles {q.min_angle:.0f} "
        f"to {q.max_angle:.0f} degrees, largest growth {q.max_growth:.2f}",
        fontsize=10.5,
    )
