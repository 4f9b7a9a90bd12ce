"""Shared by the tests of what is written and shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from .imagined import write_run


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that has ended well; not to be changed."""
    return write_run(tmp_path_factory.mktemp("finished"))
