"""Heat flux through the strand's surface: plain arrays in, flux and its slope out (thesis II.4).

Every law gives q (W/m2, positive when heat leaves the strand) and dq/dT at the surface temperatures
handed in, and the range of ambient temperatures it can drive the surface to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

STEFAN_BOLTZMANN = 5.670374419e-8  # W/m2K4, CODATA 2018
_DT = 1e-3  # K, half width of the difference quotient of tabulated coefficients


class SurfaceLaw(Protocol):
    """What the thermal problem asks of a law."""

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """Q and dq/dT (n,) at surface temperatures (n,), K, `time` seconds after the meniscus."""
        ...

    def ambient_range(self, time: float) -> tuple[float, float]:
        """Lowest and highest temperature the law pulls the surface to, K."""
        ...


@dataclass(frozen=True)
class Convection:
    """h(T) (T - Ta): convection (35), (30); `coefficient` is a number or a function of T (K)."""

    coefficient: float | Callable[[Array], Array]
    ambient: float

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        excess = temperature - self.ambient
        if not callable(self.coefficient):
            return self.coefficient * excess, np.full_like(temperature, self.coefficient)
        h = self.coefficient(temperature)
        rise = self.coefficient(temperature + _DT) - self.coefficient(temperature - _DT)
        return h * excess, h + rise / (2 * _DT) * excess

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        return self.ambient, self.ambient


@dataclass
class Contact:
    """Contact with the mould through a gap d (301): h = h_c k_g / (k_g + h_c d).

    Attributes:
        coefficient: h_c at d = 0, W/m2K.
        wall: Temperature of the mould's wall, K; a number or a function of time.
        gap_conductivity: k_g, W/mK.
        gap: d, m; a number or one per surface node.
        follows: Whether the gap is that of the mechanics, which set it before each interval.
    """

    coefficient: float
    wall: float | Callable[[float], float]
    gap_conductivity: float
    gap: float | Array = 0.0
    follows: bool = False

    def heat_transfer(self) -> Array:
        """Overall coefficient h(d) of (301), W/m2K."""
        hc, kg = self.coefficient, self.gap_conductivity
        return np.asarray(hc * kg / (kg + hc * np.maximum(self.gap, 0.0)))

    def _wall(self, time: float) -> float:
        return self.wall(time) if callable(self.wall) else self.wall

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        h = np.broadcast_to(self.heat_transfer(), temperature.shape)
        return h * (temperature - self._wall(time)), np.array(h)

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        return self._wall(time), self._wall(time)


@dataclass(frozen=True)
class Radiation:
    """gamma (T^4 - Ta^4), (32), with the gap factor (33).

    gamma = m^2 sigma / (0.75 a d + 1/eps_strand + 1/eps_wall - 1); eps_wall = 1 and d = 0 (the
    defaults) leave eps_strand sigma, a small body in wide surroundings.
    """

    emissivity: float | Callable[[Array], Array]
    ambient: float
    wall_emissivity: float | Callable[[Array], Array] = 1.0
    refractive_index: float = 1.0
    absorption: float = 0.0
    gap: float = 0.0

    def factor(self, temperature: Array) -> Array:
        """Gamma of (33), W/m2K4, at surface temperatures (n,)."""
        strand = self.emissivity(temperature) if callable(self.emissivity) else self.emissivity
        wall = self.wall_emissivity
        if callable(wall):  # the wall is as warm as the surroundings it stands for
            wall = float(wall(np.array([self.ambient]))[0])
        resistance = 0.75 * self.absorption * self.gap + 1.0 / strand + 1.0 / wall - 1.0
        return np.broadcast_to(
            self.refractive_index**2 * STEFAN_BOLTZMANN / resistance, temperature.shape
        )

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        gamma = self.factor(temperature)
        # Odd below absolute zero, where an iterate may stray: the flux stays monotone.
        cube = np.abs(temperature) ** 3
        excess = temperature * cube - self.ambient**4
        slope = gamma * 4.0 * cube
        if callable(self.emissivity):
            rise = self.factor(temperature + _DT) - self.factor(temperature - _DT)
            slope = slope + rise / (2 * _DT) * excess
        return gamma * excess, slope

    def ambient_range(self, time: float) -> tuple[float, float]:
        """See `SurfaceLaw.ambient_range`."""
        return self.ambient, self.ambient


@dataclass(frozen=True)
class PrescribedFlux:
    """A given flux q(t), W/m2; a number or a function of the time since the meniscus."""

    value: float | Callable[[float], float]

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """See `SurfaceLaw.flux`."""
        q = self.value(time) if callable(self.value) else self.value
        return np.full_like(temperature, q), np.zeros_like(temperature)

    def ambient_range(self, time: float) -> tuple[float, float]:
        """Without bounds: a flux does not know where it leads."""
        return -np.inf, np.inf


@dataclass(frozen=True)
class PrescribedTemperature:
    """A given surface temperature, K (essential condition); it has no flux of its own."""

    value: float
