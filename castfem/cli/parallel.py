"""MPI ranks of the command line: which one prints, and agreement on input errors."""

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
    ("SLURM_PROCID", "SLURM_STEP_NUM_TASKS"),  # a batch script has the first, a step both
)
"""Environment variables for rank and number of processes, by launcher."""
_SLURM = _LAUNCHERS[-1]
_DRAINED = 0.3  # s for the launcher to pass on output
_REACHED = 60.0  # s for all ranks to reach the first synchronisation


def started() -> tuple[int, int]:
    """Return rank and number of processes according to the launcher: 0 of 1 without one."""
    for rank, size in _LAUNCHERS:
        if rank in os.environ and size in os.environ:
            return int(os.environ[rank]), int(os.environ[size])
    return 0, 1


def rank_and_size() -> tuple[int, int]:
    """Return MPI's rank and size; MPI is only used if something indicates a launcher.

    The variables of a launcher are only an indication: a batch script has those of its job, and a
    launcher of another MPI, or of none, starts separate processes.
    """
    if not any(rank in os.environ for rank, _ in _LAUNCHERS):
        return 0, 1
    try:
        from mpi4py import MPI
    except ImportError:  # no solver installed: cases can be checked and results shown
        return 0, 1
    return MPI.COMM_WORLD.rank, MPI.COMM_WORLD.size


def check_launcher() -> None:
    """Refuse processes that a launcher has started as ranks, but that MPI does not connect."""
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
    """Whether this is a task of srun itself, not of Open MPI's mpirun within a job."""
    return _LAUNCHERS[0][0] not in os.environ and all(name in os.environ for name in _SLURM)


def _meet() -> None:
    """Check that messages from each rank reach the others (collective); abort if not."""
    from castfem.fem.rank_zero import all_arrive

    comm = communicator()
    if comm is None or all_arrive(comm, _REACHED):
        return
    mend = "; start castfem by mpirun, without srun" if _by_slurm() else ""
    print(
        f"castfem: rank {comm.rank} waited for the other ranks in vain: MPI is set up, but no "
        f"message gets through{mend}",
        file=sys.stderr,
        flush=True,
    )
    comm.Abort(InputError.exit_status)


def console() -> Console:
    """Return standard output for tables, without markup.

    A launcher may give its ranks a terminal even if its own output is redirected, so that under a
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
    """Return the problems of the first rank that has any, equal on all ranks (collective)."""
    if comm is None:
        return problems
    return next((found for found in comm.allgather(problems) if found), ())


def rank_of(comm: MPI.Intracomm | None) -> int:
    """Return this process's rank."""
    return 0 if comm is None else int(comm.rank)


def pass_on() -> None:
    """Let the launcher pass on the output before something is printed on the other stream.

    Lines that reach Open MPI's launcher on both streams at once may be mixed: the text on one
    stream, its line end on the other.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    if rank_and_size()[1] > 1:
        time.sleep(_DRAINED)


def settle() -> None:
    """Wait for the other ranks, so that rank 0 has printed before the first one ends.

    A launcher ends all ranks as soon as one exits with an error status, possibly before it has read
    the last output; a short pause gives it time.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    comm = communicator()
    if comm is not None:
        from castfem.fem.rank_zero import all_arrive

        all_arrive(comm)
        time.sleep(_DRAINED)


def together(comm: MPI.Intracomm | None) -> AbstractContextManager[object]:
    """Return a context in which an error on one rank ends all (collective)."""
    if comm is None:
        return nullcontext()
    from castfem.fem.rank_zero import Together

    return Together(comm)
