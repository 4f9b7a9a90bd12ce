"""Ranks: partition of a mesh, extremes and failures on all ranks, freed communicators."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from castfem.base.errors import RunFailure
from castfem.fem import compat, reductions
from castfem.fem.factorisation import MUMPS, OWN, SEVERAL_RANKS, has_minimum_degree
from castfem.fem.rank_zero import shared_out
from castfem.fem.section import straight_cuts
from castfem.meshes import SectionMesh, build
from castfem.physics.mechanics.newton import split_options


def slab() -> SectionMesh:
    lengths = {"surface_size": 4e-3, "face_size": 50e-3, "core_size": 16e-3}
    return build("rectangle", width=1.2, height=0.22, symmetry="half", **lengths)


def billet() -> SectionMesh:
    return build("rectangle", width=0.125, height=0.125, surface_size=2e-3, core_size=8e-3)


def rim_of(mesh: SectionMesh) -> np.ndarray:
    outer = [i for i, name in enumerate(mesh.groups) if not name.startswith("symmetry")]
    at = np.zeros(len(mesh.points), bool)
    at[mesh.facets[np.isin(mesh.facet_group, outer)]] = True
    return at[mesh.cells].any(axis=1)


@pytest.mark.parametrize("mesh", [slab(), billet()], ids=["slab", "billet"])
def test_two_ranks_have_equal_shares_of_cells_and_rim(mesh: SectionMesh) -> None:
    rim = rim_of(mesh)
    rank = straight_cuts(mesh.points, mesh.cells, rim, 2)
    for ranks in (rank, rank[rim]):
        assert abs(np.diff(np.bincount(ranks, minlength=2))) <= 2


@pytest.mark.parametrize("ranks", [1, 3, 5])
def test_ranks_have_equal_numbers_of_cells(ranks: int) -> None:
    mesh = slab()
    cells = np.bincount(straight_cuts(mesh.points, mesh.cells, rim_of(mesh), ranks))
    assert len(cells) == ranks
    assert np.ptp(cells) <= 2


def test_more_ranks_than_cells_leave_some_empty() -> None:
    mesh = slab()
    rank = straight_cuts(mesh.points, mesh.cells[:2], np.ones(2, bool), 4)
    assert len(set(rank.tolist())) == 2 and set(rank.tolist()) <= set(range(4))


def test_orderings_for_ranks_apply_to_the_default_solver_only() -> None:
    named = set(SEVERAL_RANKS)
    assert named <= set(split_options({}, True, 2)[1])
    assert not named & set(split_options({}, True, 1)[1])
    assert not named & set(split_options({"pc_type": "lu"}, True, 2)[1])
    assert set(MUMPS) <= set(split_options({}, True, 2)[1])
    unsymmetric = split_options({}, False, 1)[1]
    assert (OWN if has_minimum_degree() else MUMPS).items() <= unsymmetric.items()
    assert not set(MUMPS) & set(split_options({"pc_type": "lu"}, True, 1)[1])
    of_mumps = split_options({"mat_mumps_icntl_14": 80}, True, 1)[1]
    assert of_mumps["pc_factor_mat_solver_type"] == "mumps"
    assert split_options({"mat_mumps_icntl_7": 4}, True, 2)[1]["mat_mumps_icntl_7"] == 4


@pytest.fixture
def without_collector() -> Iterator[None]:
    """Switch the garbage collector off."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def next_handle() -> int:
    """Return the handle of the next communicator; MPI reuses freed handles first."""
    duplicate = MPI.COMM_SELF.Dup()
    handle = duplicate.py2f()
    duplicate.Free()
    return handle


def test_communicators_of_unused_meshes_are_freed(without_collector: None) -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    cells = np.array([[0, 1, 2], [1, 2, 3]])
    handles = []
    for _ in range(6):
        mesh = compat.create_mesh(MPI.COMM_SELF, cells, square, "triangle", 1)
        ring: list[object] = [fem.functionspace(mesh, ("Lagrange", 1))]
        ring.append(ring)  # a cycle, as of a problem and its solver
        handles.append(next_handle())
    assert max(handles[2:]) <= max(handles[:2])


@pytest.mark.mpi
def test_extremes_and_nan_reach_all_ranks() -> None:
    comm = MPI.COMM_WORLD
    last = comm.size - 1
    one, none = np.array([float(comm.rank)]), np.zeros(0)
    lone = one if comm.rank == last else none
    for values, most, least in ((one, last, 0.0), (lone, last, last), (none, -np.inf, np.inf)):
        assert reductions.largest(comm, values) == most
        assert reductions.smallest(comm, values) == least
    for rank in range(comm.size):
        invalid = np.array([np.nan if comm.rank == rank else 1.0])
        assert np.isnan(reductions.largest(comm, invalid))
        assert np.isnan(reductions.smallest(comm, invalid))
        first, second = reductions.largest_of(comm, [invalid[0], comm.rank])
        assert np.isnan(first) and second == last


COMM = MPI.COMM_WORLD


def work(number: int) -> Callable[[], tuple[int, int]]:
    return lambda: (number, COMM.rank)


def fails(number: int) -> Callable[[], tuple[int, int]]:
    def _fail() -> tuple[int, int]:
        raise RunFailure(f"piece {number}")

    return _fail


@pytest.mark.mpi
def test_each_piece_is_done_once_for_all_ranks() -> None:
    pieces = [work(number) for number in range(5)]
    assert shared_out(COMM, pieces) == [(number, number % COMM.size) for number in range(5)]
    assert shared_out(MPI.COMM_SELF, pieces) == [(number, COMM.rank) for number in range(5)]
    assert shared_out(COMM, pieces[:1]) == [(0, 0)]


@pytest.mark.mpi
def test_first_failed_piece_fails_on_all_ranks() -> None:
    pieces = [work(0), work(1), fails(2), fails(3)]
    for comm in (COMM, MPI.COMM_SELF):
        with pytest.raises(RunFailure, match="piece 2"):
            shared_out(comm, pieces)
