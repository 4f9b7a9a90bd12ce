"""Hot spots of the surface from the fields: highest temperatures and thinnest shell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from castfem.base.types import Array
from castfem.post.plots.shape import Outline
from castfem.runs.output.fields import Fields
from castfem.runs.output.layout import triangulate

_SAME = 1e-3  # relative; smaller differences count as equal


@dataclass(frozen=True, slots=True)
class HotSpot:
    """A value at a place of the surface: (x, y) [m], on the undeformed section."""

    value: float
    x: float
    y: float


def hottest(fields: Fields, index: int) -> HotSpot:
    """The highest temperature [K] of the surface; `index` selects the time, as in a list."""
    nodes = np.unique(Outline.of(fields).surface)
    kelvin = fields.values("temperature", index)[nodes]
    return _hot_spot(fields, nodes, kelvin, kelvin >= kelvin.max() - _SAME * np.ptp(kelvin))


def thinnest(fields: Fields, solidus: float, index: int) -> HotSpot | None:
    """The shortest distance [m] from the surface to the solidus; None where there is none.

    A piece of the surface above the solidus has no shell: 0.
    """
    nodes = np.unique(Outline.of(fields).surface)
    kelvin = fields.values("temperature", index)
    if kelvin.max() <= solidus:
        return None
    bare = kelvin[nodes] > solidus
    if bare.any():
        return _hot_spot(fields, nodes, np.zeros(len(nodes)), bare)
    front = _isotherm(fields, kelvin, solidus)
    surface = fields.points[nodes, :2]
    parts = [surface[i : i + 200] for i in range(0, len(surface), 200)]
    distance = np.concatenate([_distance(part, front) for part in parts])
    return _hot_spot(fields, nodes, distance, distance <= (1 + _SAME) * distance.min())


def _hot_spot(
    fields: Fields, nodes: NDArray[np.intp], values: Array, best: NDArray[np.bool_]
) -> HotSpot:
    """The highest of the best nodes; symmetry makes several."""
    place = fields.points[nodes, :2]
    number = max(np.flatnonzero(best), key=lambda i: (place[i, 1], place[i, 0]))
    return HotSpot(float(values[number]), float(place[number, 0]), float(place[number, 1]))


def _isotherm(fields: Fields, kelvin: Array, level: float) -> Array:
    """Segments (s, 2, 2) of an isotherm [m], straight in each triangle of the mesh."""
    plane, triangles, parents = triangulate(fields.points, fields.cells, fields.cell, fields.order)
    above = kelvin[parents].mean(axis=1) - level
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]]
    ends = above[edges]
    crossed = (ends[..., 0] > 0.0) != (ends[..., 1] > 0.0)
    cut = crossed.any(axis=1)
    pairs = edges[cut][crossed[cut]].reshape(-1, 2, 2)
    first, second = above[pairs[..., 0]], above[pairs[..., 1]]
    share = (first / (first - second))[..., None]
    return np.asarray((1.0 - share) * plane[pairs[..., 0]] + share * plane[pairs[..., 1]])


def _distance(points: Array, pieces: Array) -> Array:
    """Shortest distance (n,) of points (n, 2) from segments (s, 2, 2)."""
    start, along = pieces[:, 0], pieces[:, 1] - pieces[:, 0]
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    reach = points[:, None, :] - start
    share = np.clip(np.einsum("nsj,sj->ns", reach, along) / square, 0.0, 1.0)
    off = reach - share[..., None] * along
    return np.asarray(np.sqrt(np.einsum("nsj,nsj->ns", off, off)).min(axis=1))
