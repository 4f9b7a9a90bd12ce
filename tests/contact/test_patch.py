"""Uniform contact pressure comes out to solver tolerance, by both methods, on all cells."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from mechanics.setups import SliceSetup, elastic, mapped, skewed

from castfem.base.types import Array
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import OPEN
from castfem.physics.contact.summary import summary
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure
from castfem.physics.mould import Contour, GapFunction, Straight
from contact.setups import LineWall

METHODS = ("penalty", "nitsche")
CELLS = ("quadrilateral", "triangle")
YOUNG, POISSON, WIDTH, HEIGHT = 200e9, 0.3, 0.03, 0.02
CONFINED = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
MODULI = {"free": YOUNG, "plane strain": YOUNG / (1 - POISSON**2), "confined": CONFINED}


def pressed(method: str, cell: str, kind: str, large: bool = False, **given: Any) -> SliceSetup:
    """A block of distorted cells on rollers, and a wall that comes down on it by 1 um a second."""
    right = ("right",) if kind == "confined" else ()
    groups = ("symmetry_x", "symmetry_y", "right", "top")
    wall = LineWall(lambda z: np.array([0.0, HEIGHT - z]))
    contact = Contact(wall, ("top",), lambda t: 1e-6 * t, method=method, **given)  # type: ignore
    return SliceSetup(
        mapped(3, 3, skewed(WIDTH, HEIGHT), cell, groups=groups),
        elastic(YOUNG, POISSON),
        given={
            "planes": PlainPlanes(("a0",) if kind == "free" else ()),
            "held": tuple(PrescribedDisplacement((name,), 0) for name in right),
            "interactions": (contact,),
            "large_strain": large,
        },
        tolerance=1e-11,
    )


@pytest.mark.parametrize(
    ("method", "cell", "kind"),  # every kind by each method and on each cell
    [(m, CELLS[(i + j) % 2], k) for i, m in enumerate(METHODS) for j, k in enumerate(MODULI)],
)
def test_wall_presses_a_block(method: str, cell: str, kind: str) -> None:
    """Sigma = -E' d / H; with the penalty the contact is a spring in series, E'/H and K_p."""
    setup = pressed(method, cell, kind)
    setup.step(2.0)
    setup.step(3.0)
    state, stiffness = setup.state.contact, setup.problem.contact.stiffness
    assert state is not None
    modulus, depth = MODULI[kind], 3e-6
    spring = stiffness.mean() if method == "penalty" else np.inf
    pressure = depth / (HEIGHT / modulus + 1.0 / spring)
    assert state.pressure == pytest.approx(pressure, rel=1e-8)
    assert np.abs(state.gap + pressure / spring).max() < 1e-8 * depth
    assert setup.stress[:, 1] == pytest.approx(-pressure, rel=1e-8)
    support = setup.results[-1].balance.support  # type: ignore[union-attr]
    force = summary(setup.problem.contact, state, setup.state.generalized_strains).force
    assert force == pytest.approx([0.0, -pressure * WIDTH], rel=1e-8)
    assert force[1] == pytest.approx(-support[1], rel=1e-8)


class PiecedWall:
    """The line y = 0 in segments that match nothing in the mesh."""

    def __init__(self) -> None:
        ends = np.array([-0.01, 0.0031, 0.0047, 0.0131, 0.0202, 0.0299, 0.05])
        pairs = pairwise(ends)
        self.contour = Contour([Straight((float(a), 0.0), (float(b), 0.0)) for a, b in pairs])

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        return self.contour.gap_function(points, normals)

    def temperature(self, position: float) -> float:
        return 400.0


# One method on each of the cells.
@pytest.mark.parametrize(
    ("method", "cell", "large", "pieces"),
    [(m, c, large, p) for m, c in zip(METHODS, CELLS, strict=True) for large in (False, True)
     for p in (False, True)],
)  # fmt: skip
def test_pressure_passes_into_the_wall(method: str, cell: str, large: bool, pieces: bool) -> None:
    """A block is pressed against a wall below by a uniform pressure from above."""
    groups = ("left", "foot", "right", "top")
    wall = PiecedWall() if pieces else LineWall(lambda z: np.zeros(2), lambda z: np.pi)
    setup = SliceSetup(
        mapped(3, 2, skewed(WIDTH, HEIGHT, 0.0), cell, groups=groups),
        elastic(YOUNG, POISSON),
        given={
            "planes": PlainPlanes(("a0",)),
            "loads": (SurfacePressure(("top",), lambda t: 1e6 * t),),
            "held": (PrescribedDisplacement(("left",), 0),),
            "pin": False,
            "interactions": (Contact(wall, ("foot",), method=method),),  # type: ignore[arg-type]
            "large_strain": large,
        },
        tolerance=1e-11,
    )
    setup.step(1.0)
    state = setup.state.contact
    assert state is not None
    # At large strain the foot has widened, and the top with it; it is thicker, too.
    assert state.pressure == pytest.approx(1e6, rel=1e-8)
    assert setup.stress[:, 1] == pytest.approx(-1e6, rel=1e-8)
    assert np.abs(setup.stress[:, [0, 2, 3]]).max() < 1.0


@pytest.mark.parametrize("method", METHODS)
def test_free_block_on_an_oblique_wall(method: str) -> None:
    """Two walls at an angle hold a block that nothing else holds; the forces are in balance."""
    groups = ("symmetry_x", "foot", "right", "top")
    angle = 0.1
    wall = LineWall(lambda z: np.zeros(2), lambda z: np.pi - angle)
    setup = SliceSetup(
        mapped(3, 2, skewed(WIDTH, HEIGHT, 0.0), groups=groups),
        elastic(YOUNG, POISSON),
        given={
            "planes": PlainPlanes(("a0",)),
            "loads": (SurfacePressure(("top",), lambda t: 1e5 * t),),
            "pin": False,
            "interactions": (Contact(wall, ("foot",), method=method),),  # type: ignore[arg-type]
        },
    )
    setup.step(1.0)
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)  # type: ignore[arg-type]
    normal = np.array([-np.sin(angle), np.cos(angle)])
    assert found.force == pytest.approx(normal * 1e5 * WIDTH / np.cos(angle), rel=1e-7)
    state = setup.state.contact
    assert state is not None
    touching = state.weight[state.status != OPEN].sum()
    assert 0.1 * WIDTH < touching < 0.9 * WIDTH
    assert found.share == pytest.approx(touching / WIDTH, rel=1e-12)
