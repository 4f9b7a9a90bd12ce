"""Patch tests: what a second-order slice must represent exactly, on distorted cells."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped, skewed

FREE = ("left", "bottom", "right", "top")
E, NU = 200e9, 0.3
SHAPES = [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 1), ("triangle", 2)]


def stiffness() -> Array:
    """Hooke's law for Mandel vectors."""
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
    setup = SliceSetup(mesh, given={"held": held, "planes": planes, "pin": False})
    setup.step(1.0)
    strain = np.array([1e-3, -2e-3, 5e-4, 3e-4 / np.sqrt(2)])
    assert np.abs(setup.stress / (stiffness() @ strain) - 1).max() < 1e-11


@pytest.mark.parametrize(("cell", "order"), SHAPES)
def test_free_expansion_makes_no_stress(cell: str, order: int) -> None:
    """Uniform heating, all generalized strains free, held as a rigid body alone."""
    setup = SliceSetup(
        mapped(3, 2, skewed(0.1, 0.07), cell, order, FREE),
        thermal=expansion(1e-5),
        given={"planes": PlainPlanes(("a0", "a1", "a2"))},
    )
    setup.step(1.0, 500.0)
    assert setup.state.generalized_strains == pytest.approx([5e-3, 0.0, 0.0, 0.0], abs=1e-13)
    assert np.abs(setup.state.stress).max() < 1e-10 * E * 5e-3


@pytest.mark.parametrize("imposed", [True, False])
@pytest.mark.parametrize(("cell", "order"), [s for s in SHAPES if s != ("triangle", 2)])
def test_bar_bending_is_exact(cell: str, order: int, imposed: bool) -> None:
    """Eps_zz = e0 + k y with u quadratic (physics: GPS bar bending), curvature or moment given."""
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
    setup = SliceSetup(mesh, elastic(E, NU), given={"planes": planes})
    result = setup.step(1.0)
    y = setup.places[:, 1]
    assert setup.state.generalized_strains == pytest.approx([e0, 0.0, k, 0.0], abs=1e-13)
    largest = E * (e0 + k * height / 2)
    assert np.abs(setup.stress[:, 2] - E * (e0 + k * y)).max() < 1e-10 * largest
    assert np.abs(setup.stress[:, [0, 1, 3]]).max() < 1e-10 * largest
    assert result.balance is not None
    assert result.balance.axial[2] == pytest.approx(E * inertia * k, rel=1e-10)
    # Displacement, but for the rigid motion that the pins choose.
    places = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    u = setup.state.displacement.reshape(-1, 2)
    x, y = places.T
    exact = -NU * np.column_stack([e0 * x + k * x * y, e0 * y + 0.5 * k * (y**2 - x**2)])
    on_sides = np.isclose(np.abs(x), width / 2) | np.isclose(np.abs(y), height / 2)
    rigid = np.zeros((2 * on_sides.sum(), 3))
    rigid[::2, 0] = rigid[1::2, 1] = 1.0
    rigid[::2, 2], rigid[1::2, 2] = -y[on_sides], x[on_sides]
    left = (u - exact)[on_sides].ravel()
    left -= rigid @ np.linalg.lstsq(rigid, left, rcond=None)[0]
    assert np.abs(left).max() < 1e-11 * np.abs(exact).max()


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_one_cell(cell: str) -> None:
    """A single cell (two triangles) of a quarter, pulled along the strand."""
    setup = SliceSetup(
        mapped(1, 1, box(0.01, 0.01), cell), given={"planes": PlainPlanes(force=lambda t: 1e3)}
    )
    setup.step(1.0)
    assert setup.stress[:, 2] == pytest.approx(1e7, rel=1e-11)
    assert np.abs(setup.stress[:, [0, 1, 3]]).max() < 1e-4
    assert setup.state.generalized_strains[0] == pytest.approx(1e7 / E, rel=1e-11)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_aspect_ratio_of_fifty(cell: str) -> None:
    """Thin cells change neither exactness nor the number of iterations."""
    planes = PlainPlanes(("a0", "a1", "a2"), moment_y=lambda t: 10.0)
    mesh = mapped(2, 20, box(0.1, 0.02, -0.05, -0.01), cell, 1, FREE)
    setup = SliceSetup(mesh, given={"planes": planes})
    result = setup.step(1.0)
    inertia = 0.1 * 0.02**3 / 12
    assert np.abs(setup.stress[:, 2] * inertia / (10.0 * setup.places[:, 1]) - 1).max() < 1e-8
    assert result.newton <= 2
