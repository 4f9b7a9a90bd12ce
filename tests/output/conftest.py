"""Shared by the tests of what is written and shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.output.history import read_history

from .imagined import write_run
from .strained import write_strained


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that has ended well; not to be changed."""
    return write_run(tmp_path_factory.mktemp("finished"))


@pytest.fixture(scope="session")
def strained_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with mechanics; not to be changed."""
    return write_strained(tmp_path_factory.mktemp("strained"))


@pytest.fixture
def table(strained_run):
    """Its history."""
    return read_history(strained_run / "history.csv")
