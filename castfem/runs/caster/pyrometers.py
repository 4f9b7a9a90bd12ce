"""Simulated pyrometers: the surface temperature of each slice as it passes fixed positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.base.units import nearest

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
"""Columns of pyrometers.csv, one row for each passing slice; times are clock times."""


class Passing:
    """Records when a slice passes the pyrometers, with temperatures linear in time within a step.

    Args:
        places: The pyrometers.
        run: Run of the slice.
        passed: Pyrometer number, age s and temperature K of readings that are not written yet.

    Raises:
        InputError: A pyrometer points at a place that the surface does not have.
    """

    def __init__(
        self, places: Sequence[Pyrometer], run: RunState, passed: Sequence[Sequence[float]] = ()
    ) -> None:
        names = run.sampler.surface_vertices
        for i, one in enumerate(places):
            if one.on not in names:
                known = f"one of {', '.join(names)}{nearest(one.on, names)}"
                raise InputError(f"caster.pyrometer.{i}.on: '{one.on}': {known}")
        self._places = places
        self._vertices = [names[one.on] for one in places]
        self.passed = [list(one) for one in passed]
        self._before = self._seen(run)

    def _seen(self, run: RunState) -> tuple[float, Array]:
        thermal = run.state.thermal
        return thermal.time, thermal.point.temperature[self._vertices]

    def go_on(self, run: RunState) -> None:
        """Continue from the present position of the slice, without the positions before."""
        self._before = self._seen(run)

    def note(self, run: RunState) -> None:
        """Process a committed step."""
        (before, old), (now, new) = self._before, self._seen(run)
        for i, one in enumerate(self._places):
            at = run.simulation.machine.time_at(one.at)
            if before < at <= now:
                found = float(np.interp(at, [before, now], [old[i], new[i]]))
                self.passed.append([i, at, found])
        self._before = now, new


def rows(caster: Caster, looks: Sequence[Look]) -> list[Row]:
    """Return the readings since the previous output, in their order."""
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
