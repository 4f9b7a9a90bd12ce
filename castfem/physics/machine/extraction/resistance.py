"""Resistance of each pair of rolls to the strand, and the forces that cause it.

Equation numbers are those of [Pascon2003] (docs/references.md). Forces are those on the whole
strand, N.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array


def friction(axis: float, surface: float, locked: npt.ArrayLike) -> Array:
    """Effective coefficient of friction of each pair, (45)-(46).

    A roll turns while the friction of its axis is below that of its surface; a locked one slides.

    Args:
        axis: Coefficient at the axes of the rolls.
        surface: Coefficient between strand and roll.
        locked: Whether the rolls of each pair are locked (n,).
    """
    return np.where(np.asarray(locked, bool), surface, min(axis, surface))


def pair_resistances(
    coefficients: npt.ArrayLike, bulging: npt.ArrayLike, bending: npt.ArrayLike
) -> Array:
    """Resistance of each pair, N: friction times the forces on its two rolls, (47) and (327).

    Args:
        coefficients: Coefficients of friction (n,).
        bulging: Bulging force on both rolls of each pair (n,), N.
        bending: Difference of the forces on the two rolls by bending (n,), N; either sign.
    """
    return np.asarray(np.asarray(coefficients) * (np.asarray(bulging) + np.abs(bending)))


def tributary_lengths(positions: Sequence[float] | Array) -> Array:
    """Tributary length of strand of each pair (n,), m: to the middle of the neighbouring pitches.

    The first and the last pair have a whole pitch, half of it on the side without a neighbour; a
    single pair has none.
    """
    pitches = np.diff(np.asarray(positions, float))
    if not len(pitches):
        return np.zeros(len(positions))
    before, after = np.append(pitches[0], pitches), np.append(pitches, pitches[-1])
    return np.asarray(0.5 * (before + after))


def pressed(pressure: npt.ArrayLike, lengths: npt.ArrayLike, width: npt.ArrayLike) -> Array:
    """Force of the liquid's pressure on both rolls of each pair (n,), N; see (319).

    However the shell bulges, they carry the pressure on their tributary length.

    Args:
        pressure: Pressure of the liquid in the middle of the strand at each pair, Pa.
        lengths: Tributary lengths, m (`tributary_lengths`).
        width: Width of the liquid behind a wide face, m.
    """
    return 2.0 * np.asarray(pressure, float) * np.asarray(lengths, float) * np.asarray(width, float)


def bending_force(moments: Sequence[float], pitches: Sequence[float]) -> float:
    """Force on a pair from bending, N, positive on the roll of the extrados.

    The strand between two pairs has the shear force Q = dM/ds; a pair carries its jump. Equal
    moments from roll to roll give no force. The force of the axial tension on the rolls of an arc,
    k N L, is neglected: 2 kN compared with 580 kN from the liquid's pressure.

    Args:
        moments: M at the pair before, at the pair and at the one after, N m, positive for tension
            at the intrados.
        pitches: Distances from the previous pair and to the next one, m.
    """
    before, here, after = moments
    return (here - before) / pitches[0] - (after - here) / pitches[1]


def hinge_force(moment: float, pitch: float) -> float:
    """Force on a pair from a strand with plastic hinges, N, as in the thesis: M/L (320).

    Each pair is taken by itself; between pairs with equal moments equilibrium gives no force.

    Args:
        moment: Moment at the pair, N m (321).
        pitch: Distance to the next pair, m.
    """
    return moment / pitch


def steps_of(curve: Callable[[Array], Array], positions: Sequence[float]) -> Array:
    """Resistance of each pair (n,), N, from a cumulative curve that begins at the first pair.

    Args:
        curve: Resistance, N, over position, m; it never decreases.
        positions: Positions of the pairs, m.
    """
    return np.diff(curve(np.asarray(positions, float)), prepend=0.0)
