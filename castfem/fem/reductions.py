"""Sums and extremes over all ranks; every reported number uses these."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import numpy.typing as npt


def total(comm: MPI.Comm, value: float) -> float:
    """Sum of one number over the ranks."""
    return float(comm.allreduce(float(value), op=MPI.SUM))


def totals(comm: MPI.Comm, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Sum of an array of numbers over the ranks, in one message."""
    send = np.array(values, dtype=np.float64)
    if comm.size == 1:
        return send
    receive = np.empty_like(send)
    comm.Allreduce(send, receive, op=MPI.SUM)
    return receive


def any_of(comm: MPI.Comm, flag: bool) -> bool:
    """Whether a flag is set on any rank."""
    return flag if comm.size == 1 else bool(comm.allreduce(flag, op=MPI.LOR))


def smallest(comm: MPI.Comm, array: npt.NDArray[np.float64]) -> float:
    """Smallest entry over all ranks, NaN if any is NaN; a rank may have no entries."""
    return -float(largest_of(comm, [-array.min() if array.size else -np.inf])[0])


def largest(comm: MPI.Comm, array: npt.NDArray[np.float64]) -> float:
    """Largest entry over all ranks, NaN if any is NaN; a rank may have no entries."""
    own = float(array.max()) if array.size else -np.inf
    return own if comm.size == 1 else float(largest_of(comm, [own])[0])


def peak(
    comm: MPI.Comm, values: npt.NDArray[np.float64], places: npt.NDArray[np.float64]
) -> tuple[float, float, float]:
    """Largest entry over all ranks, and x and y of its place, NaN if there is none.

    Of equal entries, which symmetry causes, the one of largest x, then y: the choice must not
    depend on rounding, which varies with the number of ranks.
    """
    top = largest(comm, values)
    near = places[values >= top - 1e-9 * abs(top)] if np.isfinite(top) else places[:0]
    own = max(((float(x), float(y)) for x, y in near), default=(-np.inf, -np.inf))
    x, y = max(comm.allgather(own))
    return (top, x, y) if np.isfinite(x) else (top, np.nan, np.nan)


def largest_of(comm: MPI.Comm, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Largest of each of several numbers over the ranks, in one message; NaN if a rank has NaN.

    MPI does not specify NaN: its maximum keeps or loses one depending on the order of the ranks.
    """
    own = np.array(values, dtype=np.float64)
    if comm.size == 1:
        return own
    unknown = np.isnan(own)
    send = np.stack([np.where(unknown, -np.inf, own), unknown])
    receive = np.empty_like(send)
    comm.Allreduce(send, receive, op=MPI.MAX)
    return np.where(receive[1] > 0.0, np.nan, receive[0])
