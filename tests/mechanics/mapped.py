"""Meshes of mapped squares with cells of prescribed shape and number."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from castfem import meshes
from castfem.base.types import Array

Map = Callable[[Array, Array], tuple[Array, Array]]

# Local nodes of quadrilaterals and triangles on a lattice of half steps, in DOLFINx order.
QUAD = ((0, 0), (2, 0), (0, 2), (2, 2), (1, 0), (0, 1), (2, 1), (1, 2), (1, 1))
LOWER = ((0, 0), (2, 0), (2, 2), (2, 1), (1, 1), (1, 0))
UPPER = ((0, 0), (2, 2), (0, 2), (1, 2), (0, 1), (1, 1))


def mapped(
    across: int,
    along: int,
    shape: Map,
    cell: str = "quadrilateral",
    order: int = 1,
    groups: tuple[str, str, str, str] = ("symmetry_x", "symmetry_y", "right", "top"),
) -> meshes.SectionMesh:
    """Mesh the unit square (s, t) with `across` x `along` cells, mapped by `shape`.

    `groups` name its sides s = 0, t = 0, s = 1, t = 1.
    """
    patterns = [QUAD[:4] if order == 1 else QUAD]
    if cell == "triangle":
        patterns = [p[: 3 * order] for p in (LOWER, UPPER)]
    i, j = np.meshgrid(2 * np.arange(across), 2 * np.arange(along), indexing="ij")
    rows = [
        np.stack([(i + a) * (2 * along + 1) + j + b for a, b in p], axis=-1).reshape(-1, len(p))
        for p in patterns
    ]
    lattice = np.stack(rows, axis=1).reshape(-1, rows[0].shape[1])
    used, cells = np.unique(lattice, return_inverse=True)
    s, t = used // (2 * along + 1) / (2 * across), used % (2 * along + 1) / (2 * along)
    points = np.column_stack(shape(s, t))
    number = np.full((2 * across + 1) * (2 * along + 1), -1)
    number[used] = np.arange(len(used))
    at = number.reshape(2 * across + 1, 2 * along + 1)[::2, ::2]
    sides = (at[0, ::-1], at[:, 0], at[-1, :], at[::-1, -1])
    facets = [np.column_stack([side[:-1], side[1:]]) for side in sides]
    return meshes.SectionMesh(
        points=points,
        cells=cells.reshape(lattice.shape).astype(np.int64),
        cell=cell,
        order=order,
        facets=np.concatenate(facets),
        facet_group=np.repeat(np.arange(4), [len(f) for f in facets]).astype(np.int32),
        groups=groups,
        probes={},
        multiplicity=1,
        exact_area=np.nan,
    )


def box(width: float, height: float, x0: float = 0.0, y0: float = 0.0) -> Map:
    return lambda s, t: (x0 + width * s, y0 + height * t)


def skewed(width: float, height: float, strength: float = 0.12) -> Map:
    """Return a map to a rectangle with distorted cells inside and along the sides."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        bump = strength * np.sin(np.pi * s) * np.sin(np.pi * t)
        slide_s, slide_t = (0.3 * v * (1 - v) for v in (s, t))
        return width * (s + bump + 0.3 * slide_s), height * (t - bump - 0.4 * slide_t)

    return shape


def ring(inner: float, outer: float) -> Map:
    """Return a map to a quarter of a ring: s is radial, t goes from the x to the y axis."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        radius, angle = inner + (outer - inner) * s, 0.5 * np.pi * t
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        return np.where(t == 1.0, 0.0, x), y

    return shape


RING_GROUPS = ("inner", "symmetry_y", "outer", "symmetry_x")
