"""Progress and log: lines in a pipe, a bar on a terminal, silence if quiet, no line per step."""

from __future__ import annotations

import io
import logging
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from castfem.base import log
from castfem.base import progress as module
from castfem.base.progress import Progress


@pytest.fixture(autouse=True)
def _clean():
    yield
    log.close()
    log.logger.setLevel(logging.INFO)


@pytest.fixture
def clock(monkeypatch):
    """Return a clock that the test moves."""

    class Clock:
        now = 100.0

    monkeypatch.setattr(module.time, "perf_counter", lambda: Clock.now)
    return Clock


def _advance(progress: Progress, clock, steps: int, seconds: float) -> None:
    progress.start(0.6)
    for step in range(1, steps + 1):
        clock.now += seconds / steps
        progress.update(0.6 * step / steps, 10.0 * step / steps, 3, 10.0 / steps, "mould")
    progress.stop()


def test_plain_lines_every_five_percent(capsys, clock):
    log.setup()
    _advance(Progress(terminal=False), clock, 1000, 100.0)
    lines = capsys.readouterr().err.splitlines()
    assert 20 <= len(lines) <= 21
    assert len(set(lines)) == len(lines)
    assert lines[0].startswith("  5 %  0.030 of 0.600 m  t = 0.500 s  step 10 ms")
    assert "Newton 3.0 a step" in lines[0]
    assert "elapsed 0:05  left 1:35  mould" in lines[0]
    assert lines[-1].startswith("100 %  0.600 of 0.600 m")


def test_slow_run_prints_every_ten_seconds(capsys, clock):
    log.setup()
    _advance(Progress(terminal=False), clock, 100_000, 10_000.0)
    assert 900 < len(capsys.readouterr().err.splitlines()) < 1100


def test_resumed_run_estimates_from_its_start(capsys, clock):
    log.setup()
    progress = Progress(terminal=False)
    progress.start(0.6, position=0.3)
    clock.now += 10.0
    progress.update(0.4, 6.0, 2, 0.05)
    assert "left 0:20" in capsys.readouterr().err


def test_quiet(capsys, clock, tmp_path):
    log.setup(-1)
    log.to_file(tmp_path / "run.log")
    _advance(Progress(-1, terminal=False), clock, 100, 100.0)
    log.logger.warning("mind the gap")
    log.close()
    assert capsys.readouterr().err == "castfem: warning: mind the gap\n"
    assert "100 %" in (tmp_path / "run.log").read_text()


def test_bar_on_a_terminal(monkeypatch, clock, tmp_path):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    log.setup()
    log.to_file(tmp_path / "run.log")
    _advance(Progress(), clock, 50, 10.0)
    log.close()
    shown = screen.getvalue()
    assert "0.300 of 0.600 m" in shown
    assert "Newton 3, step 200 ms" in shown
    assert "elapsed" not in shown
    assert "elapsed" in (tmp_path / "run.log").read_text()


def test_log_does_not_change_the_root_logger(capsys):
    before = list(logging.getLogger().handlers), logging.getLogger().level
    log.setup(1)
    logging.getLogger("castfem.physics.thermal").debug("a step")
    logging.getLogger("other").info("unheard")
    assert (list(logging.getLogger().handlers), logging.getLogger().level) == before
    assert capsys.readouterr().err == "a step\n"


def test_level_depends_on_verbosity(capsys):
    for verbosity, expected in ((-1, ""), (0, "stage\n"), (1, "stage\nstep\n")):
        log.setup(verbosity)
        log.logger.info("stage")
        log.logger.debug("step")
        assert capsys.readouterr().err == expected


def test_other_ranks_are_silent(capsys, tmp_path):
    log.setup(1, rank=1)
    log.to_file(tmp_path / "run.log")
    log.logger.error("on rank 1")
    assert capsys.readouterr().err == ""
    assert not (tmp_path / "run.log").exists()


def test_next_run_has_its_own_file(tmp_path):
    """A script does many runs in one process, without `setup`."""
    for name in ("a.log", "b.log"):
        log.to_file(tmp_path / name)
        log.logger.info("in %s", name)
    log.close()
    assert (tmp_path / "a.log").read_text().endswith("in a.log\n")
    assert (tmp_path / "b.log").read_text().endswith("in b.log\n")
    assert len((tmp_path / "a.log").read_text().splitlines()) == 1


def test_file_is_continued(tmp_path):
    path = tmp_path / "run.log"
    for words in ("first", "second"):
        log.setup(-1)
        log.to_file(path, append=words == "second")
        log.logger.info(words)
        log.close()
    lines = path.read_text().splitlines()
    assert [line.rpartition(" ")[2] for line in lines] == ["first", "second"]
    assert lines[0][:2] == "20"


def test_time_left_is_read_back_from_a_line(capsys, clock):
    log.setup()
    _advance(Progress(terminal=False), clock, 1000, 10_000.0)
    lines = capsys.readouterr().err.splitlines()
    left = [module.time_left(line) for line in lines]
    assert left[-1] == 0.0 and left[0] == pytest.approx(9990.0, abs=1.0)
    assert module.time_left("the steps are short, left 0:07") is None


@pytest.mark.parametrize(("length", "reported"), [(1000.0, True), (0.6, False)])
def test_run_of_hours_is_reported_early(clock, monkeypatch, length, reported) -> None:
    """Short steps at its begin do not count: 1 mm a second after 3 s."""
    progress = Progress(terminal=False)
    progress.start(length)
    place, warned = 0.0, []
    monkeypatch.setattr(module._logger, "warning", lambda text, *given: warned.append(text % given))
    for _ in range(30):
        clock.now += 0.5
        place += 1e-6 if clock.now <= 103.0 else 5e-4
        progress.update(place, 10.0 * place, 3, 0.5)
    assert len(warned) == reported
    assert not reported or "takes about 277.8 more hours" in warned[0]


# The log of a run on a full disk: one line reports it, and the run continues


@contextmanager
def small_files(size: int) -> Iterator[None]:
    """Limit the size of files: writing fails as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_full_disk_gives_one_line_about_the_log(
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
    printed = capsys.readouterr().err.splitlines()
    steps = [f"step {number} of a run" for number in range(100)]
    assert [line for line in printed if not line.startswith("castfem: ")] == [
        *steps, "space again", "lost",
    ]  # fmt: skip
    (line,) = (line for line in printed if line.startswith("castfem: "))
    assert line == "castfem: warning: run.log: cannot be written (File too large)"
    text = (tmp_path / "run.log").read_text()
    assert text.endswith("space again\n") and "step 0 of a run" in text
