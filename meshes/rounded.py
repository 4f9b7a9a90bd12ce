"""Structured quadrilaterals of a quarter rectangle with a rounded corner, or of a quarter disc.

Three blocks: layers along the side face and half of the arc, layers along the other half and the
top face, and a core whose corner lies on the bisector of the arc. One vertex of three cells there
is the only irregular one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from castfem.meshes.blocks import (
    arc_length,
    cell_sizes,
    corner_angle,
    join,
    largest_growth,
    slant,
    transfinite,
)
from castfem.meshes.grading import SizeLaw
from castfem.meshes.outline import Piece
from castfem.meshes.perimeter import (
    Ring,
    Stretch,
    best_ring,
    half_arcs,
    layer_block,
    ring_cost,
)
from castfem.meshes.sizes import check_count

_REACH = 1.5
"""Length over which the bend of the layers at the corner is felt in the core, over the radius."""


@dataclass(frozen=True, slots=True)
class Grading:
    """Laws of one section: `inward` from the surface, `along` it from the corner; m."""

    inward: SizeLaw
    along: SizeLaw


@dataclass(frozen=True, slots=True)
class _Blocks:
    """Layers along the side (from y = 0 up) and along the top (towards x = 0), and the core."""

    side: np.ndarray
    top: np.ndarray
    core: np.ndarray


def rounded_quarter(
    faces: tuple[Piece, Piece, Piece], grading: Grading, quarters: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Mesh the quarter bounded by a side face, a corner arc and a top face.

    Args:
        faces: The narrow face (x = a, from y = 0 up), the arc and the wide face (y = b, towards
            x = 0). The faces may have no length (a disc).
        grading: Size laws.
        quarters: How many quarters the finished mesh has, for the limit on cells.

    Returns:
        Points (n, 2) and cells (m, 4) in tensor order.

    Raises:
        ValueError: There would be too many cells.
    """
    side, arc, top = faces
    rows = corner_cells(arc, grading, 0.5 * arc.radius)
    check_count(
        (rows + grading.along.count(side.length)) * (rows + grading.along.count(top.length)),
        quarters,
    )
    blocks = _blocks(faces, grading, _ring(faces, grading))
    return join([blocks.core, blocks.side, blocks.top])


@lru_cache(maxsize=16)
def _ring(faces: tuple[Piece, Piece, Piece], grading: Grading) -> Ring:
    """The best ring; kept, because half, whole and second order need the same one."""
    return best_ring(
        lambda ring: _cost(_blocks(faces, grading, ring), faces[1], grading), "straight"
    )


def corner_cells(arc: Piece, grading: Grading, depth: float) -> int:
    """Cells on half of a convex arc under which the layers have the given depth, m.

    They respect the size along the surface, and the size at that depth, because the core takes its
    rows from them.
    """
    limit = min(grading.along.fine, float(grading.inward.size(np.array([depth]))[0]) / 0.8)
    limit = min(limit, grading.inward.coarse / 0.7)
    return max(1, math.ceil(0.5 * arc.length / limit - 1e-9))


def _blocks(faces: tuple[Piece, Piece, Piece], grading: Grading, ring: Ring) -> _Blocks:
    """Blocks for one shape of the ring."""
    side, arc, top = faces
    a, b, r = side.start[0], top.end[1], arc.radius
    half, law = 0.5 * arc.length, grading.inward
    arc_cells = corner_cells(arc, grading, ring.depth * r)
    along = replace(grading.along, lead=half / arc_cells)
    n_side, n_top = (along.cells(f.length) if f.length > 0.0 else 0 for f in (side, top))
    # Not much thinner than necessary, which is the fine size, or the pitch on the arc.
    thin = 0.8 * min(law.fine, half / arc_cells)
    most = math.floor(ring.depth * r / thin)
    n = max(1, min(round(ring.crowd * law.count(ring.depth * r)), most))
    # Rows and columns end on the other face: where it has fewer than the depth needs, refine it.
    n_side = max(n_side, math.ceil(law.count(b)) - n - arc_cells) if n_side else 0
    n_top = max(n_top, math.ceil(law.count(a)) - n - arc_cells) if n_top else 0
    bottom, left = (
        law.fitted(length, n + arc_cells + across).nodes(length, n + arc_cells + across)
        for length, across in ((a, n_top), (b, n_side))
    )
    corner = min(0.5 * float(left[n] + bottom[n]), ring.depth * r)
    deep_side, deep_top = (
        float((1.0 - ring.straight) * line[n] + ring.straight * corner) for line in (bottom, left)
    )
    first, second = half_arcs(arc)
    nodes = np.linspace(0.0, half, arc_cells + 1)
    side_run, top_run = [Stretch(first, nodes, "end")], [Stretch(second, nodes, "start")]
    if n_side:
        side_run.insert(0, Stretch(side, side.length - along.nodes(side.length, n_side)[::-1]))
    if n_top:
        top_run.append(Stretch(top, along.nodes(top.length, n_top)))
    at, depth = _depths(side.length, half, corner, deep_side)
    side_knots = (side.length + half - at[::-1], depth[::-1])
    side_layers = layer_block(side_run, side_knots, n, law, ring)
    top_knots = _depths(top.length, half, corner, deep_top)
    top_layers = layer_block(top_run, top_knots, n, law, ring)
    side_layers[-1] = top_layers[0]
    upper, right = top_layers[::-1, -1], side_layers[:, -1]
    x = _core_line(a - bottom[n:][::-1], upper[:, 0], ring.straight) * (a - deep_side)
    y = _core_line(b - left[n:][::-1], right[:, 1], ring.straight) * (b - deep_top)
    lower = np.stack([x, np.zeros(len(x))], axis=1)
    middle = np.stack([np.zeros(len(y)), y], axis=1)
    core = _core((lower, upper, middle, right), _REACH * r)
    return _Blocks(side_layers, top_layers, core)


