"""Closed forms: patch tests, free thermal stress, tubes, creep, bending."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement
from mechanics.setups import (
    RING_GROUPS,
    SliceSetup,
    box,
    elastic,
    expansion,
    mapped,
    pressed_tube,
    ring,
    skewed,
)
from mechanics.weiner_boley import HalfSpace, Strip

pytestmark = pytest.mark.slow


MPA = 1e6
CELLS = ["quadrilateral", "triangle"]


def quench(x: Array, y: Array) -> Array:
    """Return the temperature change of the free square, K."""
    return np.asarray(-400.0 * ((x / 0.1) ** 8 + (y / 0.1) ** 8))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("cell", CELLS)
def test_unrestrained_square_has_the_mean_thermal_strain(cell: str, poisson: float) -> None:
    """Strain_zz is alpha mean(dT) for any Poisson's ratio and temperature field."""
    alpha, young = 1.35e-5, 200e9
    mesh = mapped(8, 8, skewed(0.1, 0.1, 0.05), cell)
    setup = SliceSetup(mesh, elastic(young, poisson), expansion(alpha), tolerance=1e-12)
    result = setup.step(1.0, quench)
    points = setup.problem.points
    heat = setup.problem.at_points(setup.state.temperature)
    for rows in (slice(0, points.deviator_points), slice(points.deviator_points, None)):
        mean = points.volume[rows] @ heat[rows] / points.volume[rows].sum()
        # The points of the mean stress sample the field more coarsely than those of the deviator.
        assert setup.state.generalized_strains[0] == pytest.approx(alpha * mean, rel=1e-9)
    assert result.balance.axial_error < 1e-12
    # Without Poisson's effect the axial stress is that of the remaining axial strain.
    hot = heat[: points.deviator_points]
    strain = setup.state.generalized_strains[0] - alpha * hot
    if poisson == 0.0:
        stress = setup.state.stress[: points.deviator_points, 2]
        assert np.abs(stress - young * strain).max() < 1e-10 * young * np.abs(strain).max()


def test_stress_at_the_free_corner_is_uniaxial() -> None:
    """Sigma_zz = E (strain_zz - alpha dT) where both faces are free, to second order."""
    alpha, young = 1.35e-5, 200e9
    errors = []
    for n in (8, 16, 32):
        setup = SliceSetup(mapped(n, n, box(0.1, 0.1)), elastic(young), expansion(alpha))
        setup.step(1.0, quench)
        corner = setup.stress[np.argmax(setup.places.sum(axis=1))]
        place = setup.places[np.argmax(setup.places.sum(axis=1))]
        exact = young * (setup.state.generalized_strains[0] - alpha * quench(*place))
        errors.append(abs(corner[2] / exact - 1.0))
    assert errors[-1] < 0.01
    assert np.log2(errors[0] / errors[-1]) / 2 > 1.0


@pytest.mark.parametrize("cell", CELLS)
def test_thermoelastic_tube_has_its_closed_form(cell: str) -> None:
    """Timoshenko's tube with a hot bore in generalized plane strain, free of axial force."""
    a, b, hot, alpha, young, nu = 0.02, 0.04, 100.0, 1e-5, 200e9, 0.3

    def heat(x: Array, y: Array) -> Array:
        return np.asarray(hot * np.log(b / np.hypot(x, y)) / np.log(b / a))

    found = []
    for n in (4, 8):
        setup = SliceSetup(
            mapped(n, n, ring(a, b), cell, 2, RING_GROUPS), elastic(young, nu), expansion(alpha)
        )
        setup.step(1.0, heat)
        r = np.hypot(*setup.places.T)
        log, share = np.log(b / a), a**2 / (b**2 - a**2)
        level = alpha * young * hot / (2 * (1 - nu) * log)
        axial = level * (1 - 2 * np.log(b / r) - 2 * share * log)
        error = setup.stress[:, 2] - axial
        found.append(float(np.sqrt(np.mean(error**2)) / level))
        mean = 2 * alpha * hot * (0.25 * (b**2 - a**2) - 0.5 * a**2 * log) / (log * (b**2 - a**2))
        assert setup.state.generalized_strains[0] == pytest.approx(mean, rel=0.7 / n**2)
    assert found[-1] < 0.01
    assert np.log2(found[0] / found[1]) > (1.0 if cell == "triangle" else 1.7)


