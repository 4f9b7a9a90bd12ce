"""Structured quadrilaterals of a quarter beam blank: four blocks of layers and three of the core.

Layers follow the whole surface. The core is an L of three blocks that meet in one node under the
middle of the fillet: A below the web, B beside it in the flange, C above B up to the tip. Irregular
vertices: three cells under each of the two convex corners, five under the fillet.
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
    transfinite,
)
from castfem.meshes.grading import SizeLaw, two_sided
from castfem.meshes.outline import Piece
from castfem.meshes.perimeter import (
    Ring,
    Stretch,
    best_ring,
    half_arcs,
    layer_block,
    ring_cost,
)
from castfem.meshes.rounded import Grading, corner_cells
from castfem.meshes.sizes import check_count

# Length over which lines from the node under the fillet keep their direction, relative to its y.
_BEND = 0.3


@dataclass(frozen=True, slots=True)
class _Nodes:
    """Nodes along the surface (distances from the start of each piece, m) and numbers of cells."""

    corner: np.ndarray  #: nodes on half of the corner, equally spaced
    shoulder: np.ndarray  #: the same on the shoulder
    fillet: np.ndarray  #: the same on the fillet
    tip: np.ndarray  #: nodes on the tip, from the corner
    flank: np.ndarray  #: nodes on the flank, from the shoulder
    web: np.ndarray  #: nodes on the web, from the fillet
    layers: int  #: number of layers
    rows: int  #: rows of block A and B, below the fillet
    pitch: SizeLaw  #: size along the surface on the fillet, m


def beam_quarter(
    faces: tuple[Piece, ...], grading: Grading, quarters: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Mesh the quarter of a beam blank.

    Args:
        faces: Narrow face, corner, tip, shoulder, flank, fillet and web, from (a, 0) to (0, c).
        grading: Size laws; `along` from the convex corners.
        quarters: How many quarters the finished mesh has, for the limit on cells.

    Returns:
        Points (n, 2) and cells (m, 4) in tensor order.

    Raises:
        ValueError: There would be too many cells.
    """
    nodes = _nodes(faces, grading, Ring())
    along = [len(x) for x in (nodes.corner, nodes.tip, nodes.shoulder, nodes.flank)]
    check_count(
        (nodes.layers + nodes.rows + len(nodes.web) + len(nodes.fillet)) * sum(along), quarters
    )
    return join(_blocks(faces, grading, _ring(faces, grading)))


@lru_cache(maxsize=16)
def _ring(faces: tuple[Piece, ...], grading: Grading) -> Ring:
    """The best ring; kept, because half, whole and second order need the same one."""
    return best_ring(lambda ring: _cost(_blocks(faces, grading, ring)), "even")


def _cost(blocks: list[np.ndarray]) -> float:
    """Cost of the ring that made the blocks."""
    sizes = [cell_sizes(block) for block in blocks]
    outer, tip, flank, web, a, b, c = (s[1] for s in sizes)
    a_x, b_x, c_x = (s[0] for s in sizes[4:])
    rows = a_x.shape[1]
    growth = max(
        largest_growth(np.concatenate([a_x.T, b_x.T, outer[:rows, ::-1]], axis=1)),
        largest_growth(np.concatenate([flank[::-1], c_x.T, outer[rows:, ::-1]], axis=1)),
        largest_growth(np.concatenate([a, web[::-1, ::-1]], axis=1)),
        largest_growth(np.concatenate([b, c, tip[::-1, ::-1]], axis=1)),
        largest_growth(np.concatenate([s[0].T for s in sizes[:4]], axis=1)),
    )
    core = blocks[6]
    angle = max(
        corner_angle(core[0, -1], core[1, -1], core[0, -2]),
        corner_angle(core[-1, -1], core[-2, -1], core[-1, -2]),
    )
    return ring_cost(growth, angle, sum(s[0].size for s in sizes))


