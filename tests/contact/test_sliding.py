"""Rate-dependent friction, and a wall that oscillates along the strand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped
from scipy.optimize import brentq

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import NortonCreep, ThermoElastic
from castfem.physics.contact.friction import Coulomb, Friction, Lubricant, Tresca, Viscous
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import SLIP, STICK
from castfem.physics.contact.summary import summary
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.slice_definition import Ferrostatic
from castfem.physics.mechanics.supports import PrescribedDisplacement
from castfem.physics.mould.wall import GapFunction
from contact.setups import FOOT, PLANE_STRAIN, LineWall, dragged_block, drawn_block

METHODS = ("penalty", "nitsche")
YOUNG, WIDTH, HEIGHT, PRESSURE = 40e9, 20e-3, 10e-3, 5e6
FACTOR = 100.0
COMPLIANCE = HEIGHT / (YOUNG / 2) + HEIGHT / 2 / (FACTOR * YOUNG / 3)  # block and K_tau in series
SPEED, DRAG, STEP, STEPS = 1e-4, 1.0, 0.1, 20  # of the top: dragged for a second, then held
P0, MU = 12e6, 0.3


class Dashpot:
    """Shear of the block: a spring in series with the friction of its foot, step by step."""

    def __init__(self, law: Any) -> None:
        self.law = law
        self.threshold = float(law.threshold(np.array([PRESSURE]))[0][0])
        self.stress = [0.0]
        for time in STEP * np.arange(1, STEPS + 1):
            self.stress.append(self._after(time))

    def friction(self, speed: float) -> float:
        """Return the friction at a slip rate, Pa."""
        excess = float(self.law.excess(np.array([speed]))[0][0])
        return self.threshold + min(excess, self.law.cap * PRESSURE)

    @staticmethod
    def top(time: float) -> float:
        """Return the displacement of the top, m."""
        return SPEED * min(time, DRAG)

    def _after(self, time: float) -> float:
        old = self.stress[-1]
        way = self.top(time) - self.top(time - STEP)
        trial = old + way / COMPLIANCE
        if trial <= self.threshold:
            return trial
        rate = lambda tau: (trial - tau) * COMPLIANCE / STEP  # noqa: E731
        return float(brentq(lambda tau: tau - self.friction(rate(tau)), 0.0, trial, xtol=1e-6))

    def __call__(self, time: float) -> float:
        """Return the shear stress at the end of a step, Pa."""
        return self.stress[round(time / STEP)]


def dragged(law: Any, method: str, spring: Dashpot) -> SliceSetup:
    """Set up a block pressed on a wall and dragged by its top; its sides carry the shear."""
    contact = Contact(FOOT, ("foot",), method=method, friction=law, factor=FACTOR)  # type: ignore
    mesh = mapped(2, 2, box(WIDTH, HEIGHT), groups=("left", "foot", "right", "top"))
    return dragged_block(mesh, elastic(YOUNG, 0.0), contact, PRESSURE, spring.top, spring)


LINEAR = Lubricant(2e10, 1.0)
VISCOUS: dict[str, Any] = {
    "linear": LINEAR,
    "root": Lubricant(1.5e8, 0.5),
    "threshold": Viscous(Coulomb(0.1), 0.2, P0, SPEED, 0.5),
    "light": Lubricant(1e11, 1.0, cap=0.3),
}


@pytest.mark.parametrize(("method", "name"), zip(METHODS * 2, VISCOUS, strict=True))
def test_viscous_friction_of_a_dragged_block_is_exact(method: str, name: str) -> None:
    """The friction is that of the closed form at every step, in dragging and relaxation."""
    spring = Dashpot(VISCOUS[name])
    setup = dragged(spring.law, method, spring)
    seen = []
    for time in STEP * np.arange(1, STEPS + 1):
        setup.step(time)
        state = setup.state.contact
        assert -state.friction[:, 0] == pytest.approx(spring(time), rel=1e-6, abs=1.0)
        assert state.pressure == pytest.approx(PRESSURE, rel=1e-7)
        seen.append(-float(state.friction[0, 0]))
    assert np.all(state.status == SLIP)
    # While it slides at the speed of the top, the traction is that of the law.
    dragging = seen[round(DRAG / STEP) - 1]
    assert dragging == pytest.approx(spring.friction(SPEED), rel=1e-3)
    assert spring.threshold <= seen[-1] < 0.9 * dragging


def moving(stroke: Callable[[float], float], method: str) -> SliceSetup:
    """Set up a block drawn along an oscillating wall."""
    contact = Contact(
        FOOT,
        ("foot",),
        lambda time: SPEED * time,
        method=method,  # type: ignore[arg-type]
        friction=Coulomb(MU),
        stroke=stroke,
    )
    mesh = mapped(2, 2, box(WIDTH, HEIGHT), groups=("left", "foot", "right", "top"))
    return drawn_block(mesh, contact, PRESSURE, ("a0",))


@pytest.mark.parametrize("method", METHODS)
def test_wall_at_the_speed_of_the_strand_has_no_friction(method: str) -> None:
    setup = moving(lambda time: SPEED * time, method)
    for time in (0.5, 1.0):
        setup.step(time)
    state = setup.state.contact
    assert state is not None and np.all(state.pressure > 0.0) and np.all(state.status == STICK)
    assert not state.friction[:, 1].any() and not state.withdrawal_resistance.any()


@pytest.mark.parametrize("method", METHODS)
def test_oscillating_mould_pushes_the_strand_while_faster(method: str) -> None:
    """Friction has the sign of the slip in each step; the pull accumulates with the length cast."""
    amplitude, period, steps = SPEED, 1.0, 10  # 2 pi times as fast as the strand, at most

    def stroke(time: float) -> float:
        return amplitude * np.sin(2.0 * np.pi * time / period)

    setup, pull, signs = moving(stroke, method), 0.0, []
    for time in period / steps * np.arange(1, steps + 1):
        old = time - period / steps
        slip = SPEED * (time - old) - (stroke(time) - stroke(old))
        setup.step(time)
        found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
        assert found.axial == pytest.approx(-np.sign(slip) * MU * PRESSURE * WIDTH, rel=1e-7)
        pull -= found.axial * SPEED * (time - old)
        assert setup.state.contact.withdrawal_resistance[0] == pytest.approx(
            pull, rel=1e-9, abs=1e-9
        )
        signs.append(np.sign(slip))
    assert signs.count(-1.0) == 4 and signs.count(1.0) == 6


@pytest.mark.parametrize(
    ("method", "law"),
    [
        ("penalty", Tresca(0.2, 95e6)),
        ("nitsche", Coulomb(0.1, cohesion=6e6)),
        ("nitsche", Viscous(Coulomb(0.1), 0.2, 95e6, 1e-4, 0.5)),
    ],
)
def test_steps_converge_where_contact_is_lost(method: str, law: Any) -> None:
    """A block tilted by 10 um under 50 MPa moves back and forth, and loses contact at one end."""
    tilted = LineWall(lambda z: np.zeros(2), lambda z: np.pi + 5e-4)

    def aside(x: Array, time: float) -> Array:
        return np.full(len(x), 20e-6 * np.interp(time, [0, 1, 2, 4, 5], [0, 0, 1, -1, 0]))

    def down(x: Array, time: float) -> Array:
        return np.full(len(x), -16e-6 * min(time, 1.0))

    setup = SliceSetup(
        mapped(8, 4, box(WIDTH, HEIGHT), groups=("left", "foot", "right", "top")),
        elastic(YOUNG, 0.3),
        settings={
            "planes": PlainPlanes(()),
            "held": (
                PrescribedDisplacement(("top",), 0, aside),
                PrescribedDisplacement(("top",), 1, down),
            ),
            "pin": False,
            "interactions": (Contact(tilted, ("foot",), method=method, friction=law),),  # type: ignore
        },
    )
    touching = set()
    for time in np.arange(1, 41) / 8.0:
        setup.step(time)
        state = setup.state.contact
        touching.add(int((state.pressure > 0.0).sum()))
        size, limit = np.hypot(*state.friction.T), law.threshold(state.pressure)[0]
        assert np.all(size <= limit + (1.0 + 1e-9) * law.cap * state.pressure)
    assert len(touching) > 2 and max(touching) == 16


# Liquid at the wall has the status it has physically: it slides without friction.


SOLIDUS, LIQUIDUS, HEAD = 1700.0, 1750.0, 2e5


@pytest.mark.parametrize("law", [Coulomb(0.3), Lubricant(1e6, 1.0)])
def test_liquid_at_the_wall_does_not_stick(law: Friction) -> None:
    """Half of the foot is liquid, which transmits only its pressure."""

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
        settings={
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
    liquid = state.place[:, 0] > 0.0125
    assert liquid.sum() == 6 and np.all(state.pressure[liquid] > 0.9 * HEAD)
    solid = state.place[:, 0] < 0.01
    assert not state.friction[liquid].any() and np.all(state.friction[solid, 1] < 0.0)
    assert np.all(state.status == SLIP)
    assert summary(setup.problem.contact, state, setup.state.generalized_strains).sticking == 0.0


# A creeping block between jaws, supported in its plane only by friction.


JAW_WIDTH, JAW_HEIGHT, CLOSURE, JAW_MU = 20e-3, 14e-3, 0.3e-3, 0.2
LAW = NortonCreep.constant(Elasticity.constant(40e9, 0.3), 1e-2, 1e8, 3.0)


class Jaws:
    """Two plane walls, rotated by an angle, that approach the origin at 0.3 mm/s."""

    def __init__(self, angle: float) -> None:
        self.up = np.array([-np.sin(angle), np.cos(angle)])

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        cosine = normals @ self.up
        side = np.sign(cosine)
        away = 0.5 * JAW_HEIGHT - CLOSURE * position - side * (points @ self.up)
        facing = np.abs(cosine) > 1e-9
        gap = np.where(facing, away / np.where(facing, np.abs(cosine), 1.0), np.inf)
        return GapFunction(gap, np.where(facing[:, None], side[:, None] * self.up, normals))

    def temperature(self, position: float) -> float:
        return 400.0


@pytest.mark.parametrize(
    ("method", "large", "angle"),
    [ ("penalty", True, 0.6),
     ("nitsche", True, 0.0), ("nitsche", True, 0.6)],
)  # fmt: skip
def test_block_supported_by_friction_only_converges(method: str, large: bool, angle: float) -> None:
    """All points slide: a full Newton step may reverse the friction and diverge."""

    def shape(s: Array, t: Array) -> tuple[Array, Array]:
        x, y = JAW_WIDTH * (s - 0.5), JAW_HEIGHT * (t - 0.5)
        c, sine = np.cos(angle), np.sin(angle)
        return c * x - sine * y, sine * x + c * y

    contact = Contact(
        Jaws(angle),
        ("lower", "upper"),
        lambda time: time,
        method=method,  # type: ignore[arg-type]
        friction=Coulomb(JAW_MU),
        stroke=lambda time: time,  # the jaws move with the strand
    )
    setup = SliceSetup(
        mapped(5, 4, shape, groups=("left", "lower", "right", "upper")),
        LAW,
        expansion(0.0),
        settings={"planes": PLANE_STRAIN, "large_strain": large, "interactions": (contact,)},
        springs=1e-7,
    )
    for time in (0.1, 0.3, 0.6, 1.0):
        assert setup.step(time).newton <= 16
    state = setup.state.contact
    found = summary(setup.problem.contact, state, setup.state.generalized_strains)
    load = state.weight @ state.pressure
    assert np.abs(found.force).max() < 1e-4 * load and found.axial == 0.0
    # The block flows outwards.
    along = np.column_stack([-state.normal[:, 1], state.normal[:, 0]])
    x = np.einsum("ni,ni->n", along, state.place)
    outer = np.abs(x) > 0.1 * JAW_WIDTH
    assert np.all(state.friction[outer, 0] * x[outer] < 0.0)
    assert np.abs(state.friction[outer, 0]) == pytest.approx(JAW_MU * state.pressure[outer])
