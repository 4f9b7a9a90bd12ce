"""Run of a benchmark that is not repeated if its folder has a finished one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

from mpi4py import MPI

from castfem.base.errors import RunFailure
from castfem.model import Case
from castfem.runs import existing_run, loop
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Summary

if TYPE_CHECKING:
    import pandas as pd

CLOCK = "processor_time.txt"


@dataclass(frozen=True, slots=True)
class Finished:
    """Results of a run that has ended."""

    summary: Summary  #: its summary
    history: pd.DataFrame  #: a row for each step
    seconds: float  #: processor time since its last start, s; NaN if not known
    failure: str  #: message of a run that failed, otherwise ""


def finished_run(case: Case, folder: Path) -> Finished:
    """Run a case into a folder, unless the folder has a finished run of it.

    An interrupted run continues from its checkpoint.

    Raises:
        InputError: The folder has a run of another case.
        RunFailure: The run failed before its first summary.
    """
    existing_run.check(folder, case, resume=True, overwrite=False)
    summary, failure = Summary.load(folder), ""
    if summary is None or summary.status != "finished":
        start = process_time()
        try:
            summary = loop.run(case, folder, comm=MPI.COMM_SELF, resume=folder.exists())
        except RunFailure as error:
            failure, summary = str(error), Summary.load(folder)
            if summary is None:
                raise
        (folder / CLOCK).write_text(f"{process_time() - start:.6g}\n", encoding="utf-8")
    clock = folder / CLOCK
    seconds = float(clock.read_text(encoding="utf-8")) if clock.exists() else float("nan")
    return Finished(summary, read_history(folder / "history.csv"), seconds, failure)
