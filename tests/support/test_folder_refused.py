"""What is said of a folder that cannot be written."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from castfem.base.atomic_files import folder_refused, saving
from castfem.base.errors import RunFailure


def test_the_reason_stands_there_once() -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    said = "out: cannot be written (No space left on device); choose another with -o"
    assert folder_refused(Path("out"), full) == said
    with pytest.raises(RunFailure) as caught, saving(Path("out/sweep.json")):
        raise full
    assert folder_refused(Path("out"), caught.value) == said
