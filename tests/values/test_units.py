"""Quantities: values, dimensions, temperatures and differences, and conversion to text."""

from __future__ import annotations

import importlib
import math
import pkgutil
from typing import Annotated, Optional, get_args, get_origin

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

import castfem.base
import castfem.model
from castfem.base import quantities, units
from castfem.base.quantities import Notation
from castfem.base.shown_units import below_meniscus


def test_common_units_agree_with_pint(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [(unit, si) for unit, (_, names) in units.COMMON.items() for si in names]

    def conversions() -> list[object]:
        units._conversion.cache_clear()
        units._si_of.cache_clear()
        return [(units._conversion(unit, si, False), units._si_of(unit)) for unit, si in pairs]

    found = conversions()
    with monkeypatch.context() as patch:
        patch.setattr(units, "COMMON", {})
        parsed: list[str] = []
        parse = units._parse_unit
        patch.setattr(units, "_parse_unit", lambda unit, *_: parsed.append(unit) or parse(unit))
        expected = conversions()
        assert {*parsed} >= {*units.COMMON}
    conversions()
    for entry, one, other in zip(pairs, found, expected, strict=True):
        assert one == other, entry
    with pytest.raises(ValueError, match="in kelvin"):
        units.parse("40 degC", "K", difference=True)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("3.6 m/min", "m/s", 0.06),
        ("125 mm", "m", 0.125),
        ("160 degC", "K", 433.15),
        ("1242 °C", "K", 1515.15),
        ("32 degF", "K", 273.15),
        ("1600 W/(m^2 K)", "W/(m^2 K)", 1600.0),
        ("0.15 W/(m degC)", "W/(m K)", 0.15),
        ("270 kJ/kg", "J/kg", 270e3),
        ("13.5e-6/K", "1/K", 13.5e-6),
        ("-3 %/m", "1/m", -0.03),
        ("45 deg", "rad", math.pi / 4),
        (0.8, "1", 0.8),
        ("0.8", "1", 0.8),
    ],
)
def test_value(text, unit, value):
    assert units.parse(text, unit) == pytest.approx(value, rel=1e-15)


def test_decimal_texts_give_the_nearest_float():
    for millimetres in range(1, 2000):
        assert units.parse(f"{millimetres / 10} mm", "m") == float(f"{millimetres}e-4")


def test_difference_of_temperatures_is_written_in_kelvin():
    assert units.parse("40 K", "K", difference=True) == 40.0
    with pytest.raises(ValueError, match="written in kelvin"):
        units.parse("40 degC", "K", difference=True)
    with pytest.raises(ValueError, match="is a difference"):
        units.parse("40 delta_degC", "K")


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        (160, "K", 'needs its unit, such as "160 degC"'),
        ("3.6 m", "m/s", r"'m' is the unit of a length, a speed is needed.*did you mean m/min\?"),
        ("2 kW", "W/m^2", r"did you mean kW/m\^2\?"),
        ("0.15 W/mK", "W/(m K)", r"did you mean W/\(m K\)\?"),
        ("3 kg", "m/s", 'a speed is needed, such as "3.6 m/min"$'),
        ("3.6 m/mn", "m/s", "did you mean m/min?"),
        ("1600 W/m2K", "W/(m^2 K)", r"did you mean W/\(m\^2 K\)\?"),
        ("160 degZ", "K", r"'degZ' is not known; did you mean degC\?"),
        ("45 degZ", "rad", r"'degZ' is not known; did you mean deg\?"),
        ("3 mn", "m", "'mn' is not known; a length is needed"),
        ("3,6 m/min", "m/s", "decimal point"),
        ("five mm", "m", "does not begin with a number"),
        (math.nan, "1", "finite"),
        ("1e400 m", "m", "too large"),
        (True, "1", "is needed"),
        (None, "m", "a length is needed"),
        ("-300 degC", "K", "absolute zero"),
        ("5 m", "1", "number without unit is needed"),
        ("2 %", "m", "'%' has no dimension, a length is needed"),
    ],
)
def test_refused(text, unit, message):
    with pytest.raises(ValueError, match=message):
        units.parse(text, unit)


@given(st.text(max_size=30))
def test_any_text_is_read_or_refused(text):
    """Any text raises nothing but ValueError."""
    for candidate in (text, f"3 {text}"):
        try:
            assert math.isfinite(units.parse(candidate, "m"))
        except ValueError as error:
            assert str(error)


_SHOWN = [
    ("m", "mm", False),
    ("K", "degC", False),
    ("K", "degF", False),
    ("K", "K", True),
    ("m/s", "m/min", False),
    ("W/m^2", "MW/m^2", False),
    ("1/m", "percent/m", False),
    ("s", "ms", False),
]


@pytest.mark.parametrize(("unit", "shown", "difference"), _SHOWN)
@given(value=st.floats(min_value=0.0, max_value=1e12))
def test_format_reads_back_to_the_same_float(unit, shown, difference, value):
    text = units.format(value, unit, shown, difference=difference)
    assert units.parse(text, unit, difference=difference) == value


def test_format_prefers_the_users_unit():
    assert units.format(433.15, "K", "degC") == "160 degC"
    assert units.format(0.06, "m/s", "m/min") == "3.6 m/min"
    assert units.format(0.8, "1") == "0.8"


