"""Which sizes bring the numbers of a case to an error, and how long a run with them takes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from castfem.base.errors import InputError
from castfem.studies.accuracy.sizes import AXES, COUPLING, MESH, STEP
from castfem.studies.accuracy.table import ErrorTable

_FINEST: Mapping[str, float] = {MESH: 0.25, STEP: 0.125, COUPLING: 0.125}
# Power of 1 / factor that the time goes with: what is taken if the runs do not tell, least, most.
_DEARER: Mapping[str, tuple[float, float, float]] = {
    MESH: (2.0, 1.0, 3.0),
    STEP: (0.5, 0.0, 1.2),
    COUPLING: (1.0, 0.3, 1.2),
}


@dataclass(frozen=True, slots=True)
class Proposal:
    """Sizes for an error that is asked for."""

    factors: Mapping[str, float]  #: of the sizes of the case, by axis
    seconds: float  #: how long a run with them is expected to take
    now: float  #: how long one of the case as it is has taken
    unreached: Mapping[str, float]
    """Numbers that no sizes within reach bring there, with the share that is left."""


def read_share(text: str) -> float:
    """Return the share that `1%` or `0.5 %` means."""
    number, percent, rest = text.strip().partition("%")
    try:
        share = 0.01 * float(number)
    except ValueError:
        share = math.nan
    if not percent or rest or not 0.0 < share < 1.0:
        raise InputError(f"--to {text}: write it in percent, such as 1%")
    return share


def propose(table: ErrorTable, names: Sequence[str], share: float) -> Proposal:
    """Return the sizes of the shortest run whose errors are small enough.

    Each part of an error scales with the order that its sizes have shown, or else linearly.

    Args:
        table: The errors of the case as it is.
        names: Results that count.
        share: Allowed error of each, over its `Entry.scale`.
    """
    entries = {
        name: table.quantities[name]
        for name in names
        if math.isfinite(table.quantities[name].error()) and table.quantities[name].scale > 0.0
    }
    axes = [a for a in AXES if any(a in entry.parts for entry in entries.values())]
    finest = {axis: _FINEST[axis] for axis in axes}
    unreached = {
        name: entry.error(finest) / entry.scale
        for name, entry in entries.items()
        if entry.error(finest) > share * entry.scale
    }
    wanted = [entry for name, entry in entries.items() if name not in unreached]
    dearer = {axis: _exponent(table, axis) for axis in axes}
    best, least = finest, math.inf
    for chosen in itertools.product(*(_choices(axis) for axis in axes)):
        factors = dict(zip(axes, chosen, strict=True))
        work = math.prod(factors[axis] ** -dearer[axis] for axis in axes)
        if work < least and all(e.error(factors) <= share * e.scale for e in wanted):
            best, least = factors, work
    now = next(run.seconds for run in table.runs if not run.axis)
    if not wanted:
        best, least = dict.fromkeys(axes, 1.0), 1.0
    return Proposal(best, now * least, now, unreached)


def _choices(axis: str) -> list[float]:
    """The factors that are tried, from 2, the coarsest that has been run, to the finest."""
    steps = 4  # factors between 1 and 2
    last = round(steps * math.log2(_FINEST[axis]))
    return [2.0 ** (i / steps) for i in range(steps, last - 1, -1)]


def _exponent(table: ErrorTable, axis: str) -> float:
    """How the time grows with finer sizes, by the run with the finest ones."""
    usual, least, most = _DEARER[axis]
    now = next(run.seconds for run in table.runs if not run.axis)
    finer = [r for r in table.runs if r.axis == axis and r.factor < 1.0 and not r.message]
    if not finer or now <= 0.0:
        return usual
    finest = min(finer, key=lambda run: run.factor)
    if finest.seconds <= 0.0:
        return usual
    found = math.log(finest.seconds / now) / -math.log(finest.factor)
    return min(max(found, least), most)
