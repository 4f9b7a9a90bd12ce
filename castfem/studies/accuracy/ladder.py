"""The runs that tell the error of a case: one size scaled at a time, in a folder as of a sweep.

And what they propose: which sizes bring its numbers to an error, and how long that run takes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError, RunFailure
from castfem.base.shown_quantity import Quantity
from castfem.model import Case
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary import Summary
from castfem.runs.results.labels import quantities_at
from castfem.studies.accuracy import sizes
from castfem.studies.accuracy.sizes import AXES, COUPLING, MESH, STEP
from castfem.studies.accuracy.table import ErrorTable, Ran, gather
from castfem.studies.sweep.plan import Variant
from castfem.studies.sweep.record import Record
from castfem.studies.sweep.record import prepare as prepare_runs
from castfem.studies.sweep.work import Job

BASE = "base"
FACTORS: Mapping[str, tuple[float, ...]] = {
    MESH: (2.0, 2.0**0.5, 2.0**-0.5),
    STEP: (2.0, 0.5),
    COUPLING: (2.0, 0.5),
}
"""Of the runs beside that of the case itself."""
_FINEST: Mapping[str, float] = {MESH: 0.25, STEP: 0.125, COUPLING: 0.125}
# Power of 1 / factor that the time goes with: what is taken if the runs do not tell, least, most.
_DEARER: Mapping[str, tuple[float, float, float]] = {
    MESH: (2.0, 1.0, 3.0),
    STEP: (0.5, 0.0, 1.2),
    COUPLING: (1.0, 0.3, 1.2),
}


@dataclass(frozen=True, slots=True)
class Level:
    """A run of the ladder."""

    name: str  #: of its folder
    axis: str  #: which of the sizes is scaled; "" for the case itself
    factor: float  #: by how much
    case: Case  #: the case with these sizes
    problem: str = ""  #: why it cannot be run, empty if it can

    @property
    def text(self) -> str:
        """What tables call it: "mesh x 1.41"."""
        return f"{self.axis} x {self.factor:.3g}" if self.axis else "as it is"


def levels(case: Case) -> tuple[Level, ...]:
    """Return the runs of a case, the cheapest first.

    Runs beside that of the case itself write one field, if that writes any. Sizes that a check of
    the case refuses (cells larger than a face) make a level with a problem.
    """
    found = [Level(BASE, "", 1.0, case)]
    for axis in sizes.axes_of(case):
        factors = FACTORS[axis]
        if axis == STEP and sizes.steps_fill_windows(case):
            factors = (0.5, 0.25)  # the windows limit the step: no longer one
        found += [_level(case, axis, factor) for factor in factors]
    return tuple(sorted(found, key=_cost))


def _level(case: Case, axis: str, factor: float) -> Level:
    name = f"{axis}_x{factor:.3g}"
    try:
        scaled = case.with_(sizes.changes(case, {axis: factor}) | quiet(case))
    except InputError as error:
        return Level(name, axis, factor, case, "; ".join(error.problems))
    return Level(name, axis, factor, scaled)


def quiet(case: Case) -> dict[str, Any]:
    """Return the keys with which a case writes little, and takes the same steps.

    Steps and windows end where fields are written: one of them is kept if there are any.
    """
    return {"output.fields": list(case.output_fields[:1]), "output.figures": False}


def _cost(level: Level) -> float:
    return 1.0 if not level.axis else level.factor ** -_DEARER[level.axis][0]


@dataclass(frozen=True, slots=True)
class Ladder:
    """The runs of a case in their folder."""

    levels: tuple[Level, ...]  #: all of them
    record: Record  #: of what is finished
    jobs: tuple[Job, ...]
    """What is still to be run; a run that was cut short goes on from its checkpoint."""
    at: tuple[float, ...] = ()
    """Places on the way whose errors are asked for, m, besides the exit of the mould."""

    @property
    def runnable(self) -> tuple[Level, ...]:
        """Those whose sizes the case allows."""
        return tuple(level for level in self.levels if not level.problem)

    def table(self) -> ErrorTable:
        """Return the errors as far as the runs that have ended tell them."""
        base = next(level for level in self.levels if not level.axis)
        results: dict[str, Summary] = {}
        runs: list[Ran] = []
        for level in self.levels:
            entry = self.record.entries.get(level.name)
            message, seconds = level.problem or "not run yet", 0.0
            if not level.problem and entry is not None:
                seconds = entry.seconds
                message = entry.message or ("" if entry.physics else message)
            summary = None if message else Summary.load(self.record.folder / level.name)
            if summary is not None:
                results[level.name] = summary
            runs.append(Ran(level.name, level.axis, level.factor, seconds, message))
        if base.name not in results:
            why = next(run.message for run in runs if run.name == base.name)
            raise RunFailure(f"{self.record.folder / base.name}: no error without this run: {why}")
        return gather(base.case, self.levels, results, runs, self._on_the_way(base, results))

    def _on_the_way(
        self, base: Level, results: Mapping[str, Summary]
    ) -> dict[float, dict[str, dict[str, Quantity]]]:
        """Results of the runs where errors are asked for, and where their mould ends, if above."""
        exit_, length = results[base.name].mould_exit, base.case.casting.length
        places = list(self.at)
        if exit_ is not None and exit_ < length * (1.0 - ROUNDING):
            places += [] if any(same(exit_, at) for at in places) else [exit_]
        if not places:
            return {}
        folders = {name: self.record.folder / name for name in results}
        tables = {name: read_columns(path / HISTORY_NAME) for name, path in folders.items()}
        return {
            at: {name: quantities_at(table, at, folders[name]) for name, table in tables.items()}
            for at in sorted(places)
            if at >= float(tables[base.name]["position"][0])
        }


def same(one: float, other: float) -> bool:
    """Whether two positions (m) are one."""
    return abs(one - other) <= ROUNDING * max(abs(one), abs(other))


def prepare(
    levels: Sequence[Level], folder: Path, *, overwrite: bool = False, at: Sequence[float] = ()
) -> Ladder:
    """Look at what is finished in a folder, and make it ready for the rest.

    Args:
        levels: The runs.
        folder: Where they lie, a folder each.
        overwrite: Run all anew, also over runs of other cases.
        at: Places on the way whose errors are asked for, m.
    """
    runnable = [
        Variant(one.name, {"sizes": one.text}, one.case) for one in levels if not one.problem
    ]
    record, jobs = prepare_runs(folder, runnable, resume=not overwrite, overwrite=overwrite)
    return Ladder(tuple(levels), record, jobs, tuple(at))


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