def _nodes(faces: tuple[Piece, ...], grading: Grading, ring: Ring) -> _Nodes:
    """Distribute nodes on the surface."""
    face, corner, tip, shoulder, flank, fillet, web = faces
    inward, along = grading.inward, grading.along
    depths = _corner_depths(corner, shoulder, ring)
    small = math.sqrt(depths[0] * depths[1])
    at_corner, at_shoulder = (
        replace(along, lead=0.5 * p.length / corner_cells(p, grading, deep))
        for p, deep in zip((corner, shoulder), depths, strict=True)
    )
    layers = max(1, round(ring.crowd * inward.count(small)))
    limit = min(inward.coarse, float(inward.size(np.array([small]))[0]) / 0.8, fillet.length / 6.0)
    halves = [
        np.linspace(0.0, 0.5 * p.length, max(1, round(0.5 * p.length / size)) + 1)
        for p, size in ((corner, at_corner.lead), (shoulder, at_shoulder.lead))
    ]
    bend = np.linspace(0.0, 0.5 * fillet.length, math.ceil(0.5 * fillet.length / limit) + 1)
    pitch = SizeLaw(min(float(bend[1]), inward.coarse), inward.coarse, 0.0, along.slope)
    on_flank = two_sided(flank.length, at_shoulder, pitch)
    half_web = web.end[1]
    rows = max(2, math.ceil(inward.count(half_web)) - layers, math.ceil(layers / 1.5))
    # The outer face has the rows of A and those of C: refine the flank until they are enough.
    short = at_corner.cells(face.length) + len(halves[0]) - 1
    short -= rows + len(halves[1]) - 1 + len(on_flank) - 1 + len(bend) - 1
    if short > 0:
        on_flank = two_sided(flank.length, at_shoulder, pitch, len(on_flank) - 1 + short)
    return _Nodes(
        halves[0],
        halves[1],
        bend,
        two_sided(tip.length, at_corner, at_shoulder),
        on_flank,
        pitch.nodes(web.length),
        layers,
        rows,
        pitch,
    )


def _corner_depths(corner: Piece, shoulder: Piece, ring: Ring) -> tuple[float, float]:
    """Depth of the layers round the two convex corners."""
    small = min(corner.radius, shoulder.radius)
    first, second = (small * (p.radius / small) ** ring.even for p in (corner, shoulder))
    return ring.depth * first, ring.depth * second


def _blocks(faces: tuple[Piece, ...], grading: Grading, ring: Ring) -> list[np.ndarray]:
    """The four blocks of layers and the three of the core for one shape of the ring."""
    nodes = _nodes(faces, grading, ring)
    face, corner, tip, shoulder, flank, fillet, web = faces
    n, inward, half_web = nodes.layers, grading.inward, web.end[1]
    left = inward.fitted(half_web, n + nodes.rows).nodes(half_web, n + nodes.rows)
    deep = float(left[n])
    corner_1, corner_2 = half_arcs(corner)
    shoulder_1, shoulder_2 = half_arcs(shoulder)
    fillet_1, fillet_2 = half_arcs(fillet)
    at_corner, at_shoulder = (min(deep, d) for d in _corner_depths(corner, shoulder, ring))
    middle = fillet_1.at(np.array([fillet_1.length]))[0]
    outward = (np.array(fillet.centre) - middle) / fillet.radius
    inner = middle - deep * outward  # the node where A, B and C meet
    lower = min(float(inner[1]) - 0.5 * _BEND * float(inner[1]), 0.8 * face.length)
    on_face = _face_nodes(face, nodes, lower, (left[n:] - deep) / (half_web - deep))
    runs = (
        [Stretch(face, on_face), Stretch(corner_1, nodes.corner, "end")],
        [
            Stretch(corner_2, nodes.corner, "start"),
            Stretch(tip, nodes.tip),
            Stretch(shoulder_1, nodes.shoulder, "end"),
        ],
        [
            Stretch(shoulder_2, nodes.shoulder, "start"),
            Stretch(flank, nodes.flank),
            Stretch(fillet_1, nodes.fillet),
        ],
        [Stretch(fillet_2, nodes.fillet), Stretch(web, nodes.web)],
    )
    depths = (
        (deep, at_corner, at_corner),
        (at_corner, at_corner, at_shoulder, at_shoulder),
        (at_shoulder, at_shoulder, deep, deep),
        (deep, deep, deep),
    )
    layers: list[np.ndarray] = []
    for run, values in zip(runs, depths, strict=True):
        knots = np.r_[0.0, np.cumsum([s.piece.length for s in run])]
        block = layer_block(run, (knots, np.array(values)), n, inward, ring)
        if layers:
            block[0] = layers[-1][-1]
        layers.append(block)
    layers[-1][-1] = np.stack([np.zeros(n + 1), half_web - left[: n + 1]], axis=1)
    return [*layers, *_core([b[:, -1] for b in layers], nodes, grading, left[n:])]


