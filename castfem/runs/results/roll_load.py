"""Roll forces and bulging between the rolls, from the history of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity, to_si
from castfem.base.shown_units import documented, said
from castfem.model.machine import thickness_of
from castfem.physics.machine.stations import Stations
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.results.labels import has_values, unit_of
from castfem.runs.results.run_case import case_with

_FORCE, BULGE = "roll_force", "bulge_pitch"
_NAMES = {_FORCE: "force on roll {}, a metre of width", BULGE: "bulge below roll {}"}


@dataclass(frozen=True, slots=True)
class RollLoads:
    """Force on each pair of rolls, and largest bulge in the pitch below it."""

    stations: Stations  #: the rolls
    #: values by column name and number of the pair, from 1
    values: Mapping[str, Mapping[int, float]]
    units: Mapping[str, str]  #: units of the columns

    @classmethod
    def of(cls, folder: Path) -> RollLoads | None:
        """Read those of a run; None without rolls or bulging."""
        case = case_with(folder, "bulging")
        rolls = None if case is None or case.machine is None else case.machine.pairs()
        if case is None or rolls is None:
            return None
        thickness = thickness_of(case.section) or 0.0
        return cls.read(folder, Stations(rolls, thickness, case.mould_exit()))

    @classmethod
    def read(cls, folder: Path, stations: Stations) -> RollLoads | None:
        """Read those of a run with known rolls; None without rolls or bulging.

        The history has the force on a pair in the rows of the pitch below it, up to and including
        the next pair.
        """
        if stations.rolls is None:
            return None
        try:
            table = read_columns(folder / HISTORY_NAME)
        except InputError:  # reported where its figures are drawn
            return None
        having = [name for name in (_FORCE, BULGE) if has_values(table, name)]
        if not having:
            return None
        position, places = table["position"], [p.position for p in stations.rolls.pairs]
        values: dict[str, dict[int, float]] = {name: {} for name in having}
        for number, (start, end) in enumerate(pairwise([*places, np.inf]), start=1):
            rows = (position > start + ROUNDING) & (position <= end + ROUNDING)
            for name in having:
                part = table[name][rows]
                if np.isfinite(part).any():
                    values[name][number] = float(np.nanmax(part))
        return cls(stations, values, {name: unit_of(table, name) for name in having})

    def largest(self, name: str) -> tuple[int, float] | None:
        """Number and value of the pair with the largest value; None if none is above 0."""
        found = self.values.get(name, {})
        number = max(found, key=lambda one: found[one], default=0)
        return (number, found[number]) if number and found[number] > 0.0 else None

    def quantities(self) -> dict[str, Quantity]:
        """Largest bulge and force, for tables of many runs."""
        labels = {
            BULGE: ("bulge_largest", "largest bulge between rolls"),
            _FORCE: ("roll_force_largest", "largest force on a roll, a metre of width"),
        }
        found = {}
        for column, (name, label) in labels.items():
            if (one := self.largest(column)) is not None:
                unit = documented(self.units[column])
                found[name] = Quantity(to_si(one[1], unit), unit, label)
        return found

    def changes(self, base: RollLoads) -> Iterator[str]:
        """Yield where force and bulge differ most from those of another run with the same rolls."""
        for name, words in _NAMES.items():
            ours, theirs = self.values.get(name, {}), base.values.get(name, {})
            both = [number for number in ours if number in theirs]
            number = max(both, key=lambda one: abs(ours[one] - theirs[one]), default=0)
            if not number:
                continue
            before, now = theirs[number], ours[number]
            if abs(now - before) > 0.05 * max(now, before):
                unit = documented(self.units[name])
                values = (said(value, unit, ".3g", name) for value in (before, now))
                where = self.where(number)
                yield f"{words.format(number)}: {' -> '.join(values)}, at {where}"

    def where(self, number: int) -> str:
        """Position of a pair as text."""
        assert self.stations.rolls is not None, "it has forces"
        return self.stations.words(self.stations.rolls.pairs[number - 1].position)


def heaviest_roll(folder: Path, stations: Stations) -> Iterator[tuple[str, str]]:
    """Yield the largest force on a pair of rolls, and which pair; nothing without bulging."""
    loads = RollLoads.read(folder, stations)
    found = None if loads is None else loads.largest(_FORCE)
    if loads is None or found is None:
        return
    number, force = found
    most = said(force, documented(loads.units[_FORCE]), ".3g", _FORCE)
    yield f"largest force on a roll, {most} of width", loads.where(number)
