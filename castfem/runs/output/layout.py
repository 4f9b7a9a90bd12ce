"""Units of the fields, VTK order of nodes and components, and triangulation for plots."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# VTK node i is DOLFINx (basix) node _VTK_ORDER[i].
_VTK_ORDER = {
    ("triangle", 1): (0, 1, 2),
    ("quadrilateral", 1): (0, 1, 3, 2),
    ("triangle", 2): (0, 1, 2, 5, 3, 4),
    ("quadrilateral", 2): (0, 1, 3, 2, 4, 6, 7, 5, 8),
}
# Triangles that cover a cell, in VTK node order. A straight quadrilateral is divided from its
# centre, the extra node 4, so that no diagonal is preferred.
_TRIANGLES = {
    ("triangle", 1): ((0, 1, 2),),
    ("quadrilateral", 1): ((0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    ("triangle", 2): ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    ("quadrilateral", 2): tuple(
        triangle
        for corner, after, before in ((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6))
        for triangle in ((corner, after, 8), (before, corner, 8))
    ),
}

# Fields are written in SI; "-" for dimensionless ones.
UNITS = {
    "temperature": "K",
    "solid_fraction": "-",
    "displacement": "m",
    "strain": "-",
    "stress": "Pa",
    "von_mises": "Pa",
    "pressure": "Pa",
    "viscoplastic_strain": "-",
    "gap": "m",
    "contact_pressure": "Pa",
}


def vtk_cells(cells: ArrayLike, cell: str, order: int) -> NDArray[np.int32]:
    """Reorder the nodes of cells (m, k) from DOLFINx to VTK.

    Raises:
        ValueError: Unknown cell, or a wrong number of nodes per cell.
    """
    if (cell, order) not in _VTK_ORDER:
        raise ValueError(f"cell {cell!r} of order {order} cannot be written")
    nodes = _VTK_ORDER[cell, order]
    table = np.asarray(cells)
    if table.ndim != 2 or table.shape[1] != len(nodes):
        raise ValueError(f"cells are {table.shape}, not (m, {len(nodes)}) of {cell} order {order}")
    return np.ascontiguousarray(table[:, nodes], dtype=np.int32)


def components(values: ArrayLike, rows: int, name: str) -> NDArray[Any]:
    """Reshape a field for ParaView: (rows,) scalar, (rows, 3) vector or (rows, 9) tensor.

    A plane vector gets a zero third component. A tensor is given as (rows, 2, 2) or (rows, 3, 3),
    or symmetric as (rows, 4) = xx, yy, zz, xy.

    Args:
        values: The field, one row per node or cell.
        rows: Number of nodes or cells.
        name: Name of the field, for the message.

    Raises:
        ValueError: The array has another shape.
    """
    field = np.asarray(values)
    if field.ndim == 0 or field.shape[0] != rows:
        raise ValueError(f"field {name} has shape {field.shape}, not {rows} rows")
    shape = field.shape[1:]
    if shape in ((), (1,)):
        return field.reshape(rows)
    if shape in ((3,), (3, 3)):
        return field.reshape(rows, -1)
    if shape == (2,):
        return np.column_stack([field, np.zeros(rows, field.dtype)])
    tensor = np.zeros((rows, 3, 3), field.dtype)
    if shape == (2, 2):
        tensor[:, :2, :2] = field
    elif shape == (4,):
        tensor[:, (0, 1, 2, 0, 1), (0, 1, 2, 1, 0)] = field[:, (0, 1, 2, 3, 3)]
    else:
        raise ValueError(f"field {name} has shape {field.shape}: not scalar, vector or tensor")
    return tensor.reshape(rows, 9)


def triangulate(
    points: NDArray[np.float64], cells: NDArray[np.int32], cell: str, order: int
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32]]:
    """Divide the cells of a mesh into straight triangles.

    Returns:
        The plane points (n', 2); the triangles (t, 3), anticlockwise as the cells are; and
        parents (n', q), whose mean value is the value of each point (q is 1, or 4 where the centre
        of straight quadrilaterals was added: a node then has itself four times).
    """
    pattern = np.array(_TRIANGLES[cell, order])
    plane = np.asarray(points, dtype=np.float64)[:, :2]
    own = np.arange(len(plane), dtype=np.int32)
    if (cell, order) != ("quadrilateral", 1):
        return plane, cells[:, pattern].reshape(-1, 3), own[:, None]
    centres = np.arange(len(plane), len(plane) + len(cells), dtype=np.int32)
    table = np.column_stack([cells, centres])
    parents = np.vstack([np.repeat(own[:, None], 4, axis=1), cells])
    return plane[parents].mean(axis=1), table[:, pattern].reshape(-1, 3), parents
