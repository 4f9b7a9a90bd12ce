"""Stacks the slices of a run along the caster in one file for ParaView.

The strand is a mesh of hexahedra or wedges, with its slices at their positions in the caster:
distance from the mould, across, and upwards from the meniscus, m. Between two written slices values
are linear in the position, while the strand follows the curve of its rolls. Quantities known only
at the surface, such as crack indexes, come from the surface maps, which have a row per step; inside
they are NaN. A row is placed where one of these is largest, so that the file has the largest value.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.atomic_files import replacing
from castfem.base.errors import InputError
from castfem.base.types import Array, Indices
from castfem.runs.output.fields import Fields
from castfem.runs.output.surface_maps import SurfaceMaps

if TYPE_CHECKING:
    from castfem.physics.machine.side import Side

CORNERS = {"triangle": 3, "quadrilateral": 4}
_SOLIDS = {"triangle": "wedge", "quadrilateral": "hexahedron"}


def write_strand(folder: Path, target: Path, side: Side, every: float) -> tuple[int, int]:
    """Write the strand of a run, as far as it has been computed, as a VTK unstructured grid.

    Args:
        folder: Folder of the run.
        target: Output file, with the ending .vtu.
        side: Side view of the strand.
        every: Largest distance between the rows of cells along the strand, m.

    Returns:
        Numbers of points and cells.

    Raises:
        InputError: The run has not written slices at two positions.
        RunFailure: The file cannot be written.
    """
    with Fields(folder) as fields:
        times = np.flatnonzero(np.diff(fields.positions, prepend=-1.0) > 0.0)
        if len(times) < 2:
            raise InputError(f"{folder}: has {len(times)} slices; two are needed")
        slices = fields.positions[times]
        maps = SurfaceMaps(folder) if SurfaceMaps.exist(folder) else None
        rows = between(slices, every)
        if maps is not None:
            rows = np.unique(np.concatenate([rows, peaks(maps, rows)]))
        corners = CORNERS[fields.cell]
        table = fields.cells[:, :corners].astype(np.int64)
        nodes, cells = np.unique(table, return_inverse=True)
        cells = cells.reshape(-1, corners)
        place = fields.points[nodes, :2]
        data = _fields(fields, times, nodes, slices, rows, side)
    if maps is not None:
        data |= _mapped(maps, nodes, rows)
    data["position"] = np.repeat(rows, len(nodes))
    return write_stack(target, side.placed(rows, place), cells, fields.cell, data)


def write_stack(
    target: Path, points: Array, cells: Indices, cell: str, data: Mapping[str, Array]
) -> tuple[int, int]:
    """Write a stack of slices as a VTK unstructured grid.

    Args:
        target: Output file.
        points: Points of the slices (rows, n, 3), m.
        cells: Cells of one slice (m, k) in VTK node order.
        cell: "triangle" or "quadrilateral".
        data: Values at the points, (rows * n, ...) or (rows, n).

    Returns:
        Numbers of points and cells.

    Raises:
        RunFailure: The file cannot be written.
    """
    import meshio

    rows, count, _ = points.shape
    table = stacked(cells, count, rows)
    values = {
        n: (v.ravel() if v.ndim == 2 and v.shape == (rows, count) else v) for n, v in data.items()
    }
    mesh = meshio.Mesh(
        points.reshape(-1, 3),
        [(_SOLIDS[cell], table)],
        {name: found.astype(np.float32) for name, found in values.items()},
    )
    with replacing(target, durable=False) as temporary:
        meshio.write(temporary, mesh, file_format="vtu", binary=True)
    return rows * count, len(table)


def between(slices: Array, every: float) -> Array:
    """Positions of the rows (rows,), m: slices, and between them at most `every` apart."""
    found = [slices[:1]]
    for before, after in pairwise(slices):
        count = max(1, int(np.ceil((after - before) / every - 1e-9)))
        found.append(before + (after - before) / count * np.arange(1, count + 1))
    return np.concatenate(found)


def peaks(maps: SurfaceMaps, rows: Array) -> Array:
    """Positions of the largest values of the maps, where no row is near (n,), m."""
    onward = np.flatnonzero(np.diff(maps.position, prepend=-1.0) > 0.0)
    found = []
    for name in _indexes(maps):
        worst = np.nan_to_num(maps[name][onward], nan=-np.inf).max(axis=1)
        found.append(maps.position[onward][int(np.argmax(worst))])
    apart = (one for one in found if np.abs(rows - one).min() > 1e-6)
    return np.array([one for one in apart if rows[0] < one < rows[-1]])


def _indexes(maps: SurfaceMaps) -> list[str]:
    """Names of maps without a field."""
    return [name for name in maps.names() if name != "temperature"]


def stacked(cells: Indices, nodes: int, rows: int) -> Indices:
    """Cells of a stack (n, 2 k) from those of a section (m, k): each row joined to the next.

    The first face of a VTK hexahedron has its normal into the cell, that of a wedge out of it.
    """
    cells = cells[:, ::-1] if cells.shape[1] == CORNERS["triangle"] else cells
    starts = nodes * np.arange(rows - 1)[:, None, None]
    both = np.concatenate([cells + starts, cells + starts + nodes], axis=2)
    return np.asarray(both.reshape(-1, 2 * cells.shape[1]))


def _fields(
    fields: Fields, times: Indices, nodes: Indices, slices: Array, rows: Array, side: Side
) -> dict[str, Array]:
    found: dict[str, Array] = {}
    for name in fields.names:
        if fields.centre(name) != "point":
            continue
        given = np.array([fields.values(name, int(k))[nodes] for k in times])
        if given.ndim == 3 and given.shape[2] == 9:
            if name != "stress":
                continue
            name, given = "axial_stress", given[..., 8]  # zz
        values = at_rows(rows, slices, given)
        if values.ndim == 3:
            inward = side.inward_at(rows)[:, None]
            x, y = values[..., 0], values[..., 1]
            values = np.stack([y * inward[..., 0], x, y * inward[..., 1]], axis=-1)
            found[name] = values.reshape(-1, 3)
        else:
            found[name] = values.ravel()
    return found


def _mapped(maps: SurfaceMaps, nodes: Indices, rows: Array) -> dict[str, Array]:
    """Values of the maps at all points, by name; NaN inside, and below the end of the maps."""
    found: dict[str, Array] = {}
    at = np.searchsorted(nodes, maps.heading.line.nodes)
    onward = np.flatnonzero(np.diff(maps.position, prepend=-1.0) > 0.0)
    for name in _indexes(maps):
        values = np.full((len(rows), len(nodes)), np.nan)
        values[:, at] = at_rows(rows, maps.position[onward], maps[name][onward])
        found[name] = values.ravel()
    return found


def at_rows(rows: Array, position: Array, values: Array) -> Array:
    """Interpolate values (k, ...) linearly from their positions to the rows (rows, ...)."""
    upper = np.clip(np.searchsorted(position, rows, side="left"), 1, len(position) - 1)
    share = (rows - position[upper - 1]) / (position[upper] - position[upper - 1])
    share = np.clip(share, 0.0, 1.0).reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray((1.0 - share) * values[upper - 1] + share * values[upper])
