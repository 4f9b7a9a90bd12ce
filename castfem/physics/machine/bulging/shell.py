"""The solid shell at mid-face: points through its thickness, and its elastic stiffness."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.elasticity import Elasticity

_GAUSS = 3.0**-0.5

Profile = Callable[[Array], npt.ArrayLike]
"""Function of depths (n,), m, that returns a number for each, or one for all."""


@dataclass(frozen=True, slots=True)
class Shell:
    """The solid shell at one position.

    Raises:
        ValueError: The thickness is not positive.
    """

    thickness: float  #: thickness, m
    temperature: Profile  #: temperature over the depth from the surface, K
    #: rate of the free thermal strain over the depth, 1/s; None for none
    thermal_rate: Profile | None = None

    def __post_init__(self) -> None:
        if not self.thickness > 0.0:
            raise ValueError(f"a shell needs a thickness, not {self.thickness} m")

    def points(self, layers: int = 24, breaks: Iterable[float] = ()) -> Points:
        """Return two Gauss points in each of the sublayers.

        Args:
            layers: Number of points, even; breaks add some more.
            breaks: Depths at which a sublayer must end, m.

        Raises:
            ValueError: The number of layers is odd or below 2.
        """
        if layers < 2 or layers % 2:
            raise ValueError(f"layers ({layers}) must be even, at least 2")
        ends = [0.0, *sorted(d for d in breaks if 0.0 < d < self.thickness), self.thickness]
        edges = np.zeros(1)
        for low, high in itertools.pairwise(ends):
            count = max(1, round(layers // 2 * (high - low) / self.thickness))
            edges = np.concatenate([edges, np.linspace(low, high, count + 1)[1:]])
        half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        places: Array = np.asarray(middle[:, None] + half[:, None] * [-_GAUSS, _GAUSS])
        depth = places.ravel()
        rate = 0.0 if self.thermal_rate is None else self.thermal_rate(depth)
        return Points(
            self.thickness, depth, np.repeat(half, 2), _at(depth, self.temperature(depth)),
            _at(depth, rate),
        )  # fmt: skip

    def breaks(self, law: Law) -> Array:
        """Depths at which the coefficients of a law jump, m, such as at a change of phase.

        A jump is a fifth of the range of a coefficient between neighbours of 801 depths.
        """
        depth: Array = np.asarray(np.linspace(0.0, self.thickness, 801))
        heat = _at(depth, self.temperature(depth))
        steps = np.abs(np.diff(law.coefficients(heat, heat), axis=0))
        jumps = (steps > 0.2 * np.maximum(steps.sum(axis=0), 1e-300)).any(axis=1)
        return np.asarray(0.5 * (depth[1:] + depth[:-1])[jumps])


@dataclass(frozen=True, slots=True)
class Points:
    """Points through the thickness of a shell."""

    thickness: float  #: thickness of the shell, m
    depth: Array  #: below the surface, m, (n,)
    weight: Array  #: weight in an integral over the thickness, m, (n,)
    temperature: Array  #: K, (n,)
    thermal_rate: Array  #: rate of the free thermal strain, 1/s, (n,)


@dataclass(frozen=True, slots=True)
class Stiffness:
    """Stiffness of a shell bent along z but not across, and free to stretch in both."""

    #: D, moment per unit width over curvature, N m; E h^3 / (12 (1 - nu^2)) for constant E
    bending: float
    neutral: float  #: depth of the neutral axis, m
    #: slope over shear force per unit width, m/N; 6/5 / (G h) for constant G
    shear: float


def stiffness(elasticity: Elasticity, points: Points) -> Stiffness:
    """Elastic stiffness of a shell with the moduli at its temperatures."""
    shear, bulk, young = elasticity.moduli(points.temperature)
    poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
    stiff = points.weight * young / (1.0 - poisson**2)
    arm = 0.5 * points.thickness - points.depth
    matrix = np.array(
        [
            [stiff.sum(), (stiff * poisson).sum(), (stiff * poisson * arm).sum()],
            [(stiff * poisson).sum(), stiff.sum(), (stiff * arm).sum()],
            [(stiff * poisson * arm).sum(), (stiff * arm).sum(), (stiff * arm * arm).sum()],
        ]
    )
    across, axial, bent = np.linalg.solve(matrix, [0.0, 0.0, 1.0])
    stress = stiff / points.weight * (axial + bent * arm + poisson * across)
    flow = _below(points.weight, stress)  # shear flow for a unit shear force
    return Stiffness(
        float(1.0 / bent),
        float(0.5 * points.thickness + axial / bent),
        float((points.weight * flow**2 / shear).sum()),
    )


def _below(weight: Array, values: Array) -> Array:
    """Integral of values from the surface to each of the points, linear in a sublayer."""
    half = weight[::2]
    one, other = values[::2], values[1::2]
    mean, slope = 0.5 * (one + other), 0.5 * (other - one) / _GAUSS
    whole = np.concatenate([[0.0], np.cumsum(2.0 * half * mean)[:-1]])
    parts = []
    for t in (-_GAUSS, _GAUSS):
        area = mean * (t + 1.0) + 0.5 * slope * (t**2 - 1.0)
        parts.append(whole + half * area)
    return np.stack(parts, axis=1).ravel()


def _at(depth: Array, values: npt.ArrayLike) -> Array:
    return np.array(np.broadcast_to(np.asarray(values, float), depth.shape))
