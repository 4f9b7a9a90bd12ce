"""Heat capacity and conductivity of a steel as pieces linear in T, with exact integrals.

Pieces begin and end at every kink and jump of a property; where a property is curved in between,
they are at most 2 K long, and shorter in the mushy zone. The heat of a piece is integrated to
rounding, and the error of the linear rho c is added to its constant part, so that the enthalpy is
exact at every knot.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.materials.iron_carbon import Side

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True, slots=True)
class PieceLimits:
    """Limits of the division of a property into pieces."""

    longest: float = 2.0  # K, of a curved piece
    fewest: int = 64  # pieces of a curved interval: the lever rule is steep near the liquidus
    merge: float = 1e-9  # K: closer kinks are merged (rounding of a point computed in two ways)


LIMITS = PieceLimits()


def _lobatto() -> tuple[Array, Array, Array]:
    """Nodes on [0, 1], weights of the integral, and matrix M with r.M.h = integral of r dh."""
    inner = np.polynomial.Legendre.basis(6).deriv().roots()
    nodes = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])
    basis = [np.polynomial.Polynomial.fromroots(np.delete(nodes, i)) for i in range(len(nodes))]
    basis = [p / p(x) for p, x in zip(basis, nodes, strict=True)]
    values = np.array([p(_NODES) for p in basis])
    slopes = np.array([p.deriv()(_NODES) for p in basis])
    return (
        0.5 * (nodes + 1.0),
        0.5 * values @ _WEIGHTS,
        np.einsum("iq,jq,q->ij", values, slopes, _WEIGHTS),
    )


POINTS, WEIGHTS, STIELTJES = _lobatto()


def merged(kinks: Iterable[float], jumps: Iterable[float], lower: float, upper: float) -> Array:
    """Kinks and jumps within [lower, upper], increasing; of nearly equal ones a jump is kept.

    Args:
        kinks: Temperatures, K.
        jumps: Temperatures, K; these exact floats are kept, since properties compare with them.
        lower: Lower limit, K.
        upper: Upper limit, K.
    """
    kept = sorted({t for t in jumps if lower <= t <= upper})
    for t in sorted(set(kinks)):
        if lower <= t <= upper and all(abs(t - other) > LIMITS.merge for other in kept):
            kept.append(t)
    return np.array(sorted(kept), float)


def grid(breakpoints: Array, lower: float, upper: float, curved: bool) -> Array:
    """Knots from `lower` to `upper` with all breakpoints; curved pieces are divided finely."""
    merge = LIMITS.merge
    inside = breakpoints[(breakpoints > lower + merge) & (breakpoints < upper - merge)]
    ends = np.concatenate([[lower], inside, [upper]])
    # A breakpoint next to an end replaces it, so that a jump there is hit exactly.
    for i, end in ((0, lower), (-1, upper)):
        near = breakpoints[np.abs(breakpoints - end) <= merge]
        if near.size:
            ends[i] = near[0]
    if not curved:
        return ends
    pieces = [
        np.linspace(a, b, max(LIMITS.fewest, int(np.ceil((b - a) / LIMITS.longest))) + 1)[:-1]
        for a, b in itertools.pairwise(ends)
    ]
    return np.unique(np.concatenate([*pieces, ends[-1:]]))


def nodes(knots: Array) -> Array:
    """Integration points of each piece, (n-1, 7), K; the ends are the knots."""
    left, right = knots[:-1, None], knots[1:, None]
    t = left + POINTS * (right - left)
    t[:, 0], t[:, -1] = knots[:-1], knots[1:]
    return t


def one_sided(function: Callable[[npt.ArrayLike, Side], Array], temperature: Array) -> Array:
    """Values on the pieces: the last column is taken from below, all others from above."""
    values = np.empty_like(temperature)
    values[:, :-1] = function(temperature[:, :-1], "above")
    values[:, -1] = function(temperature[:, -1], "below")
    return values


def heat_of(density: Array, enthalpy: Array) -> Array:
    """Integral of rho dh over each piece, J/m3, from values at the integration points."""
    return np.asarray(np.einsum("pi,ij,pj->p", density, STIELTJES, enthalpy))
