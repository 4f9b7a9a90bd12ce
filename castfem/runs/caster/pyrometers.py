"""What pyrometers would see: the surface of each slice as it passes fixed places."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.types import Array

if TYPE_CHECKING:
    from castfem.model.caster import Caster
    from castfem.model.probe import Pyrometer
    from castfem.runs.caster.files import Row
    from castfem.runs.caster.look import Look
    from castfem.runs.results.run_state import RunState

HEADING = [
    ("time", "s"), ("pyrometer", ""), ("position", "m"), ("slice", "-"),
    ("surface_temperature", "degC"),
]  # fmt: skip
"""Columns of pyrometers.csv, a row for a slice that passes; the time is that of the clock."""


class Passing:
    """A slice on its way past the places, between whose steps the temperature is linear in time.

    Args:
        places: Of the pyrometers.
        run: Of the slice.
        passed: Number of a pyrometer, age s and temperature K of those that are not written yet.

    Raises:
        InputError: One looks at a place that the surface does not have.
    """

    def __init__(
        self, places: Sequence[Pyrometer], run: RunState, passed: Sequence[Sequence[float]] = ()
    ) -> None:
        names = run.sampler.surface_vertices
        for i, one in enumerate(places):
            if one.on not in names:
                raise InputError(f"caster.pyrometer.{i}.on: '{one.on}': one of {', '.join(names)}")
        self._places = places
        self._vertices = [names[one.on] for one in places]
        self.passed = [list(one) for one in passed]
        self._before = self._seen(run)

    def _seen(self, run: RunState) -> tuple[float, Array]:
        thermal = run.state.thermal
        return thermal.time, thermal.point.temperature[self._vertices]

    def go_on(self, run: RunState) -> None:
        """Go on from where a slice is now, which was not watched on its way there."""
        self._before = self._seen(run)

    def note(self, run: RunState) -> None:
        """Take in a committed step."""
        (before, old), (now, new) = self._before, self._seen(run)
        for i, one in enumerate(self._places):
            at = run.simulation.machine.time_at(one.at)
            if before < at <= now:
                found = float(np.interp(at, [before, now], [old[i], new[i]]))
                self.passed.append([i, at, found])
        self._before = now, new


def rows(caster: Caster, looks: Sequence[Look]) -> list[Row]:
    """Return what has been seen since the instant before, in its order."""
    places = caster.pyrometer
    found: list[Row] = [
        {
            "time": one.start + age, "pyrometer": places[int(i)].name,
            "position": places[int(i)].at, "slice": one.number,
            "surface_temperature": temperature - ZERO_CELSIUS,
        }
        for one in looks
        for i, age, temperature in one.passed
        if one.start + age >= caster.window[0]
    ]  # fmt: skip
    return sorted(found, key=lambda row: float(row["time"]))
