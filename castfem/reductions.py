"""Sums and extremes over all ranks; every number that is reported goes through here."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import numpy.typing as npt


def total(comm: MPI.Comm, value: float) -> float:
    """Sum of one number over the ranks."""
    return float(comm.allreduce(float(value), op=MPI.SUM))


def totals(comm: MPI.Comm, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Sum of an array of numbers over the ranks, in one message."""
    send = np.ascontiguousarray(values, dtype=np.float64)
    receive = np.empty_like(send)
    comm.Allreduce(send, receive, op=MPI.SUM)
    return receive


def smallest(comm: MPI.Comm, array: npt.NDArray[np.float64]) -> float:
    """Smallest entry over all ranks; a rank may hold none."""
    return float(comm.allreduce(float(array.min()) if array.size else np.inf, op=MPI.MIN))


def largest(comm: MPI.Comm, array: npt.NDArray[np.float64]) -> float:
    """Largest entry over all ranks; a rank may hold none."""
    return float(comm.allreduce(float(array.max()) if array.size else -np.inf, op=MPI.MAX))


def largest_of(comm: MPI.Comm, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Largest of each of several numbers over the ranks, in one message."""
    send = np.ascontiguousarray(values, dtype=np.float64)
    receive = np.empty_like(send)
    comm.Allreduce(send, receive, op=MPI.MAX)
    return receive
