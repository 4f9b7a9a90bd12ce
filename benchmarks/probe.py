"""One run of the billet in a process of its own, for what cannot be measured in a shared one.

`measure` prints time, memory and sizes: start-up and memory belong to a process, ranks to mpirun.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from benchmarks.processes import answer, argument, launch, peak

if TYPE_CHECKING:
    from benchmarks.billet import Settings


def main() -> None:
    """Run and print."""
    given = argument()
    from mpi4py import MPI

    from benchmarks.billet import Settings, run

    comm = MPI.COMM_WORLD
    before = peak()
    result = run(Settings(**given["settings"]), repeats=given["repeats"], comm=comm)
    memory = comm.allreduce(peak())
    if comm.rank == 0:
        answer({
            "seconds": result.wall,
            "vertices": result.vertices,
            "cells": result.cells,
            "memory_mb": 1e-6 * memory,
            "memory_before_mb": 1e-6 * before,
            "corner": result.corner[-1],
            "sections": result.sections,
        })  # fmt: skip


def measure(settings: Settings, ranks: int = 1, repeats: int = 1) -> dict[str, Any]:
    """Run `main` in a process of its own, or under mpirun."""
    return launch("benchmarks.probe", {"settings": asdict(settings), "repeats": repeats}, ranks)


if __name__ == "__main__":
    main()