def _face_nodes(face: Piece, nodes: _Nodes, lower: float, rows: np.ndarray) -> np.ndarray:
    """Nodes on the outer face: the rows of B up to `lower`, then those of C to the corner.

    Above, the sizes are in proportion to those at the other end of the row, on the flank, so that
    rows run straight across the flange; but from both ends they grow by no more than a quarter.
    """
    below = lower * (1.0 - rows[::-1])
    sizes = np.concatenate([np.diff(x) for x in (nodes.shoulder, nodes.flank, nodes.fillet)])
    flank, room = sizes[len(nodes.corner) - 1 :][::-1], face.length - lower
    growth = 1.25 ** np.minimum(np.arange(1, len(flank) + 1), 100)
    most = np.minimum((below[-1] - below[-2]) * growth, nodes.corner[1] * growth[::-1])
    low, high = 0.0, 1e3 * room / flank.min()
    for _ in range(80):
        middle = 0.5 * (low + high)
        short = np.minimum(middle * flank, most).sum() < room
        low, high = (middle, high) if short else (low, middle)
    above = np.cumsum(np.minimum(high * flank, most))
    return np.r_[below, lower + above * room / above[-1]]


def _core(
    lines: list[np.ndarray], nodes: _Nodes, grading: Grading, left: np.ndarray
) -> list[np.ndarray]:
    """Blocks A, B and C of the core within the inner lines of the four runs."""
    outer, tip, flank, web = lines
    rows, inward = nodes.rows, grading.inward
    corner, columns = flank[-1], len(tip) - 1
    fraction = (left - left[0]) / (left[-1] - left[0])
    down, right = _fan(flank[-2] - corner, web[1] - corner)
    reach = _BEND * float(corner[1])
    foot = np.array([corner[0] + reach * down[0], 0.0])
    deeper = SizeLaw(float(left[1] - left[0]), inward.coarse, 0.0, inward.slope)
    along = arc_length(web)
    bottom_a = _divide(np.stack([foot, np.zeros(2)]), along / along[-1])
    beside = replace(nodes.pitch, fine=float(bottom_a[0, 0] - bottom_a[1, 0]))

    def spread(line: np.ndarray, near: SizeLaw) -> np.ndarray:
        length = float(arc_length(line)[-1])
        return _divide(line, two_sided(length, near, deeper, columns) / length)

    bottom_b = spread(np.stack([foot, outer[0]]), beside)
    b_left = _divide(_bent(corner, corner + reach * down, foot), fraction)
    b_top = spread(_bent(corner, corner + reach * right, outer[rows]), deeper)
    block_b = transfinite(bottom_b, b_top, b_left[::-1], outer[: rows + 1])
    block_c = transfinite(b_top, tip[::-1], flank[::-1], outer[rows:])
    middle = np.stack([np.zeros(len(left)), left[-1] - left], axis=1)
    block_a = transfinite(bottom_a[::-1], web[::-1], middle[::-1], b_left[::-1])
    return [block_a, block_b, block_c]


def _fan(up: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions that cut the core's angle at its inner corner into three equal ones.

    Args:
        up: Direction from the node under the fillet towards the flank.
        along: Direction from it towards the web.

    Returns:
        The direction down (between A and B) and the one to the right (between B and C).
    """
    first = np.arctan2(up[1], up[0])
    last = np.arctan2(along[1], along[0])
    turn = (first - last) % (2.0 * np.pi)
    down, right = last + turn / 3.0, last + 2.0 * turn / 3.0
    return (
        np.array([np.cos(down), np.sin(down)]),
        np.array([np.cos(right), np.sin(right)]),
    )


def _bent(start: np.ndarray, control: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Dense polyline (201, 2) that leaves `start` towards `control` (a parabola)."""
    t = np.linspace(0.0, 1.0, 201)[:, None]
    return (1 - t) ** 2 * start + 2.0 * t * (1 - t) * control + t**2 * end


def _divide(line: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Points (n, 2) at fractions (n,) of the length of a polyline; its ends exactly."""
    length = arc_length(line)
    points = np.stack([np.interp(at * length[-1], length, line[:, k]) for k in (0, 1)], axis=1)
    points[0], points[-1] = line[0], line[-1]
    return points
