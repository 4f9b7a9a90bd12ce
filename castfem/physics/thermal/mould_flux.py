"""Measured heat flux to the mould: published curves, and the equivalent contact coefficient.

A measured flux q belongs to good contact between a surface at Ts and a wall at Tw. It is equivalent
to the coefficient q/(Ts - Tw), in series with a gap like any other, (301): without a gap the flux
is q at any temperature, with a gap it is smaller.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array

NEAREST = 10.0
"""K: smallest temperature difference for the coefficient; it is constant below.

So no measured flux cools a strand below the wall temperature.
"""
WATER = 4.17e6
"""J/(m3 K): heat capacity of water at 25 to 40 degC (4.18 kJ/(kg K), 997 to 992 kg/m3)."""


def with_slope(function: Callable[[Array], Array], temperature: Array) -> tuple[Array, Array]:
    """Tabulated values at temperatures (...), K, and their derivative, a difference quotient.

    Args:
        function: Called once for all temperatures (3, ...), since calls cost more than values.
        temperature: The temperatures.
    """
    half = 1e-3  # K
    here, above, below = function(np.add.outer([0.0, half, -half], temperature))
    return here, (above - below) / (2 * half)


Value = float | Callable[[float], float]
"""A number, or a function of the time since the meniscus, s."""


@dataclass(frozen=True, slots=True)
class MouldFlux:
    """A published mould heat flux over the time in the mould."""

    formula: Callable[[float], float]  #: W/m2 at a time since the meniscus, s
    until: float  #: end of its range, s
    kinks: tuple[float, ...]  #: times at which its slope jumps, s
    source: str  #: its authors, and where it was read

    @property
    def checked(self) -> bool:
        """Whether it was compared with a publication rather than quoted from memory."""
        return "memory" not in self.source


MOULD_FLUXES: dict[str, MouldFlux] = {}
"""The published fluxes by their names in case files."""


def mould_flux(
    until: float, source: str, kinks: tuple[float, ...] = ()
) -> Callable[[Callable[[float], float]], Callable[[float], float]]:
    """Register a formula in `MOULD_FLUXES` under its own name; arguments as in `MouldFlux`."""

    def enter(formula: Callable[[float], float]) -> Callable[[float], float]:
        MOULD_FLUXES[formula.__name__] = MouldFlux(formula, until, kinks, source)
        return formula

    return enter


@mould_flux(32.0, "[Savage1954], quoted")
def savage_pritchard(time: float) -> float:
    """Savage and Pritchard (1954): 2.68 - 0.335 sqrt(t) MW/m2.

    It is 0 at 64 s; used here up to 32 s, half of that.
    """
    return 1e6 * (2.68 - 0.335 * math.sqrt(time))


@mould_flux(73.0, "[Lait1974], from memory")
def brimacombe(time: float) -> float:
    """Lait, Brimacombe and Weinberg (1974): 2.67 - 0.22 sqrt(t) MW/m2.

    It is 0 at 147 s; used here up to 73 s, half of that.
    """
    return 1e6 * (2.67 - 0.22 * math.sqrt(time))


@mould_flux(60.0, "[Li2004], from memory", kinks=(1.0,))
def li_thomas(time: float) -> float:
    """Li and Thomas (2004): 5 - 0.2444 t to 1 s, then 4.7556 t^-0.504 MW/m2."""
    return 1e6 * (5.0 - 0.2444 * time if time <= 1.0 else 4.7556 * time**-0.504)


@dataclass(frozen=True, slots=True)
class CoefficientCurve:
    """A contact coefficient that depends on time or temperature."""

    value: Value = 0.0  #: W/(m2 K), over the time since the meniscus, s
    #: instead, over surface temperatures (n,), K
    over_temperature: Callable[[Array], Array] | None = None

    def of(self, temperature: Array, time: float, wall: float) -> tuple[Array, Array]:
        """Coefficient (n,) at surface temperatures (n,), K, and its derivative."""
        return _value(self, temperature, time)


@dataclass(frozen=True, slots=True)
class FluxCurve:
    """The contact coefficient equivalent to a measured flux of good contact."""

    value: Value = 0.0  #: W/m2, over the time since the meniscus, s
    #: instead, over surface temperatures (n,), K
    over_temperature: Callable[[Array], Array] | None = None

    def of(self, temperature: Array, time: float, wall: float) -> tuple[Array, Array]:
        """Coefficient (n,) at surface temperatures (n,), K, and its derivative."""
        flux, slope = _value(self, temperature, time)
        excess = np.maximum(temperature - wall, NEAREST)
        coefficient = flux / excess
        falling = np.where(temperature - wall > NEAREST, coefficient, 0.0)
        return coefficient, (slope - falling) / excess


Curve = CoefficientCurve | FluxCurve


def _value(curve: Curve, temperature: Array, time: float) -> tuple[Array, Array]:
    """Value of a curve at surface temperatures (n,), and its derivative."""
    of_surface = curve.over_temperature
    if of_surface is not None:
        return with_slope(of_surface, temperature)
    value = curve.value(time) if callable(curve.value) else curve.value
    return np.full_like(temperature, value), np.zeros_like(temperature)


@dataclass(frozen=True, slots=True)
class Scaled:
    """A function of time, times a factor, which may also be a function."""

    factor: Value
    value: Value

    def __call__(self, time: float) -> float:
        """The product at `time` (s)."""
        factor, value = (it(time) if callable(it) else it for it in (self.factor, self.value))
        return factor * value


def heat_to_mould(
    value: Value,
    speed: Callable[[float], float],
    between: tuple[float, float],
    kinks: tuple[float, ...] = (),
) -> float:
    """Integral of a flux along the strand, W per m of perimeter.

    Args:
        value: Flux over the time since the meniscus, W/m2.
        speed: Casting speed over it, m/s.
        between: Times at which the slice reaches both ends, s.
        kinks: Times at which the slope of flux or speed jumps, s.
    """
    from scipy.integrate import quad

    start, end = between
    inner = sorted({t for t in kinks if start < t < end})
    flux = value if callable(value) else lambda _: value
    total = 0.0
    for first, last in zip([start, *inner], [*inner, end], strict=True):
        total += quad(lambda t: flux(t) * speed(t), first, last, epsrel=1e-10)[0]
    return float(total)
