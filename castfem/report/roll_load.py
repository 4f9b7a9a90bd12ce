"""Which pair of rolls the shell presses on most, from the history of a run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from castfem.errors import InputError
from castfem.machine.stations import Stations
from castfem.output.history import HISTORY_NAME, read_history
from castfem.plots.history import has_values, unit_of
from castfem.values.same_place import ROUNDING
from castfem.values.shown_units import documented, said

_FORCE = "roll_force"


def heaviest_roll(folder: Path, stations: Stations) -> Iterator[tuple[str, str]]:
    """The largest force on a pair of rolls, and which pair it is; nothing without bulging.

    The history has the force on a pair in the rows of the pitch below it, the one at the next pair
    included.

    Args:
        folder: Of the run.
        stations: Its rolls.
    """
    if stations.rolls is None or not (folder / HISTORY_NAME).is_file():
        return
    try:
        table = read_history(folder / HISTORY_NAME)
    except InputError:  # told where its figures are drawn
        return
    if not has_values(table, _FORCE):
        return
    force = table[_FORCE].to_numpy()
    row = int(np.nanargmax(force))
    position = float(table["position"].iloc[row])
    above = [pair.position for pair in stations.rolls.pairs if pair.position < position - ROUNDING]
    if not force[row] > 0.0 or not above:
        return
    most = said(float(force[row]), documented(unit_of(table, _FORCE)), ".3g", _FORCE)
    yield f"largest force on a roll, {most} of width", stations.words(above[-1])
