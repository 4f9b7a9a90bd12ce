"""The runs that tell the error of a case: one size scaled at a time, in a folder as of a sweep."""

from __future__ import annotations

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
from castfem.studies.accuracy.sizes import COUPLING, MESH, STEP
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
_DEARER = {MESH: 2.0, STEP: 0.5, COUPLING: 1.0}  # time goes with this power of 1 / factor


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
    return 1.0 if not level.axis else level.factor ** -_DEARER[level.axis]


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
