"""Liquid at the wall: it is told as what it does, which is to slide without friction."""

from __future__ import annotations

import numpy as np
import pytest
from mechanics.setups import SliceSetup, box, mapped

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.contact.friction import Coulomb, Friction, Lubricant
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import SLIP
from castfem.physics.contact.summary import summary
from castfem.physics.mechanics.definition import Ferrostatic
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement
from contact.setups import FOOT

SOLIDUS, LIQUIDUS, HEAD = 1700.0, 1750.0, 2e5


@pytest.mark.parametrize("law", [Coulomb(0.3), Lubricant(1e6, 1.0)])
def test_liquid_at_the_wall_does_not_stick(law: Friction) -> None:
    """Half of the foot is liquid: its pressure touches there, and no more than that."""

    def heat(x: Array, y: Array) -> Array:
        return np.where(x > 0.01 + 1e-9, LIQUIDUS + 10.0, SOLIDUS - 100.0)

    def fraction(temperature: Array) -> Array:
        return np.clip((LIQUIDUS - temperature) / (LIQUIDUS - SOLIDUS), 0.0, 1.0)

    solidity = Solidity.between(
        SOLIDUS, LIQUIDUS, stiffness_ratio=1e-5, mushy_zone="none", memory=False
    )
    contact = Contact(FOOT, ("foot",), lambda t: 1e-2 * t, friction=law)
    walls = tuple(PrescribedDisplacement((name,), 0) for name in ("left", "right"))
    down = PrescribedDisplacement(("top",), 1, lambda x, t: np.full(len(x), -1e-6))
    setup = SliceSetup(
        mapped(8, 4, box(0.02, 0.01), groups=("left", "foot", "right", "top")),
        ThermoElastic(Elasticity.constant(10e9, 0.3, solidity)),
        start=heat,
        given={
            "ferrostatic": Ferrostatic(lambda t: HEAD, fraction, "full", "free"),
            "planes": PlainPlanes(()),
            "liquid": "fed",
            "held": (*walls, down),
            "pin": False,
            "interactions": (contact,),
        },
    )
    setup.step(1.0)
    state = setup.state.contact
    assert state is not None
    liquid = state.place[:, 0] > 0.0125
    assert liquid.sum() == 6 and np.all(state.pressure[liquid] > 0.9 * HEAD)
    solid = state.place[:, 0] < 0.01
    assert not state.friction[liquid].any() and np.all(state.friction[solid, 1] < 0.0)
    assert np.all(state.status == SLIP)
    assert summary(setup.problem.contact, state, setup.state.generalized_strains).sticking == 0.0
