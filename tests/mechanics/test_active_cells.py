"""Deep liquid takes no part in the equations of a step: the answer is that of all cells."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import fem, la

from castfem.base.types import Array
from castfem.fem.compat import CELLS, CellForm, assemble_into, create_matrix
from castfem.fem.dof_values import matrix_of_nodes
from castfem.physics.contact.settings import Contact
from castfem.physics.mechanics.state import Balance
from castfem.physics.mechanics.supports import SPRING
from castfem.physics.mould import Mould, RectangleCavity, Taper, same
from mechanics.casting import CastSetup, billet_mesh
from mechanics.setups import RING_GROUPS, SliceSetup, mapped, ring


def billet(whole: bool, cell: str = "quadrilateral", comm: MPI.Comm = MPI.COMM_SELF) -> CastSetup:
    """A billet in its mould; with `whole` every cell takes part in every step."""
    mesh = billet_mesh(cell=cell, surface_size=2e-3, core_size=1.5e-2)
    cavity = RectangleCavity(0.125, 0.125, 0.0)
    wall = Mould(cavity, 0.6, same(Taper.single(0.01, 0.6)), None, None)
    sides = tuple(g for g in mesh.groups if not g.startswith("symmetry"))
    given: dict[str, Any] = {
        "interactions": (Contact(wall, sides, lambda time: 0.06 * time),),
        "springs": SPRING,
        "liquid": "fed",
    }
    made = CastSetup(mesh, comm, **given)
    liquid = made.problem.liquid
    assert liquid is not None
    if whole:
        every = np.arange(made.problem.section.cells, dtype=np.int32)
        liquid.cells_to = lambda layer: every  # type: ignore[method-assign]
    return made


def taken(made: CastSetup) -> list[tuple[int, Array, Array, Balance]]:
    """Some steps: active points, displacement, stress and forces after each."""
    found = []
    for time in (1.5, 3.0, 4.5, 6.0):
        made.advance(time, 1.5)
        balance = made.results[-1].balance
        assert balance is not None
        state = made.state
        found.append((made.problem.active.count, state.displacement, state.stress, balance))
    return found


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_cells_without_stress_change_nothing(cell: str) -> None:
    part, whole = taken(billet(False, cell)), taken(billet(True, cell))
    for (_, *one, here), (_, *other, there) in zip(part, whole, strict=True):
        for mine, its in zip(one, other, strict=True):
            assert np.abs(mine - its).max() < 1e-7 * np.abs(its).max()
        for mine, its in ((here.axial[1:], there.axial[1:]), (here.support, there.support)):
            assert np.abs(mine - its).max() < 1e-7 * np.abs(its).max()
    counts = [count for count, *_ in part]
    assert counts == sorted(counts)
    assert counts[0] < 0.5 * whole[0][0] and counts[0] < counts[-1] < whole[0][0]


@pytest.mark.mpi
def test_ranks_agree() -> None:
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        made = billet(False, comm=comm)
        made.advance(1.5, 1.5).advance(3.0, 1.5)
        balance = made.results[-1].balance
        assert balance is not None
        found.append(np.concatenate([balance.support, balance.axial[1:]]))
    assert np.abs(found[0] - found[1]).max() < 1e-7 * np.abs(found[0]).max()


def test_steel_that_melts_again_leaves_no_stress() -> None:
    """Cells that had a shell, and are liquid again, bear nothing but the pressure."""
    found = []
    for whole in (False, True):
        made = billet(whole).advance(4.5, 1.5)
        frozen = made.problem.active.count
        heat = np.full_like(made.state.temperature, made.state.temperature.max())
        result = made.stepper.step(made.state, made.state.time + 1e-3, heat)
        assert result.converged and result.balance is not None and made.problem.liquid is not None
        assert not result.state.stress[~made.problem.liquid.carries].any()
        assert whole or made.problem.active.count < frozen
        found.append(result)
    part, every = found
    one, other = part.state.displacement, every.state.displacement
    assert np.abs(one - other).max() < 1e-7 * np.abs(other).max()
    assert part.balance.support == pytest.approx(every.balance.support, rel=1e-7)


def measured(section: Any) -> tuple[ufl.Form, ufl.Form, fem.FunctionSpace]:
    """A vector and a matrix with a term on cells and one on a part of the surface."""
    mesh = section.mesh
    space = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", domain=mesh, subdomain_id=CELLS)
    tags = tuple(section.matching(["outer"]))
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=section.facet_tags)(tags)
    x = ufl.SpatialCoordinate(mesh)
    factor, scale = fem.Function(space), fem.Constant(mesh, 3.0)
    factor.interpolate(lambda at: at[:2] + 1.0)
    vector = ufl.inner(factor, v) * dx + scale * v[0] * x[0] * ds
    matrix = ufl.inner(ufl.grad(u), ufl.grad(v)) * factor[0] * dx + scale * ufl.inner(u, v) * ds
    return vector, matrix, space


def assembled(form: fem.Form) -> Array:
    vector = fem.assemble_vector(form)
    vector.scatter_reverse(la.InsertMode.add)
    return np.array(vector.array)


def test_a_form_on_parts_of_the_cells_adds_up() -> None:
    section = SliceSetup(mapped(6, 3, ring(0.02, 0.05), "quadrilateral", 2, RING_GROUPS)).section
    vector, matrix, space = measured(section)
    form = CellForm(section.mesh, vector)
    every = np.arange(section.cells, dtype=np.int32)
    one, other = every[every % 3 == 0], every[every % 3 != 0]
    whole = assembled(form.on(every))
    parts = assembled(form.on(one)) + assembled(form.on(other, False))
    assert np.abs(whole - parts).max() < 1e-14 * np.abs(whole).max()
    assert np.abs(assembled(form.on(every, False)) - whole).max() > 0.1 * np.abs(whole).max()

    compiled = CellForm(section.mesh, matrix)
    full = create_matrix(compiled.on(every))
    assemble_into(full, compiled.on(every), [])
    nodes = np.zeros(space.dofmap.index_map.size_local, dtype=bool)
    nodes[np.asarray(space.dofmap.list)[one]] = True
    part, rows = matrix_of_nodes(full, space, nodes)
    assert len(rows) == 2 * nodes.sum() < full.getSize()[0]
    condition = fem.dirichletbc(fem.Function(space), np.flatnonzero(nodes)[:3].astype(np.int32))
    for form_ in (compiled.on(every), compiled.on(one, False)):
        assemble_into(full, form_, [condition])
        assemble_into(part, form_, [condition])
        wanted = full[:, :][np.ix_(rows, rows)]
        assert np.abs(part[:, :] - wanted).max() < 1e-14 * np.abs(wanted).max()
    for thing in (full, part):
        thing.destroy()
