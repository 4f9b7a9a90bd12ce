"""Quantities with units, as users write them: "3.6 m/min", "160 degC", "0.15 W/(m K)".

Inside castfem every number is in SI (K, m, s, J, W, Pa, kg); units exist at the border only.
`parse` reads a quantity and checks its dimension; `format` writes one that reads back exactly.

A temperature and a temperature difference are different things: "160 degC" is 433.15 K, but a
difference is written in kelvin, "40 K". Conversions use exact fractions, so that "0.3 mm" is the
float nearest to 0.0003. pint is imported at the first unit that is not among the most common ones.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache, partial
from typing import TYPE_CHECKING

from castfem.base.unit_names import COMMON, KNOWN, NAMES, alike, letters

if TYPE_CHECKING:
    import pint


_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*?)\s*")

LARGEST = 1e300
"""Largest number, in any unit."""

# Scale and offset to kelvin of temperature scales that do not begin at absolute zero.
_OFFSET_SCALES = {
    "degree_Celsius": (Fraction(1), Fraction(27315, 100)),
    "degree_Fahrenheit": (Fraction(5, 9), Fraction(45967, 180)),
}
_COMPOSED = "write products and powers like W/(m^2 K)"
_ROUNDING = Fraction(1, 10**15)  # of pint's factors, which are products of several floats


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    import pint

    return pint.UnitRegistry()


def _tidy(unit: str) -> str:
    """Rewrite spellings unknown to pint: "m2" is m^2, "°C" degC, a raised dot a product."""
    for written, meant in (("°", "deg"), ("·", " "), ("⋅", " "), ("μ", "u"), ("µ", "u")):
        unit = unit.replace(written, meant)
    if unit.startswith("/"):
        unit = "1" + unit
    return re.sub(r"\b(m|mm|cm|s|K)(-?[1-4])\b", r"\1^\2", unit)


def _unknown(
    unit: str, si: str = "", difference: bool = False, wanted: str = _COMPOSED
) -> ValueError:
    """Return the error of an unknown unit, with the nearest one for what is measured in `si`."""
    fitting = [name for name in sorted(KNOWN) if not si or _si_of(name) == _si_of(si)]
    near = alike(_tidy(unit), [si] if difference else fitting)
    return ValueError(f"unit '{unit}' is not known; {f'did you mean {near}?' if near else wanted}")


def _meant(unit: str, example: str, target: pint.Unit) -> str:
    """Return a unit of the right dimension that a wrong one may stand for; "" if none is near.

    This is the unit with the divisor of the example ("%/m" for "%"), or one with the same letters
    ("W/(m K)" for "W/mK").
    """
    per = example.partition("/")[2]
    whole = [f"{unit}/{per}"] if per and "/" not in unit else []
    alike = sorted(name for name in KNOWN if letters(name) == letters(unit))
    right = target.dimensionality
    return next((one for one in whole + alike if _parse_unit(one).dimensionality == right), "")


_NEAR = 0.6  # similarity of the letters: "stirrer" is not "water", with which it shares half
_PART = 3  # least number of letters of an abbreviated name


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return "; did you mean X?" with the allowed name nearest to `name`, "" if none is near.

    A name is also near if it, or one of its words, begins with `name`: "savage" is near
    "savage_pritchard".
    """
    bare = {_stem(choice): choice for choice in allowed}
    lower = {choice.lower(): choice for choice in bare}
    given = _stem(name).lower()
    near = difflib.get_close_matches(_stem(name), bare, 1, _NEAR)
    near = near or [lower[n] for n in difflib.get_close_matches(given, lower, 1, _NEAR)]
    if not near and len(given) >= _PART:
        near = [lower[n] for n in lower if f"_{given}" in "_" + re.sub(r"\W", "_", n)]
    return f"; did you mean {bare[near[0]]}?" if near else ""


def _stem(name: str) -> str:
    """Return a name without its file ending, which would distort the similarity."""
    return name.removesuffix(".toml").removesuffix(".csv")


def _a(name: str) -> str:
    return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def _parse_unit(unit: str, unknown: Callable[[str], ValueError] = _unknown) -> pint.Unit:
    """Return pint's unit for a text; raise the error that `unknown` returns if there is none."""
    if len(unit) > 60:
        raise ValueError(f"'{unit[:20]}...' is too long for a unit")
    try:
        return _registry().parse_units(_tidy(unit))
    except RecursionError:
        raise
    except Exception as error:  # pint's tokenizer raises assertion, token and key errors
        raise unknown(unit) from error


