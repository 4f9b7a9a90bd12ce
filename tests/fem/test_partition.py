"""Every rank gets its share of the cells, and of those at the surface."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.fem.factorisation import MUMPS, OWN, SEVERAL_RANKS, has_minimum_degree
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
def test_two_ranks_share_cells_and_rim(mesh: SectionMesh) -> None:
    rim = rim_of(mesh)
    rank = straight_cuts(mesh.points, mesh.cells, rim, 2)
    for shared in (rank, rank[rim]):
        assert abs(np.diff(np.bincount(shared, minlength=2))) <= 2


@pytest.mark.parametrize("ranks", [1, 3, 5])
def test_each_rank_has_as_many_cells_as_any_other(ranks: int) -> None:
    mesh = slab()
    cells = np.bincount(straight_cuts(mesh.points, mesh.cells, rim_of(mesh), ranks))
    assert len(cells) == ranks
    assert np.ptp(cells) <= 2


def test_more_ranks_than_cells_leave_some_without() -> None:
    mesh = slab()
    rank = straight_cuts(mesh.points, mesh.cells[:2], np.ones(2, bool), 4)
    assert len(set(rank.tolist())) == 2 and set(rank.tolist()) <= set(range(4))


def test_orderings_of_several_ranks_are_those_of_the_default_factorisation_alone() -> None:
    named = set(SEVERAL_RANKS)
    assert named <= set(split_options({}, True, 2)[1])
    assert not named & set(split_options({}, True, 1)[1])
    assert not named & set(split_options({"pc_type": "lu"}, True, 2)[1])
    assert set(MUMPS) <= set(split_options({}, True, 2)[1])
    alone = split_options({}, False, 1)[1]
    assert (OWN if has_minimum_degree() else MUMPS).items() <= alone.items()
    assert not set(MUMPS) & set(split_options({"pc_type": "lu"}, True, 1)[1])
    of_mumps = split_options({"mat_mumps_icntl_14": 80}, True, 1)[1]
    assert of_mumps["pc_factor_mat_solver_type"] == "mumps"
    assert split_options({"mat_mumps_icntl_7": 4}, True, 2)[1]["mat_mumps_icntl_7"] == 4
