"""Heat transfer coefficients of water sprays by published correlations.

Each gives h (W/m2K) for water per area W (L/m2s, the same number as kg/m2s), and temperatures of
water and surface. Sources as listed in `docs/materials.md`; outside its stated range a correlation
extrapolates, but below its smallest flow it falls to zero with the water. They differ by a factor
of two, which is the present uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array

Flow = float | Array
"""Water on a surface, L/(m2 s): one flow, or one per vertex (n,)."""
Formula = Callable[[Flow, float, Array], Array]
"""h, W/m2K (n,), for the water flow, L/(m2 s), its temperature, K, and surfaces (n,), K."""

WATER_DENSITY = 1e3  # kg/m3
WENDELSTORF_MOST = 30.0  # L/(m2 s)
WENDELSTORF_EXCESS = (180.0, 1100.0)  # K


@dataclass(frozen=True, slots=True)
class Correlation:
    """A published correlation."""

    formula: Formula  #: formula of the coefficient
    #: smallest and largest measured flow, L/(m2 s)
    water: tuple[float, float] = (0.0, math.inf)
    #: lowest and highest measured surface temperature, K; for `wendelstorf` relative to the water
    surface: tuple[float, float] = (0.0, math.inf)
    excess: bool = False  #: whether `surface` is relative to the water
    held: str = ""  #: quantity that is constant beyond the largest flow; "" for extrapolation

    def coefficient(
        self, water: Flow, water_temperature: float, machine_factor: float, surface: Array
    ) -> Array:
        """Coefficient at surface temperatures (n,), K, divided by the machine factor.

        Below the smallest measured flow it is proportional to the flow: zero without water.
        """
        least = self.water[0]
        h = self.formula(np.maximum(water, least), water_temperature, surface) / machine_factor
        return np.asarray(h * np.minimum(water / least, 1.0) if least > 0.0 else h)


def flows_up_to(most: float, least: float = 0.0) -> Array:
    """Flows from 0 to `most`, in steps of at most a tenth of the flow above its hundredth.

    Args:
        most: Largest flow, L/(m2 s).
        least: A flow that is included, L/(m2 s).
    """
    growing = most * np.geomspace(0.01, 1.0, 50)
    growing[-1] = most  # without rounding
    return np.unique(np.r_[0.0, min(least, most), growing])


CORRELATIONS: dict[str, Correlation] = {}
"""The correlations by their names in case files."""


def correlation(
    water: tuple[float, float] = (0.0, math.inf),
    surface: tuple[float, float] = (0.0, math.inf),
    *,
    excess: bool = False,
    held: str = "",
) -> Callable[[Formula], Formula]:
    """Register a formula in `CORRELATIONS` under its own name; ranges as in `Correlation`."""

    def enter(formula: Formula) -> Formula:
        CORRELATIONS[formula.__name__] = Correlation(formula, water, surface, excess, held)
        return formula

    return enter


@correlation()
def nozaki(water: Flow, water_temperature: float, surface: Array) -> Array:
    """Nozaki and Shimada: 1570 W^0.55 (1 - 0.0075 Tw); divide by a machine factor of about 4."""
    cold = 1.0 - 0.0075 * (water_temperature - ZERO_CELSIUS)
    return np.full_like(surface, 1570.0 * water**0.55 * cold)


@correlation()
def ishiguro(water: Flow, water_temperature: float, surface: Array) -> Array:
    """Ishiguro: 581 W^0.451 (1 - 0.0075 Tw)."""
    cold = 1.0 - 0.0075 * (water_temperature - ZERO_CELSIUS)
    return np.full_like(surface, 581.0 * water**0.451 * cold)


@correlation((1.0, 7.0), (627.0 + ZERO_CELSIUS, 927.0 + ZERO_CELSIUS))
def bolle(water: Flow, water_temperature: float, surface: Array) -> Array:
    """Bolle and Moureau: 423 W^0.556, for 1 < W < 7 and 627-927 degC."""
    return np.full_like(surface, 423.0 * water**0.556)


@correlation((0.0, 20.3))
def mizikar(water: Flow, water_temperature: float, surface: Array) -> Array:
    """Mizikar at 0.276 MPa: 77.6 W, for W < 20.3."""
    return np.full_like(surface, 77.6 * water)


@correlation((1.67, 41.7), (700.0 + ZERO_CELSIUS, 1200.0 + ZERO_CELSIUS))
def sasaki(water: Flow, water_temperature: float, surface: Array) -> Array:
    """Sasaki: 708 W^0.75 Ts^-1.2 + 0.116 kW/m2K, Ts in degC, 1.67 < W < 41.7 and 700-1200 degC.

    Constant below 100 degC, where the growth of the formula has no meaning.
    """
    celsius = np.maximum(surface - ZERO_CELSIUS, 100.0)
    return 1e3 * (708.0 * water**0.75 * celsius**-1.2 + 0.116)


@correlation(
    (3.0, WENDELSTORF_MOST),
    WENDELSTORF_EXCESS,
    excess=True,
    held=f"the coefficient is that of {WENDELSTORF_MOST:g}",
)
def wendelstorf(water: Flow, water_temperature: float, surface: Array) -> Array:
    """Wendelstorf, Spitzer and Wendelstorf (2008), with the rise below the Leidenfrost point.

    h = 190 + tanh(W/8) [140 W (1 - W dT/72000) + 3.26 dT^2 (1 - tanh(dT/128))], dT = Ts - Tw from
    180 to 1100 K, W from 3 to 30. dT is limited to its range, W to the upper end of its range:
    beyond it the bracket decreases with more water, and becomes negative with much more.
    """
    water = np.minimum(water, WENDELSTORF_MOST)
    dt = np.clip(surface - water_temperature, *WENDELSTORF_EXCESS)
    film = 140.0 * water * (1.0 - water * dt / 72000.0)
    boiling = 3.26 * dt**2 * (1.0 - np.tanh(dt / 128.0))
    return np.asarray(190.0 + np.tanh(water / 8.0) * (film + boiling))
