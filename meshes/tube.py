"""Mesh of a quarter of a tube: bricks between its inner wall and the offset of it.

The wall is thin and smooth, so that a mapped mesh follows it exactly, with cells normal to it.
(Unstructured tetrahedra of the same error need some ten times the unknowns: several through a wall
of 10 mm, over 800 mm of length.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_EDGES = (
    *((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3)),
    *((2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7)),
)
_FACES = (
    *((0, 1, 2, 3), (0, 1, 4, 5), (0, 2, 4, 6)),
    *((1, 3, 5, 7), (2, 3, 6, 7), (4, 5, 6, 7)),
)
_GROWTH = 1.3
"""Ratio of the length of a layer to that of its neighbour nearer to the meniscus."""


@dataclass(frozen=True, slots=True, eq=False)
class TubeMesh:
    """A block of bricks: across the wall x round it x along it."""

    #: Nodes (n, 3), m; z runs down along the tube. Node (i, j, k) has the number (k * round + j) *
    #: across + i.
    points: np.ndarray
    cells: np.ndarray  #: nodes of each brick (m, (order + 1)^3), in the order of DOLFINx
    order: int  #: order of the cells' geometry, 1 or 2
    shape: tuple[int, int, int]  #: nodes across the wall (0 at the inner one), round it, along it
    #: layer of nodes from which on the inner wall is hot; the collar is above it
    meniscus: int = 0

    def node(self, i: int | np.ndarray, j: int | np.ndarray, k: int | np.ndarray) -> np.ndarray:
        """Numbers of nodes by their places in the block; negative ones count from the end."""
        across, around, along = self.shape
        i, j, k = np.arange(across)[i], np.arange(around)[j], np.arange(along)[k]
        return np.asarray((k * around + j) * across + i)

    def inner(self) -> np.ndarray:
        """Nodes of the inner wall (along, round)."""
        _, around, along = self.shape
        return self.node(0, np.arange(around)[None, :], np.arange(along)[:, None])

    def outer(self) -> np.ndarray:
        """Nodes of the outer wall (along, round)."""
        _, around, along = self.shape
        return self.node(-1, np.arange(around)[None, :], np.arange(along)[:, None])


def tube(
    inner: np.ndarray,
    normals: np.ndarray,
    positions: np.ndarray,
    thickness: float,
    across: int,
    order: int = 2,
    meniscus: int = 0,
) -> TubeMesh:
    """Mesh a tube.

    Args:
        inner: Points of the inner wall (along, round, 2), m, counter-clockwise; of cells of second
            order every other one is the middle of a cell.
        normals: Unit normals there, out of the cavity.
        positions: z of the layers (along,), m, increasing.
        thickness: Thickness of the wall along the normals, m.
        across: Cells across the wall.
        order: 1 or 2.
        meniscus: See `TubeMesh`.

    Raises:
        ValueError: The nodes do not make up whole cells.
    """
    along, around = inner.shape[:2]
    if (around - 1) % order or (along - 1) % order:
        raise ValueError(f"cells of order {order} need {order} k + 1 nodes round and along")
    depth = thickness * np.linspace(0.0, 1.0, order * across + 1)
    place = inner[:, :, None, :] + depth[:, None] * normals[:, :, None, :]
    z = np.broadcast_to(positions[:, None, None, None], (*place.shape[:3], 1))
    points = np.concatenate([place, z], axis=-1).reshape(-1, 3)
    shape = (len(depth), around, along)
    return TubeMesh(points, _bricks(shape, order), order, shape, meniscus)


def _bricks(shape: tuple[int, int, int], order: int) -> np.ndarray:
    """Nodes of the bricks of a block."""
    local = brick_nodes(order)
    counts = [(n - 1) // order for n in shape]
    first = [order * np.arange(n) for n in counts]
    k, j, i = np.meshgrid(first[2], first[1], first[0], indexing="ij")
    start = np.stack([i.ravel(), j.ravel(), k.ravel()], axis=1)
    at = start[:, None, :] + local[None, :, :]
    return np.asarray((at[..., 2] * shape[1] + at[..., 1]) * shape[0] + at[..., 0], np.int64)


def brick_nodes(order: int) -> np.ndarray:
    """Places (nodes, 3) of a brick's nodes in steps of 1/order, in the order of DOLFINx.

    Vertices in tensor order; then the middles of the edges, of the faces, of the brick.
    """
    vertices = np.array([(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)])
    if order == 1:
        return vertices
    parts = [[(n,) for n in range(8)], _EDGES, _FACES, [tuple(range(8))]]
    return np.array([2 * vertices[list(part)].mean(axis=0) for p in parts for part in p], np.int64)


def graded(start: float, end: float, fine: float, coarse: float, order: int = 2) -> np.ndarray:
    """Layers from `start` to `end`, m, both included: fine at 0 and coarser away from it.

    Args:
        start: First layer, not above 0.
        end: Last layer, above 0.
        fine: Length of a cell at 0, m.
        coarse: Largest length, m.
        order: Order of the cells; 2 adds a layer in the middle of each.
    """
    down = _side(end, fine, coarse)
    up = _side(-start, fine, coarse) if start < 0.0 else np.zeros(1)
    z = np.concatenate([-up[:0:-1], down])
    if order == 2:
        z = np.sort(np.concatenate([z, 0.5 * (z[1:] + z[:-1])]))
    return z


def _side(length: float, fine: float, coarse: float) -> np.ndarray:
    """Ends of cells that grow from 0 to a length."""
    steps, size = [], min(fine, length)
    while sum(steps) < length:
        steps.append(size)
        size = min(_GROWTH * size, coarse)
    ends = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(ends * (length / ends[-1]))
