"""Runs in separate processes, to measure their own time and memory."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter
from typing import Any

from benchmarks.report import ROOT


@dataclass(frozen=True, slots=True)
class Spent:
    """Times of a command, s."""

    processor: float  #: processor time of the process and its child processes
    wall: float  #: wall time


def castfem(*words: str, environment: Mapping[str, str] | None = None) -> Spent:
    """Run a command of castfem quietly in a process of its own.

    Args:
        words: Arguments of `castfem`.
        environment: Variables that are added to those of this process.

    Raises:
        RuntimeError: The command failed; the message contains its output.
    """
    command = [sys.executable, "-m", "castfem.cli", *words, "-q"]
    start, before = perf_counter(), getrusage(RUSAGE_CHILDREN)
    _run(command, {**os.environ, **(environment or {})})
    after = getrusage(RUSAGE_CHILDREN)
    return Spent(sum(after[:2]) - sum(before[:2]), perf_counter() - start)  # user and system


def launch(
    module: str,
    arguments: Mapping[str, Any],
    ranks: int = 1,
    environment: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Run `module` in a process of its own, or under mpirun.

    Args:
        module: Module that reads `argument` and calls `answer` with its results.
        arguments: What `argument` returns in the new process.
        ranks: Number of processes.
        environment: Variables that are added to those of this process.

    Raises:
        RuntimeError: The module failed; the message contains its output.
    """
    command = [sys.executable, "-m", module, json.dumps(arguments)]
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PMIX_", "PMI_"))}
    clean |= environment or {}
    if ranks > 1:
        command = [shutil.which("mpirun") or "mpirun", "-n", str(ranks), *command]
        # Two ranks on two cores of one machine, for any user.
        clean |= {
            "OMPI_MCA_rmaps_base_oversubscribe": "1",
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        }
        clean.setdefault("OMPI_MCA_btl", "^tcp,ofi,uct")
        # A rank that waits yields its core, on which other programs may run.
        clean.setdefault("OMPI_MCA_mpi_yield_when_idle", "1")
        clean.setdefault("PRTE_MCA_rmaps_default_mapping_policy", ":oversubscribe")
    # Open MPI does not start if a killed run has left a folder with the same number.
    with tempfile.TemporaryDirectory() as own:
        written = _run(command, clean | {"PRTE_MCA_prte_tmpdir_base": own})
    lines = [line for line in written.splitlines() if line.startswith("RESULT ")]
    if not lines:
        raise RuntimeError(f"{' '.join(command)}: no answer\n{written}")
    results: dict[str, Any] = json.loads(lines[-1].removeprefix("RESULT "))
    return results


def argument() -> dict[str, Any]:
    """Return the argument that `launch` passed to this process."""
    arguments: dict[str, Any] = json.loads(sys.argv[1])
    return arguments


def answer(results: Mapping[str, Any]) -> None:
    """Return results to `launch`; call it on one rank only."""
    print("RESULT " + json.dumps(results))


def peak() -> float:
    """Return the largest resident memory of this process, bytes.

    The value of `getrusage` would include the memory of the process that started this one.
    """
    status = Path("/proc/self/status")
    if status.exists():
        found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text())
        if found:
            return 1024.0 * float(found[1])
    from castfem.base.stopwatch import peak_memory

    return peak_memory()


def _run(command: Sequence[str], environment: Mapping[str, str]) -> str:
    """Run a command; return its standard output."""
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}:\n{done.stdout}\n{done.stderr}")
    return done.stdout
