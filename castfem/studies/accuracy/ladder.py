"""The runs for the errors of a case, each with one size scaled, in a folder like that of a sweep.

Also proposes sizes for a given error, with the duration of such a run.
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
from castfem.runs.output.summary_file import Summary
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
"""Scale factors of the additional runs."""
_FINEST: Mapping[str, float] = {MESH: 0.25, STEP: 0.125, COUPLING: 0.125}
# Exponent of the run time over 1 / factor: default if it is not known, smallest, largest.
_DEARER: Mapping[str, tuple[float, float, float]] = {
    MESH: (2.0, 1.0, 3.0),
    STEP: (0.5, 0.0, 1.2),
    COUPLING: (1.0, 0.3, 1.2),
}


@dataclass(frozen=True, slots=True)
class Level:
    """One of the runs for the errors of a case."""

    name: str  #: name of its folder
    axis: str  #: scaled size; "" for the case itself
    factor: float  #: scale factor
    case: Case  #: the case with these sizes
    problem: str = ""  #: why it cannot be run; "" if it can

    @property
    def text(self) -> str:
        """Description in tables: "mesh x 1.41"."""
        return f"{self.axis} x {self.factor:.3g}" if self.axis else "as it is"


def levels(case: Case) -> tuple[Level, ...]:
    """Return the runs of a case, the cheapest first.

    Runs other than that of the case write one field, if the case writes any. Sizes that are refused
    by a check of the case (cells larger than a face) give a level with a problem.
    """
    found = [Level(BASE, "", 1.0, case)]
    for axis in sizes.axes_of(case):
        factors = FACTORS[axis]
        if axis == STEP and sizes.steps_fill_windows(case):
            factors = (0.5, 0.25)  # the windows limit the step, which cannot be longer
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
    """Return the keys with which a case writes little but takes the same steps.

    Steps and windows end where fields are written: one field is kept if there are any.
    """
    return {"output.fields": list(case.output_fields[:1]), "output.figures": False}


def _cost(level: Level) -> float:
    return 1.0 if not level.axis else level.factor ** -_DEARER[level.axis][0]


@dataclass(frozen=True, slots=True)
class Ladder:
    """The runs of a case in their folder."""

    levels: tuple[Level, ...]  #: all levels
    record: Record  #: record of finished runs
    jobs: tuple[Job, ...]
    """Runs still to be made; an interrupted run continues from its checkpoint."""
    at: tuple[float, ...] = ()
    """Positions whose errors are requested, m, besides the exit of the mould."""

    @property
    def runnable(self) -> tuple[Level, ...]:
        """Levels whose sizes the case allows."""
        return tuple(level for level in self.levels if not level.problem)

    def table(self) -> ErrorTable:
        """Return the errors from the finished runs."""
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
        """Results of the runs at the requested positions, and at the mould's end if above."""
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
    """Whether two positions (m) are equal."""
    return abs(one - other) <= ROUNDING * max(abs(one), abs(other))


def prepare(
    levels: Sequence[Level], folder: Path, *, overwrite: bool = False, at: Sequence[float] = ()
) -> Ladder:
    """Check which runs in a folder are finished, and prepare the rest.

    Args:
        levels: The runs.
        folder: Folder of the runs.
        overwrite: Repeat all runs, also over runs of other cases.
        at: Positions whose errors are requested, m.
    """
    runnable = [
        Variant(one.name, {"sizes": one.text}, one.case) for one in levels if not one.problem
    ]
    record, jobs = prepare_runs(folder, runnable, resume=not overwrite, overwrite=overwrite)
    return Ladder(tuple(levels), record, jobs, tuple(at))


@dataclass(frozen=True, slots=True)
class Proposal:
    """Proposed sizes for a given error."""

    factors: Mapping[str, float]  #: scale factors of the case's sizes, by axis
    seconds: float  #: predicted duration of a run with them
    now: float  #: duration of a run of the case
    unreached: Mapping[str, float]
    """Numbers whose error remains larger with all available sizes, with that error as a fraction.
    """


def read_share(text: str) -> float:
    """Return the fraction given as `1%` or `0.5 %`."""
    number, percent, rest = text.strip().partition("%")
    try:
        share = 0.01 * float(number)
    except ValueError:
        share = math.nan
    if not percent or rest or not 0.0 < share < 1.0:
        raise InputError(f"--to {text}: write it in percent, above 0 and below 100, such as 1%")
    return share


def propose(table: ErrorTable, names: Sequence[str], share: float) -> Proposal:
    """Return the sizes of the fastest run with sufficiently small errors.

    Each part of an error scales with its observed order, or else linearly.

    Args:
        table: The errors of the case.
        names: Results to consider.
        share: Allowed error of each, relative to its `Entry.scale`.
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
    """The tried factors from 2, the coarsest run, to the finest."""
    steps = 4  # factors between 1 and 2
    last = round(steps * math.log2(_FINEST[axis]))
    return [2.0 ** (i / steps) for i in range(steps, last - 1, -1)]


def _exponent(table: ErrorTable, axis: str) -> float:
    """Exponent of the run time for finer sizes, from the finest run."""
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
