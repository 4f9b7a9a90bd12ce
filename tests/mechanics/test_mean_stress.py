"""The mean stress is stable on any mesh; its reduced integration prevents locking.

The rule is that of docs/mechanics.md; equation numbers are those of [Pascon2003]
(docs/references.md).
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep
from castfem.physics.machine import Machine, Steady
from castfem.physics.mechanics.quadrature_rules import Integration
from castfem.physics.mechanics.slice_definition import SHARES, Ferrostatic
from mechanics.mean_stress_blocks import (
    FOUR_TERMS,
    MESHES,
    SIDES,
    Block,
    colliding,
    inf_sup,
    punch,
    punch_error,
)
from mechanics.setups import Map, SliceSetup, box, elastic, mapped, pressed_tube, skewed


@pytest.mark.parametrize(
    ("name", "least"), zip(MESHES, (0.41, 0.42, 0.32, 0.34, 0.2, 0.16), strict=True)
)
def test_inf_sup_constant_does_not_decrease(name: str, least: float) -> None:
    """With all sides fixed only the uniform mean stress is spurious, on any mesh."""
    cell, shape, order = MESHES[name]
    counts = (2, 4, 8)
    found = [inf_sup(mapped(n, n, shape, cell, order, SIDES), None) for n in counts]
    assert [spurious for spurious, _ in found] == [1] * len(counts)
    constants = np.array([constant for _, constant in found])
    assert constants.min() > least
    assert (constants[1:] > 0.92 * constants[:-1]).all()


def test_fourth_term_is_unstable() -> None:
    found = [inf_sup(mapped(n, n, box(1.0, 1.0), groups=SIDES), FOUR_TERMS) for n in (2, 4, 8)]
    assert [spurious for spurious, _ in found] == [2, 2, 2]
    assert found[-1][1] < 0.4 * found[0][1]


def xy_term_in_results(block: Block) -> float:
    """Return the rms of the term xy of the mean stress in the results, over the total rms."""
    points = block.problem.points
    x, y = 2.0 * points.deviator.points.T - 1.0
    mean = points.recovered(block.state.stress)[:, :3].mean(axis=1).reshape(-1, len(x))
    terms = np.linalg.lstsq(np.column_stack([np.ones(len(x)), x, y, x * y]), mean.T, rcond=None)[0]
    return float(np.sqrt(np.mean(terms[3] ** 2) / np.mean(mean**2)))


def test_mean_stress_under_a_punch_has_no_checkerboard() -> None:
    """Poisson's ratio is 0.499999; the reference is a mesh four times as fine."""
    fine = punch(32, None)
    blocks = {n: punch(n, None) for n in (4, 8)}
    errors = np.array([punch_error(block, fine, n) for n, block in blocks.items()])
    assert errors[-1, 0] < 0.012
    assert errors[0, 0] > 2.5 * errors[1, 0]
    four = punch(8, FOUR_TERMS)
    assert punch_error(four, fine, 8)[1] > 3.0 * errors[-1, 0]
    assert xy_term_in_results(blocks[8]) < 1e-12
    assert xy_term_in_results(four) > 0.03


@pytest.mark.parametrize(("cell", "last"), [("quadrilateral", 8e-3), ("triangle", 4e-2)])
def test_mean_stress_of_colliding_flows_is_of_second_order(cell: str, last: float) -> None:
    """Stokes' flow between walls has a closed form."""
    errors = np.array([colliding(n, None, cell) for n in (4, 8, 16)])
    assert errors[-1] < last
    assert np.log2(errors[:-1] / errors[1:]).min() > 1.7


def test_projection_on_linear_functions_is_exact() -> None:
    """The projection keeps functions linear in x and y on any cell, and is self-adjoint."""
    for order in (1, 2):
        points = SliceSetup(mapped(3, 3, skewed(0.1, 0.07), order=order), elastic()).problem.points
        x, y = points.mean.position.T
        straight = 3.0 - 20.0 * x + 7.0 * y
        assert np.abs(points.linear(straight) - straight).max() < 1e-13
        one, other = np.random.default_rng(0).normal(size=(2, len(x)))
        volume = points.mean.volume
        work = volume @ (points.linear(one) * other)
        assert work == pytest.approx(volume @ (one * points.linear(other)), rel=1e-12)
        assert np.abs(points.linear(points.linear(one)) - points.linear(one)).max() < 1e-12
        by_cell = (volume * (one - points.linear(one))).reshape(-1, 4).sum(axis=1)
        assert np.abs(by_cell).max() < 1e-16  # integrals over cells are kept


