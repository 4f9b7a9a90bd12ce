"""What a model of bulging is asked, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.machine.bulging.shell import Shell

_WITHIN = np.linspace(0.0, 1.0, 9)  # of an interval, where the largest deflection is looked for


@dataclass(frozen=True, slots=True)
class Span:
    """The strand between two pairs of rolls.

    Raises:
        ValueError: If the length or the speed is not positive.
    """

    length: float  #: pitch, m
    pressure: float  #: of the liquid on the shell, the mean over the pitch, Pa
    speed: float  #: of the strand, m/s

    def __post_init__(self) -> None:
        if not (self.length > 0.0 and self.speed > 0.0):
            raise ValueError(
                f"a pitch ({self.length} m) and a casting speed ({self.speed} m/s) must be positive"
            )


@dataclass(frozen=True, slots=True)
class Bulge:
    """A strip between two rolls, or over several."""

    z: Array  #: positions from the first roll, m, increasing, (n,)
    deflection: Array  #: w, outwards, m, (n,)
    slope: Array  #: w' (n,)
    moment: Array  #: M per metre of width, N, (n,)
    curvature: Array  #: kappa = -w'', 1/m, (n,)
    axial_strain: Array  #: e of the neutral axis since the first roll, (n,)
    neutral: float  #: depth of the neutral axis, m
    thickness: float  #: of the shell, m
    roll_force: Array  #: on each roll that has a span on both sides, N per metre of width
    periodic: bool = True  #: whether the strip has come to its periodic state
    #: estimate of the error of the deflection, m: of its steps, and what a strip still moves that
    #: should repeat itself and does not yet
    error: float = 0.0

    @classmethod
    def none(cls, span: Span, shell: Shell) -> Bulge:
        """A strip that does not bulge."""
        z, zero = np.array([0.0, span.length]), np.zeros(2)
        force = np.array([max(span.pressure, 0.0) * span.length])
        return cls(z, zero, zero, zero, zero, zero, 0.5 * shell.thickness, shell.thickness, force)

    def at(self, positions: npt.ArrayLike) -> Array:
        """Deflection at positions (m,), m: cubic from node to node by values and slopes."""
        return along(self.z, self.deflection, self.slope, positions)

    def extremes(self) -> tuple[float, float, float]:
        """Largest deflection, where that is, and the smallest, m."""
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
        """Axial strain that bulging adds at a depth, m, since the first roll (n,)."""
        bent = self.curvature - self.curvature[0]
        return np.asarray(self.axial_strain + bent * (self.neutral - depth))


class BulgingModel(Protocol):
    """A model of bulging between two rolls."""

    def bulge(self, span: Span, shell: Shell) -> Bulge:
        """Return how a shell bulges over a pitch.

        Raises:
            RunFailure: If the shell cannot carry the pressure.
        """


def along(z: Array, deflection: Array, slope: Array, positions: npt.ArrayLike) -> Array:
    """Deflections and slopes at nodes (n,) made deflections at positions (m,), cubic in between."""
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
    """Deflection and slope (2, n) of a strip of curvature -w'' that is held at its ends.

    The curvature is linear from node to node.
    """
    dz = np.diff(z)
    turns = 0.5 * (curvature[1:] + curvature[:-1]) * dz
    turned = np.concatenate([[0.0], np.cumsum(turns)])
    areas = 0.5 * (turned[1:] + turned[:-1]) * dz - dz**2 / 12.0 * np.diff(curvature)
    sunk = np.concatenate([[0.0], np.cumsum(areas)])
    start = sunk[-1] / (z[-1] - z[0])
    return np.stack([start * (z - z[0]) - sunk, start - turned])
