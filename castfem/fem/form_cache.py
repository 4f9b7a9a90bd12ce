"""Compiled forms on disk, and what a process that was killed while it compiled has left there.

FFCx marks a form as being compiled by its C file, which it creates before, and as ready by another
file, which it creates after; whoever finds the first alone waits for the second. If the process
that would write it is dead, nobody ever will. Here every process that compiles holds a lock, which
the operating system releases with the process: whoever has waited in vain, and can have the lock
for itself, knows that no one is at work on what lacks the second file.
"""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from mpi4py import MPI

from castfem.fem.root import on_root
from castfem.support.log import logger

T = TypeVar("T")
WAIT = 10  # s: of FFCx for a form that another process compiles
LOCK = "compiling.lock"
TIMED_OUT = "compilation timed out"  # what FFCx says then
# What DOLFINx says on several ranks: 0.9 and 0.10 on all of them, 0.11 on the first, on the others.
FAILED = (
    "Failed just-in-time compilation", "Failed JIT compilation", "JIT compilation failed on rank 0",
)  # fmt: skip


def compiled(comm: MPI.Comm, cache: Path, make: Callable[[], T]) -> T:
    """What `make` compiles, or finds compiled (collective).

    Args:
        comm: Of those who need it; the first of them compiles.
        cache: Folder of compiled forms; created if there is none.
        make: Calls DOLFINx.

    Raises:
        Exception: Whatever `make` raises, but that its wait was in vain.
    """
    cache.mkdir(parents=True, exist_ok=True)
    while True:
        try:
            with _locked(cache, fcntl.LOCK_SH):
                return make()
        except (TimeoutError, RuntimeError) as error:
            if not _waited_in_vain(comm, error):
                raise
        on_root(comm, lambda: _clean(cache))


def _waited_in_vain(comm: MPI.Comm, error: Exception) -> bool:
    """Whether the first rank has; all ranks fail together then (collective in that case)."""
    if comm.size == 1:
        return isinstance(error, TimeoutError)
    return str(error).startswith(FAILED) and bool(comm.bcast(TIMED_OUT in str(error), root=0))


@contextmanager
def _locked(cache: Path, kind: int) -> Iterator[None]:
    """Hold the lock of the folder, with others (shared) or alone.

    Where there can be none, for want of permission or on the file system, go on without.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            file = stack.enter_context(open(cache / LOCK, "ab"))
            fcntl.flock(file, kind)
        yield


def _clean(cache: Path) -> None:
    """Remove what no one will finish; waits until no other process compiles."""
    with _locked(cache, fcntl.LOCK_EX):
        for source in cache.glob("*.c"):
            if not source.with_suffix(".c.cached").exists():
                logger.debug("%s was never finished, and is removed", source)
                source.unlink(missing_ok=True)