def cylinder(cells: int, cell: str = "quadrilateral") -> SliceSetup:
    """Let a thick cylinder under inner pressure creep until its stress is stationary."""
    law = NortonCreep.constant(Elasticity.constant(20e9, 0.3), 1e-9, MPA, 5.0)
    setup = pressed_tube((cells, cells), (0.02, 0.04), law, lambda t: 10 * MPA, cell=cell)
    time, dt = 0.0, 1.0
    while time < 1e6:
        time += dt
        setup.step(time)
        dt *= 2.0
    return setup


def creep_errors(setup: SliceSetup) -> tuple[float, float]:
    """Return the largest rms error of the stresses over the pressure, and the error of udot."""
    a, b, p, n = 0.02, 0.04, 10 * MPA, 5.0
    r = np.hypot(*setup.places.T)
    c, s = setup.places.T / r
    stress = setup.stress
    shear = np.sqrt(2.0) * stress[:, 3] * c * s
    radial = stress[:, 0] * c * c + stress[:, 1] * s * s + shear
    hoop = stress[:, 0] * s * s + stress[:, 1] * c * c - shear
    spread, q = (b / a) ** (2 / n) - 1, (b / r) ** (2 / n)
    exact_radial, exact_hoop = -p * (q - 1) / spread, p * ((2 / n - 1) * q + 1) / spread
    differences = (
        radial - exact_radial, hoop - exact_hoop, stress[:, 2] - 0.5 * (exact_radial + exact_hoop)
    )  # fmt: skip
    inner = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    at = int(np.argmin(np.abs(inner - [a, 0.0]).sum(axis=1)))
    rate = setup.state.rate[2 * at]
    return (
        max(float(np.sqrt(np.mean(d**2))) for d in differences) / p,
        abs(float(rate) / 1.037924e-5 - 1.0),
    )


def test_thick_cylinder_creeps_as_its_closed_form() -> None:
    """Stress and rate of the stationary state, with D = (b/a)^(2/n) - 1, converge."""
    found = np.array([creep_errors(cylinder(n)) for n in (2, 4, 8)])
    assert found[-1, 0] < 1e-3
    assert found[-1, 1] < 2e-5
    orders = np.log2(found[:-1] / found[1:])
    assert orders[:, 0].min() > 1.9
    assert orders[:, 1].min() > 3.5


def test_thick_cylinder_creeps_on_triangles() -> None:
    stress, rate = creep_errors(cylinder(8, "triangle"))
    assert stress < 5e-3
    assert rate < 1e-3


def test_creeping_bar_has_the_moment_of_norton() -> None:
    """M = 2 b (k/A)^(1/n) (h/2)^(2 + 1/n) / (2 + 1/n) at a constant rate of curvature."""
    height, width, rate = 0.22, 1.2, 1e-3
    law = NortonCreep.constant(Elasticity.constant(20e9, 0.3), 1e-9, MPA, 5.0)
    # y = 0 is the neutral axis: the upper half is modelled, symmetric in x, fixed in y at y = 0.
    setup = SliceSetup(
        mapped(
            1, 8, box(width / 2, height / 2), groups=("symmetry_x", "neutral", "side", "outside")
        ),
        law,
        settings={"planes": PlainPlanes((), {"a2": lambda t: rate * t})},
    )
    for time in np.cumsum(np.geomspace(1e-2, 2e4, 40)):
        result = setup.step(float(time))
    moment = 4 * result.balance.axial[2]
    assert moment == pytest.approx(1.345403e5, rel=2e-3)
    outer = setup.stress[np.argmax(setup.places[:, 1]), 2]
    y = setup.places[:, 1].max()
    assert outer == pytest.approx(10.1924e6 * (y / (height / 2)) ** 0.2, rel=1e-3)


FREE = ("left", "bottom", "right", "top")
E, NU = 200e9, 0.3
SHAPES = [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 1), ("triangle", 2)]


def stiffness() -> Array:
    """Return the matrix of Hooke's law for Mandel vectors."""
    shear, bulk = 0.5 * E / (1 + NU), E / (3 * (1 - 2 * NU))
    one = np.array([1.0, 1.0, 1.0, 0.0])
    return 2 * shear * (np.eye(4) - np.outer(one, one) / 3) + bulk * np.outer(one, one)


