"""What cannot change during a run is asked for once, however often a run saves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import pytest
from small_case import small

from castfem.model import Case
from castfem.runs import loop
from castfem.runs.output.checkpoint import CHECKPOINT_NAME, load_checkpoint


def test_the_case_is_written_out_once_for_all_checkpoints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = small({"output.checkpoint_every": 1})
    tables, asked = case.physics(), 0

    def physics(self: Case) -> dict[str, Any]:
        nonlocal asked
        asked += 1
        return tables

    monkeypatch.setattr(Case, "physics", physics)
    loop.run(case, tmp_path, comm=MPI.COMM_SELF)
    assert len((tmp_path / "history.csv").read_text().splitlines()) > 10  # a save for each
    assert asked == 1
    monkeypatch.undo()
    # What is kept is still the case, and is held against it.
    load_checkpoint(tmp_path / CHECKPOINT_NAME, physics=case.physics_hash(), case=tables)
