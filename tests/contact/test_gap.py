"""The gap between a tapered wall and a contracting block, also at vertices and large strain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from dolfinx import fem
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped, skewed
from scipy.optimize import brentq

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import OPEN
from castfem.physics.contact.summary import summary
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.state import MechanicalState
from castfem.physics.mechanics.supports import SurfacePressure
from castfem.physics.mechanics.surface_gap import SurfaceGap
from castfem.physics.mould import Mould, RectangleCavity, Taper, same
from castfem.physics.thermal.flux_laws import Contact as ContactLaw
from contact.setups import LineWall

METHODS = ("penalty", "nitsche")
CELLS = ("quadrilateral", "triangle")
YOUNG, POISSON, ALPHA, HALF = 100e9, 0.3, 1e-5, 0.05
TAPER, SPEED = 1e-3, 0.02  # of the half width per length of mould; m/s


def free_half(time: float, large: bool) -> float:
    """Return the half width of the free block, m: finally it contracts faster than the taper."""
    strain = -ALPHA * 4.0 * time**2
    return HALF * float(np.exp(strain) if large else 1.0 + strain)


def wall_at(time: float) -> float:
    return HALF - TAPER * SPEED * time


def pressure_at(time: float, large: bool, stiffness: float) -> float:
    """Return the contact pressure at a wall with the compliance 1 / stiffness, Pa."""
    free, pressure = free_half(time, large), 0.0
    for _ in range(60):
        place = wall_at(time) + pressure / stiffness
        strain = np.log(place / free) if large else (place - free) / HALF
        pressure = -YOUNG * strain
    return float(pressure)


def shrinking_block(method: str, cell: str, large: bool) -> SliceSetup:
    """Set up a quarter block that cools uniformly between two converging walls."""
    wall = LineWall(lambda z: np.array([HALF - TAPER * z, 0.0]), axis=0)
    contact = Contact(wall, ("right",), lambda t: SPEED * t, method=method)  # type: ignore
    return SliceSetup(
        mapped(3, 3, skewed(HALF, 0.03), cell),
        elastic(YOUNG, POISSON),
        expansion(ALPHA),
        tolerance=1e-11,
        start=1000.0,
        settings={
            "planes": PlainPlanes(("a0",)),
            "interactions": (contact,),
            "large_strain": large,
        },
    )


# At large strain one method for each cell shape.
@pytest.mark.parametrize(
    ("method", "cell", "large"),
    [(m, c, large) for m in METHODS for c in CELLS for large in (False, True)
     if not large or (m, c) in zip(METHODS, CELLS, strict=True)],
)  # fmt: skip
def test_pressure_and_gap_of_a_contracting_block_are_exact(
    method: str, cell: str, large: bool
) -> None:
    """Contact pressure, later the gap and the time of its opening are exact."""
    setup = shrinking_block(method, cell, large)
    gaps = SurfaceGap(setup.problem.contact)
    opening = brentq(lambda t: free_half(t, large) - wall_at(t), 5.0, 15.0)
    rel = 1e-5 if large else 1e-8
    for time in (2.0, 5.0, 9.0, opening * (1 - 1e-4), opening * (1 + 1e-4), 12.0, 15.0):
        setup.step(time, 1000.0 - 4.0 * time**2)
        state = setup.state.contact
        found = summary(setup.problem.contact, state, setup.state.generalized_strains)
        if time < opening:
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
def test_contact_stiffness_is_that_of_the_frozen_surface(method: str, below: float) -> None:
    """At any time of freezing within a step the stiffness is that of the solid at its end."""
    elasticity = Elasticity.constant(YOUNG, POISSON, Solidity.between(1000.0, 1050.0))
    wall = LineWall(lambda z: np.zeros(2), lambda z: np.pi)
    setup = SliceSetup(
        mapped(3, 3, box(HALF, HALF), groups=("symmetry_x", "foot", "right", "top")),
        ThermoElastic(elasticity),
        start=1010.0,
        settings={
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
    penetration = 1e4 / contact.stiffness[0] if method == "penalty" else 0.0
    assert state.gap == pytest.approx(-penetration, rel=1e-6, abs=1e-16)


def contracted_billet(size: float) -> tuple[Array, Array, Array]:
    """Return the gap at rest, the relative error of the gap after contraction, and the place (n,).

    The place is 1 in the middle of the corner arc and 0 on the faces and the ends of the arc.
    """
    from mechanics.casting import billet_mesh

    mesh = billet_mesh(corner_radius=5e-3, surface_size=size, core_size=2e-2, order=2)
    mould = Mould(RectangleCavity(0.125, 0.125, 5e-3), 0.6, same(Taper.single(0.0, 0.6)))
    outer = tuple(g for g in mesh.groups if not g.startswith("symmetry"))
    contact = Contact(mould, outer)
    setup = SliceSetup(
        mesh, elastic(), expansion(ALPHA), start=1500.0, settings={"interactions": (contact,)}
    )
    gaps = SurfaceGap(setup.problem.contact)
    assert not len(gaps.corners)  # on an arc no vertex is opposite to two walls
    places = setup.vertices[gaps.dofs]
    assert len(places) == len(np.unique(mesh.facets[np.isin(mesh.facet_group, [
        i for i, g in enumerate(mesh.groups) if g in outer])]))  # fmt: skip
    rest = gaps.at(setup.state)
    setup.step(1.0, 500.0)
    # Contracted towards the centre, each vertex keeps its normal.
    normal = np.maximum(places - 0.0575, 0.0)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    to_wall = contact.wall.gap_function(places * (1.0 - ALPHA * 1000.0), normal, 0.0)
    exact = np.asarray(to_wall.gap) * np.einsum("ni,ni->n", to_wall.normal, normal)
    return rest, gaps.at(setup.state) / exact - 1.0, np.minimum(*normal.T) * np.sqrt(2.0)


def test_gap_at_the_vertices_of_a_billet_converges() -> None:
    """The gap is exact on the faces of a quarter billet, and of second order on the arc."""
    coarse, fine = (contracted_billet(size) for size in (2e-3, 1e-3))
    for _, error, arc in (coarse, fine):
        # The ends of the arc have a part of its error.
        flat = (arc < 1e-6) & (np.abs(error) < 1e-6)
        assert np.count_nonzero((arc < 1e-6) & ~flat) == 2
        assert np.abs(error).max() < 0.02
    # The mesh approximates the arc of the mould by parabolas: fourth order.
    rest = [np.abs(at_rest).max() for at_rest, _, _ in (coarse, fine)]
    assert rest[0] < 3e-7 and rest[1] < rest[0] / 14.0
    inside = [np.abs(error[arc > 1e-6]).max() for _, error, arc in (coarse, fine)]
    assert inside[1] < 4e-3 and inside[1] < inside[0] / 3.5


def moved_by(setup: SliceSetup, moved: Callable[[Array], Array]) -> MechanicalState:
    """Return the state with nodes displaced by a function of their positions (2, n)."""
    field = fem.Function(setup.problem.space)
    field.interpolate(lambda x: moved(x[:2]))
    return replace(setup.state, displacement=field.x.array, generalized_strains=np.zeros(4))


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("cell", CELLS)
def test_waviness_of_facets_leaves_the_mean_gap(cell: str, large: bool) -> None:
    """A displacement of zero mean and slope over each facet does not change the gap."""
    wall = LineWall(lambda z: np.array([HALF, 0.0]), axis=0)
    setup = SliceSetup(
        mapped(3, 3, box(HALF, HALF), cell),
        elastic(),
        settings={"interactions": (Contact(wall, ("right",)),), "large_strain": large},
    )
    depth, off = 2e-5, 1e-4
    side = 2.0 * np.pi * 3.0 / HALF

    def wavy(x: Array) -> Array:
        # 1 at the ends of a facet and -1/2 in its middle: zero mean and slope over the facet.
        wave = 0.25 + 0.75 * np.cos(side * x[1])
        return np.stack([-depth * wave - off * (x[0] > 0.0), np.zeros(x.shape[1])])

    # At large strain the surface also rotates locally.
    gap = SurfaceGap(setup.problem.contact).at(moved_by(setup, wavy))
    assert gap == pytest.approx(off, abs=(1e-3 if large else 1e-9) * depth)


def sharp_corner(*off: float) -> tuple[SliceSetup, SurfaceGap, MechanicalState]:
    """Set up a rectangle with the gaps `off` to walls on its right and above, m."""
    mould = Mould(RectangleCavity(0.4, 0.2, 0.0), 0.6, same(Taper.single(0.0, 0.6)))
    setup = SliceSetup(
        mapped(2, 2, box(0.2, 0.1)),
        elastic(),
        settings={"interactions": (Contact(mould, ("right", "top")),)},
    )
    moved = moved_by(setup, lambda x: -np.broadcast_to(np.array(off)[:, None], x.shape))
    return setup, SurfaceGap(setup.problem.contact), moved


def test_gap_of_a_sharp_corner_is_the_mean_of_both() -> None:
    """The mean is weighted by the lengths of the adjacent facets."""
    off = (3e-4, 1e-4)
    setup, gaps, moved = sharp_corner(*off)
    gap = gaps.at(moved)
    x, y = setup.vertices[gaps.dofs].T
    right, top = np.isclose(x, 0.2), np.isclose(y, 0.1)
    assert gap[right & ~top] == pytest.approx(off[0], rel=1e-9)
    assert gap[top & ~right] == pytest.approx(off[1], rel=1e-9)
    assert gap[right & top] == pytest.approx((off[0] + 2.0 * off[1]) / 3.0, rel=1e-9)


def test_heat_flows_across_both_gaps_of_a_sharp_corner() -> None:
    """Each gap counts for its part of the surface."""
    setup, gaps, moved = sharp_corner(2e-3, 0.0)
    crossed = gaps.crossed(moved)
    (corner,) = gaps.corners
    assert setup.vertices[corner] == pytest.approx([0.2, 0.1])
    assert gaps.count == len(crossed) == setup.problem.section.owned + 1
    to_top, to_right = crossed[corner], crossed[gaps.second[corner]]
    assert (to_top, to_right) == (pytest.approx(0.0, abs=1e-12), pytest.approx(2e-3, rel=1e-9))
    assert gaps.first[corner] == pytest.approx(2.0 / 3.0)  # facets of 100 and of 50 mm
    assert gaps.shares(np.ones(gaps.count - 1)).sum() == pytest.approx(gaps.count - 1)
    h, k, excess = 1200.0, 0.15, 1000.0
    law = ContactLaw(h, 400.0, k, follows=True)
    both = np.array([[to_top], [to_right]])
    flux, slope = law.across(both, gaps.first[[corner]]).flux(np.array([400.0 + excess]), 0.0)
    exact = 2.0 / 3.0 * h + 1.0 / 3.0 / (1.0 / h + 2e-3 / k)
    assert flux == pytest.approx(exact * excess, rel=1e-9)
    assert slope == pytest.approx(exact, rel=1e-9)
    # The mean gap would give less than a quarter of that flux.
    mean = gaps.at(moved)[np.searchsorted(gaps.dofs, corner)]
    assert mean == pytest.approx(2e-3 / 3.0, rel=1e-9)
    assert law.across(np.array([mean])).flux(np.array([1400.0]), 0.0)[0] < 0.25 * flux


def test_below_the_mould_there_is_no_contact() -> None:
    """Below the exit of the mould the gap is infinite."""
    from mechanics.casting import billet_mesh

    mesh = billet_mesh(corner_radius=5e-3, surface_size=4e-3, core_size=2e-2, order=2)
    mould = Mould(RectangleCavity(0.125, 0.125, 5e-3), 0.6, same(Taper.single(0.01, 0.6)))
    contact: dict[str, Any] = {"wall": mould, "on": ("wide", "narrow", "corner")}
    setup = SliceSetup(
        mesh,
        elastic(40e9),
        settings={"interactions": (Contact(**contact, position=lambda t: 0.1 * t),)},
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