@pytest.mark.parametrize("thin", [1.0, 1e3])
def test_projection_is_exact_on_thin_and_rotated_cells(thin: float) -> None:
    def shape(s: Any, t: Any) -> Any:
        return 0.8 * s - 0.6 * t / thin, 0.6 * s + 0.8 * t / thin

    points = SliceSetup(mapped(2, 2, shape, groups=SIDES), elastic()).problem.points
    x, y = points.mean.position.T
    straight = 3.0 - 20.0 * x + 7.0 * y
    assert np.abs(points.linear(straight) - straight).max() < 1e-11


INNER, OUTER, PRESSURE, E, NU = 0.02, 0.04, 1e7, 200e9, 0.499999
ONE_RULE = Integration(4, 4, linear=False)


def tube(cells: int, cell: str, rules: Integration | None, law: object = None) -> SliceSetup:
    """Set up a quarter of a thick tube under inner pressure, in plane strain."""
    law, settings = law or elastic(E, NU), {"cell": cell, "integration": rules}
    return pressed_tube((cells, cells), (INNER, OUTER), law, lambda t: PRESSURE, **settings)


def bore(setup: SliceSetup, nodal: Array) -> float:
    """Return the radial part of a nodal field at the bore."""
    places = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    at = int(np.argmin(np.abs(places - [INNER, 0.0]).sum(axis=1)))
    return float(nodal.reshape(-1, 2)[at, 0])


def lame_errors(setup: SliceSetup) -> tuple[float, float]:
    """Return the errors of the displacement of the bore and of the mean stress (rms/pressure)."""
    setup.step(1.0)
    share = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    exact = share * (1 + NU) / E * ((1 - 2 * NU) * INNER + OUTER**2 / INNER)
    mean = setup.stress[:, :3].mean(axis=1) - 2 * (1 + NU) / 3 * share
    moved = bore(setup, setup.state.displacement) / exact - 1
    return abs(moved), float(np.sqrt(np.mean(mean**2))) / PRESSURE


@pytest.mark.parametrize(
    ("cell", "displacement", "stress"), [("quadrilateral", 2e-4, 2e-4), ("triangle", 2e-3, 1e-2)]
)
def test_nearly_incompressible_tube_does_not_lock(
    cell: str, displacement: float, stress: float
) -> None:
    found = lame_errors(tube(4, cell, None))
    assert found[0] < displacement
    assert found[1] < stress
    locked = lame_errors(tube(4, cell, ONE_RULE))
    assert locked[0] > 5 * found[0]
    assert locked[1] > 0.5


def test_creeping_tube_does_not_lock() -> None:
    """The bore has the stationary speed of Norton's law; with a single rule it hardly moves."""
    speeds = []
    for rules in (None, ONE_RULE):
        law = NortonCreep.constant(Elasticity.constant(20e9, 0.3), 1e-9, 1e6, 5.0)
        setup, time = tube(4, "quadrilateral", rules, law), 0.0
        for dt in 2.0 ** np.arange(20):
            time += dt
            setup.step(time)
        speeds.append(bore(setup, setup.state.rate) / 1.037924e-5)
    assert speeds[0] == pytest.approx(1.0, abs=5e-4)
    assert speeds[1] < 0.1


# Ferrostatic pressure: its resultant on the shell for any mesh, and where it acts.


SOLIDUS, LIQUIDUS, HEAD = 1700.0, 1750.0, 3.0e5


def fraction(temperature: Array) -> Array:
    return np.clip((LIQUIDUS - temperature) / (LIQUIDUS - SOLIDUS), 0.0, 1.0)


def nodal_forces(setup: SliceSetup, temperature: Any) -> Array:
    """Return the nodal forces of the pressure (n, 2), N/m, at zero displacement."""
    problem = setup.problem
    problem.begin(setup.state, 1.0, setup.field(temperature))
    residual_state = problem._evaluate(np.zeros(problem.solver.x.getLocalSize()))
    return -residual_state.forces.reshape(-1, 2)


def setup_on(
    shape: Map, cell: str, mushy_zone: str, cells: int = 9, order: int = 1, outside: str = "free"
) -> SliceSetup:
    pressure = Ferrostatic(lambda t: HEAD, fraction, mushy_zone, outside)  # type: ignore[arg-type]
    mesh = mapped(cells, cells, shape, cell, order)
    return SliceSetup(mesh, elastic(), settings={"ferrostatic": pressure}, start=1600.0)


