"""Units of nearly all quantities, known without pint: it takes a fifth of a second to start.

A test holds every entry against pint, which stays the judge of all others.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

# Unit -> factor to SI, and the names of the SI units it may be read in: first that of its dimension
# among `units.NAMES`, then others of the same dimension.
_WRITTEN = {
    "%": ("1/100", "1"),
    "percent": ("1/100", "1"),
    "%/m": ("1/100", "1/m"),
    "percent/m": ("1/100", "1/m"),
    "1/m": ("1", "1/m"),
    "1/K": ("1", "1/K"),
    "1/s": ("1", "1/s"),
    "K": ("1", "K"),
    "m": ("1", "m"),
    "mm": ("1/1000", "m"),
    "um": ("1/1000000", "m"),
    "s": ("1", "s"),
    "ms": ("1/1000", "s"),
    "m/s": ("1", "m/s"),
    "m/min": ("1/60", "m/s"),
    "L/(m^2 s)": ("1/1000", "m/s"),
    "L/min": ("1/60000", "m^3/s"),
    "W/(m^2 K)": ("1", "W/(m^2 K)"),
    "W/(m K)": ("1", "W/(m K)"),
    "W/m^2": ("1", "W/m^2"),
    "kW/m^2": ("1000", "W/m^2"),
    "MW/m^2": ("1000000", "W/m^2"),
    "kW": ("1000", "W"),
    "kg/m^3": ("1", "kg/m^3"),
    "J/(kg K)": ("1", "J/(kg K)"),
    "J/kg": ("1", "J/kg"),
    "kJ/kg": ("1000", "J/kg"),
    "Pa": ("1", "Pa"),
    "MPa": ("1000000", "Pa"),
    "GPa": ("1000000000", "Pa"),
    "J": ("1", "J"),
    "kJ": ("1000", "J"),
    "J/m": ("1", "J/m"),
    "kJ/m": ("1000", "J/m"),
    "MJ/m": ("1000000", "J/m"),
    "kN": ("1000", "J/m", "N"),
    "kN m": ("1000", "J", "N m"),
    "kN/m": ("1000", "kilogram/second**2"),
}
COMMON: Mapping[str, tuple[Fraction, tuple[str, ...]]] = {
    unit: (Fraction(factor), tuple(names)) for unit, (factor, *names) in _WRITTEN.items()
}
