"""A block that creeps between jaws and slides in its plane alone: nothing else holds it there."""

from __future__ import annotations

import numpy as np
import pytest
from mechanics.setups import SliceSetup, expansion, mapped

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep
from castfem.physics.contact.friction import Coulomb
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.summary import summary
from castfem.physics.mould.wall import GapFunction
from contact.setups import PLANE_STRAIN

WIDTH, HEIGHT, CLOSURE, MU = 20e-3, 14e-3, 0.3e-3, 0.2
LAW = NortonCreep.constant(Elasticity.constant(40e9, 0.3), 1e-2, 1e8, 3.0)


class Jaws:
    """Two flat walls that close in on the origin by 0.3 mm a second, turned by an angle."""

    def __init__(self, angle: float) -> None:
        self.up = np.array([-np.sin(angle), np.cos(angle)])

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        cosine = normals @ self.up
        side = np.sign(cosine)
        away = 0.5 * HEIGHT - CLOSURE * position - side * (points @ self.up)
        met = np.abs(cosine) > 1e-9
        gap = np.where(met, away / np.where(met, np.abs(cosine), 1.0), np.inf)
        return GapFunction(gap, np.where(met[:, None], side[:, None] * self.up, normals))

    def temperature(self, position: float) -> float:
        return 400.0


@pytest.mark.parametrize(
    ("method", "large", "angle"),
    [ ("penalty", True, 0.6),
     ("nitsche", True, 0.0), ("nitsche", True, 0.6)],
)  # fmt: skip
def test_block_that_only_friction_holds(method: str, large: bool, angle: float) -> None:
    """All points slide: a full Newton step may turn friction round, and the block run away."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        x, y = WIDTH * (s - 0.5), HEIGHT * (t - 0.5)
        c, sine = np.cos(angle), np.sin(angle)
        return c * x - sine * y, sine * x + c * y

    contact = Contact(
        Jaws(angle),
        ("lower", "upper"),
        lambda time: time,
        method=method,  # type: ignore[arg-type]
        friction=Coulomb(MU),
        stroke=lambda time: time,  # the jaws go with the strand
    )
    setup = SliceSetup(
        mapped(5, 4, shape, groups=("left", "lower", "right", "upper")),
        LAW,
        expansion(0.0),
        given={"planes": PLANE_STRAIN, "large_strain": large, "interactions": (contact,)},
        springs=1e-7,
    )
    for time in (0.1, 0.3, 0.6, 1.0):
        assert setup.step(time).newton <= 16
    state = setup.state.contact
    assert state is not None
    found = summary(setup.problem.contact, state, setup.state.generalized_strains)
    load = state.weight @ state.pressure
    assert np.abs(found.force).max() < 1e-4 * load and found.axial == 0.0
    # It flows out of the middle.
    along = np.column_stack([-state.normal[:, 1], state.normal[:, 0]])
    x = np.einsum("ni,ni->n", along, state.place)
    outer = np.abs(x) > 0.1 * WIDTH
    assert np.all(state.friction[outer, 0] * x[outer] < 0.0)
    assert np.abs(state.friction[outer, 0]) == pytest.approx(MU * state.pressure[outer])
