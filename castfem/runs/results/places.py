"""Results at places of the strand, read off the history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import units
from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import place_said
from castfem.runs.output.summary import Summary
from castfem.runs.results.labels import last_quantities

if TYPE_CHECKING:
    from castfem.runs.output.history import Columns


def read_positions(given: Sequence[str]) -> list[float]:
    """Return positions a user has written, "800 mm", in m."""
    found, problems = [], []
    for text in given:
        try:
            found.append(units.parse(text, "m"))
        except ValueError as error:
            problems.append(f"--at {text}: {error}")
    if problems:
        raise InputError(problems)
    return found


def read_number(name: str, given: float | str | None, unit: str) -> float | None:
    """Return what a script gives as a number in an SI unit, or as one with its unit; None stays.

    Raises:
        InputError: It is neither; `name` says what was meant.
    """
    if given is None or (isinstance(given, Real) and not isinstance(given, bool)):
        return None if given is None else float(given)
    if not isinstance(given, str):
        raise InputError(
            f"{name}: must be a number in {unit}, or one with its unit (given: {given!r})"
        )
    try:
        return units.parse(given, unit)
    except ValueError as error:
        raise InputError(f"{name} {given}: {error}") from None


def quantities_at(
    table: Columns,
    position: float,
    folder: Path | str,
    summary: Summary | None = None,
) -> dict[str, Quantity]:
    """Return the results where the slice came to a position, between two rows by straight lines.

    Raises:
        InputError: The run has not been there.
    """
    columns = {str(name): np.asarray(table[name]) for name in table}
    places = columns["position"]
    start, end = float(places[0]), float(places[-1])
    slack = ROUNDING * max(end, 1e-3)
    if not start - slack <= position <= end + slack:
        raise InputError(
            f"{folder}: {place_said(position)} is not between {place_said(start)} and "
            f"{place_said(end)}, where the run begins and ends; ask for a place within, or run it "
            "farther (casting.length)"
        )
    # Where the strand stands the slice is at a place more than once: the first time counts.
    after = min(int(np.searchsorted(places, position - slack)), len(places) - 1)
    if abs(places[after] - position) <= slack or after == 0:
        values = {name: float(column[after]) for name, column in columns.items()}
    else:
        share = (position - places[after - 1]) / (places[after] - places[after - 1])
        values = {
            name: float(column[after - 1] + share * (column[after] - column[after - 1]))
            for name, column in columns.items()
        }
    found = last_quantities(values, table.attrs["units"])
    errors = {} if summary is None else summary.errors_near(position)
    return {name: replace(one, error=errors.get(name)) for name, one in found.items()}
