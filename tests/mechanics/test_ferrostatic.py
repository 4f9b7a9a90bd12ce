"""Ferrostatic pressure: its resultant on the shell whatever the mesh, and where it acts.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.machine import Machine, Steady
from castfem.physics.mechanics.definition import SHARES, Ferrostatic
from mechanics.setups import Map, SliceSetup, box, elastic, mapped, skewed

SOLIDUS, LIQUIDUS, HEAD = 1700.0, 1750.0, 3.0e5


def fraction(temperature: Array) -> Array:
    return np.clip((LIQUIDUS - temperature) / (LIQUIDUS - SOLIDUS), 0.0, 1.0)


def nodal_forces(setup: SliceSetup, temperature: Any) -> Array:
    """Forces of the pressure on the nodes (n, 2), N/m, before the material answers."""
    problem = setup.problem
    problem.begin(setup.state, 1.0, setup.field(temperature))
    residual_state = problem._evaluate(np.zeros(problem.solver.x.getLocalSize()))
    return -residual_state.forces.reshape(-1, 2)


def setup_on(
    shape: Map, cell: str, mushy_zone: str, cells: int = 9, order: int = 1, outside: str = "free"
) -> SliceSetup:
    pressure = Ferrostatic(lambda t: HEAD, fraction, mushy_zone, outside)  # type: ignore[arg-type]
    mesh = mapped(cells, cells, shape, cell, order)
    return SliceSetup(mesh, elastic(), given={"ferrostatic": pressure}, start=1600.0)


@pytest.mark.parametrize("mushy_zone", list(SHARES))
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_resultant_of_a_straight_front(cell: str, mushy_zone: str) -> None:
    """Gamma D times the height, wherever the front lies and however wide the mushy zone."""
    height = 0.06
    setup = setup_on(box(0.1, height), cell, mushy_zone)
    x = setup.problem.space.tabulate_dof_coordinates()[:, 0]
    # All but what the line of symmetry carries is the shell's and the mushy zone's.
    shell = x >= 1e-9
    for front, width in product((0.043, 0.0555, 0.0777), (0.0, 0.004, 0.03)):
        ends = [front - width - 1e-9, front]
        force = nodal_forces(setup, lambda x, y, at=ends: np.interp(x, at, [1780.0, 1600.0]))
        assert force[shell, 0].sum() == pytest.approx(HEAD * height, rel=1e-10), (front, width)
        assert np.abs(force.sum(axis=0)).max() < 1e-10 * HEAD * height, (front, width)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_resultant_on_distorted_cells(cell: str) -> None:
    """The cut runs through distorted liquid cells: still gamma D times its projected length."""
    setup = setup_on(skewed(0.1, 0.06), cell, "proportional", 8)
    force = nodal_forces(setup, lambda x, y: np.where(x < 0.062, 1780.0, 1600.0))
    x = setup.problem.space.tabulate_dof_coordinates()[:, 0]
    shell = x > 1e-9
    assert force[shell, 0].sum() == pytest.approx(HEAD * 0.06, rel=1e-10)


@pytest.mark.parametrize("mushy_zone", list(SHARES))
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_resultant_of_a_curved_front(cell: str, mushy_zone: str) -> None:
    """A round pool in a quarter: gamma D times its radius on each line, better on finer meshes."""
    radius, errors = 0.05, []
    for cells in (8, 16, 32):
        setup = setup_on(box(0.1, 0.1), cell, mushy_zone, cells)
        force = nodal_forces(
            setup, lambda x, y: 1725.0 + 4000.0 * (radius - np.hypot(x, y)) / radius
        )
        places = setup.problem.space.tabulate_dof_coordinates()[:, :2]
        on_lines = [places[:, i] < 1e-9 for i in range(2)]
        found = [force[~on_lines[i], i].sum() / (HEAD * radius) for i in range(2)]
        assert found[0] == pytest.approx(found[1], rel=1e-10)
        errors.append(abs(found[0] - 1.0))
    assert errors[-1] < 0.01


@pytest.mark.parametrize("mushy_zone", list(SHARES))
def test_nothing_where_there_is_no_liquid(mushy_zone: str) -> None:
    setup = setup_on(box(0.1, 0.06), "quadrilateral", mushy_zone, 10)
    force = nodal_forces(setup, lambda x, y: np.where(x < 0.035, 1780.0, 1600.0))
    x = setup.problem.space.tabulate_dof_coordinates()[:, 0]
    assert np.abs(force[x > 0.0401]).max() == 0.0
    inside = (x > 1e-9) & (x < 0.0299)
    y = setup.problem.space.tabulate_dof_coordinates()[:, 1]
    inside &= (y > 1e-9) & (y < 0.06 - 1e-9)
    assert np.abs(force[inside]).max() < 1e-12 * HEAD
    cold = nodal_forces(setup, 1500.0)
    assert not cold.any()


def test_shares_of_the_mushy_zone() -> None:
    """(219) and the two extremes of Fig. 63."""
    solid = np.array([0.0, 1e-9, 0.5, 1.0 - 1e-9, 1.0])
    assert SHARES["proportional"](solid) == pytest.approx(1 - solid, abs=0.0)
    assert list(SHARES["full"](solid)) == [1, 1, 1, 1, 0]
    assert list(SHARES["none"](solid)) == [1, 0, 0, 0, 0]
    with pytest.raises(InputError, match=r"ferrostatic\.mushy_zone"):
        Ferrostatic(lambda t: 0.0, fraction, "half")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"ferrostatic\.outside"):
        Ferrostatic(lambda t: 0.0, fraction, outside="open")  # type: ignore[arg-type]


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_liquid_at_the_surface_is_held_from_outside(cell: str) -> None:
    """Before there is a shell the slice feels nothing; then the front alone."""
    setup = setup_on(skewed(0.1, 0.06), cell, "proportional", 8, outside="held")
    place = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    outside = (place[:, 0] > 1e-9) & (place[:, 1] > 1e-9)
    assert np.abs(nodal_forces(setup, 1780.0)[outside]).max() < 1e-12 * HEAD
    # Liquid up to the upper face, a shell at the right: gamma D times the height on the shell.
    force = nodal_forces(setup, lambda x, y: np.where(x < 0.062, 1780.0, 1600.0))
    assert force[place[:, 0] > 1e-9, 0].sum() == pytest.approx(HEAD * 0.06, rel=1e-10)
    upper = (place[:, 1] > 0.06 - 1e-9) & (place[:, 0] < 0.03) & (place[:, 0] > 1e-9)
    assert np.abs(force[upper]).max() < 1e-12 * HEAD


def test_liquid_is_held_on_the_deformed_surface() -> None:
    """The same blown up to 1.3 times its size."""
    given = {"ferrostatic": Ferrostatic(lambda t: HEAD, fraction), "large_strain": True}
    setup = SliceSetup(mapped(2, 2, box(0.1, 0.1)), elastic(), given=given, start=1780.0)
    problem = setup.problem
    problem.begin(setup.state, 1.0, setup.field(1780.0))
    places = problem.space.tabulate_dof_coordinates()[:, :2]
    local = np.concatenate([0.3 * places.ravel(), [0.0]])
    pressed = problem._evaluate(local).forces.reshape(-1, 2)
    problem.points.mean.fill(problem.fields.pressure, 0.0 * problem.pressure)
    problem.loads.liquid.x.array[:] = 0.0
    free = problem._evaluate(local).forces.reshape(-1, 2)
    inner = (places > 1e-9).all(axis=1)
    assert np.abs(pressed - free)[inner].max() < 1e-10 * HEAD * 0.1


def test_head_of_a_vertical_machine() -> None:
    head = Machine(Steady(0.06)).head(7000.0)
    assert head(10.0) == pytest.approx(7000.0 * 9.81 * 0.6)


def test_pressure_follows_the_walls_at_large_strain() -> None:
    """A liquid square blown up to 1.3 times its size: gamma D times its new length."""
    setup = SliceSetup(
        mapped(2, 2, box(0.1, 0.1)),
        elastic(),
        given={
            "ferrostatic": Ferrostatic(lambda t: HEAD, fraction, outside="free"),
            "large_strain": True,
        },
        start=1780.0,
    )
    problem = setup.problem
    problem.begin(setup.state, 1.0, setup.field(1780.0))
    places = problem.space.tabulate_dof_coordinates()[:, :2]
    local = np.concatenate([0.3 * places.ravel(), [0.0]])
    with_pressure = problem._evaluate(local).forces.reshape(-1, 2)
    problem.points.mean.fill(problem.fields.pressure, 0.0 * problem.pressure)
    without = problem._evaluate(local).forces.reshape(-1, 2)
    force = (without - with_pressure)[np.isclose(places[:, 0], 0.1), 0].sum()
    assert force == pytest.approx(HEAD * 0.13, rel=1e-10)
