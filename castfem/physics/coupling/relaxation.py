"""Aitken relaxation of a field in fixed-point iterations, such as the gap of a window."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np

from castfem.base.types import Array, Flags
from castfem.fem import reductions

FACTORS = (0.02, 1.0)
"""Smallest and largest relaxation factor."""


def difference(one: Array, other: Array) -> Array:
    """One gap minus another; 0 where both have no wall."""
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(one - other, nan=0.0)


class Relaxation:
    """Aitken's dynamic relaxation of a field in fixed-point iterations.

    [Kuettler2008], equation 44.

    Args:
        comm: Ranks that share the field.
        weight: Weight of each value in sums: its share of the surface, so that a whole section and
            its symmetric part, or fine and coarse meshes, are relaxed equally.

    Attributes:
        factor: Factor on the last residual.
        residual: Last result minus its input; None before the first.
        reached: Whether last result and input are finite (n,).
    """

    def __init__(self, comm: MPI.Comm, weight: Array) -> None:
        self._comm, self.weight, self.factor = comm, weight, 1.0
        self.residual: Array | None = None
        self.reached: Flags = np.zeros(0, np.bool_)

    def __call__(self, tried: Array, found: Array) -> Array:
        """Return the next input, after `tried` gave `found` (collective)."""
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
