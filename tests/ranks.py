"""Python processes on several ranks, started as a user starts them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from mpi4py import MPI

import psutil
import pytest

_LAUNCHER = ("OMPI_", "PMIX_", "PMI_", "PRTE_")
_KEPT = ("OMPI_MCA_btl", "OMPI_MCA_mpi_yield_when_idle")  # the user's choice, not the launcher's
_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
# Open MPI names its session folder by its process, and does not start where a killed process has
# left a folder with the same number: each launch has its own place.
_SESSIONS = tempfile.TemporaryDirectory(prefix="ranks")
# Only Open MPI needs this option; MPICH does not have it.
_MORE_THAN_CORES = ["--oversubscribe"] if "Open MPI" in MPI.Get_library_version() else []

needs_mpirun = pytest.mark.skipif(
    shutil.which("mpirun") is None or MPI.COMM_WORLD.size > 1,
    reason="starts ranks of its own; needs mpirun",
)


def python_on(
    ranks: int, *words: str, folder: Path | None = None, timeout: float = 300.0
) -> subprocess.CompletedProcess[str]:
    """Run Python on several ranks (1: without mpirun) and return the completed process.

    Args:
        ranks: Number of ranks.
        words: Arguments of Python.
        folder: Working folder.
        timeout: Time after which the test has failed, s.
    """
    command, environment = started(ranks, words)
    return subprocess.run(
        command,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def mains(folder: Path, *commands: Sequence[str], then: Sequence[str] = ()) -> list[str]:
    """Return arguments for Python that run several commands of castfem, each of which is refused.

    The exit status is 0 if each command has ended with 1 on all ranks; if there is a command
    `then`, its status is the exit status.
    """
    script = folder / "refused.py"
    script.write_text(
        "import json, sys\nfrom castfem.cli import main\nended = []\n"
        "refused, then = json.loads(sys.argv[1])\n"
        "for words in refused:\n"
        "    try:\n        main(words)\n"
        "    except SystemExit as end:\n        ended.append(end.code)\n"
        "assert ended == [1] * len(refused), ended\n"
        "then and main(then)\n"
    )
    return [str(script), json.dumps([commands, then])]


def killed_on(
    ranks: int, *words: str, folder: Path, when: Callable[[], bool], timeout: float = 300.0
) -> None:
    """Run Python on several ranks, and kill all of them as soon as `when` is true."""
    command, environment = started(ranks, words)
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as launcher:
        end = time.monotonic() + timeout
        while not when() and launcher.poll() is None and time.monotonic() < end:
            time.sleep(0.02)
        assert launcher.poll() is None, "it ended before it could be killed"
        processes = [launcher, *psutil.Process(launcher.pid).children(recursive=True)]
        for process in processes:
            with suppress(psutil.NoSuchProcess):
                process.kill()


def started(ranks: int, words: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return command line and environment of Python on several ranks."""
    # The variables of this process's launcher would be taken for those of the new one.
    clean = {
        key: value
        for key, value in os.environ.items()
        if key in _KEPT or not key.startswith(_LAUNCHER)
    }
    launcher = ["mpirun", *_MORE_THAN_CORES, "-n", str(ranks)] if ranks > 1 else []
    if launcher:
        clean["PRTE_MCA_prte_tmpdir_base"] = tempfile.mkdtemp(dir=_SESSIONS.name)
    return [*launcher, sys.executable, *words], clean | _ROOT