def _core(sides: tuple[np.ndarray, ...], reach: float) -> np.ndarray:
    """Core from its lower, upper, left and right side, all (., 2).

    The bends of the upper and right side near the corner are felt within `reach` of them, and not,
    as in plain transfinite interpolation, by lines all across the core.
    """
    lower, upper, left, right = sides
    bends, chords = [], []
    for line in (upper, right):
        along = (arc_length(line) / arc_length(line)[-1])[:, None]
        chords.append(line[0] + along * (line[-1] - line[0]))
        chords[-1][-1] = line[-1]
        bends.append(line - chords[-1])
    block = transfinite(lower, chords[0], left, chords[1])
    far_x, far_y = np.abs(block - block[-1, -1]).max(axis=(0, 1))
    from_right = np.exp(-np.abs(block[..., 0] - chords[1][None, :, 0]) / reach)
    from_top = np.exp(-np.abs(block[..., 1] - chords[0][:, None, 1]) / reach)
    # Shifted and scaled so that the effect vanishes on the lines of symmetry.
    zero_x, zero_y = math.exp(-far_x / reach), math.exp(-far_y / reach)
    block = block + bends[1][None] * np.maximum((from_right - zero_x) / (1 - zero_x), 0)[..., None]
    block = block + bends[0][:, None] * np.maximum((from_top - zero_y) / (1 - zero_y), 0)[..., None]
    block[:, 0], block[:, -1], block[0], block[-1] = lower, upper, left, right
    return block


def _core_line(graded: np.ndarray, opposite: np.ndarray, straight: float) -> np.ndarray:
    """Nodes (n,) of the core on a line of symmetry, from the centre (0) to the layers (1).

    Between those `graded` by the law of the depth and those at the other side of the core.
    """
    line = (1.0 - straight) * graded / graded[-1] + straight * opposite / opposite[-1]
    line[0], line[-1] = 0.0, 1.0
    return line


def _depths(face: float, half: float, corner: float, deep: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth of the layers along half an arc and a face, from the middle of the arc.

    It is constant on the arc and changes along the face; where the face is short, along the arc.
    """
    even = half * min(1.0, face / half)
    return np.array([0.0, even, half + face]), np.array([corner, corner, deep])


def _cost(blocks: _Blocks, arc: Piece, grading: Grading) -> float:
    """Cost of the ring that made the blocks.

    Besides what `ring_cost` counts, cells on the lines of symmetry that are larger than the law of
    the depth allows.
    """
    core_x, core_y = cell_sizes(blocks.core)
    side_along, side_in = cell_sizes(blocks.side)
    top_along, top_in = cell_sizes(blocks.top)
    growth = max(
        largest_growth(np.concatenate([core_x.T, side_in[:, ::-1]], axis=1)),
        largest_growth(np.concatenate([core_y, top_in[::-1, ::-1]], axis=1)),
        largest_growth(np.concatenate([side_along.T, top_along.T], axis=1)),
    )
    excess = 0.0
    for line in (
        np.r_[blocks.top[-1, :, 1], blocks.core[0, -2::-1, 1]],
        np.r_[blocks.side[0, :, 0], blocks.core[-2::-1, 0, 0]],
    ):
        allowed = grading.inward.size(line[0] - line[1:])
        excess = max(excess, math.log(float((-np.diff(line) / allowed).max())) - 0.02)
    angle = corner_angle(blocks.core[-1, -1], blocks.core[-2, -1], blocks.core[-1, -2])
    cells = core_x.size + side_in.size + top_in.size
    # A disc's core has no straight faces to be parallel to.
    flat = 1.0 - arc.radius / min(blocks.side[0, 0, 0], blocks.top[-1, 0, 1])
    return ring_cost(growth, angle, cells, flat * slant(blocks.core)) + excess