@pytest.mark.parametrize(("cell", "order"), SHAPES)
def test_linear_displacement_gives_constant_stress(cell: str, order: int) -> None:
    gradient = np.array([[1e-3, -4e-4], [7e-4, -2e-3]])
    held = tuple(
        PrescribedDisplacement(FREE, i, lambda p, t, g=gradient[i]: t * (p @ g))  # type: ignore[misc]
        for i in range(2)
    )
    planes = PlainPlanes((), {"a0": lambda t: 5e-4 * t})
    mesh = mapped(3, 3, skewed(0.1, 0.07), cell, order, FREE)
    setup = SliceSetup(mesh, settings={"held": held, "planes": planes, "pin": False})
    setup.step(1.0)
    strain = np.array([1e-3, -2e-3, 5e-4, 3e-4 / np.sqrt(2)])
    assert np.abs(setup.stress / (stiffness() @ strain) - 1).max() < 1e-11


@pytest.mark.parametrize(("cell", "order"), SHAPES)
def test_free_expansion_makes_no_stress(cell: str, order: int) -> None:
    """Uniform heating with all generalized strains free and only rigid motions fixed."""
    setup = SliceSetup(
        mapped(3, 2, skewed(0.1, 0.07), cell, order, FREE),
        thermal=expansion(1e-5),
        settings={"planes": PlainPlanes(("a0", "a1", "a2"))},
    )
    setup.step(1.0, 500.0)
    assert setup.state.generalized_strains == pytest.approx([5e-3, 0.0, 0.0, 0.0], abs=1e-13)
    assert np.abs(setup.state.stress).max() < 1e-10 * E * 5e-3


@pytest.mark.parametrize("imposed", [True, False])
@pytest.mark.parametrize(("cell", "order"), [s for s in SHAPES if s != ("triangle", 2)])
def test_bar_bending_is_exact(cell: str, order: int, imposed: bool) -> None:
    """Eps_zz = e0 + k y with quadratic u, for a prescribed curvature or moment."""
    width, height, e0, k = 0.04, 0.06, 2e-4, 0.05
    inertia, area = width * height**3 / 12, width * height
    if imposed:
        planes = PlainPlanes(("a1",), {"a0": lambda t: e0 * t, "a2": lambda t: k * t})
    else:
        planes = PlainPlanes(
            ("a0", "a1", "a2"), force=lambda t: E * area * e0, moment_y=lambda t: E * inertia * k
        )
    straight = box(width, height, -width / 2, -height / 2)
    warped = skewed(width, height)

    def centred(s: Array, t: Array) -> tuple[Array, Array]:
        x, y = warped(s, t)
        return x - width / 2, y - height / 2

    # Second-order displacement contains all quadratics on straight-sided cells only.
    mesh = mapped(2, 4, centred if order == 1 else straight, cell, order, FREE)
    setup = SliceSetup(mesh, elastic(E, NU), settings={"planes": planes})
    result = setup.step(1.0)
    y = setup.places[:, 1]
    assert setup.state.generalized_strains == pytest.approx([e0, 0.0, k, 0.0], abs=1e-13)
    largest = E * (e0 + k * height / 2)
    assert np.abs(setup.stress[:, 2] - E * (e0 + k * y)).max() < 1e-10 * largest
    assert np.abs(setup.stress[:, [0, 1, 3]]).max() < 1e-10 * largest
    assert result.balance.axial[2] == pytest.approx(E * inertia * k, rel=1e-10)
    # Displacement except the rigid motion, which depends on the pins.
    places = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    u = setup.state.displacement.reshape(-1, 2)
    x, y = places.T
    exact = -NU * np.column_stack([e0 * x + k * x * y, e0 * y + 0.5 * k * (y**2 - x**2)])
    on_sides = np.isclose(np.abs(x), width / 2) | np.isclose(np.abs(y), height / 2)
    rigid = np.zeros((2 * on_sides.sum(), 3))
    rigid[::2, 0] = rigid[1::2, 1] = 1.0
    rigid[::2, 2], rigid[1::2, 2] = -y[on_sides], x[on_sides]
    error = (u - exact)[on_sides].ravel()
    error -= rigid @ np.linalg.lstsq(rigid, error, rcond=None)[0]
    assert np.abs(error).max() < 1e-11 * np.abs(exact).max()


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_single_cell_is_exact(cell: str) -> None:
    """A quarter of a single quadrilateral or two triangles, pulled along the strand."""
    setup = SliceSetup(
        mapped(1, 1, box(0.01, 0.01), cell), settings={"planes": PlainPlanes(force=lambda t: 1e3)}
    )
    setup.step(1.0)
    assert setup.stress[:, 2] == pytest.approx(1e7, rel=1e-11)
    assert np.abs(setup.stress[:, [0, 1, 3]]).max() < 1e-4
    assert setup.state.generalized_strains[0] == pytest.approx(1e7 / E, rel=1e-11)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_thin_cells_are_exact(cell: str) -> None:
    """Thin cells change neither exactness nor the number of iterations."""
    planes = PlainPlanes(("a0", "a1", "a2"), moment_y=lambda t: 10.0)
    mesh = mapped(2, 20, box(0.1, 0.02, -0.05, -0.01), cell, 1, FREE)
    setup = SliceSetup(mesh, settings={"planes": planes})
    result = setup.step(1.0)
    inertia = 0.1 * 0.02**3 / 12
    assert np.abs(setup.stress[:, 2] * inertia / (10.0 * setup.places[:, 1]) - 1).max() < 1e-8
    assert result.newton <= 2


