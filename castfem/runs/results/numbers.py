"""Formats numbers, errors, units and times for tables."""

from __future__ import annotations

import math

from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import Scale, documented, plain_unit, scale_of

_RATE, _SMALL_RATE, _PARTS = "1/s", 1e-2, "e-5"  # smaller strain rates are shown in 1e-5 1/s
_DECIMALS = {"degC": 1, "K": 1, "degF": 1, "delta_degF": 1, "mm": 2}


def shown(value: float, unit: str, resolution: float | None = None) -> str:
    """A value as text without its unit; "-" if it does not exist.

    Args:
        value: Value in the unit.
        unit: Unit of the value.
        resolution: Resolution in the same unit: the last printed digit is at the place of its
            first.
    """
    if not math.isfinite(value):
        return "-"
    if unit in _DECIMALS and abs(value) < 1e5:
        digits = _digits(_DECIMALS[unit], resolution)
        return f"{rounded(value, digits):.{max(digits, 0)}f}"
    if abs(value) < 1e6 and (value == int(value) or abs(value) >= 9999.5):
        return f"{value:.0f}"
    if unit == _RATE and abs(value) < _SMALL_RATE:
        return small_rate(value)
    text = f"{value:.4g}"
    usual = len(text.partition(".")[2])
    digits = _digits(usual, resolution)
    return text if digits == usual else f"{rounded(value, digits):.{max(digits, 0)}f}"


def _digits(usual: int, resolution: float | None) -> int:
    """Number of decimals; fewer than usual if the resolution is coarser."""
    return min(usual, -math.floor(math.log10(resolution))) if resolution else usual


def small_rate(value: float, digits: str = ".4g") -> str:
    """A strain rate (1/s) with a common exponent for comparison: 37.41e-5."""
    return f"{1e5 * value:{digits}}{_PARTS}"


def is_small_rate(printed: str) -> bool:
    """Whether a text is from `small_rate`; other exponents have two digits."""
    return printed.endswith(_PARTS)


def error_shown(error: float, unit: str = "") -> str:
    """An error with two significant digits, without its unit; "-" if it does not exist."""
    if not math.isfinite(error):
        return "-"
    if unit == _RATE and 0.0 < abs(error) < _SMALL_RATE:
        return f"{error_shown(1e5 * error)}{_PARTS}"
    if error == 0.0 or not 1e-4 <= abs(error) < 1e5:  # with an exponent
        return f"{error:.2g}"
    return f"{error:.{max(0, 1 - math.floor(math.log10(abs(error))))}f}"


def with_error(value: str, error: float | None) -> str:
    """A value as text with its error, if there is one."""
    if error is None or not math.isfinite(error):
        return value
    unit = _RATE if is_small_rate(value) else ""
    return f"{value} \N{PLUS-MINUS SIGN} {error_shown(error, unit)}"


def is_gap(name: str) -> bool:
    """Whether a name is that of a gap to the mould."""
    return name.startswith(("gap_", "mould_gap_"))


def small_gap(value: float, unit: str) -> str | None:
    """A gap below 0.01 mm in micrometres, without unit; None if it is larger or undefined."""
    if unit == "mm" and 5e-5 <= abs(value) < 0.01:
        return f"{1e3 * value:.1f}"
    return None


def cells(name: str, quantity: Quantity) -> tuple[str, str]:
    """Value and unit of a quantity as in the table of a run."""
    scale = scale_of(quantity.shown_unit, name)
    resolution = resolution_in(scale, quantity)
    return value_cells(quantity.shown, scale, quantity.shown_error, resolution, is_gap(name))


def value_cells(
    value: float,
    scale: Scale,
    error: float | None = None,
    resolution: float | None = None,
    gap: bool = False,
) -> tuple[str, str]:
    """A value with its error, and its unit, as text for tables.

    Args:
        value: Value in its documented unit.
        scale: Conversion to the shown unit.
        error: Error in the documented unit; None if unknown.
        resolution: Resolution in the shown unit; None if unknown.
        gap: Show small values in micrometres.
    """
    value, error = scale(value), None if error is None else scale.factor * error
    if gap and (small := small_gap(value, scale.unit)) is not None:
        return with_error(small, None if error is None else 1e3 * error), unit_shown("um")
    return with_error(shown(value, scale.unit, resolution), error), unit_shown(scale.unit)


def resolution_in(scale: Scale, quantity: Quantity) -> float | None:
    """Resolution of a quantity in the unit of a scale; None if unknown.

    A known error is more precise, and printed beside the value.
    """
    if quantity.error is not None or quantity.shown_resolution is None:
        return None
    return abs(scale.factor) * quantity.shown_resolution


def finely(value: float, unit: str, name: str = "", resolution: float | None = None) -> str:
    """A value with its unit; lengths below 1 mm to the micrometre, below 0.01 mm in micrometres."""
    scale = scale_of(documented(unit), name)
    if scale.unit != documented(unit):
        resolution = None if resolution is None else abs(scale.factor) * resolution
        return f"{shown(scale(value), scale.unit, resolution)} {plain_unit(scale.unit)}"
    if resolution:
        return f"{shown(value, unit, resolution)} {unit}"
    if (small := small_gap(value, unit)) is not None:
        return f"{small} {unit_shown('um')}"
    if unit == "mm" and abs(value) < 1.0:
        return f"{value:.3f} mm"
    return f"{shown(value, unit)} {unit}"


def unit_shown(unit: str) -> str:
    """A unit as printed in tables."""
    return plain_unit(unit).replace("percent", "%")


def duration(seconds: float) -> str:
    """A time in seconds as readable text."""
    if seconds < 120:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def rounded(value: float, digits: int) -> float:
    """A rounded value, without a sign if it is 0."""
    return round(value, digits) + 0.0
