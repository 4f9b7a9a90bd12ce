"""An error that reads like the end of typed input is a failure, not an interruption."""

from __future__ import annotations

import json
from pathlib import Path

from mpi4py import MPI

import pytest
from small_case import small

from castfem.runs import loop


@pytest.mark.parametrize("place", ["build", "TimeLoop.advance"])
def test_an_end_of_file_is_not_an_interruption(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    def cut_off(*_: object) -> None:
        raise EOFError("Ran out of input")

    monkeypatch.setattr(f"castfem.runs.loop.{place}", cut_off)
    with pytest.raises(EOFError, match="Ran out of input"):
        loop.run(small(), tmp_path, comm=MPI.COMM_SELF)
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["status"] == "failed" and "Ran out of input" in record["reason"]
