"""Meshes that a script has left do not keep their communicators, of which MPI has but so many."""

from __future__ import annotations

import gc
from collections.abc import Iterator

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from castfem.fem import compat


@pytest.fixture
def without_collector() -> Iterator[None]:
    """As where Python finds no reason to collect garbage."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def next_handle() -> int:
    """The handle of the next communicator: MPI hands out those that were given back first."""
    own = MPI.COMM_SELF.Dup()
    handle = own.py2f()
    own.Free()
    return handle


def test_a_mesh_gives_back_what_earlier_ones_held(without_collector: None) -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    cells = np.array([[0, 1, 2], [1, 2, 3]])
    handles = []
    for _ in range(6):
        mesh = compat.create_mesh(MPI.COMM_SELF, cells, square, "triangle", 1)
        ring: list[object] = [fem.functionspace(mesh, ("Lagrange", 1))]
        ring.append(ring)  # as a problem and its solver hold each other
        handles.append(next_handle())
    assert max(handles[2:]) <= max(handles[:2])
