"""One run of the billet in a process of its own or on several ranks, for its time and memory."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from benchmarks.processes import answer, argument, launch, peak

if TYPE_CHECKING:
    from benchmarks.billet import Settings


def main() -> None:
    """Run the billet of the argument and print its results."""
    arguments = argument()
    from mpi4py import MPI

    from benchmarks.billet import Settings, run

    comm = MPI.COMM_WORLD
    before = peak()
    result = run(Settings(**arguments["settings"]), repeats=arguments["repeats"], comm=comm)
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
    """Run `main` in a process of its own, or under mpirun; return times, memory and sizes."""
    return launch("benchmarks.probe", {"settings": asdict(settings), "repeats": repeats}, ranks)


if __name__ == "__main__":
    main()
