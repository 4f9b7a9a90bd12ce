"""Which cell of which rank holds a point, and the shape functions there."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx import geometry

from castfem.base.types import Array, Indices
from castfem.fem import compat, reductions
from castfem.fem.section import Section

_NEARLY = 1e-2  # of a cell: how far outside a sample may lie (a curved face, cut by straight cells)


def locate(
    section: Section, points: Array, along: Array
) -> tuple[Indices, list[npt.NDArray[np.int32]], list[Array], Array]:
    """The points this rank has; vertices, weights and size of the cell of each (collective).

    The vertices are global ones, the size is that along a direction, m.
    Of all cells whose box holds a point the one is taken in which it lies deepest, on all
    ranks: a point on an edge, or a rounding outside a face, is found the same way on any
    number of ranks.

    Args:
        section: The section.
        points: (n, 2), m.
        along: Unit vectors of the directions (n, 2).

    Raises:
        ValueError: A point lies outside the section.
    """
    n = len(points)
    mesh, dofmap = section.mesh, section.vertex_space.dofmap
    best = np.full(n, np.inf)
    cells, shapes = np.full(n, -1), np.zeros((n, 3 if section.cell == "triangle" else 4))
    sizes = np.zeros(n)
    local = mesh.topology.index_map(2).size_local
    if local and n:
        tree = geometry.bb_tree(mesh, 2, entities=np.arange(local, dtype=np.int32), padding=1e-9)
        xyz = np.column_stack([points, np.zeros(n)])
        near = geometry.compute_collisions_points(tree, xyz)
        node_of, x = compat.geometry_dofmap(mesh), mesh.geometry.x[:, :2]
        cmap = compat.coordinate_map(mesh)
        for i in range(n):
            for cell in near.links(i):
                corners = np.ascontiguousarray(x[node_of[cell]])
                xi = cmap.pull_back(points[i : i + 1], corners)[0]
                outside = _outside(section.cell, xi)
                if outside < best[i]:
                    best[i], cells[i] = outside, cell
                    shapes[i] = _first_order_shapes(section.cell, xi)
                    sizes[i] = np.ptp(corners @ along[i])
    rows = _won(section, points, best)
    columns = [
        dofmap.index_map.local_to_global(dofmap.cell_dofs(int(cells[i]))).astype(np.int32)
        for i in rows
    ]
    return rows, columns, [shapes[i] for i in rows], sizes[rows]


def _won(section: Section, points: Array, outside: Array) -> npt.NDArray[np.int64]:
    """The points that lie deepest in a cell of this rank; a tie goes to the lower rank."""
    comm = section.comm
    least = -reductions.largest_of(comm, -outside)
    if (least > _NEARLY).any():
        x, y = points[np.argmax(least)]
        raise ValueError(f"probe point ({x:g}, {y:g}) m lies outside the section")
    rank = np.where(outside <= least + 1e-12, comm.rank, comm.size).astype(float)
    return np.flatnonzero(-reductions.largest_of(comm, -rank) == comm.rank)


def _first_order_shapes(cell: str, xi: Array) -> Array:
    """First-order shape functions of the cell at reference point xi (2,)."""
    r, s = xi[0], xi[1]
    if cell == "triangle":
        return np.array([1 - r - s, r, s])
    return np.array([(1 - r) * (1 - s), r * (1 - s), (1 - r) * s, r * s])


def _outside(cell: str, xi: Array) -> float:
    """How far reference point xi (2,) lies outside its cell; negative inside."""
    r, s = xi
    if cell == "triangle":
        return float(max(-r, -s, r + s - 1))
    return float(max(-r, -s, r - 1, s - 1))
