"""Aitken's relaxation of a field that is found by repetition, such as the gap of a window."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np

from castfem.base.types import Array, Flags
from castfem.fem import reductions

FACTORS = (0.02, 1.0)
"""Smallest and largest factor of the relaxation."""


def difference(one: Array, other: Array) -> Array:
    """One gap less another; 0 where both are without a wall."""
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(one - other, nan=0.0)


class Relaxation:
    """Aitken's dynamic relaxation of a field that is looked for by repetition.

    [Kuettler2008], equation 44.

    Args:
        comm: Ranks that have the field.
        weight: Of each value in sums: the surface that is its own, so that a section and a part
            of it that symmetry leaves are relaxed alike, and so are fine and coarse meshes.

    Attributes:
        factor: By which the last residual was multiplied.
        residual: What was found last less what was tried; None before.
        reached: Where both are finite.
    """

    def __init__(self, comm: MPI.Comm, weight: Array) -> None:
        self._comm, self.weight, self.factor = comm, weight, 1.0
        self.residual: Array | None = None
        self.reached: Flags = np.zeros(0, np.bool_)

    def __call__(self, tried: Array, found: Array) -> Array:
        """What to try next, after `found` has come of `tried` (collective)."""
        self.reached = np.isfinite(tried) & np.isfinite(found)
        residual = np.where(self.reached, difference(found, tried), 0.0)
        if self.residual is not None:
            change = residual - self.residual
            weighted = self.weight * change
            sums = [float(self.residual @ weighted), float(change @ weighted)]
            along, size = reductions.totals(self._comm, sums)
            if size > 0.0:
                self.factor = float(np.clip(-self.factor * along / size, *FACTORS))
        self.residual = residual
        return np.where(self.reached, tried + self.factor * residual, found)