def test_parse_any_returns_the_si_unit():
    assert units.parse_any("4.75 mm") == (0.00475, "m")
    assert units.parse_any("1242 degC") == (1515.15, "K")
    assert units.parse_any("142.7 kJ") == (142700.0, "J")
    assert units.parse_any("99 percent") == (0.99, "1")
    assert units.parse_any(3) == (3.0, "1")
    value, unit = units.parse_any("3 N s/m^2")
    assert units.parse("3 Pa s", unit) == value


def test_convert_is_the_inverse_of_parse():
    assert units.convert(433.15, "K", "degC") == pytest.approx(160.0, abs=1e-12)
    assert units.convert(0.06, "m/s", "m/min") == pytest.approx(3.6, rel=1e-15)
    assert units.convert(0.5, "1", "percent") == 50.0


def test_types_check_bounds_and_convert_back():
    length = TypeAdapter(quantities.Length)
    assert length.validate_python("125 mm") == 0.125
    assert length.dump_python(0.125, mode="json") == "125 mm"
    assert length.dump_python(0.125) == 0.125
    with pytest.raises(ValidationError, match="must be above 0 m"):
        length.validate_python("-1 mm")
    with pytest.raises(ValueError, match="must not be above 1"):
        quantities.Kind("1", most=1.0).read("120 percent")
    with pytest.raises(ValidationError, match="must be above 0"):
        TypeAdapter(quantities.Conductivity).validate_python("-30 W/(m K)")


def test_water_is_volume_or_mass():
    water = TypeAdapter(quantities.WaterFlow)
    assert water.validate_python("5 L/(m^2 s)") == 5.0
    assert water.validate_python("300 kg/(m^2 min)") == 5.0
    assert water.dump_python(5.0, mode="json") == "5 L/(m^2 s)"
    with pytest.raises(ValidationError, match="water flow per area"):
        water.validate_python("5 L/min")


@pytest.mark.parametrize(
    ("position", "digits", "text"),
    [
        (0.1002, ".4g", "100.2 mm"),
        (6.744412, ".6g", "6744.41 mm"),
        (10.09, ".4g", "10.09 m"),
        (12.0, ".6g", "12 m"),
    ],
)
def test_places_far_down_are_in_metres(position: float, digits: str, text: str) -> None:
    assert below_meniscus(position, digits) == f"{text} below the meniscus"


@pytest.mark.parametrize(
    ("written", "unit"), [("mm", "m"), ("degC", "K"), ("degF", "K"), ("m/min", "m/s"), ("m", "m")]
)
@given(numbers=st.lists(st.floats(0.0, 1e12) | st.integers(0, 10**9), min_size=1, max_size=5))
def test_many_numbers_are_read_as_single_ones(
    written: str, unit: str, numbers: list[float | int]
) -> None:
    found = units.parse_numbers(numbers, written, unit)
    assert found == tuple(units.parse(f"{number!r} {written}", unit) for number in numbers)
    assert all(type(number) is float for number in found)


def test_many_numbers_below_absolute_zero_are_refused() -> None:
    with pytest.raises(ValueError, match="below absolute zero"):
        units.parse_numbers([20.0, -300.0], "degC", "K")
    assert units.parse_numbers([-5.0], "K", "K", difference=True) == (-5.0,)


def test_temperature_is_not_proposed_for_a_difference() -> None:
    with pytest.raises(ValueError, match=r'a temperature difference is needed, such as "40 K"$'):
        units.parse("40 degZ", "K", difference=True)


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("savage", "savage_pritchard"),
        ("pritchard", "savage_pritchard"),
        ("on", ""),
        ("any", "any speed"),
    ],
)
def test_beginning_of_a_name_proposes_it(name: str, near: str) -> None:
    proposed = units.nearest(name, ["li_thomas", "savage_pritchard", "any speed", "only_this_one"])
    assert proposed == (f"; did you mean {near}?" if near else "")


@pytest.mark.parametrize(
    ("name", "near"),
    [("stirrer", ""), ("mold", "mould"), ("Cooling", "cooling"), ("casing", "casting")],
)
def test_similar_name_is_proposed(name: str, near: str) -> None:
    proposed = units.nearest(name, ["casting", "cooling", "mould", "water"])
    assert proposed == (f"; did you mean {near}?" if near else "")
    files = units.nearest(f"{name}.toml", ["casting.toml", "cooling.toml", "mould.toml", "x.toml"])
    assert files == (f"; did you mean {near}.toml?" if near else "")


# Notation of values in files: the annotations of fields


def annotations() -> dict[str, object]:
    """Return each annotated type in a module of case files, by module and name."""
    found = {}
    for package in (castfem.model, castfem.base):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            for name, value in vars(importlib.import_module(module.name)).items():
                if get_origin(value) is Annotated:
                    found[f"{module.name}.{name}"] = value
    return found


def test_annotations_can_be_optional_in_any_python() -> None:
    """Early releases of Python 3.11 and 3.12 put the members of a union in a set."""
    assert annotations()
    for name, annotation in annotations().items():
        marks = [mark for mark in get_args(annotation)[1:] if isinstance(mark, Notation)]
        assert len({*marks, *marks}) == len(marks), name
        assert type(None) in get_args(Optional[annotation]), name  # noqa: UP045
