"""Runs that are stopped by their user, and are resumed."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import pytest

from castfem.base.progress import Progress
from castfem.model import Case
from castfem.runs import loop


class Interrupted(Progress):
    """Progress display that raises KeyboardInterrupt after a number of steps."""

    def __init__(self, steps: int) -> None:
        super().__init__(verbosity=-1, terminal=False)
        self.left = steps

    def update(self, *step: object) -> None:  # type: ignore[override]
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def stopped(case: Case, folder: Path, steps: int) -> None:
    """Run a case on one rank until it is stopped after `steps` steps."""
    with pytest.raises(KeyboardInterrupt):
        loop.run(case, folder, comm=MPI.COMM_SELF, progress=Interrupted(steps))


def history_of(case: Case, folder: Path, stopped_after: int = 0) -> bytes:
    """Return the history of a run on one rank that is stopped after some steps (0: never)."""
    if stopped_after:
        stopped(case, folder, stopped_after)
    loop.run(case, folder, comm=MPI.COMM_SELF, resume=stopped_after > 0)
    return (folder / "history.csv").read_bytes()
