"""output.units: what is a choice of units, and what is not."""

from __future__ import annotations

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.model.shown_units import read_choice


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ('"imperial"', 'output.units: "imperial" is not a system of units'),
        ('{ shell = "MPa" }', "output.units.shell: 'MPa' is the unit of a pressure"),
        ('{ shel = "mm" }', "output.units.shel: .*did you mean shell"),
        ('{ length = "ells" }', "output.units: length: unit 'ells' is not known"),
        ("3", "output.units: .*is needed"),
    ],
)
def test_what_is_no_choice(write, sound, value: str, told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        load_case(write(f"{sound}\n[output]\nunits = {value}\n"))
    assert len(caught.value.problems) == 1


def test_a_choice_is_written_as_it_was_read(write, sound) -> None:
    case = load_case(write(f'{sound}\n[output]\nunits = {{ system = "si", length = "inch" }}\n'))
    assert case.document()["output"]["units"] == {"system": "si", "length": "inch"}
    assert case.physics_hash() == load_case(write(sound)).physics_hash()
    assert "units" not in load_case(write(sound)).document()["output"]


@pytest.mark.parametrize("given", ["imperial", "length=degF", "shel=mm"])
def test_the_command_line(given: str) -> None:
    with pytest.raises(InputError, match="--units"):
        read_choice([given])
