"""Named formulas for properties of plain carbon steel, each with its unit, source and status.

A formula takes temperatures in K and, if it depends on the phases, the fractions and the carbon of
each phase from the iron-carbon diagram; it returns SI. The published forms in degC and kJ are
converted here. Status: F read in the source named, M from memory of the reference named and not yet
checked, C computed here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.physics.materials.iron_carbon import Phases


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a formula that the user may change: default, SI unit and (inclusive) bounds."""

    default: float
    unit: str
    least: float
    most: float


@dataclass(frozen=True, slots=True)
class Formula:
    """A property as a function of temperature, with its source."""

    name: str  #: name in a material file
    quantity: str  #: property that it may define, the key in a material file
    #: function of temperatures in K, phases (None unless `by_phase`) and parameters, in SI
    evaluate: Callable[..., Array]
    source: str  #: source of the numbers
    status: str  #: F, M or C, see the module
    by_phase: bool = False  #: whether the formula needs the iron-carbon diagram
    #: temperatures of its own kinks, as a function of the parameters
    kinks: Callable[..., tuple[float, ...]] = lambda **_: ()
    #: numbers that the user may change
    parameters: Mapping[str, Parameter] = field(default_factory=lambda: MappingProxyType({}))


def _weigh(phases: Phases, liquid: Array, delta: Array, gamma: Array) -> Array:
    """Average over the phases by mass fraction."""
    return np.asarray(phases.liquid * liquid + phases.delta * delta + phases.gamma * gamma)


def _carbon(content: Array) -> Array:
    """Carbon of a phase, 0 where the phase is absent (and its weight 0)."""
    return np.nan_to_num(content, nan=0.0)


def harste_conductivity(
    temperature: Array,
    phases: Phases,
    liquid_factor: float = 1.0,
    liquid_conductivity: float = 39.0,
) -> Array:
    """Thermal conductivity, W/(m K), phases weighted by their fractions.

    `liquid_factor` multiplies the conductivity of the liquid, to represent stirring of the pool (1
    for a liquid at rest; values of 2 to 7 are in use).
    """
    celsius = temperature - ZERO_CELSIUS
    strength = 0.425 - 4.385e-4 * celsius
    exponent = np.maximum(0.209 + 1.09e-3 * celsius, 0.0)
    delta = 20.14 + 9.313e-3 * celsius
    delta = delta * (1.0 - strength * _carbon(phases.carbon_delta) ** exponent)
    gamma = 21.6 + 8.35e-3 * celsius
    return _weigh(phases, np.full_like(gamma, liquid_factor * liquid_conductivity), delta, gamma)


def phase_densities(temperature: Array, phases: Phases) -> tuple[Array, Array, Array]:
    """Densities of liquid, delta ferrite and austenite with their carbon contents, kg/m3.

    That of the liquid is rounded as it is quoted in models of casting. The abstract of Jimbo and
    Cramb (1993) has 7100 - 73.2 C - (0.828 - 0.0874 C)(T - 1823 K), with 1.5 % scatter of the data;
    from 1450 to 1600 degC, up to 1 % C, the two differ by 0.04 %.
    """
    celsius = temperature - ZERO_CELSIUS
    c_liquid, c_delta, c_gamma = (
        _carbon(c) for c in (phases.carbon_liquid, phases.carbon_delta, phases.carbon_gamma)
    )
    liquid = 7100.0 - 73.0 * c_liquid - (0.8 - 0.09 * c_liquid) * (celsius - 1550.0)
    delta = 100.0 * (8011.0 - 0.47 * celsius) / ((100.0 - c_delta) * (1.0 + 0.013 * c_delta) ** 3)
    gamma = 100.0 * (8106.0 - 0.51 * celsius) / ((100.0 - c_gamma) * (1.0 + 0.008 * c_gamma) ** 3)
    return liquid, delta, gamma


def jimbo_cramb_density(temperature: Array, phases: Phases) -> Array:
    """Density, kg/m3: specific volumes of the phases averaged by mass fraction."""
    volumes = (np.reciprocal(density) for density in phase_densities(temperature, phases))
    return np.reciprocal(_weigh(phases, *volumes))


