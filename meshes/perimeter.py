"""Boundary layers that follow a curved perimeter.

A run is a stretch of surface between two ends: a line of symmetry, the middle of a concave fillet,
or the middle of a convex corner. A constant number of layers follows it; at a convex corner the
layers of two runs end on the bisector in one node of three cells (the corner of the core). The
inner line is an offset of the surface, sharpened at the corners so that these three cells share
the angle; its nodes slide away from the corners, so that cells do not shrink with the arc's radius.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from castfem.meshes.blocks import arc_length, layers
from castfem.meshes.grading import SizeLaw
from castfem.meshes.outline import Piece

_SPREAD = 1.0
"""Length over which nodes slide away from a corner, over the corner's radius."""

_SAMPLES = 2001

_FINE_GROWTH = math.log(1.2)


@dataclass(frozen=True, slots=True)
class Ring:
    """Shape of the layers round a convex corner."""

    depth: float = 0.5  #: depth of the layers over the radius of the corner
    #: 0 where the inner line is the offset arc, 1 where it is the sharp corner of the offset's
    #: tangents; in between the three cells that meet there share the angle
    sharpness: float = 0.5
    crowd: float = 1.0  #: number of layers over the number the grading asks for in that depth
    #: for two corners of different radius: 0 gives both the depth of the smaller one, 1 to each the
    #: depth of its own radius
    even: float = 0.0
    #: 0 where the lines of symmetry are graded by the law of the depth, 1 where rows and columns
    #: run straight across the core, as they start at the other face
    straight: float = 0.0


def best_ring(cost: Callable[[Ring], float], freedom: str) -> Ring:
    """The ring of least cost: the best of a coarse grid, then smaller and smaller steps from it.

    Args:
        cost: Cost of a ring, such as `ring_cost`.
        freedom: "even" or "straight", what is varied besides depth, sharpness and crowd.
    """

    def ring(values: Sequence[float]) -> Ring:
        depth, sharpness, crowd, free = values
        return replace(Ring(depth, sharpness, crowd), **{freedom: free})

    def cheapest(choices: Iterable[Sequence[float]]) -> tuple[float, tuple[float, ...]]:
        return min((cost(ring(values)), tuple(values)) for values in choices)

    grid = itertools.product((0.35, 0.55), (0.4, 0.6), (0.8, 1.0, 1.3, 1.9), (0.0, 0.5, 1.0))
    least, best = cheapest(grid)
    step = np.array([0.1, 0.1, 0.2, 0.25])
    low, high = (0.2, 0.3, 0.6, 0.0), (0.8, 0.8, 3.0, 1.0)
    for _ in range(4):
        tried = [
            [float(v) for v in np.clip(best + sign * step * axis, low, high)]
            for axis, sign in itertools.product(np.eye(4), (-1.0, 1.0))
        ]
        nearby = cheapest(tried)
        if nearby[0] < least - 1e-9:
            least, best = nearby
        else:
            step /= 2.0
    return ring(best)


def ring_cost(growth: float, angle: float, cells: int, slant: float = 0.0) -> float:
    """Cost that `best_ring` minimises.

    Growth below 1.2 counts like none, so that the number of cells decides.

    Args:
        growth: Logarithm of the largest ratio of neighbouring sizes.
        angle: Largest angle of the core under a convex corner, degrees; free up to 125.
        cells: Number of cells.
        slant: Root mean square of the cosine of the core's angles, 0 for rectangles.
    """
    wide = max(0.0, angle - 125.0) / 40.0
    return max(growth, _FINE_GROWTH) + wide + 0.2 * math.log(cells) + 0.7 * slant


@dataclass(frozen=True, slots=True)
class Stretch:
    """A piece of a run."""

    piece: Piece  #: segment or arc; an arc that is half of a convex corner has an end in its middle
    distances: np.ndarray  #: distances (n + 1,) of the nodes from the start of the piece, m
    #: "" for a face or fillet; "start" or "end" for half a convex corner, the end that is the
    #: middle of the corner
    corner: str = ""


def half_arcs(arc: Piece) -> tuple[Piece, Piece]:
    """The two halves of an arc."""
    middle = arc.at(np.array([0.5 * arc.length]))[0]
    point = (float(middle[0]), float(middle[1]))
    return (
        Piece(arc.group, arc.start, point, arc.centre, arc.mirrors),
        Piece(arc.group, point, arc.end, arc.centre, arc.mirrors),
    )


