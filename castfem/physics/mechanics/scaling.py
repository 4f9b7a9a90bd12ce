"""Scales of forces and stresses of a slice, for relative residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.physics.constitutive.base import Response
from castfem.physics.mechanics.quadrature import ActivePoints, Points


@dataclass(frozen=True, slots=True)
class RoundingLimits:
    """Limits below which forces and stresses are rounding."""

    digits: float = 8 * np.finfo(float).eps  # relative rounding of a number
    strain: float = 1e-15  # strain that counts as zero
    most: float = 1e-6  # largest rounding, relative to the typical stress
    least: float = 1e-200  # absolute limit, below which a value is zero


LIMITS = RoundingLimits()


def over(value: float, allowed: float) -> float:
    """`value` over its allowed size; 0 if it is zero."""
    return 0.0 if value == 0.0 else value / max(allowed, LIMITS.least * value, LIMITS.least)


@dataclass(frozen=True, slots=True)
class StressScale:
    """Magnitude of the stress."""

    #: mean stress weighted with itself, Pa: the stress where there is any, however small the shell
    #: in its section
    typical: float
    total: float  #: int |stress| da, N
    rounding: float  #: rounding of the stress from displacements and old stress, Pa


class Scales:
    """Scales of a section and of the stress in it.

    Args:
        points: Its quadrature points.
        space: Space of the displacement.

    Attributes:
        comm: Communicator.
        length: Larger extent of the section, m.
        area: Area, m2.
        force_per_stress: Force per length on each owned degree of freedom per unit of stress
            around it, m.
    """

    def __init__(self, points: Points, space: fem.FunctionSpace) -> None:
        self._points, self.comm = points, points.section.comm
        ends = [
            (reductions.smallest(self.comm, v), reductions.largest(self.comm, v))
            for v in points.position.T
        ]
        self.length = max(high - low for low, high in ends)
        weights = np.repeat(points.deviator.volume, 4)
        self.force_per_stress = dof_values.summed(
            space, abs(points.strain[: len(weights)]).T @ weights
        )
        self.area = reductions.total(self.comm, float(points.deviator.volume.sum()))
        self._finest = np.sqrt(reductions.smallest(self.comm, points.deviator.volume))

    def beside(self, active: ActivePoints, pressure: Array) -> Array:
        """Contribution of the pressure (n,), Pa, in other cells to the sums of `stress` (2,)."""
        rest = active.rest() if pressure.size else np.zeros(0, np.int64)
        volume, squares = np.abs(self._points.mean.volume[rest]), 2.0 * pressure[rest] ** 2
        return np.array([volume @ squares, volume @ np.sqrt(squares)])

    def stress(
        self,
        active: ActivePoints,
        parts: tuple[Array, Array, Array],
        response: Response,
        moved: Array,
        before: float,
        noise: float,
        beside: Array,
    ) -> StressScale:
        """Scale of the stress at the points (collective).

        Args:
            active: Points with stress.
            parts: Stress deviators; mean stress and ferrostatic pressure at the points of their own
                rule.
            response: Response of the law.
            moved: This rank's displacements, m.
            before: Typical stress at the start of the step, Pa.
            noise: Rounding of the stress elsewhere, at a contact, Pa.
            beside: See `beside`.
        """
        deviator, mean, pressure = parts
        deviator_points, volume = active.deviator_points, np.abs(active.volume)
        volumetric = 3.0 * mean**2
        if pressure.size:
            volumetric += 2.0 * pressure**2
        squares = np.concatenate([np.einsum("ij,ij->i", deviator, deviator), volumetric])
        here = np.array([volume @ squares, volume @ np.sqrt(squares)]) + beside
        sums = reductions.totals(self.comm, here)
        stiff = response.tangent[deviator_points:, 0, 0].max(initial=0.0)
        farthest = max(float(moved.max(initial=0.0)), -float(moved.min(initial=0.0)))
        sizes = reductions.largest_of(self.comm, [stiff, farthest])
        typical = float(sums[0] / sums[1]) if sums[1] > 0.0 else 0.0
        # Limited, so that a diverged displacement does not count as converged.
        rounding = LIMITS.digits * (float(sizes[0] * sizes[1]) / self._finest + before) + noise
        rounding = min(rounding, LIMITS.most * max(typical, before))
        rounding += LIMITS.strain * float(sizes[0])
        return StressScale(typical, float(sums[1]), rounding)
