"""The same numbers on one rank and on several."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from castfem.fem.section import Cellwise
from castfem.physics.contact.settings import Contact
from castfem.physics.mechanics.supports import SPRING
from castfem.physics.mould import Mould, RectangleCavity, Taper, same
from mechanics.casting import CastSetup, billet_mesh
from mechanics.setups import SliceSetup, box, mapped

# Symmetry, cells, large strain, and whether a mould holds the strand, springs beside it.
SETUPS = [
    ("whole", "triangle", False, False),
    ("quarter", "quadrilateral", True, False),
    ("half", "quadrilateral", False, True),
]


def cooled(
    comm: MPI.Comm, symmetry: str, cell: str, large: bool, mould: bool, until: float = 2.0
) -> CastSetup:
    mesh = billet_mesh(symmetry, cell=cell, surface_size=4e-3, core_size=1.5e-2)
    given: dict[str, Any] = {"large_strain": large}
    if mould:
        cavity = RectangleCavity(0.125, 0.125, 0.0)
        wall = Mould(cavity, 0.6, same(Taper.single(0.01, 0.6)), None, None)
        sides = tuple(g for g in mesh.groups if not g.startswith("symmetry"))
        given |= {
            "interactions": (Contact(wall, sides, lambda time: 0.06 * time),),
            "springs": SPRING,
        }
    return CastSetup(mesh, comm, **given).advance(until, 0.5)


def gathered(setup: CastSetup) -> list[np.ndarray] | None:
    """Displacement and stress of all vertices on rank 0."""
    section = setup.thermal.section
    columns = np.column_stack([setup.moved, setup.stress]).T
    found = [section.gather(np.ascontiguousarray(c)) for c in columns]
    return None if found[0] is None else found  # type: ignore[return-value]


def differ(one: list[np.ndarray], many: list[np.ndarray]) -> float:
    """Largest relative difference; displacements together, stresses together."""
    pairs = [(np.array(one[:2]), np.array(many[:2])), (np.array(one[2:]), np.array(many[2:]))]
    return max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in pairs)


@pytest.mark.mpi
@pytest.mark.parametrize(("symmetry", "cell", "large", "mould"), SETUPS)
def test_many_ranks_give_what_one_gives(symmetry: str, cell: str, large: bool, mould: bool) -> None:
    alone = cooled(MPI.COMM_SELF, symmetry, cell, large, mould)
    together = cooled(MPI.COMM_WORLD, symmetry, cell, large, mould)
    one, many = gathered(alone), gathered(together)
    if MPI.COMM_WORLD.rank == 0:
        assert one is not None and many is not None
        assert differ(one, many) < 1e-8
    assert together.state.generalized_strains == pytest.approx(
        alone.state.generalized_strains, rel=1e-8, abs=1e-12
    )
    assert [r.newton for r in together.results] == [r.newton for r in alone.results]
    first, second = alone.results[-1].balance, together.results[-1].balance
    assert first is not None and second is not None
    scale = alone.problem.residual_state.scale.total if alone.problem.residual_state else 1.0
    assert np.abs(first.axial - second.axial).max() < 1e-8 * scale
    assert together.results[-1].flowing == pytest.approx(alone.results[-1].flowing, rel=1e-6)
    heat = [
        s.problem.points.to_vertices(s.results[-1].dissipation).sum() for s in (alone, together)
    ]
    assert MPI.COMM_WORLD.allreduce(heat[1]) == pytest.approx(heat[0], rel=1e-7)


@pytest.mark.mpi
def test_fewer_cells_than_ranks() -> None:
    """A rank without cells takes part in everything."""
    setup = SliceSetup(
        mapped(1, 1, box(0.01, 0.01)), comm=MPI.COMM_WORLD, thermal=lambda T: 1e-5 * T
    )
    setup.step(1.0, 100.0)
    assert setup.state.generalized_strains[0] == pytest.approx(1e-3, rel=1e-10)


@pytest.mark.mpi
def test_cellwise_values_do_not_depend_on_the_ranks() -> None:
    """Stress gathered on rank 0 is by input cell; scattering brings it back."""
    fields = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        setup = SliceSetup(mapped(5, 4, box(0.1, 0.1)), comm=comm, thermal=lambda T: 1e-5 * T)
        setup.step(1.0, lambda x, y: 1e4 * x**2 + 500 * y)
        cellwise = Cellwise(setup.section)
        cells = len(cellwise.cells)
        mine = setup.stress.reshape(cells, -1)
        whole = cellwise.gather(mine)
        assert np.array_equal(cellwise.scatter(whole), mine)
        fields.append(whole)
    if MPI.COMM_WORLD.rank == 0:
        assert np.abs(fields[0] - fields[1]).max() < 1e-9 * np.abs(fields[0]).max()


@pytest.mark.mpi
def test_planes_that_move_strain_all_ranks() -> None:
    """Their unknowns are kept by one rank; of the others none may have moved."""
    setup = SliceSetup(mapped(5, 4, box(0.1, 0.1)), comm=MPI.COMM_WORLD)
    problem = setup.problem
    cold = np.zeros(setup.section.owned)
    problem.begin(setup.state, 1.0, cold)
    x, out = problem.bordered.vector(), problem.bordered.vector()
    still = np.zeros(problem.owned)
    for strain in (0.0, 1e-4):
        scalars = np.array([strain]) / problem.planes.scaled.scaling
        x.setArray(problem.bordered.join(still, scalars))
        problem.residual(x, out)
        stiff = 200e9 * 0.7 / (1.3 * 0.4)
        assert problem.response.stress[:, 2] == pytest.approx(stiff * strain)
    x.destroy()
    out.destroy()
