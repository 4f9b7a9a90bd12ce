"""One run of the billet in a process of its own, for what cannot be measured in a shared one.

    python -m benchmarks.probe '{"surface_size": 0.4}'          (mpirun -n 2 before it)

prints time, memory and sizes as JSON: start-up and memory belong to a process, ranks to mpirun.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.report import ROOT

if TYPE_CHECKING:
    from benchmarks.billet import Settings


def main() -> None:
    """Run and print."""
    given = json.loads(sys.argv[1])
    from mpi4py import MPI

    from benchmarks.billet import Settings, run

    comm = MPI.COMM_WORLD
    before = peak()
    result = run(Settings(**given["settings"]), repeats=given.get("repeats", 1), comm=comm)
    memory = comm.allreduce(peak())
    if comm.rank == 0:
        found = {
            "seconds": result.wall,
            "vertices": result.vertices,
            "cells": result.cells,
            "memory_mb": 1e-6 * memory,
            "memory_before_mb": 1e-6 * before,
            "corner": result.corner[-1],
            "sections": result.sections,
        }
        print("RESULT " + json.dumps(found))


def peak() -> float:
    """Largest resident memory of this process, bytes.

    What `getrusage` says would begin with the memory of the process that started this one.
    """
    status = Path("/proc/self/status")
    if status.exists():
        found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text())
        if found:
            return 1024.0 * float(found[1])
    from castfem.base.stopwatch import peak_memory

    return peak_memory()


def measure(settings: Settings, ranks: int = 1, repeats: int = 1) -> dict[str, Any]:
    """Run `main` in a process of its own, or under mpirun."""
    return launch("benchmarks.probe", {"settings": asdict(settings), "repeats": repeats}, ranks)


def launch(module: str, given: dict[str, Any], ranks: int = 1) -> dict[str, Any]:
    """Run `module` in a process of its own, or under mpirun.

    Args:
        module: Takes its argument as JSON and prints "RESULT " and JSON.
        given: Its argument.
        ranks: Processes.

    Raises:
        RuntimeError: It failed; holds what it wrote.
    """
    command = [sys.executable, "-m", module, json.dumps(given)]
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PMIX_", "PMI_"))}
    if ranks > 1:
        command = [shutil.which("mpirun") or "mpirun", "-n", str(ranks), *command]
        # Two ranks on two cores of one machine, whoever runs them.
        clean |= {
            "OMPI_MCA_rmaps_base_oversubscribe": "1",
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        }
        clean.setdefault("OMPI_MCA_btl", "^tcp,ofi,uct")
        # A rank that waits gives way: the cores may have other work.
        clean.setdefault("OMPI_MCA_mpi_yield_when_idle", "1")
        clean.setdefault("PRTE_MCA_rmaps_default_mapping_policy", ":oversubscribe")
    done = subprocess.run(
        command, cwd=ROOT, env=clean, capture_output=True, text=True, timeout=600, check=False
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if done.returncode != 0 or not lines:
        raise RuntimeError(f"{' '.join(command)}:\n{done.stdout}\n{done.stderr}")
    found: dict[str, Any] = json.loads(lines[-1].removeprefix("RESULT "))
    return found


if __name__ == "__main__":
    main()
