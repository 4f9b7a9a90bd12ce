"""Structured blocks of quadrilaterals: transfinite interpolation, boundary layers, joining.

A block is an array (p, q, 2) of points; index [i, j] is the node i along the first and j along the
second direction. Blocks share nodes where their sides hold identical points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from castfem.meshes.grading import SizeLaw


def arc_length(line: np.ndarray) -> np.ndarray:
    """Length (n,) along a polyline (n, 2) from its first point."""
    return np.r_[0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))]


def transfinite(
    bottom: np.ndarray, top: np.ndarray, left: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Points of a block (p, q, 2) from its four sides (Gordon and Hall 1973).

    The blending functions are the arc lengths of the sides, combined so that the lines that join
    equal fractions of opposite sides cross where they would in the unit square: a graded side
    keeps its grading into the block.

    Args:
        bottom: Side [:, 0], (p, 2).
        top: Side [:, -1], (p, 2).
        left: Side [0, :], (q, 2).
        right: Side [-1, :], (q, 2).

    Raises:
        ValueError: The sides do not meet in the corners.
    """
    corners = (
        (bottom[0], left[0]),
        (bottom[-1], right[0]),
        (top[0], left[-1]),
        (top[-1], right[-1]),
    )
    if any(not np.allclose(a, b, rtol=0.0, atol=1e-12) for a, b in corners):
        raise ValueError("the sides of a block do not meet in its corners")
    s0, s1, t0, t1 = (x / x[-1] for x in map(arc_length, (bottom, top, left, right)))
    ds, dt = (s1 - s0)[:, None], (t1 - t0)[None, :]
    s0, t0 = s0[:, None], t0[None, :]
    u = ((s0 + t0 * ds) / (1.0 - ds * dt))[..., None]
    v = ((t0 + s0 * dt) / (1.0 - ds * dt))[..., None]
    block = (
        (1 - v) * bottom[:, None]
        + v * top[:, None]
        + (1 - u) * left[None, :]
        + u * right[None, :]
        - (1 - u) * (1 - v) * bottom[0]
        - u * (1 - v) * bottom[-1]
        - (1 - u) * v * top[0]
        - u * v * top[-1]
    )
    block[:, 0], block[:, -1], block[0], block[-1] = bottom, top, left, right
    return block


def layers(
    surface: np.ndarray, normal: np.ndarray, interface: np.ndarray, cells: int, law: SizeLaw
) -> np.ndarray:
    """Block of boundary layers between the surface and an inner line.

    Each line of nodes leaves the surface along the inward normal and bends to its node of the
    inner line (a parabola). Along it the sizes start with `law.fine`, or smaller where the layers
    are thinner than that many cells of the fine size.

    Args:
        surface: Nodes on the surface (n, 2), m.
        normal: Inward unit normals there (n, 2).
        interface: Nodes of the inner line (n, 2), m.
        cells: Number of layers.
        law: Grading inwards from the surface.

    Returns:
        Points (n, cells + 1, 2); [:, 0] is the surface.
    """
    chord = interface - surface
    length = np.hypot(*chord.T)
    # Fitting a law is slow and its fractions depend smoothly on the length: fit it at a few.
    sample = np.linspace(length.min(), length.max(), 5)
    table = np.array([law.fitted(d, cells).nodes(d, cells) / d for d in sample])
    fraction = np.stack([np.interp(length, sample, column) for column in table.T], axis=1)[
        ..., None
    ]
    depth = np.einsum("na,na->n", chord, normal)[:, None, None]
    straight = normal[:, None] * depth
    slide = fraction**2 * (3.0 - 2.0 * fraction)
    block = surface[:, None] + fraction * straight + slide * (chord[:, None] - straight)
    block[:, 0], block[:, -1] = surface, interface
    return block


def cell_sizes(block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sizes (p - 1, q - 1) of the cells of a block along its first and second direction, m.

    A size is the cell's area over the mean length of the two sides that run across.
    """
    first, second = np.diff(block, axis=0), np.diff(block, axis=1)
    across = block[1:, 1:] - block[:-1, :-1], block[:-1, 1:] - block[1:, :-1]
    area = 0.5 * np.abs(
        across[0][..., 0] * across[1][..., 1] - across[0][..., 1] * across[1][..., 0]
    )
    along = np.hypot(first[..., 0], first[..., 1])
    up = np.hypot(second[..., 0], second[..., 1])
    return (
        area / (0.5 * (up[1:] + up[:-1])),
        area / (0.5 * (along[:, 1:] + along[:, :-1])),
    )


def largest_growth(sizes: np.ndarray) -> float:
    """Largest |log ratio| of neighbours along the last axis of sizes."""
    return float(np.abs(np.diff(np.log(sizes), axis=-1)).max(initial=0.0))


def slant(block: np.ndarray) -> float:
    """Root mean square of the cosine of the angle at which the lines of a block cross."""
    first, second = np.diff(block, axis=0)[:, 1:], np.diff(block, axis=1)[1:]
    dot = first[..., 0] * second[..., 0] + first[..., 1] * second[..., 1]
    lengths = np.hypot(first[..., 0], first[..., 1]) * np.hypot(second[..., 0], second[..., 1])
    return float(np.sqrt(np.mean((dot / lengths) ** 2)))


def corner_angle(vertex: np.ndarray, first: np.ndarray, second: np.ndarray) -> float:
    """Angle at `vertex` between two points, degrees."""
    p, q = first - vertex, second - vertex
    return math.degrees(abs(math.atan2(p[0] * q[1] - p[1] * q[0], p @ q)))


def join(blocks: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Number the nodes of blocks, those on common sides once.

    Returns:
        Points (n, 2) and cells (m, 4) in tensor order, counter-clockwise.
    """
    flat = np.concatenate([b.reshape(-1, 2) for b in blocks]) + 0.0  # no negative zeros
    scale = np.abs(flat).max()
    keys = np.round(flat / (1e-11 * scale)).astype(np.int64)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    cells, start = [], 0
    for block in blocks:
        p, q = block.shape[:2]
        node = number.reshape(-1)[start : start + p * q].reshape(p, q)
        start += p * q
        corners = (node[:-1, :-1], node[1:, :-1], node[:-1, 1:], node[1:, 1:])
        quads = np.stack([c.ravel() for c in corners], axis=1)
        a, b = block[1, 0] - block[0, 0], block[0, 1] - block[0, 0]
        if a[0] * b[1] - a[1] * b[0] < 0.0:
            quads = quads[:, [0, 2, 1, 3]]
        cells.append(quads)
    return flat[first], np.concatenate(cells)
