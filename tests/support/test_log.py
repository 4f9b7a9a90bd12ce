"""The log of a run on a full disk: one line says so, and it ends no run."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from castfem.base import log


@contextmanager
def small_files(size: int) -> Iterator[None]:
    """No file can grow beyond so many bytes: writing fails as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_costs_the_log_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log.setup()
    try:
        log.to_file(tmp_path / "run.log")
        with small_files(4096):
            for number in range(100):
                log.logger.info("step %d of a run", number)
        assert (tmp_path / "run.log").stat().st_size == 4096
        log.logger.info("space again")
        with small_files(4096):
            log.logger.info("lost")
            log.end_file()  # as at the end of a run
    finally:
        log.close()
    told = capsys.readouterr().err.splitlines()
    steps = [f"step {number} of a run" for number in range(100)]
    assert [line for line in told if not line.startswith("castfem: ")] == [
        *steps, "space again", "lost",
    ]  # fmt: skip
    (line,) = (line for line in told if line.startswith("castfem: "))
    assert line == "castfem: warning: run.log: cannot be written (File too large)"
    text = (tmp_path / "run.log").read_text()
    assert text.endswith("space again\n") and "step 0 of a run" in text
