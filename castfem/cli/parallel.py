"""Ranks: who prints, and how; how all agree on the mistakes of the user."""

from __future__ import annotations

import os
import sys
import time
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from castfem.base.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI

    from rich.console import Console

_LAUNCHERS = (
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
    ("PMI_RANK", "PMI_SIZE"),
    ("SLURM_PROCID", "SLURM_STEP_NUM_TASKS"),  # a batch script has the first, a step has both
)
"""Variables of a process's number and of how many there are, by launcher."""
_SLURM = _LAUNCHERS[-1]
_DRAINED = 0.3  # s for the launcher to pass on what was printed
_REACHED = 60.0  # s for all ranks to come to the first meeting


def started() -> tuple[int, int]:
    """Return number of this process and of all, as the launcher says: 0 of 1 without one."""
    for rank, size in _LAUNCHERS:
        if rank in os.environ and size in os.environ:
            return int(os.environ[rank]), int(os.environ[size])
    return 0, 1


def rank_and_size() -> tuple[int, int]:
    """Return MPI's rank and size; MPI is not touched where nothing says that there is a launcher.

    Variables of a launcher are no more than a sign: a batch script has those of its job, and a
    launcher that belongs to another MPI, or to none, starts processes of which each is alone.
    """
    if not any(rank in os.environ for rank, _ in _LAUNCHERS):
        return 0, 1
    try:
        from mpi4py import MPI
    except ImportError:  # no solver here: cases are checked and results shown without
        return 0, 1
    return MPI.COMM_WORLD.rank, MPI.COMM_WORLD.size


def check_launcher() -> None:
    """Refuse processes that a launcher has started as ranks, and that MPI does not connect."""
    _, size = rank_and_size()
    _, tasks = started()
    if tasks > size:
        from mpi4py import MPI

        name, version = MPI.get_vendor()
        said = f"MPI ({name} {'.'.join(map(str, version))}) has {size} in each"
        if _by_slurm():
            raise InputError(
                f"srun has started {tasks} tasks, and {said}: srun has not set up MPI; start "
                f"castfem by mpirun -n {tasks} in a batch script or under salloc, without srun"
            )
        raise InputError(
            f"the launcher has started {tasks} processes, and {said}: it belongs to another MPI; "
            f"start castfem by the mpirun of {name}"
        )
    if size > 1:
        _meet()


def _by_slurm() -> bool:
    """Return whether this is a task of srun itself, not of Open MPI's mpirun within a job."""
    return _LAUNCHERS[0][0] not in os.environ and all(name in os.environ for name in _SLURM)


def _meet() -> None:
    """See that a message gets from each rank to the others (collective); abort if none does."""
    from castfem.fem.root import all_arrive

    comm = communicator()
    if comm is None or all_arrive(comm, _REACHED):
        return
    mend = "; start castfem by mpirun, without srun" if _by_slurm() else ""
    print(
        f"castfem: rank {comm.rank} has waited for the other ranks in vain: MPI is set up, but no "
        f"message gets through{mend}",
        file=sys.stderr,
        flush=True,
    )
    comm.Abort(InputError.exit_status)


def console() -> Console:
    """Return standard output for tables, without markup.

    A launcher may give its ranks a terminal even where its own output is redirected: under a
    launcher only plain text is printed.
    """
    from rich.console import Console

    plain = any(rank in os.environ for rank, _ in _LAUNCHERS)
    return Console(markup=False, force_terminal=False if plain else None)


def communicator() -> MPI.Intracomm | None:
    """Return the communicator of all ranks, None when there is only one."""
    if rank_and_size()[1] == 1:
        return None
    from mpi4py import MPI

    return MPI.COMM_WORLD


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
    if rank_and_size()[1] > 1:
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