def _name_of(unit: pint.Unit) -> str:
    """Return the quantity of a unit ("length"), "" if it has no common name."""
    registry = _registry()
    for si, (name, _) in NAMES.items():
        if si != "1" and registry.parse_units(si).dimensionality == unit.dimensionality:
            return name
    return ""


def _exact(factor: float) -> Fraction:
    """Return the simple fraction of a conversion factor (1/60 for 0.01666...)."""
    exact = Fraction(factor)
    for digits in range(0, 16, 3):
        simple = exact.limit_denominator(10**digits)
        if abs(simple - exact) <= abs(exact) * _ROUNDING:
            return simple
    return exact


def describe(si: str, difference: bool) -> tuple[str, str]:
    """Return the name of the quantity of an SI unit, and an example."""
    if difference:
        return "temperature difference", "40 K"
    return NAMES.get(si, (f"quantity in {si}", f"1 {si}"))


@lru_cache(maxsize=1024)
def _conversion(
    unit: str, si: str, difference: bool, kind: tuple[str, str] | None = None
) -> tuple[Fraction, Fraction]:
    """Return scale and offset with `value_in_si = scale * value + offset`."""
    scale, names = COMMON.get(unit, (Fraction(1), ()))
    if si in names:
        return scale, Fraction(0)
    if (unit, si, difference) == ("degC", "K", False):
        return _OFFSET_SCALES["degree_Celsius"]
    name, example = kind or describe(si, difference)
    if not unit:
        if si == "1":
            return Fraction(1), Fraction(0)
        raise ValueError(f'{_a(name)} needs its unit, such as "{example}"')
    wanted = f'{_a(name)} is needed, such as "{example}"'
    parsed = _parse_unit(unit, partial(_unknown, si=si, difference=difference, wanted=wanted))
    target = _registry().parse_units("" if si == "1" else si)
    if parsed.dimensionality != target.dimensionality:
        fix = "; put a divisor of several units in brackets" if "/" in unit and " " in unit else ""
        if meant := _meant(unit, example, target):
            fix = f"; did you mean {meant}?"
        if parsed.dimensionless:
            problem = "has no dimension"
        else:
            found = _name_of(parsed)
            problem = f"is the unit of {_a(found)}" if found else "does not fit"
        raise ValueError(f"'{unit}' {problem}, {wanted}{fix}")
    if str(parsed) in _OFFSET_SCALES:
        if difference:
            raise ValueError(f'{_a(name)} is written in kelvin, such as "{example}", not in {unit}')
        return _OFFSET_SCALES[str(parsed)]
    if si == "K" and not difference and str(parsed).startswith("delta_"):
        raise ValueError(
            f"'{unit}' is a difference, a temperature is needed, such as \"{example}\""
        )
    return _exact(_registry().convert(1.0, parsed, target)), Fraction(0)


def split(text: str) -> tuple[str, str]:
    """Split a quantity into its number and its unit ("" if there is none)."""
    found = _QUANTITY.fullmatch(text)
    if not found:
        raise ValueError(f'"{text}" does not begin with a number')
    number, unit = found.groups()
    if re.match(r",\d", unit):
        raise ValueError(
            f'"{text.strip()}" has a comma; use a decimal point and no thousands separators'
        )
    return number, "" if unit == "-" else unit  # a placeholder for no unit


def parse(
    text: object, unit: str, *, difference: bool = False, kind: tuple[str, str] | None = None
) -> float:
    """Read a quantity in SI.

    Args:
        text: The quantity as written by the user: number and unit; a plain number if `unit` is "1".
        unit: SI unit of the returned value, such as "m" or "W/(m^2 K)", which also sets the
            required dimension. "1" is a dimensionless number.
        difference: With `unit` "K": the text is a temperature difference, not a temperature.
        kind: Name and example for messages, if the unit alone is not enough ("water flow per
            area").

    Returns:
        The value in `unit`; finite.

    Raises:
        ValueError: Missing or unknown unit, another dimension, not a number, not finite, or below
            absolute zero. The text says what is wrong and how to write it.
    """
    name, example = kind or describe(unit, difference)
    if isinstance(text, Mapping | Sequence) and not isinstance(text, str):
        raise ValueError(f'a single {name} is needed here, such as "{example}"; no table or list')
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise ValueError(f'{_a(name)} is needed, such as "{example}"')
    if not isinstance(text, str):
        return _check(_plain(text, unit, name, example), unit, difference)
    if _QUANTITY.fullmatch(text) is None:
        wanted = f'{_a(name)} is needed, such as "{example}"'
        raise ValueError(f'"{text}" does not begin with a number; {wanted}')
    number, written = split(text)
    scale, offset = _conversion(written, unit, difference, kind)
    if abs(float(number)) > LARGEST:
        raise ValueError("the number is too large")
    return _check(float(Fraction(number) * scale + offset), unit, difference)


