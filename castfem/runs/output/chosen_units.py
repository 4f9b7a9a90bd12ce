"""In which units a run is shown: `output.units` of its case."""

from __future__ import annotations

import tomllib
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.shown_units import ShownUnits
from castfem.model.shipped_cases import CASE_NAME


def units_of_run(folder: Path) -> ShownUnits:
    """The choice of the case in the folder of a run; the units of the plant where it makes none.

    Raises:
        InputError: It is not a choice of units.
    """
    path = folder / CASE_NAME
    try:
        text = path.read_text(encoding="utf-8")
        if "units" not in text:
            return ShownUnits()
        output = tomllib.loads(text).get("output", {})
    except (OSError, tomllib.TOMLDecodeError):
        return ShownUnits()
    try:
        return ShownUnits.read(output.get("units", "plant"))
    except ValueError as error:
        raise InputError(f"{path}: output.units: {error}") from None
