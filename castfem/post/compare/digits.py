"""Digits of the numbers of an optimum in tables, such that differences are visible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from castfem.base.constants import EXACT, ROUNDING
from castfem.runs.results.numbers import shown


@dataclass(frozen=True, slots=True)
class Digits:
    """Numbers of digits in the tables of an optimum."""

    finest: float = 1e-4  #: smallest number printed without an exponent
    largest: float = 1e4  #: smallest number above 1 printed with an exponent
    result: int = 7  #: largest number of significant digits of a result
    variable: int = 9  #: the same for a variable, which is rounded in the search
    #: rounding relative to a value or a difference above which two of its digits are printed
    lost: float = 0.05


DIGITS = Digits()


def significant(value: float, digits: int, sign: str = "") -> str:
    """A number with some significant digits, without trailing zeros; "?" for NaN."""
    if not math.isfinite(value):
        return "?"
    if value == 0.0 or not DIGITS.finest <= abs(value) < DIGITS.largest:
        return f"{value + 0.0:{sign}.{digits}g}"
    text = f"{value:{sign}.{max(0, digits - 1 - _power(value))}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def result(value: float, unit: str, apart: float = 0.0) -> str:
    """A result as text, with more decimals if it is small, or close to another.

    Args:
        value: Value in the shown unit.
        unit: The shown unit.
        apart: Difference to the value it is compared with; two digits of it are shown.
    """
    usual = shown(value, unit)
    if not math.isfinite(value) or value == 0.0 or not usual.lstrip("-").replace(".", "").isdigit():
        return usual
    usual_decimals = len(usual.partition(".")[2])
    lost = abs(float(usual) - value)
    least = 1 - _power(value) if lost > DIGITS.lost * abs(value) else 0
    if abs(apart) > EXACT * abs(value) and lost > DIGITS.lost * abs(apart):
        least = max(least, min(1 - _power(apart), DIGITS.result - 1 - _power(value)))
    if least <= usual_decimals:
        return usual
    if abs(value) >= DIGITS.finest:
        return f"{value:.{least}f}"
    return f"{value:.{least + _power(value) + 1}g}"


def column(values: Sequence[float], unit: str) -> list[str]:
    """Results of a column, each distinguished from its neighbours."""
    found = []
    for i, value in enumerate(values):
        near = [abs(value - one) for one in (*values[max(i - 1, 0) : i], *values[i + 1 : i + 2])]
        found.append(result(value, unit, min((one for one in near if one > 0.0), default=0.0)))
    return found


def variable(value: float) -> str:
    """A value of a variable as text."""
    return f"{value:.{DIGITS.variable}g}"


def ends(low: float, high: float) -> tuple[str, str]:
    """The ends of an interval: four digits, or enough for two digits of its width."""
    digits, largest = 4, max(abs(low), abs(high))
    if 0.0 < high - low < largest:
        digits = min(max(4, _power(largest) - _power(high - low) + 2), DIGITS.variable)
    return f"{low:.{digits}g}", f"{high:.{digits}g}"


def _power(value: float) -> int:
    return math.floor(math.log10(abs(value)) + ROUNDING)