def parse_numbers(
    numbers: Sequence[float], written: str, unit: str, *, difference: bool = False
) -> tuple[float, ...]:
    """Convert many finite numbers of one unit to SI, faster than `parse`.

    Raises:
        ValueError: The unit is unknown or of another dimension, or a value is below absolute zero.
    """
    scale, offset = _conversion(written, unit, difference)
    found = tuple(map(float, numbers))
    if (scale, offset) != (1, 0):
        found = tuple(float(Fraction(repr(number)) * scale + offset) for number in numbers)
    _check(min(found), unit, difference)
    return found


def _plain(number: float, unit: str, name: str, example: str) -> float:
    """Return a number that was given without unit, if that is allowed."""
    if not math.isfinite(number):
        raise ValueError(f"a finite {name} is needed")
    if unit != "1":
        raise ValueError(f'{_a(name)} needs its unit, such as "{example}"')
    return float(number)


def _check(value: float, unit: str, difference: bool) -> float:
    if unit == "K" and not difference and value < 0.0:
        raise ValueError("this is below absolute zero")
    return value


def parse_any(text: object) -> tuple[float, str]:
    """Read a quantity of any dimension.

    Returns:
        The value in SI base units and the name of that SI unit ("1" for a plain number). A single
        unit of temperature means a temperature, not a difference; kelvins may be below 0.

    Raises:
        ValueError: As `parse`.
    """
    if not isinstance(text, str):
        return parse(text, "1"), "1"
    _, written = split(text)
    if not written:
        return parse(text, "1"), "1"
    si = _si_of(written)
    # Kelvins below 0 can only be a difference, such as a superheat varied by a search.
    return parse(text, si, difference=written == "K"), si


@lru_cache(maxsize=1024)  # a sweep reads the same units again for each of its cases
def _si_of(unit: str) -> str:
    """Return the SI unit of the same dimension, as `parse_any`."""
    if unit in COMMON:
        return COMMON[unit][1][0]
    if unit == "degC":
        return "K"
    parsed = _parse_unit(unit)
    if parsed.dimensionless:
        return "rad" if "radian" in str(parsed) or "degree" in str(parsed) else "1"
    registry = _registry()
    for si in NAMES:
        if si != "1" and registry.parse_units(si).dimensionality == parsed.dimensionality:
            return si
    return f"{registry.get_base_units(parsed)[1]:C}"


def number_in(text: object, unit: str) -> float | None:
    """Return a quantity as a number in a unit ("" for none); None for another dimension.

    None also for a table or a word.
    """
    try:
        value, si = parse_any(text)
        return convert(value, si, unit or "1")
    except ValueError:
        return None


def convert(value: float, si: str, unit: str, *, difference: bool = False) -> float:
    """Return an SI value in another unit: `convert(433.15, "K", "degC")` is 160."""
    scale, offset = _conversion("" if unit == "1" else unit, si, difference)
    return float((Fraction(value) - offset) / scale)


def factor_and_zero(si: str, unit: str) -> tuple[float, float]:
    """Return factor and zero for many SI values: factor * value - zero; (1.0, 273.15) to degC.

    `convert` rounds once but is slow; this rounds the factor and is fast.
    """
    scale, offset = _conversion("" if unit == "1" else unit, si, False)
    return float(1 / scale), float(offset / scale)


def in_mm(length: float) -> str:
    """Format a length, m, for messages: in mm, with nine digits."""
    return f"{1e3 * length:.9g} mm"


def format(value: float, unit: str, shown: str = "", *, difference: bool = False) -> str:
    """Write an SI value as a text that `parse` reads back to the same float.

    Args:
        value: Value in SI.
        unit: SI unit, "1" for none.
        shown: Unit to write it in; the SI unit is used if a round number in `shown` would not read
            back to the same float.
        difference: As in `parse`.
    """
    for name in (shown, unit):
        if not name or name == "1":
            continue
        text = f"{convert(value, unit, name, difference=difference):.12g} {name}"
        if parse(text, unit, difference=difference) == value:
            return text
    return f"{value!r}" if unit == "1" else f"{value!r} {unit}"