def run_nodes(run: Sequence[Stretch]) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) of the nodes of a run and their distances (n,) along it."""
    points, along, start = [], [], 0.0
    for i, stretch in enumerate(run):
        skip = 0 if i == 0 else 1
        points.append(stretch.piece.at(stretch.distances)[skip:])
        along.append(start + stretch.distances[skip:])
        start += stretch.piece.length
    return np.concatenate(points), np.concatenate(along)


def _frame(piece: Piece, distance: np.ndarray) -> np.ndarray:
    """Inward unit normals (n, 2) at distances along a piece (the section is on its left)."""
    if piece.centre is None:
        tangent = np.array(piece.end) - np.array(piece.start)
        normal = np.array([-tangent[1], tangent[0]]) / np.hypot(*tangent)
        return np.broadcast_to(normal, (len(distance), 2)).copy()
    toward = (np.array(piece.centre) - piece.at(distance)) / piece.radius
    return toward if piece.turn > 0.0 else -toward


def run_normals(run: Sequence[Stretch]) -> np.ndarray:
    """Inward unit normals (n, 2) at the nodes of a run."""
    return np.concatenate(
        [_frame(s.piece, s.distances)[0 if i == 0 else 1 :] for i, s in enumerate(run)]
    )


def _inner_line(
    stretch: Stretch, distance: np.ndarray, depth: np.ndarray, sharpness: float
) -> np.ndarray:
    """Points (n, 2) of the inner line facing points of a stretch, at the given depths."""
    piece = stretch.piece
    offset = piece.at(distance) + depth[:, None] * _frame(piece, distance)
    if not stretch.corner:
        return offset
    # From the tangent end of the half arc: along its tangent instead of round the arc.
    alpha = abs(piece.turn)
    angle = distance / piece.radius if stretch.corner == "end" else alpha - distance / piece.radius
    foot = np.array(piece.start if stretch.corner == "end" else piece.end)
    outward = (foot - np.array(piece.centre)) / piece.radius
    middle = np.array(piece.end if stretch.corner == "end" else piece.start)
    along = middle - foot
    along -= (along @ outward) * outward
    along /= np.hypot(*along)
    # The inner corner must stay inside: it goes out by this much less than the layers' depth.
    deep = float(depth[-1] if stretch.corner == "end" else depth[0])
    most = 0.4 * deep / max((piece.radius - deep) * (1.0 / math.cos(alpha) - 1.0), 1e-300)
    sharpness = min(sharpness, most)
    sharp = outward + (angle / alpha * math.tan(alpha))[:, None] * along
    radius = (piece.radius - depth)[:, None]
    return (1.0 - sharpness) * offset + sharpness * (np.array(piece.centre) + radius * sharp)


def layer_block(
    run: Sequence[Stretch],
    depth: tuple[np.ndarray, np.ndarray],
    cells: int,
    law: SizeLaw,
    ring: Ring,
) -> np.ndarray:
    """Block of layers along a run.

    Args:
        run: Stretches in order along the surface, the section on the left.
        depth: Knots of the depth of the layers: distances along the run and depths, m; smooth
            steps in between.
        cells: Number of layers.
        law: Grading inwards.
        ring: Shape of the inner line at the corners.

    Returns:
        Points (nodes of the run, cells + 1, 2).
    """
    surface, along = run_nodes(run)
    share = np.array([s.piece.length for s in run])
    ends = np.r_[0.0, np.cumsum(share)]
    line, dense = [], []
    for i, stretch in enumerate(run):
        samples = np.linspace(0.0, stretch.piece.length, _SAMPLES)
        line.append(
            _inner_line(stretch, samples, np.interp(ends[i] + samples, *depth), ring.sharpness)
        )
        dense.append(ends[i] + samples)
    inner, sigma = np.concatenate(line), np.concatenate(dense)
    length = arc_length(inner)
    position = _slide(run, ends, sigma, length)
    wanted = np.interp(along, sigma, position)
    interface = np.stack([np.interp(wanted, length, inner[:, k]) for k in (0, 1)], axis=1)
    interface[0], interface[-1] = inner[0], inner[-1]
    return layers(surface, run_normals(run), interface, cells, law)


def _slide(
    run: Sequence[Stretch], ends: np.ndarray, sigma: np.ndarray, length: np.ndarray
) -> np.ndarray:
    """Position along the inner line of each point of the surface.

    Its derivative is that of the offset on faces and concave arcs and, next to the corners, reduced
    by an exponential that takes up the length lost there.
    """
    natural = np.ones_like(sigma)
    lost = np.zeros_like(sigma)
    for i, stretch in enumerate(run):
        inside = (sigma >= ends[i]) & (sigma <= ends[i + 1])
        piece = stretch.piece
        if piece.centre is not None and not stretch.corner:
            span = length[inside]
            natural[inside] = (span[-1] - span[0]) / piece.length
        if stretch.corner:
            middle = ends[i + 1] if stretch.corner == "end" else ends[i]
            reach = _SPREAD * piece.radius
            lost += piece.radius / reach * np.exp(-np.abs(sigma - middle) / reach)
    step = np.diff(sigma)
    straight = np.r_[0.0, np.cumsum(0.5 * (natural[1:] + natural[:-1]) * step)]
    taken = np.r_[0.0, np.cumsum(0.5 * (lost[1:] + lost[:-1]) * step)]
    if taken[-1] == 0.0:
        return straight * length[-1] / straight[-1]
    return straight - taken * (straight[-1] - length[-1]) / taken[-1]
