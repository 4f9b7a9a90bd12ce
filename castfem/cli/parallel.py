"""Ranks: who prints, and how; how all agree on the mistakes of the user."""

from __future__ import annotations

import os
import sys
import time
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py import MPI

    from rich.console import Console

_LAUNCHERS = (
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
    ("PMI_RANK", "PMI_SIZE"),
    ("SLURM_PROCID", "SLURM_NTASKS"),
)
_DRAINED = 0.3  # s for the launcher to pass on what was printed


def launched() -> tuple[int, int]:
    """Return rank and size as the launcher set them in the environment; MPI is not touched."""
    for rank, size in _LAUNCHERS:
        if rank in os.environ and size in os.environ:
            return int(os.environ[rank]), int(os.environ[size])
    return 0, 1


def console(*, quiet: bool = False) -> Console:
    """Return standard output for tables, without markup.

    A launcher gives its ranks a terminal of their own, wherever its own output goes: under one,
    nothing but plain text is printed.
    """
    from rich.console import Console

    plain = any(rank in os.environ for rank, _ in _LAUNCHERS)
    return Console(quiet=quiet, markup=False, force_terminal=False if plain else None)


def communicator() -> MPI.Intracomm | None:
    """Return the communicator of all ranks, None when there is only one."""
    if launched()[1] == 1:
        return None
    from mpi4py import MPI

    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None


def agree(comm: MPI.Intracomm | None, problems: tuple[str, ...]) -> tuple[str, ...]:
    """Return the problems of the first rank that has any, the same on all ranks (collective)."""
    if comm is None:
        return problems
    return next((found for found in comm.allgather(problems) if found), ())


def rank_of(comm: MPI.Intracomm | None) -> int:
    """Return this process's rank."""
    return 0 if comm is None else int(comm.rank)


def pass_on() -> None:
    """Let a launcher pass on what was printed, before something is printed on the other stream.

    Lines of one rank that reach Open MPI's launcher on both streams at once may leave it mixed up:
    the text on one stream, its line end on the other.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    if launched()[1] > 1:
        time.sleep(_DRAINED)


def settle() -> None:
    """Wait a little for the other ranks, so that rank 0 has printed before the first one ends.

    A launcher ends all ranks as soon as one leaves with an exit status, and may then leave unread
    what was just printed: it gets a moment for that.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    comm = communicator()
    if comm is not None:
        from castfem.fem.root import all_arrive

        all_arrive(comm)
        time.sleep(_DRAINED)


def together(comm: MPI.Intracomm | None) -> AbstractContextManager[object]:
    """Return a block in which an error that one rank meets alone ends all (collective)."""
    if comm is None:
        return nullcontext()
    from castfem.fem.root import Together

    return Together(comm)
