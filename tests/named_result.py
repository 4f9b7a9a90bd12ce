"""Places where a case names a result: references, objectives, constraints and units."""

from __future__ import annotations

import pytest
from small_case import small

from castfem.base.errors import InputError
from castfem.model.shown_units import read_choice

VARIABLE = {"key": "casting.speed", "range": ["3 m/min", "4 m/min"]}


def assert_named_everywhere(name: str, value: str) -> None:
    """Check that a declared result can be a reference, an objective, a constraint and have a unit.

    Args:
        name: Name of the result.
        value: A value in a unit that measures it.
    """
    unit = value.partition(" ")[2]
    reference = {"quantity": name, "source": "a test"}
    search = {"minimise": name, "constraints": [f"{name} <= {value}"], "variable": [VARIABLE]}
    assert small({"reference": [{**reference, "value": value}]}).reference[0].quantity == name
    assert small({"optimise": search}).optimise.names == {name}
    assert read_choice([f"{name}={unit}"]).names == (name,)
    for changes in (
        {"reference": [{**reference, "value": "3 kg"}]},
        {"optimise": {**search, "constraints": [f"{name} <= 3 kg"]}},
    ):
        with pytest.raises(InputError, match=f"does not measure {name}; .*{unit}"):
            small(changes)
    with pytest.raises(InputError, match=f"did you mean {name}"):
        read_choice([f"{name}x={unit}"])
