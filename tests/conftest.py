"""Fixtures and settings of all tests: ranks, synthetic runs, the command line, logged warnings."""

from __future__ import annotations

import gc
import importlib.metadata
import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from hypothesis import given, settings, strategies

if TYPE_CHECKING:
    import pandas as pd

sys.path.insert(0, str(Path(__file__).parent))
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Each of hundreds of compiled forms asks setuptools six times for the entry points of all
# installed packages, which reads their metadata each time.
importlib.metadata.entry_points = lru_cache(importlib.metadata.entry_points)

# A run waits for the disk forty times, longer than a small one computes. Tests kill processes,
# which loses nothing that the operating system has buffered; no test cuts the power.
os.fsync = lambda _handle: None

# The same examples every time, and no deadline: a slow machine is no failure.
settings.register_profile(
    "castfem", deadline=None, derandomize=True, database=None, max_examples=30
)
settings.register_profile("search", deadline=None, max_examples=3000, database=None)
settings.load_profile("castfem")


def pytest_configure(config: pytest.Config) -> None:
    """Let only rank 0 report."""
    from mpi4py import MPI

    if MPI.COMM_WORLD.size > 1 and MPI.COMM_WORLD.rank > 0:
        reporter = config.pluginmanager.getplugin("terminalreporter")
        if reporter is not None:
            reporter._tw._file = open(os.devnull, "w")  # noqa: SIM115


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that contain long tests, so that no worker waits for one at the end."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_collection_finish() -> None:
    """Hide imported modules from the garbage collector after a first call of Hypothesis.

    Hypothesis looks once for random number generators among the objects of the collector.
    """
    given(strategies.none())(lambda nothing: None)()
    _hide_imported()


_hidden = 0


def _hide_imported() -> None:
    """Hide modules from the garbage collector, which every run calls at its end.

    It would search all of them, hundreds of times: a fifth of the cost of small runs.
    """
    global _hidden
    if len(sys.modules) > _hidden:
        gc.collect()
        gc.freeze()
        _hidden = len(sys.modules)


@pytest.fixture(autouse=True)
def collect_together() -> Iterator[None]:
    """Free PETSc objects on all ranks at the same moment: their destructors are collective."""
    yield
    if "mpi4py.MPI" in sys.modules:
        from mpi4py import MPI

        if MPI.COMM_WORLD.size > 1:
            gc.collect()
            MPI.COMM_WORLD.Barrier()
            return  # what a single rank has imported must not decide what it frees
    _hide_imported()


@pytest.fixture
def told(caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    """Collect the warnings of castfem, independent of changes of its logger by an earlier test."""
    from castfem.base.log import end_file, logger

    end_file()  # of an earlier run, made without the command line
    before, logger.propagate = logger.propagate, False
    logger.addHandler(caplog.handler)
    with caplog.at_level("WARNING", logger.name):
        yield caplog
    logger.propagate = before
    logger.removeHandler(caplog.handler)


class Here(Executor):
    """Executor that does the runs of a sweep in this process."""

    def __init__(self, count: int, noise: Path) -> None:
        pass

    def submit(self, function: Any, /, *args: Any, **keywords: Any) -> Future[Any]:
        """Call the function immediately."""
        call: Future[Any] = Future()
        call.set_result(function(*args, **keywords))
        return call


@pytest.fixture
def runs_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a sweep start no processes (tests/cli/test_cli_sweep.py tests those)."""
    from castfem.studies.sweep import workers

    monkeypatch.setattr(workers, "Processes", Here)


class Outcome(NamedTuple):
    """Exit status of a command and its printed text."""

    status: int
    out: str
    err: str


@pytest.fixture
def castfem(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Callable[..., Outcome]:
    """Run the command line in this process, in an empty folder; not as a rank of a launcher."""
    from castfem.cli import execute

    for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)

    def _run(*words: object) -> Outcome:
        capsys.readouterr()
        status = execute([str(word) for word in words])
        return Outcome(status, *capsys.readouterr())

    return _run


@pytest.fixture
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a temporary folder that is the same on all ranks."""
    from mpi4py import MPI

    folder = str(tmp_path_factory.mktemp("shared")) if MPI.COMM_WORLD.rank == 0 else None
    return Path(MPI.COMM_WORLD.bcast(folder))


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a finished run; not to be changed."""
    from synthetic_run import write_run

    return write_run(tmp_path_factory.mktemp("finished"))


@pytest.fixture(scope="session")
def strained_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run with mechanics; not to be changed."""
    from strained_run import write_strained

    return write_strained(tmp_path_factory.mktemp("strained"))


@pytest.fixture
def table(strained_run: Path) -> pd.DataFrame:
    """Return the history of the run with mechanics."""
    from castfem.runs.output.history import read_history

    return read_history(strained_run / "history.csv")
