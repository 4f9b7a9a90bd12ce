"""Digits of an answer in tables: what differs is seen to differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from castfem.base.constants import EXACT, ROUNDING
from castfem.runs.results.numbers import shown


@dataclass(frozen=True, slots=True)
class Digits:
    """How many digits numbers of optima are printed with."""

    finest: float = 1e-4  #: smallest number that is printed without its power of ten
    largest: float = 1e4  #: from here on the power is printed, too
    result: int = 7  #: significant digits of a result at most
    variable: int = 9  #: the same of a variable, which is rounded to those of its range
    #: rounding, over a value or a difference, from which two digits of it are printed
    lost: float = 0.05


DIGITS = Digits()


def significant(value: float, digits: int, sign: str = "") -> str:
    """A difference with so many digits that count, zeros at the end left out; "?" for NaN."""
    if not math.isfinite(value):
        return "?"
    if value == 0.0 or not DIGITS.finest <= abs(value) < DIGITS.largest:
        return f"{value + 0.0:{sign}.{digits}g}"
    text = f"{value:{sign}.{max(0, digits - 1 - _power(value))}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def result(value: float, unit: str, apart: float = 0.0) -> str:
    """A result as tables print it, with more decimals where it is small, or near to another.

    Args:
        value: In the unit that is shown.
        unit: That unit.
        apart: By how much it differs from what it is compared with; two digits of that are seen.
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
    """Results below one another, each told from its neighbours."""
    found = []
    for i, value in enumerate(values):
        near = [abs(value - one) for one in (*values[max(i - 1, 0) : i], *values[i + 1 : i + 2])]
        found.append(result(value, unit, min((one for one in near if one > 0.0), default=0.0)))
    return found


def variable(value: float) -> str:
    """A value of a variable."""
    return f"{value:.{DIGITS.variable}g}"


def ends(low: float, high: float) -> tuple[str, str]:
    """The ends of an interval: four digits, or those that two digits of its width need."""
    digits, largest = 4, max(abs(low), abs(high))
    if 0.0 < high - low < largest:
        digits = min(max(4, _power(largest) - _power(high - low) + 2), DIGITS.variable)
    return f"{low:.{digits}g}", f"{high:.{digits}g}"


def _power(value: float) -> int:
    return math.floor(math.log10(abs(value)) + ROUNDING)
