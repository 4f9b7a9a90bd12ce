"""Python on several ranks, started as a user starts it."""

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
# Open MPI names its folder by its process, and does not start where one that was killed has left a
# folder under the same number: each has its own place.
_SESSIONS = tempfile.TemporaryDirectory(prefix="ranks")
# Open MPI asks for leave; MPICH does not, nor does it know the word.
_MORE_THAN_CORES = ["--oversubscribe"] if "Open MPI" in MPI.Get_library_version() else []

needs_mpirun = pytest.mark.skipif(
    shutil.which("mpirun") is None or MPI.COMM_WORLD.size > 1,
    reason="starts ranks of its own; needs mpirun",
)


def python_on(
    ranks: int, *words: str, folder: Path | None = None, timeout: float = 300.0
) -> subprocess.CompletedProcess[str]:
    """Run Python on so many ranks (1: without mpirun), and return what came of it.

    Args:
        ranks: How many.
        words: Of Python's command line.
        folder: Where it runs.
        timeout: After which the test has failed, s.
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
    """Words for Python: commands of castfem one after another, each of which is refused.

    Its status is 0 if each command has left with 1 on all ranks and, if there is one, that of the
    command after them.
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
    """Run Python on so many ranks, and kill all of them as soon as something is so."""
    command, environment = started(ranks, words)
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as launcher:
        end = time.monotonic() + timeout
        while not when() and launcher.poll() is None and time.monotonic() < end:
            time.sleep(0.02)
        assert launcher.poll() is None, "it ended before it could be killed"
        every = [launcher, *psutil.Process(launcher.pid).children(recursive=True)]
        for process in every:
            with suppress(psutil.NoSuchProcess):
                process.kill()


def started(ranks: int, words: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return command line and environment of Python on so many ranks."""
    # What the launcher of this process has left would be taken for the new one's.
    clean = {
        key: value
        for key, value in os.environ.items()
        if key in _KEPT or not key.startswith(_LAUNCHER)
    }
    launcher = ["mpirun", *_MORE_THAN_CORES, "-n", str(ranks)] if ranks > 1 else []
    if launcher:
        clean["PRTE_MCA_prte_tmpdir_base"] = tempfile.mkdtemp(dir=_SESSIONS.name)
    return [*launcher, sys.executable, *words], clean | _ROOT
