"""A run of a benchmark, done unless it lies finished in its folder."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

from castfem.base.errors import RunFailure
from castfem.model import Case
from castfem.runs import loop
from castfem.runs.output.summary import Summary


def finished_run(case: Case, folder: Path) -> tuple[Summary, str]:
    """Return the summary of a run, and how it failed; "" where it came to its end.

    A run that was cut short there goes on from its checkpoint.

    Raises:
        RunFailure: It failed before there was anything to sum up.
    """
    summary = Summary.load(folder)
    if summary is not None and summary.status == "finished":
        return summary, ""
    try:
        return loop.run(case, folder, comm=MPI.COMM_SELF, resume=folder.exists()), ""
    except RunFailure as error:
        summary = Summary.load(folder)
        if summary is None:
            raise
        return summary, str(error)
