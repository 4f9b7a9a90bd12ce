"""Hertz: a cylinder on a rigid flat, against the closed form, with the order in the mesh."""

from __future__ import annotations

import numpy as np
import pytest
from mechanics.scenes import Array, SliceScene, elastic, mapped

from castfem.contact.contact import Contact
from castfem.contact.outcome import summary
from castfem.contact.state import ContactState
from castfem.mechanics.supports import Held
from contact.scenes import PLANE_STRAIN, LineWall

RADIUS, SIZE, YOUNG, POISSON = 100e-3, 16e-3, 200e9, 0.3
STIFF = YOUNG / (1 - POISSON**2)


def graded(share: Array, finest: float) -> Array:
    """0 ... 1 in steps that grow from `finest` times their mean."""
    c = -np.log(finest)
    return np.asarray(np.expm1(c * share) / np.expm1(c))


def cylinder(cells: int, method: str, cell: str, depth: float) -> SliceScene:
    """The foot of a cylinder, half of it, pushed onto a flat."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        x, up = SIZE * graded(s, 0.1), graded(t, 0.1)
        bottom = RADIUS - np.sqrt(RADIUS**2 - x**2)
        return x, bottom + (SIZE - bottom) * up

    groups = ("symmetry_x", "foot", "right", "top")
    wall = LineWall(lambda z: np.zeros(2), lambda z: np.pi)
    return SliceScene(
        mapped(cells, cells, shape, cell, order=2, groups=groups),
        elastic(YOUNG, POISSON),
        given={
            "planes": PLANE_STRAIN,
            "held": (Held(("top",), 1, lambda x, t: np.full(len(x), -depth * t)),),
            "pin": False,
            "contact": Contact(wall, ("foot",), method=method),  # type: ignore[arg-type]
        },
    )


def against_hertz(state: ContactState, force: float) -> tuple[float, float, float]:
    """Error of the pressure (L2), of its peak, and of the width in contact, all relative."""
    half = np.sqrt(4 * force * RADIUS / (np.pi * STIFF))
    peak = 2 * force / (np.pi * half)
    x = state.place[:, 0]
    exact = peak * np.sqrt(np.maximum(1 - (x / half) ** 2, 0.0))
    error = np.sqrt(state.weight @ (state.pressure - exact) ** 2 / (state.weight @ exact**2))
    order = np.argsort(x)
    width = state.weight[state.pressure > 0].sum()
    # The peak from a parabola through the pressures near the middle: p^2 is linear in x^2.
    inner = order[: max(4, int((x < 0.5 * half).sum()))]
    fit = np.polyfit((x[inner] / half) ** 2, (state.pressure[inner] / peak) ** 2, 1)
    return float(error), float(np.sqrt(fit[1]) - 1), float(width / half - 1)


def mean_errors(cells: int, method: str, cell: str) -> Array:
    """Root mean square of the errors over loads: where in a cell contact ends is chance."""
    scene, found = cylinder(cells, method, cell, 16e-6), []
    for time in np.linspace(0.4, 1.0, 5):
        scene.step(time)
        force = 2 * summary(scene.problem.contact, scene.state.contact, scene.state.modes).force[1]
        found.append(against_hertz(scene.state.contact, force))
    return np.asarray(np.sqrt(np.mean(np.square(found), axis=0)))


@pytest.mark.parametrize(
    ("method", "cell"),
    [("penalty", "quadrilateral"), ("nitsche", "quadrilateral"), ("nitsche", "triangle")],
)
def test_cylinder_on_a_flat(method: str, cell: str) -> None:
    errors = np.array([mean_errors(cells, method, cell) for cells in (12, 24, 48)])
    order = np.log2(errors[0] / errors[2]) / 2
    # The pressure falls to zero like a root where contact ends: first order is all there is.
    assert order[0] > 0.7 and order[2] > 0.7
    assert errors[2] == pytest.approx([0.0, 0.0, 0.0], abs=0.04)
    assert errors[2, 1] < (6e-3 if method == "penalty" else 1e-3)
