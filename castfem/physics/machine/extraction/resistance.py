"""What each pair of rolls resists to the strand, and the forces on it that it comes from.

Equation numbers are those of [Pascon2003] (docs/references.md). Forces are those of the whole
strand, N.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array


def friction(axis: float, surface: float, locked: npt.ArrayLike) -> Array:
    """Coefficient of friction that each pair resists with, (45)-(46).

    A roll turns as long as its axis resists less than its surface can; a locked one slides.

    Args:
        axis: Of the axes of the rolls.
        surface: Between strand and roll.
        locked: Whether the rolls of each pair are locked (n,).
    """
    return np.where(np.asarray(locked, bool), surface, min(axis, surface))


def pair_resistances(
    coefficients: npt.ArrayLike, bulging: npt.ArrayLike, bending: npt.ArrayLike
) -> Array:
    """Resistance of each pair, N: friction times the forces on its two rolls, (47) and (327).

    Args:
        coefficients: Of friction (n,).
        bulging: Force of bulging on both rolls of each pair (n,), N.
        bending: What bending leaves on one of the two more than on the other (n,), N; either sign.
    """
    return np.asarray(np.asarray(coefficients) * (np.asarray(bulging) + np.abs(bending)))


def tributary_lengths(positions: Sequence[float] | Array) -> Array:
    """Length of strand that each pair carries (n,), m: to the middle of the pitches beside it.

    The first and the last carry a whole pitch, half of it on the side that has no other; one alone
    carries nothing that could be told.
    """
    pitches = np.diff(np.asarray(positions, float))
    if not len(pitches):
        return np.zeros(len(positions))
    before, after = np.append(pitches[0], pitches), np.append(pitches, pitches[-1])
    return np.asarray(0.5 * (before + after))


def pressed(pressure: npt.ArrayLike, lengths: npt.ArrayLike, width: npt.ArrayLike) -> Array:
    """Force of the liquid's pressure on both rolls of each pair (n,), N; see (319).

    Whatever the shell does between the rolls, they carry the pressure of the length that is theirs.

    Args:
        pressure: Of the liquid in the middle of the strand at each pair, Pa.
        lengths: Of the strand that each carries, m (`tributary_lengths`).
        width: Of the liquid behind a wide face, m.
    """
    return 2.0 * np.asarray(pressure, float) * np.asarray(lengths, float) * np.asarray(width, float)


def bending_force(moments: Sequence[float], pitches: Sequence[float]) -> float:
    """What a pair bears by bending, N, positive where it presses on the roll of the extrados.

    The strand between two pairs has the shear force Q = dM/ds; a pair bears the jump of it. Moments
    that stay from roll to roll press on none. What the axial force presses on the rolls of an arc,
    k N L, is left out: 2 kN of the 580 kN of the liquid's pressure.

    Args:
        moments: M at the pair before, at the pair and at the one after, N m, positive where they
            pull the intrados.
        pitches: From the pair before, and to the one after, m.
    """
    before, here, after = moments
    return (here - before) / pitches[0] - (after - here) / pitches[1]


def hinge_force(moment: float, pitch: float) -> float:
    """What a pair bears of a strand with plastic hinges, N, as the thesis takes it: M/L (320).

    Each pair by itself: between pairs with the same moment equilibrium leaves nothing of it.

    Args:
        moment: At the pair, N m (321).
        pitch: To the pair after, m.
    """
    return moment / pitch


def steps_of(curve: Callable[[Array], Array], positions: Sequence[float]) -> Array:
    """Resistance of each pair (n,), N, out of a curve of the resistance from the first pair on.

    Args:
        curve: N over position, m; it never falls.
        positions: Of the pairs, m.
    """
    return np.diff(curve(np.asarray(positions, float)), prepend=0.0)
