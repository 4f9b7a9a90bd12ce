"""Rolls that are misaligned, locked or missing (thesis VI.4).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from castfem.base.types import Array
from castfem.physics.machine.line import Bent
from castfem.physics.machine.rolls import Pair, Rolls

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def circle(before: Array, here: Array, after: Array) -> float:
    """Curvature of the circle through three points (2,), 1/m: 1/R = 4 S/(a b c) (329).

    Positive for a left turn.
    """
    a, b, c = after - here, after - before, here - before
    twice = float(c[0] * b[1] - c[1] * b[0])
    return 2.0 * twice / math.prod(float(np.hypot(*side)) for side in (a, b, c))


def with_radii(rolls: Rolls) -> Rolls:
    """Return the rolls with the radii that result from misaligned and missing ones.

    At a misaligned roll and its two neighbours the curvature changes by the change of that of the
    circle through three rolls (329); elsewhere it is unchanged. At a missing pair the curvature is
    linear between its neighbours.
    """
    if not any(pair.offset or pair.lost for pair in rolls.pairs):
        return rolls
    return replace(rolls, pairs=_with_radii(rolls))


@lru_cache(maxsize=16)  # called repeatedly for the same rolls
def _with_radii(rolls: Rolls) -> tuple[Pair, ...]:
    pairs = list(rolls.pairs)
    held = rolls.there
    if not held:
        return tuple(pairs)
    moved = {i for i in held if pairs[i].offset}
    if moved:
        points, inward = _places(rolls)
        off = points + np.array([[pair.offset] for pair in pairs]) * inward
        for before, here, after in zip(held, held[1:], held[2:], strict=False):
            three = (before, here, after)
            if moved.intersection(three):
                change = circle(*(off[i] for i in three)) - circle(*(points[i] for i in three))
                pairs[here] = _curved(pairs[here], 1.0 / pairs[here].radius + change)
    places = [pairs[i].position for i in held]
    chi = [1.0 / pairs[i].radius for i in held]
    for i, pair in enumerate(pairs):
        if pair.lost:
            pairs[i] = _curved(pair, float(np.interp(pair.position, places, chi)))
    return tuple(pairs)


def out_of_line(normal: Rolls, rolls: Rolls) -> Array:
    """Return the distance of rolls from the line that their strand follows (n,), m.

    For all existing pairs, towards the centre of curvature. With 1/R linear between the rolls the
    strand follows a misaligned roll only in part, and leaves its neighbours: the shell has to take
    up the remaining distance. Beyond the second pair on each side it is zero.

    Args:
        normal: The rolls without defects.
        rolls: The rolls with their defects, from `with_radii`.
    """
    held, found = rolls.there, np.zeros(len(rolls.there))
    plain = [
        replace(pair, lost=other.lost)
        for pair, other in zip(normal.pairs, rolls.pairs, strict=True)
    ]
    base = with_radii(replace(rolls, pairs=tuple(plain)))
    places = np.array([rolls.pairs[i].position for i in held])
    gaps = np.diff(places)
    for k, i in enumerate(held):
        if not rolls.pairs[i].offset:
            continue
        alone = list(plain)
        alone[i] = replace(alone[i], offset=rolls.pairs[i].offset)
        bent = with_radii(replace(rolls, pairs=tuple(alone)))
        change = np.array([1.0 / bent.pairs[j].radius - 1.0 / base.pairs[j].radius for j in held])
        areas = 0.5 * gaps * (change[1:] + change[:-1])
        turn = np.concatenate([[0.0], np.cumsum(areas)])
        rise = gaps * turn[:-1] + gaps**2 / 6.0 * (2.0 * change[:-1] + change[1:])
        line = np.concatenate([[0.0], np.cumsum(rise)])
        first, last = max(k - 2, 0), min(k + 2, len(held) - 1)
        ends = [first, last]
        line -= np.interp(places, places[ends], line[ends])
        line[k] -= rolls.pairs[i].offset
        found[first : last + 1] -= line[first : last + 1]
    return found


def _curved(pair: Pair, curvature: float) -> Pair:
    """The pair with a curvature of the strand, 1/m; negative if bent towards the extrados."""
    designed = pair.radius if pair.designed is None else pair.designed
    return replace(pair, radius=1.0 / curvature if curvature else math.inf, designed=designed)


def _places(rolls: Rolls) -> tuple[Array, Array]:
    """Points of the line between the rolls (n, 2), m, and its normals towards the intrados.

    The strand moves down along -y; the intrados is at larger x.
    """
    places = [pair.position for pair in rolls.pairs]
    radii = [pair.radius for pair in rolls.pairs]
    line = Bent(places, radii, [0.0] * len(places), rolls.face)
    ends = [0.0, *places]
    points = np.zeros((len(ends), 2))
    for i, (start, end) in enumerate(itertools.pairwise(ends)):
        s = start + 0.5 * (end - start) * (_POINTS + 1.0)
        angle = np.array([line.inclination(float(x)) for x in s])
        along = np.column_stack([np.sin(angle), -np.cos(angle)])
        points[i + 1] = points[i] + 0.5 * (end - start) * (_WEIGHTS @ along)
    angle = np.array([line.inclination(s) for s in places])
    return points[1:], np.column_stack([np.cos(angle), np.sin(angle)])