# The solidifying half-space: stress of the strip, compared with the closed form.


EXACT = HalfSpace()


def test_closed_form_gives_the_published_values() -> None:
    assert EXACT.front == pytest.approx(0.665780, abs=1e-6)
    assert EXACT.compressed == pytest.approx(0.147449, abs=1e-6)
    assert EXACT.stretched == pytest.approx(0.263898, abs=1e-6)
    assert EXACT.rate == pytest.approx(-4.053264e-3, rel=1e-6)
    depths = np.array([0.0, 2, 3, 4, 5, 6, 8, 10, 12, 15]) * 1e-3
    published = [
        -20.0,
        -17.0865,
        -15.6427,
        -3.7846,
        8.1180,
        11.2705,
        8.7490,
        6.2234,
        3.8720,
        0.7113,
    ]
    assert EXACT.stress(depths, 21.0) / 1e6 == pytest.approx(published, abs=2e-4)
    depths = np.arange(8) * 1e-3
    published = [-20.0, -17.0149, -2.0916, 11.1986, 8.4924, 5.9232, 3.5397, 1.3614]
    assert EXACT.stress(depths, 5.0) / 1e6 == pytest.approx(published, abs=2e-4)
    assert EXACT.shell(21.0) == pytest.approx(15.7433e-3, abs=1e-7)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_coarse_strip_has_the_stated_error(cell: str) -> None:
    """With cells of 0.5 mm the error is below 5 % of 20 MPa at 5 s and 3 % at 21 s."""
    strip = Strip(0.5e-3, cell=cell).advance(5.0, 0.1)
    assert strip.error(EXACT) < 0.05
    strip.advance(21.0, 0.2)
    assert strip.error(EXACT) < 0.03
    # The two in-plane directions are equivalent, and free of force.
    stress = strip.stress
    close = 1e-6 if cell == "quadrilateral" else 0.03
    assert np.abs(stress[:, 1] - stress[:, 2]).max() < close * 20e6
    assert strip.state.generalized_strains[0] == pytest.approx(
        strip.state.generalized_strains[3], rel=close
    )
    assert max(r.balance.axial_error for r in strip.results if r.balance) < 1e-8
    # The stress across the shell is almost 0.
    assert np.abs(stress[:, 0]).max() < 0.05 * 20e6


def test_fine_strip_has_the_stated_error() -> None:
    """With cells of 0.1 mm the error is below 1 % at 5 s, and the peak is in its place."""
    strip = Strip(0.1e-3, length=0.015).advance(5.0, 0.04)
    assert strip.error(EXACT) < 0.01
    peak = int(np.argmax(strip.stress[:, 2]))
    assert strip.stress[peak, 2] == pytest.approx(11.2711e6, rel=0.02)
    assert strip.depth[peak] == pytest.approx(2.921e-3, abs=0.15e-3)
    # In-plane strain rate, K / 2t, over the last second.
    rate = (
        strip.state.generalized_strains[0] - strip.results[-26].state.generalized_strains[0]
    ) / 1.0
    mean = EXACT.rate / 2 * np.log(5.0 / 4.0)
    assert rate == pytest.approx(mean, rel=0.01)


def test_error_decreases_with_the_cell_size() -> None:
    coarse, fine = (
        Strip(size, length=0.015).advance(5.0, 0.05).error(EXACT) for size in (1e-3, 0.25e-3)
    )
    assert np.log2(coarse / fine) / 2 > 0.9
