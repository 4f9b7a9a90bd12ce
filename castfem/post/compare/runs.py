"""Reads the runs to compare from their folders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.base.units import nearest
from castfem.runs.output.folder import CASTER_NAME
from castfem.runs.output.history import HISTORY_NAME, last_row, needs_strand, read_history
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import derived
from castfem.studies.sweep.plan import brief
from castfem.studies.sweep.record import SWEEP_NAME, Record

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, slots=True)
class Run:
    """A finished run."""

    folder: Path  #: folder of the run
    label: str  #: its name among the runs
    summary: Summary  #: its results

    def history(self) -> pandas.DataFrame | None:
        """Its history, None if there is none with two rows.

        Raises:
            InputError: The file is damaged.
        """
        path = self.folder / HISTORY_NAME
        if not path.is_file():
            return None
        table = read_history(path)
        return table if len(table) > 1 else None

    def speed_and_length(self) -> tuple[float, float] | None:
        """Mean casting speed [m/s] and length followed [m]; None without a history."""
        table = self.history()
        if table is None:
            return None
        time, position = (float(table[name].iloc[-1]) for name in ("time", "position"))
        return position / time, position


def read_runs(folders: Sequence[Path]) -> list[Run]:
    """Return the runs in some folders; the folder of a sweep stands for all its finished runs."""
    problems: list[str] = []
    found: list[Run] = []
    for folder in folders:
        try:
            found += _sweep(folder) if (folder / SWEEP_NAME).is_file() else [_run(folder)]
        except InputError as error:
            problems += error.problems
    known: dict[Path, Run] = {}
    for run in found:
        known.setdefault(run.folder.resolve(), run)
    if not problems and len(known) < 2:
        problems.append("two runs are needed to compare")
    if problems:
        raise InputError(problems)
    return _distinct(list(known.values()))


def alone(folder: Path) -> Run | None:
    """Return the run in a folder; None if it holds a sweep."""
    return None if (folder / SWEEP_NAME).is_file() else _run(folder)


def _run(folder: Path, label: str = "") -> Run:
    if not folder.is_dir():
        raise InputError(f"{folder}: {'not a' if folder.exists() else 'no such'} folder")
    if (folder / CASTER_NAME).is_file():
        fix = f"use castfem show {folder}, or castfem report {folder} alone"
        raise InputError(f"{folder}: is a caster of many slices; {fix}")
    status = RunRecord.load(folder).status
    summary = Summary.load(folder)
    if summary is None:
        raise InputError(
            f"{folder}: the run has not ended ({status}); wait for it, or leave it out"
        )
    if (folder / HISTORY_NAME).is_file() and (last := last_row(folder / HISTORY_NAME)):
        needs_strand(last[1], folder)
    summary = replace(summary, quantities={**summary.quantities, **derived(folder, summary)})
    label = label or folder.resolve().name
    return Run(folder, label if status == "finished" else f"{label} ({status})", summary)


def _sweep(folder: Path) -> list[Run]:
    """Read the finished runs of a sweep, labelled by the varied values."""
    found = []
    for name, entry in Record(folder).entries.items():
        if entry.physics:
            found.append(_run(folder / name, entry.label or ", ".join(brief(entry.given)) or name))
    if not found:
        raise InputError(f"{folder}: none of the runs of this sweep has finished")
    labels = [run.label for run in found]
    return [
        replace(run, label=run.folder.name) if labels.count(run.label) > 1 else run for run in found
    ]


def _distinct(runs: Sequence[Run]) -> list[Run]:
    """Add the names of parent folders to equal labels."""
    labels = [run.label for run in runs]
    return [
        replace(run, label=f"{run.folder.resolve().parent.name}/{run.label}")
        if labels.count(run.label) > 1
        else run
        for run in runs
    ]


def heat_shared(runs: Sequence[Run]) -> list[str]:
    """Return warnings about comparing runs of different speeds, one line per mould law."""
    from castfem.model.checks.shared_heat import shared_heat
    from castfem.runs.results.run_case import case_with

    cases = [case_with(run.folder, "power", "water_rise", "position") for run in runs]
    return shared_heat(case for case in cases if case is not None)


def base_of(runs: Sequence[Run], named: str | None) -> Run:
    """Return the reference run: the named one, or the idealised one, or the first."""
    if named is None:
        return next((run for run in runs if run.label == "idealised"), runs[0])
    for run in runs:
        if named == run.label or Path(named).resolve() == run.folder.resolve():
            return run
    labels = [run.label for run in runs]
    raise InputError(
        f"--base {named}: not one of the runs ({', '.join(labels)}){nearest(named, labels)}"
    )
