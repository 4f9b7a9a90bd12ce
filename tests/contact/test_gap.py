"""Gap: a tapered wall and a block that shrinks away from it; vertices; small and large strain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped, skewed
from scipy.optimize import brentq

from castfem.constitutive.elasticity import Elasticity, Solidity
from castfem.constitutive.flow_laws import ThermoElastic
from castfem.contact.settings import Contact
from castfem.contact.state import OPEN
from castfem.contact.summary import summary
from castfem.mechanics.planes import PlainPlanes
from castfem.mechanics.supports import SurfacePressure
from castfem.mechanics.surface_gap import SurfaceGap
from castfem.mould import Mould, RectangleCavity, Taper, same
from contact.setups import LineWall

METHODS = ("penalty", "nitsche")
CELLS = ("quadrilateral", "triangle")
YOUNG, POISSON, ALPHA, HALF = 100e9, 0.3, 1e-5, 0.05
TAPER, SPEED = 1e-3, 0.02  # of the half width per length of mould; m/s


def free_half(time: float, large: bool) -> float:
    """Half width of the free block, m: it shrinks slowly first, then faster than the taper."""
    strain = -ALPHA * 4.0 * time**2
    return HALF * float(np.exp(strain) if large else 1.0 + strain)


def wall_at(time: float) -> float:
    """Where the wall is, m."""
    return HALF - TAPER * SPEED * time


def pressure_at(time: float, large: bool, stiffness: float) -> float:
    """Pressure of a wall that gives way by p / stiffness."""
    free, pressure = free_half(time, large), 0.0
    for _ in range(60):
        place = wall_at(time) + pressure / stiffness
        strain = np.log(place / free) if large else (place - free) / HALF
        pressure = -YOUNG * strain
    return float(pressure)


def shrinking_block(method: str, cell: str, large: bool) -> SliceSetup:
    """A quarter block that cools evenly between two walls that close in."""
    wall = LineWall(lambda z: np.array([HALF - TAPER * z, 0.0]), axis=0)
    contact = Contact(wall, ("right",), lambda t: SPEED * t, method=method)  # type: ignore
    return SliceSetup(
        mapped(3, 3, skewed(HALF, 0.03), cell),
        elastic(YOUNG, POISSON),
        expansion(ALPHA),
        tolerance=1e-11,
        start=1000.0,
        given={
            "planes": PlainPlanes(("a0",)),
            "interactions": (contact,),
            "large_strain": large,
        },
    )


# At large strain one method on each of the cells.
@pytest.mark.parametrize(
    ("method", "cell", "large"),
    [(m, c, large) for m in METHODS for c in CELLS for large in (False, True)
     if not large or (m, c) in zip(METHODS, CELLS, strict=True)],
)  # fmt: skip
def test_tapered_wall_and_shrinking_block(method: str, cell: str, large: bool) -> None:
    """Pressure while the taper is ahead, then a gap; both exact, and so the moment between."""
    setup = shrinking_block(method, cell, large)
    gaps = SurfaceGap(setup.problem.contact, setup.problem.points)
    lost = brentq(lambda t: free_half(t, large) - wall_at(t), 5.0, 15.0)
    rel = 1e-5 if large else 1e-8
    for time in (2.0, 5.0, 9.0, lost * (1 - 1e-4), lost * (1 + 1e-4), 12.0, 15.0):
        setup.step(time, 1000.0 - 4.0 * time**2)
        state = setup.state.contact
        found = summary(setup.problem.contact, state, setup.state.generalized_strains)
        if time < lost:
            stiffness = setup.problem.contact.stiffness[0] if method == "penalty" else np.inf
            near = 1e-6 * YOUNG * ALPHA if large else 0.0
            pressure = pressure_at(time, large, stiffness)
            assert np.all(state.status != OPEN)
            assert state.pressure == pytest.approx(
                pressure, rel=1e3 * rel if large else rel, abs=near
            )
        else:
            assert np.all(state.status == OPEN) and not state.pressure.any()
            free, near = wall_at(time) - free_half(time, large), 1e-9 * HALF
            assert state.gap == pytest.approx(free, rel=rel, abs=near)
            assert gaps.at(setup.state) == pytest.approx(free, rel=rel, abs=near)
            assert found.gap == pytest.approx(free, rel=rel, abs=near)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("below", [1e-4, 1e-2, 1.0])
def test_wall_is_as_stiff_when_the_surface_freezes(method: str, below: float) -> None:
    """However late in a step the surface freezes, the wall is that of a solid at its end."""
    elasticity = Elasticity.constant(YOUNG, POISSON, Solidity.between(1000.0, 1050.0))
    wall = LineWall(lambda z: np.zeros(2), lambda z: np.pi)
    setup = SliceSetup(
        mapped(3, 3, box(HALF, HALF), groups=("symmetry_x", "foot", "right", "top")),
        ThermoElastic(elasticity),
        start=1010.0,
        given={
            "planes": PlainPlanes(("a0",)),
            "interactions": (Contact(wall, ("foot",), method=method),),  # type: ignore[arg-type]
            "loads": (SurfacePressure(("top",), lambda t: 1e4),),
            "pin": False,
        },
    )
    setup.step(1.0, 1005.0)
    setup.step(2.0, 1000.0 - below)
    contact, state = setup.problem.contact, setup.state.contact
    bulk = YOUNG / (3.0 * (1.0 - 2.0 * POISSON))
    assert contact.stiffness == pytest.approx(contact.contact.strength * bulk * 3.0 / HALF)
    assert state.pressure == pytest.approx(1e4, rel=1e-6)
    give = 1e4 / contact.stiffness[0] if method == "penalty" else 0.0
    assert state.gap == pytest.approx(-give, rel=1e-6, abs=1e-16)


def test_vertices_of_a_billet() -> None:
    """All around a quarter billet in a mould: sides, corner arc and their ends."""
    from mechanics.casting import billet_mesh

    mesh = billet_mesh(corner_radius=5e-3, surface_size=4e-3, core_size=2e-2, order=2)
    mould = Mould(RectangleCavity(0.125, 0.125, 5e-3), 0.6, same(Taper.single(0.0, 0.6)))
    outer = tuple(g for g in mesh.groups if not g.startswith("symmetry"))
    setup = SliceSetup(
        mesh,
        elastic(),
        expansion(ALPHA),
        start=1500.0,
        given={"interactions": (Contact(mould, outer),)},
    )
    gaps = SurfaceGap(setup.problem.contact, setup.problem.points)
    places = setup.vertices[gaps.dofs]
    assert len(places) == len(np.unique(mesh.facets[np.isin(mesh.facet_group, [
        i for i, g in enumerate(mesh.groups) if g in outer])]))  # fmt: skip
    assert np.abs(gaps.at(setup.state)).max() < 1e-8
    setup.step(1.0, 500.0)
    shrunk = ALPHA * 1000.0
    gap, (x, y) = gaps.at(setup.state), places.T
    flat = np.minimum(x, y) < 0.0625 - 5e-3
    assert gap[flat] == pytest.approx(shrunk * 0.0625, rel=1e-6)
    # Along the normal of the arc: its centre has moved inwards, and its radius is smaller.
    angle = np.arctan2(y - 0.0575, x - 0.0575)[~flat]
    reach = shrunk * (0.0575 * (np.cos(angle) + np.sin(angle)) + 5e-3)
    assert gap[~flat] == pytest.approx(reach, rel=0.02)


def test_no_wall_below_the_mould() -> None:
    """Past the end of the mould the gap is infinite, and nothing is in contact."""
    from mechanics.casting import billet_mesh

    mesh = billet_mesh(corner_radius=5e-3, surface_size=4e-3, core_size=2e-2, order=2)
    mould = Mould(RectangleCavity(0.125, 0.125, 5e-3), 0.6, same(Taper.single(0.01, 0.6)))
    contact: dict[str, Any] = {"wall": mould, "on": ("wide", "narrow", "corner")}
    setup = SliceSetup(
        mesh,
        elastic(40e9),
        given={"interactions": (Contact(**contact, position=lambda t: 0.1 * t),)},
    )
    setup.step(5.0)
    inside = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert inside.pressure > 0.0 and inside.share > 0.9
    assert inside.force[0] == pytest.approx(inside.force[1], rel=1e-8)
    setup.step(7.0)
    outside = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert outside.pressure == 0.0 and outside.gap == 0.0 and outside.length == 0.0
    assert np.all(np.isinf(setup.state.contact.gap))
    assert np.abs(setup.state.displacement).max() < 1e-12