def harste_enthalpy(temperature: Array, phases: Phases) -> Array:
    """Specific enthalpy including the heats of melting and of delta -> gamma, J/kg.

    The carbon terms are as in our source; they are below 0.1 kJ/kg (some prints have a factor 1000
    on C^2, which would make them 0.4 kJ/kg at most for C < 0.5).
    """
    t = temperature
    c_delta, c_gamma = _carbon(phases.carbon_delta), _carbon(phases.carbon_gamma)
    gamma = (
        0.43 * t
        + 7.5e-5 * t**2
        + 93.0
        + (37.0 * c_gamma + 1.9 * c_gamma**2) / (44.0 * c_gamma + 1200.0)
    )
    delta = (
        0.441 * t
        + 8.87e-5 * t**2
        + 50.12
        + (18.0 * c_delta + 2.0 * c_delta**2) / (44.0 * c_delta + 1200.0)
    )
    return 1e3 * _weigh(phases, 0.825 * t - 105.0, delta, gamma)


def harste_specific_heat(temperature: Array, phases: Phases) -> Array:
    """Specific heat of the phases weighted by fraction, J/(kg K).

    It is the slope of `harste_enthalpy` within each phase, without the heats of transformation.
    """
    delta = 441.0 + 0.1774 * temperature
    gamma = 430.0 + 0.15 * temperature
    return _weigh(phases, np.full_like(temperature, 825.0), delta, gamma)


def scaled_surface_emissivity(temperature: Array) -> Array:
    """Emissivity of an oxidised steel surface, rising from 0.57 (cold) to 0.85 (hot)."""
    return np.asarray(0.85 / (1.0 + np.exp(42.68 - 0.02682 * temperature)) ** 0.0115)


def _modulus_cubic(celsius: Array) -> Array:
    """Young's modulus regression, GPa; falls with T everywhere and is negative above 1500 degC."""
    return ((-5.18e-7 * celsius + 1.90e-3) * celsius - 2.33) * celsius + 968.0


def mizukami_modulus(temperature: Array, floor: float = 1e9, ceiling: float = 130e9) -> Array:
    """Young's modulus of hot steel, Pa.

    The regression holds from 900 degC to the liquidus. It is negative above 1500 degC and unbounded
    in the cold, so it is limited by `floor` and `ceiling` (our choice).
    """
    modulus = 1e9 * _modulus_cubic(temperature - ZERO_CELSIUS)
    return np.asarray(np.clip(modulus, floor, ceiling))


def _modulus_kinks(floor: float, ceiling: float) -> tuple[float, ...]:
    """Temperatures where the regression meets its ceiling and its floor, K."""
    roots = []
    for level in (ceiling, floor):
        cubic = np.roots([-5.18e-7, 1.90e-3, -2.33, 968.0 - level / 1e9])
        roots.append(float(cubic[np.argmin(np.abs(cubic.imag))].real) + ZERO_CELSIUS)
    return tuple(roots)


def uehara_poisson(temperature: Array) -> Array:
    """Poisson's ratio of hot solid steel."""
    return np.asarray(0.278 + 8.23e-5 * (temperature - ZERO_CELSIUS))


_LIST = (
    Formula(
        "harste_conductivity", "conductivity", harste_conductivity,
        "Harste (1989), as quoted by Li and Thomas (2004)", "M", by_phase=True,
        parameters={
            "liquid_factor": Parameter(1.0, "1", 0.1, 100.0),
            "liquid_conductivity": Parameter(39.0, "W/(m K)", 1.0, 1000.0),
        },
    ),
    Formula(
        "jimbo_cramb_density", "density", jimbo_cramb_density,
        "Jimbo and Cramb (1993) for the liquid, Harste (1989) for the solid phases", "M",
        by_phase=True,
    ),
    Formula(
        "harste_enthalpy", "enthalpy", harste_enthalpy,
        "Harste (1989), as quoted by Li and Thomas (2004)", "M", by_phase=True,
    ),
    Formula(
        "harste_specific_heat", "specific_heat", harste_specific_heat,
        "slope of harste_enthalpy within each phase", "C", by_phase=True,
    ),
    Formula(
        "scaled_surface_emissivity", "emissivity", scaled_surface_emissivity,
        "formula in use in CON1D-type models of continuous casting", "M",
    ),
    Formula(
        "mizukami_modulus", "youngs_modulus", mizukami_modulus,
        "Mizukami (1977), regression by Kozlowski et al. (1992); floor and ceiling our choice", "M",
        kinks=_modulus_kinks,
        parameters={
            "floor": Parameter(1e9, "Pa", 1e3, 1e11),
            "ceiling": Parameter(130e9, "Pa", 1e9, 1e12),
        },
    ),
    Formula("uehara_poisson", "poisson_ratio", uehara_poisson, "Uehara (1986)", "M"),
)  # fmt: skip
FORMULAS: Mapping[str, Formula] = MappingProxyType({formula.name: formula for formula in _LIST})
