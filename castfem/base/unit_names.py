"""Names of units: the most common ones with their factors, those of each quantity, usual spellings.

`castfem.base.units` reads and converts with them.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from fractions import Fraction

# Unit -> factor to SI, and the SI units of the same dimension: first the one in `NAMES`.
_WRITTEN = {
    "%": ("1/100", "1"), "percent": ("1/100", "1"), "%/m": ("1/100", "1/m"),
    "percent/m": ("1/100", "1/m"), "1/m": ("1", "1/m"), "1/K": ("1", "1/K"), "1/s": ("1", "1/s"),
    "K": ("1", "K"), "m": ("1", "m"), "mm": ("1/1000", "m"), "um": ("1/1000000", "m"),
    "s": ("1", "s"), "ms": ("1/1000", "s"), "min": ("60", "s"),
    "deg": ("14964008/857374503", "rad"), "m/s": ("1", "m/s"), "m/min": ("1/60", "m/s"),
    "L/(m^2 s)": ("1/1000", "m/s"), "L/min": ("1/60000", "m^3/s"),
    "W/(m^2 K)": ("1", "W/(m^2 K)"), "W/(m K)": ("1", "W/(m K)"), "W/m^2": ("1", "W/m^2"),
    "kW/m^2": ("1000", "W/m^2"), "MW/m^2": ("1000000", "W/m^2"), "kW": ("1000", "W"),
    "kg/m^3": ("1", "kg/m^3"), "J/(kg K)": ("1", "J/(kg K)"), "J/kg": ("1", "J/kg"),
    "kJ/kg": ("1000", "J/kg"), "Pa": ("1", "Pa"), "MPa": ("1000000", "Pa"),
    "GPa": ("1000000000", "Pa"), "J": ("1", "J"), "kJ": ("1000", "J"), "J/m": ("1", "J/m"),
    "kJ/m": ("1000", "J/m"), "MJ/m": ("1000000", "J/m"), "kN": ("1000", "J/m", "N"),
    "kN m": ("1000", "J", "N m"), "kN/m": ("1000", "kilogram/second**2"),
}  # fmt: skip
COMMON: Mapping[str, tuple[Fraction, tuple[str, ...]]] = {
    unit: (Fraction(factor), tuple(names)) for unit, (factor, *names) in _WRITTEN.items()
}
NAMES: dict[str, tuple[str, str]] = {
    "1": ("number without unit", "0.8"),
    "K": ("temperature", "160 degC"),
    "m": ("length", "125 mm"),
    "s": ("time", "0.5 s"),
    "m/s": ("speed", "3.6 m/min"),
    "1/m": ("change per length", "1 percent/m"),
    "1/K": ("expansion coefficient", "13.5e-6 1/K"),
    "1/s": ("rate", "1e-3 1/s"),
    "W/(m^2 K)": ("heat transfer coefficient", "1600 W/(m^2 K)"),
    "W/(m K)": ("conductivity", "30 W/(m K)"),
    "W/m^2": ("heat flux", "2 MW/m^2"),
    "kg/m^3": ("density", "7400 kg/m^3"),
    "J/(kg K)": ("specific heat", "700 J/(kg K)"),
    "J/kg": ("latent heat", "270 kJ/kg"),
    "Pa": ("pressure", "10 MPa"),
    "rad": ("angle", "45 deg"),
    "J": ("heat", "142.7 kJ"),
    "W": ("power", "2 kW"),
    "J/m": ("heat per length", "2.4 MJ/m"),
    "kg": ("mass", "3 kg"),
    "m^2": ("area", "4 cm^2"),
    "kg/(m^2 s)": ("mass flow per area", "5 kg/(m^2 s)"),
    "J/m^3": ("heat per volume", "2 GJ/m^3"),
    "m^2/s": ("diffusivity", "6 mm^2/s"),
    "m^3/s": ("volume flow", "240 L/min"),
}
"""Quantity and example of a value by SI unit."""
KNOWN = {
    *("m", "mm", "cm", "um", "km", "inch", "ft", "s", "ms", "min", "hour", "m/min", "m/s", "mm/s"),
    *("K", "degC", "degF", "degR", "W", "kW", "MW", "J", "kJ", "MJ", "Pa", "kPa", "MPa", "GPa"),
    *("bar", "psi", "N", "kN", "kg", "g", "t", "mol", "percent", "ppm", "deg", "rad", "L"),
    *("W/m^2", "kW/m^2", "MW/m^2", "W/(m^2 K)", "kW/(m^2 K)", "W/(m K)", "J/(kg K)", "kJ/(kg K)"),
    *("J/kg", "kJ/kg", "kg/m^3", "L/(m^2 s)", "L/min", "percent/m", "1/K", "1/s"),
}
"""Usual units; the nearest one is proposed for a misspelt unit."""
_SIMILAR = 0.7  # similarity of the letters of two units


def alike(unit: str, names: Sequence[str]) -> str:
    """Return the first of the names whose letters are most like those of a unit; "" if none is."""
    matcher = difflib.SequenceMatcher(b=letters(unit))
    likeness = dict.fromkeys(names, 0.0)
    for name in names:
        matcher.set_seq1(letters(name))
        likeness[name] = matcher.ratio()
    near = max(likeness, key=likeness.__getitem__, default="")
    return near if near and likeness[near] >= _SIMILAR else ""


def letters(unit: str) -> str:
    """Return only the letters and digits of a unit: "W/m2K" and "W/(m^2 K)" become equal."""
    return re.sub(r"[^a-z0-9]", "", unit.lower())
