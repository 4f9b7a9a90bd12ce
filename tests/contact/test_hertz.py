"""Hertz contact of a cylinder on a rigid plane: closed form and order in the mesh."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mechanics.setups import SliceSetup, elastic, mapped

from castfem.base.types import Array
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import ContactState
from castfem.physics.contact.summary import summary
from castfem.physics.mechanics.supports import PrescribedDisplacement
from contact.setups import PLANE_STRAIN, LineWall

pytestmark = pytest.mark.slow

RADIUS, SIZE, YOUNG, POISSON = 100e-3, 16e-3, 200e9, 0.3
STIFF = YOUNG / (1 - POISSON**2)


def graded(share: Array, finest: float) -> Array:
    """Map 0 to 1 so that the steps grow, the first being `finest` times the last."""
    c = -np.log(finest)
    return np.asarray(np.expm1(c * share) / np.expm1(c))


def cylinder(cells: int, method: str, cell: str, depth: Callable[[float], float]) -> SliceSetup:
    """Set up half of the foot of a cylinder, pushed onto a plane to a depth over time."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        x, up = SIZE * graded(s, 0.1), graded(t, 0.1)
        bottom = RADIUS - np.sqrt(RADIUS**2 - x**2)
        return x, bottom + (SIZE - bottom) * up

    groups = ("symmetry_x", "foot", "right", "top")
    wall = LineWall(lambda z: np.zeros(2), lambda z: np.pi)
    return SliceSetup(
        mapped(cells, cells, shape, cell, order=2, groups=groups),
        elastic(YOUNG, POISSON),
        settings={
            "planes": PLANE_STRAIN,
            "held": (PrescribedDisplacement(("top",), 1, lambda x, t: np.full(len(x), -depth(t))),),
            "pin": False,
            "interactions": (Contact(wall, ("foot",), method=method),),  # type: ignore[arg-type]
        },
    )


def hertz_errors(state: ContactState, force: float) -> tuple[float, float, float]:
    """Return the relative errors of the pressure (L2), of its peak and of the contact width."""
    half = np.sqrt(4 * force * RADIUS / (np.pi * STIFF))
    peak = 2 * force / (np.pi * half)
    x = state.place[:, 0]
    exact = peak * np.sqrt(np.maximum(1 - (x / half) ** 2, 0.0))
    error = np.sqrt(state.weight @ (state.pressure - exact) ** 2 / (state.weight @ exact**2))
    order = np.argsort(x)
    width = state.weight[state.pressure > 0].sum()
    # The peak by a fit of the pressures near the middle: p^2 is linear in x^2.
    inner = order[: max(4, int((x < 0.5 * half).sum()))]
    fit = np.polyfit((x[inner] / half) ** 2, (state.pressure[inner] / peak) ** 2, 1)
    return float(error), float(np.sqrt(fit[1]) - 1), float(width / half - 1)


def mean_errors(cells: int, method: str, cell: str) -> Array:
    """Return the rms errors over several loads, as the end of contact within a cell varies."""
    setup, found = cylinder(cells, method, cell, lambda t: 16e-6 * t), []
    for time in np.linspace(0.4, 1.0, 5):
        setup.step(time)
        force = (
            2
            * summary(
                setup.problem.contact, setup.state.contact, setup.state.generalized_strains
            ).force[1]
        )
        found.append(hertz_errors(setup.state.contact, force))
    return np.asarray(np.sqrt(np.mean(np.square(found), axis=0)))


@pytest.mark.parametrize(
    ("method", "cell"),
    [(m, c) for m in ("penalty", "nitsche") for c in ("quadrilateral", "triangle")],
)
def test_cylinder_on_a_plane_converges_to_hertz(method: str, cell: str) -> None:
    errors = np.array([mean_errors(cells, method, cell) for cells in (12, 48)])
    order = np.log2(errors[0] / errors[1]) / 2
    # The pressure falls to zero like a square root at the end of contact, so the order is 1.
    assert order[0] > 0.7 and order[2] > 0.7
    assert errors[1] == pytest.approx([0.0, 0.0, 0.0], abs=0.04)
    assert errors[1, 1] < (6e-3 if method == "penalty" else 1e-3)


@pytest.mark.parametrize("method", ["penalty", "nitsche"])
def test_cylinder_has_the_hertz_values_at_a_load(method: str) -> None:
    """1000 N/mm give a half width of 0.761 mm and a peak of 836.4 MPa."""
    load, half, peak = 1e6, 0.761133e-3, 836.410e6
    depths, forces = [0.0, 11.4e-6], [0.0]
    setup = cylinder(48, method, "quadrilateral", lambda t: depths[-1])
    while abs(forces[-1] / load - 1.0) > 1e-6:  # the depth at this load, by secants
        assert len(depths) < 8
        setup.step(float(len(forces)))
        found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
        forces.append(2 * found.force[1])
        slope = (depths[-1] - depths[-2]) / (forces[-1] - forces[-2])
        depths.append(depths[-1] + slope * (load - forces[-1]))
    state = setup.state.contact
    assert state.weight[state.pressure > 0.0].sum() == pytest.approx(half, rel=0.02)
    assert state.pressure.max() == pytest.approx(peak, rel=5e-3)
    # The fitted peak, as above.
    assert abs(hertz_errors(state, load)[1]) < (6e-3 if method == "penalty" else 1e-3)
