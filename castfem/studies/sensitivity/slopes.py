"""Derivatives in the folder of a run, read again: numbers alone, without what computes them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from castfem.base.shown_quantity import to_si, unit_of_difference
from castfem.runs.output.folder import DERIVATIVES_NAME

REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class Slope:
    """The derivative of a result by a parameter.

    Attributes:
        value: In SI (K) per `unit` of the parameter; NaN where the result has none.
        at: The parameter, in `unit`; 100 of what is multiplied as a whole.
        unit: "percent" of what is multiplied, "" for none.
    """

    value: float
    at: float
    unit: str


Slopes = Mapping[str, Mapping[str, Slope]]
"""Name of the result to name of the parameter to derivative."""


def read_slopes(folder: Path) -> Slopes | None:
    """Return the derivatives that a run has carried along, empty if it could have none.

    None of a run that was made without, or whose file cannot be read.
    """
    try:
        content = json.loads((folder / DERIVATIVES_NAME).read_text(encoding="utf-8"))
        if REFUSED in content:
            return {}
        units = {name: one["unit"] for name, one in content["quantities"].items()}
        parameters = content["parameters"]
        found: dict[str, dict[str, Slope]] = {name: {} for name in units}
        for one in content["derivatives"]:
            name, its = one["quantity"], parameters[one["parameter"]]
            value = to_si(one["value"], unit_of_difference(units[name]))
            found[name][one["parameter"]] = Slope(value, its["value"], its["unit"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return found
