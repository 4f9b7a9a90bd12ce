"""Input and result of a bulging model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.machine.bulging.shell import Shell

# relative points of an interval at which the largest deflection is searched
_WITHIN = np.linspace(0.0, 1.0, 9)


@dataclass(frozen=True, slots=True)
class Span:
    """The strand between two pairs of rolls.

    Raises:
        ValueError: The length or the speed is not positive.
    """

    length: float  #: pitch, m
    pressure: float  #: mean pressure of the liquid on the shell over the pitch, Pa
    speed: float  #: casting speed, m/s

    def __post_init__(self) -> None:
        if not (self.length > 0.0 and self.speed > 0.0):
            raise ValueError(
                f"a pitch ({self.length} m) and a casting speed ({self.speed} m/s) must be positive"
            )


@dataclass(frozen=True, slots=True)
class Bulge:
    """The deflected strip between two rolls, or over several."""

    z: Array  #: positions from the first roll, m, increasing, (n,)
    deflection: Array  #: w, outwards, m, (n,)
    slope: Array  #: w' (n,)
    moment: Array  #: M per metre of width, N, (n,)
    curvature: Array  #: kappa = -w'', 1/m, (n,)
    axial_strain: Array  #: strain e of the neutral axis since the first roll, (n,)
    neutral: float  #: depth of the neutral axis, m
    thickness: float  #: thickness of the shell, m
    roll_force: Array  #: force on each roll with a span on both sides, N per metre of width
    periodic: bool = True  #: whether the strip has reached its periodic state
    #: estimated error of the deflection, m: from the step size, and what the passes through a
    #: periodic pitch have left
    error: float = 0.0

    @classmethod
    def none(cls, span: Span, shell: Shell) -> Bulge:
        """Return a strip without bulge."""
        z, zero = np.array([0.0, span.length]), np.zeros(2)
        force = np.array([max(span.pressure, 0.0) * span.length])
        return cls(z, zero, zero, zero, zero, zero, 0.5 * shell.thickness, shell.thickness, force)

    def at(self, positions: npt.ArrayLike) -> Array:
        """Deflection at positions (m,), m: cubic between nodes by values and slopes."""
        return along(self.z, self.deflection, self.slope, positions)

    def extremes(self) -> tuple[float, float, float]:
        """Largest deflection, its position, and smallest deflection, m."""
        dz = np.diff(self.z)
        fine = np.append((self.z[:-1, None] + dz[:, None] * _WITHIN[:-1]).ravel(), self.z[-1])
        values = self.at(fine)
        top = int(np.argmax(values))
        near = np.linspace(fine[max(top - 1, 0)], fine[min(top + 1, len(fine) - 1)], 65)
        best = int(np.argmax(self.at(near)))
        return float(self.at(near)[best]), float(near[best]), float(values.min())

    @property
    def largest(self) -> float:
        """Largest deflection, m."""
        return self.extremes()[0]

    @property
    def mean(self) -> float:
        """Mean deflection over the length, m."""
        dz, w, g = np.diff(self.z), self.deflection, self.slope
        area = 0.5 * dz * (w[1:] + w[:-1]) - dz**2 / 12.0 * np.diff(g)
        return float(area.sum() / (self.z[-1] - self.z[0]))

    def strain(self, depth: float) -> Array:
        """Axial strain from bulging at a depth, m, since the first roll (n,)."""
        bent = self.curvature - self.curvature[0]
        return np.asarray(self.axial_strain + bent * (self.neutral - depth))


class BulgingModel(Protocol):
    """A model of bulging between two rolls."""

    def bulge(self, span: Span, shell: Shell) -> Bulge:
        """Return the bulge of a shell in a pitch.

        Raises:
            RunFailure: The shell cannot carry the pressure.
        """


def along(z: Array, deflection: Array, slope: Array, positions: npt.ArrayLike) -> Array:
    """Interpolate deflections (n,) by values and slopes at nodes to positions (m,), cubically."""
    x = np.clip(np.asarray(positions, float), z[0], z[-1])
    i = np.clip(np.searchsorted(z, x, side="right") - 1, 0, len(z) - 2)
    dz, rise = z[i + 1] - z[i], deflection[i + 1] - deflection[i]
    t = (x - z[i]) / dz
    first, last = dz * slope[i] - rise, rise - dz * slope[i + 1]
    bend = (1.0 - t) * first + t * last
    chord = deflection[i] + t * rise
    return np.asarray(chord + t * (1.0 - t) * bend)


def evenly(length: float, count: int) -> Array:
    """Equally spaced positions over a length, m, (count,)."""
    return np.asarray(length * np.linspace(0.0, 1.0, count))


def deflected(z: Array, curvature: Array) -> Array:
    """Deflection and slope (2, n) of a strip with curvature -w'' that is held at its ends.

    The curvature is linear between nodes.
    """
    dz = np.diff(z)
    turns = 0.5 * (curvature[1:] + curvature[:-1]) * dz
    turned = np.concatenate([[0.0], np.cumsum(turns)])
    areas = 0.5 * (turned[1:] + turned[:-1]) * dz - dz**2 / 12.0 * np.diff(curvature)
    sunk = np.concatenate([[0.0], np.cumsum(areas)])
    start = sunk[-1] / (z[-1] - z[0])
    return np.stack([start * (z - z[0]) - sunk, start - turned])
