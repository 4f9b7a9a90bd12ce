"""The Jacobian with contact, friction and the bordered system, and finite differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mechanics.setups import SliceSetup, expansion, mapped, ring, skewed
from mechanics.test_tangent import jacobians

from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import NortonCreep, ThermoElastic
from castfem.physics.contact.friction import Coulomb, Lubricant, Tresca, Viscous
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import OPEN, SLIP, STICK
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.slice_definition import Ferrostatic
from castfem.physics.mould import Circular
from contact.setups import ContourWall, TwoWalls

GROUPS = ("left", "bottom", "right", "top")
LAW = NortonCreep.constant(Elasticity.constant(200e9, 0.3), 1e-2, 1e8, 3.0)


def friction_law(name: str, pressure: float) -> Any:
    """Return a friction law with which some points stick and others slide at the pressure."""
    laws: dict[str, Any] = {
        "none": None,
        "coulomb": Coulomb(0.3, cohesion=0.05 * pressure, yield_stress=1.5 * pressure),
        "viscous": Viscous(Tresca(0.5, 0.5 * pressure), 0.3, pressure, 1e-3, 0.5),
        "lubricant": Lubricant(10 * pressure, 0.7),
        # Both the threshold and the excess are limited by the pressure.
        "light": Viscous(Tresca(1.0, pressure, 0.3), 0.3, pressure, 1e-3, 0.5, 0.1),
    }
    return laws[name]


FRICTION = ("none", "coulomb", "viscous", "lubricant")
CASES = [
    (cell, large, method, friction)
    for cell in ("quadrilateral", "triangle")
    for large in (False, True)
    for method in ("penalty", "nitsche")
    for friction in FRICTION
    # For triangles only the simplest and the most complete case.
    if cell == "quadrilateral"
    or (large, method, friction) in ((False, "penalty", "none"), (True, "nitsche", "coulomb"))
] + [("quadrilateral", False, "penalty", "light"), ("quadrilateral", True, "nitsche", "light")]


def touching(
    cell: str, large: bool, method: str, friction: str, size: float, travel: float = 0.3
) -> SliceSetup:
    """Set up a skewed block between two oblique walls with half of its points in contact."""
    contact = Contact(
        TwoWalls((0.1, 0.06), 50 * size),
        ("right", "top"),
        lambda t: travel * size * t,
        method=method,  # type: ignore[arg-type]
        factor=10.0,
        points=4,
        friction=friction_law(friction, 1e14 * size),
    )
    planes = PlainPlanes(("a0", "a1", "a2", "across"))
    return SliceSetup(
        mapped(2, 2, skewed(0.1, 0.06), cell, groups=GROUPS),
        LAW,
        expansion(1e-5),
        settings={"planes": planes, "large_strain": large, "interactions": (contact,)},
    )


@pytest.mark.parametrize(("cell", "large", "method", "friction"), CASES)
def test_jacobian_matches_differences(cell: str, large: bool, method: str, friction: str) -> None:
    size = 1e-3 if large else 2e-5
    setup = touching(cell, large, method, friction, size)
    exact, found, free = jacobians(setup, size)
    # The test is valid only if some points are open, some stick and some slip.
    seen = setup.problem.contact.state().status
    expected = {OPEN, SLIP} | ({STICK} if friction in ("coulomb", "viscous", "light") else set())
    assert expected <= set(seen.tolist())
    assert np.abs(exact - found).max() < 2e-7 * np.abs(found).max()
    tail, head = slice(-free, None), slice(None, -free)
    for block in ((tail, head), (head, tail), (tail, tail)):
        assert np.abs(exact - found)[block].max() < 2e-6 * np.abs(found[block]).max()
    symmetric = np.abs(exact - exact.T).max() < 1e-12 * np.abs(exact).max()
    assert symmetric == setup.problem.kinematics.symmetric


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("method", ["penalty", "nitsche"])
def test_jacobian_under_liquid_pressure_matches_differences(large: bool, method: str) -> None:
    """The pressure of liquid acts along the normal of the strand, which rotates with the surface.

    Liquid cells are so soft that Newton's method diverges without this term.
    """
    size, head = 1e-3 if large else 2e-5, 3e9
    solidity = Solidity.between(190.0, 300.0, stiffness_ratio=1e-5, mushy_zone="none", memory=False)
    law = ThermoElastic(Elasticity.constant(10e9, 0.3, solidity))
    contact = Contact(
        TwoWalls((0.1, 0.06), 50 * size), ("right", "top"), lambda t: t,
        method=method, factor=10.0, points=4,  # type: ignore[arg-type]
    )  # fmt: skip
    setup = SliceSetup(
        mapped(2, 2, skewed(0.1, 0.06), "quadrilateral", groups=GROUPS),
        law,
        expansion(1e-5),
        settings={
            "planes": PlainPlanes(("a0", "across")), "large_strain": large, "liquid": "fed",
            "ferrostatic": Ferrostatic(lambda t: head, np.zeros_like, "full", "free"),
            "interactions": (contact,),
        },
    )  # fmt: skip
    exact, found, _ = jacobians(setup, size)
    wall = setup.problem.contact
    assert (wall.liquid.pool == head).all()  # all of the surface is liquid
    assert np.abs(exact - found).max() < 1e-6 * np.abs(found).max()


def at_a_round_wall(large: bool) -> SliceSetup:
    """Set up a ring inside a wall that is a single arc."""
    outer = 0.05
    ends = [(outer * np.cos(a), outer * np.sin(a)) for a in (-0.3, 0.5 * np.pi + 0.3)]
    contact = Contact(ContourWall(Circular(*ends, (0.0, 0.0))), ("right",), lambda t: t, points=4)
    return SliceSetup(
        mapped(1, 5, ring(0.03, outer), order=2, groups=GROUPS),
        LAW,
        expansion(1e-5),
        settings={
            "planes": PlainPlanes(("a0",)),
            "large_strain": large,
            "interactions": (contact,),
        },
    )


@pytest.mark.parametrize("large", [False, True])
def test_jacobian_at_a_round_wall_matches_differences(large: bool) -> None:
    """The normal of the wall changes as a point slides, which is 4e-4 of the tangent."""
    setup = at_a_round_wall(large)
    exact, found, _ = jacobians(setup, 2e-5)
    seen = setup.problem.contact.state().status
    assert {OPEN, SLIP} <= set(seen.tolist())
    assert np.abs(exact - found).max() < 5e-6 * np.abs(found).max()