@pytest.mark.parametrize("mushy_zone", list(SHARES))
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_resultant_at_a_straight_front_is_exact(cell: str, mushy_zone: str) -> None:
    """Gamma D times the height, for any position of the front and width of the mushy zone."""
    height = 0.06
    setup = setup_on(box(0.1, height), cell, mushy_zone)
    x = setup.problem.space.tabulate_dof_coordinates()[:, 0]
    # All nodes off the line of symmetry belong to the shell and the mushy zone, or are balanced.
    shell = x >= 1e-9
    for front, width in product((0.043, 0.0555, 0.0777), (0.0, 0.004, 0.03)):
        ends = [front - width - 1e-9, front]
        force = nodal_forces(setup, lambda x, y, at=ends: np.interp(x, at, [1780.0, 1600.0]))
        assert force[shell, 0].sum() == pytest.approx(HEAD * height, rel=1e-10), (front, width)
        assert np.abs(force.sum(axis=0)).max() < 1e-10 * HEAD * height, (front, width)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_resultant_on_distorted_cells_is_exact(cell: str) -> None:
    """The front crosses distorted liquid cells: gamma D times its projected length."""
    setup = setup_on(skewed(0.1, 0.06), cell, "proportional", 8)
    force = nodal_forces(setup, lambda x, y: np.where(x < 0.062, 1780.0, 1600.0))
    x = setup.problem.space.tabulate_dof_coordinates()[:, 0]
    shell = x > 1e-9
    assert force[shell, 0].sum() == pytest.approx(HEAD * 0.06, rel=1e-10)


@pytest.mark.parametrize("mushy_zone", list(SHARES))
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_resultant_at_a_curved_front_converges(cell: str, mushy_zone: str) -> None:
    """A round pool in a quarter: gamma D times its radius on each line of symmetry."""
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
def test_solid_has_no_ferrostatic_force(mushy_zone: str) -> None:
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


def test_shares_of_the_pressure_in_the_mushy_zone() -> None:
    """(219) and the two limits of Fig. 63."""
    solid = np.array([0.0, 1e-9, 0.5, 1.0 - 1e-9, 1.0])
    assert SHARES["proportional"](solid) == pytest.approx(1 - solid, abs=0.0)
    assert list(SHARES["full"](solid)) == [1, 1, 1, 1, 0]
    assert list(SHARES["none"](solid)) == [1, 0, 0, 0, 0]
    with pytest.raises(InputError, match=r"ferrostatic\.mushy_zone"):
        Ferrostatic(lambda t: 0.0, fraction, "half")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"ferrostatic\.outside"):
        Ferrostatic(lambda t: 0.0, fraction, outside="open")  # type: ignore[arg-type]


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_liquid_at_the_surface_is_supported_from_outside(cell: str) -> None:
    """Without a shell no force acts; with a shell only that on the front."""
    setup = setup_on(skewed(0.1, 0.06), cell, "proportional", 8, outside="held")
    place = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    outside = (place[:, 0] > 1e-9) & (place[:, 1] > 1e-9)
    assert np.abs(nodal_forces(setup, 1780.0)[outside]).max() < 1e-12 * HEAD
    # With liquid at the upper face and a shell on the right: gamma D times the height of the shell.
    force = nodal_forces(setup, lambda x, y: np.where(x < 0.062, 1780.0, 1600.0))
    assert force[place[:, 0] > 1e-9, 0].sum() == pytest.approx(HEAD * 0.06, rel=1e-10)
    upper = (place[:, 1] > 0.06 - 1e-9) & (place[:, 0] < 0.03) & (place[:, 0] > 1e-9)
    assert np.abs(force[upper]).max() < 1e-12 * HEAD


def scaled_square(outside: str) -> tuple[Array, Array]:
    """Return the nodes of a liquid square scaled by 1.3, and the forces of its pressure."""
    pressure = Ferrostatic(lambda t: HEAD, fraction, outside=outside)  # type: ignore[arg-type]
    settings = {"ferrostatic": pressure, "large_strain": True}
    setup = SliceSetup(mapped(2, 2, box(0.1, 0.1)), elastic(), settings=settings, start=1780.0)
    problem = setup.problem
    problem.begin(setup.state, 1.0, setup.field(1780.0))
    places = problem.space.tabulate_dof_coordinates()[:, :2]
    local = np.concatenate([0.3 * places.ravel(), [0.0]])
    pressed = problem._evaluate(local).forces.reshape(-1, 2)
    problem.points.mean.fill(problem.fields.pressure, 0.0 * problem.pressure)
    if outside == "held":
        problem.loads.liquid.x.array[:] = 0.0
    return places, problem._evaluate(local).forces.reshape(-1, 2) - pressed


def test_outer_pressure_acts_on_the_deformed_surface() -> None:
    """The inner and the outer pressure on liquid cancel."""
    places, forces = scaled_square("held")
    inner = (places > 1e-9).all(axis=1)
    assert np.abs(forces)[inner].max() < 1e-10 * HEAD * 0.1


def test_head_of_a_vertical_machine() -> None:
    head = Machine(Steady(0.06)).head(7000.0)
    assert head(10.0) == pytest.approx(7000.0 * 9.81 * 0.6)


def test_pressure_follows_the_walls_at_large_strain() -> None:
    """The force is gamma D times the deformed length."""
    places, by_pressure = scaled_square("free")
    force = by_pressure[np.isclose(places[:, 0], 0.1), 0].sum()
    assert force == pytest.approx(HEAD * 0.13, rel=1e-10)
