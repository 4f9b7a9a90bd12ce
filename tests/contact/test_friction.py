"""Friction: laws and return mapping, a block that sticks, slides and reverses, axial friction.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mechanics.setups import SliceSetup, elastic, mapped, skewed

from castfem.physics.contact.friction import Coulomb, Lubricant, Tresca, Viscous, return_friction
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import SLIP, STICK
from castfem.physics.contact.summary import summary
from contact.setups import FOOT, dragged_block, drawn_block

METHODS = ("penalty", "nitsche")
CELLS = ("quadrilateral", "triangle")
YOUNG, WIDTH, HEIGHT, PRESSURE, MU = 40e9, 20e-3, 10e-3, 5e6, 0.3
P0 = 12e6
LAWS: dict[str, Any] = {
    "coulomb": (Coulomb(MU), MU * PRESSURE),
    "cohesion": (Coulomb(MU, cohesion=1e5), MU * PRESSURE + 1e5),
    "limited": (Coulomb(3.0, yield_stress=20e6), np.sqrt((400e12 - PRESSURE**2) / 3)),
    "tresca": (Tresca(0.2, P0), 0.2 * P0 / np.sqrt(3)),
    "light": (Tresca(0.5, P0, cap=0.4), 0.4 * PRESSURE),
    "sticky": (Coulomb(MU, cohesion=1e6, cap=0.1), (MU + 0.1) * PRESSURE),
}


class Spring:
    """Shear of a block whose foot slides at a threshold: an elastic-plastic spring.

    The top moves back and forth by 2.7 times the displacement at which sliding begins.
    """

    def __init__(self, threshold: float) -> None:
        self.threshold, self.compliance = threshold, HEIGHT / (YOUNG / 2)
        self.reach = 2.7 * threshold * self.compliance
        self.history = [(0.0, 0.0)]

    def sweep(self, time: float) -> float:
        """Return the displacement of the top, m."""
        return self.reach * float(np.interp(time, [0, 1, 3, 4], [0, 1, -1, 0]))

    def __call__(self, time: float) -> float:
        """Return the shear stress at `time`, which may only increase from call to call."""
        last, stress = self.history[-1]
        if time > last:
            trial = stress + (self.sweep(time) - self.sweep(last)) / self.compliance
            stress = float(np.clip(trial, -self.threshold, self.threshold))
            self.history.append((time, stress))
        return stress


def sliding_block(law: Any, method: str, cell: str, spring: Spring, factor: float) -> SliceSetup:
    """Set up a block pressed on a wall with its top moved sideways; its sides carry the shear."""
    groups = ("left", "foot", "right", "top")
    contact = Contact(FOOT, ("foot",), method=method, friction=law, factor=factor)  # type: ignore
    mesh = mapped(3, 2, skewed(WIDTH, HEIGHT, 0.05), cell, groups=groups)
    return dragged_block(mesh, elastic(YOUNG, 0.0), contact, PRESSURE, spring.sweep, spring)


@pytest.mark.parametrize(
    ("cell", "method", "law"),  # every law with each method and on each cell
    [
        (CELLS[(i + j) % len(CELLS)], method, law)
        for i, law in enumerate(LAWS)
        for j, method in enumerate(METHODS)
    ],
)
def test_stick_and_slip_of_a_reversed_block_are_exact(cell: str, method: str, law: str) -> None:
    """The block sticks, slides, sticks after the reversal and slides back: exact at every step."""
    friction, threshold = LAWS[law]
    spring = Spring(threshold)
    setup = sliding_block(friction, method, cell, spring, 100.0)
    # While it sticks, the contact has the compliance 1 / K_tau (240).
    setup.problem.begin(setup.state, 1.0, setup.state.temperature)
    spring.compliance += 1.0 / setup.problem.contact.stiffness[0]
    spring.history = [(0.0, 0.0)]
    seen = []
    for time in np.linspace(0.25, 4.0, 16):
        setup.step(time)
        state = setup.state.contact
        expected = -spring(time)  # on the strand, along (-n_y, n_x) = x
        assert state.friction[:, 0] == pytest.approx(expected, rel=1e-7, abs=1.0)
        assert state.pressure == pytest.approx(PRESSURE, rel=1e-7)
        assert setup.stress[:, 3] / np.sqrt(2) == pytest.approx(spring(time), rel=1e-6, abs=10.0)
        slides = abs(abs(expected) - threshold) < 1e-3
        seen.append(slides)
        assert np.all(state.status == (SLIP if slides else STICK))
    assert seen.count(True) > 4 and seen.count(False) > 4


def pulled_block(
    method: str, cell: str, free: tuple[str, ...], speed: float, large: bool = False
) -> SliceSetup:
    """Set up a block pressed on the wall along which it is withdrawn."""
    contact = Contact(FOOT, ("foot",), lambda t: speed * t, friction=Coulomb(MU), method=method)  # type: ignore
    groups = ("left", "foot", "right", "top")
    mesh = mapped(2, 2, skewed(WIDTH, HEIGHT, 0.0), cell, groups=groups)
    return drawn_block(mesh, contact, PRESSURE, free, large)


@pytest.mark.parametrize(("method", "cell"), zip(METHODS, CELLS, strict=True))
@pytest.mark.parametrize("free", [("a0",), ("a0", "a2")])
def test_axial_force_is_the_accumulated_friction(
    method: str, cell: str, free: tuple[str, ...]
) -> None:
    """The strand carries the friction accumulated so far (38): N = mu p W z."""
    speed = 1e-2
    setup = pulled_block(method, cell, free, speed)
    for time in (0.5, 1.0, 2.0):
        result = setup.step(time)
        force = MU * PRESSURE * WIDTH * speed * time
        assert result.balance.axial[0] == pytest.approx(force, rel=1e-7)
        assert setup.state.contact.withdrawal_resistance == pytest.approx(
            [force, 0.5 * WIDTH * force, 0.0]
        )
        assert result.balance.axial_error < 1e-9
        found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
        assert found.axial == pytest.approx(-MU * PRESSURE * WIDTH, rel=1e-7)
        # With a2 free the pull acts at the foot, where friction acts.
        y = setup.places[:, 1]
        strain = force / (YOUNG * WIDTH * HEIGHT) * np.ones_like(y)
        if "a2" in free:
            strain *= 1.0 - 12.0 * 0.5 * (y - 0.5 * HEIGHT) / HEIGHT
        assert setup.stress[:, 2] == pytest.approx(YOUNG * strain, rel=1e-6, abs=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_pull_is_that_of_the_length_cast_at_large_strain(method: str) -> None:
    """The pull does not depend on the stretch of the slice.

    Without lateral contraction N = E ln(e) W H at the stretch e. Wall and load press on the
    deformed slice, which is e times as thick.
    """
    steps, thickness = 20, 1.1
    force = YOUNG * np.log(thickness) * WIDTH * HEIGHT
    setup = pulled_block(method, "quadrilateral", ("a0",), force / (MU * PRESSURE * WIDTH), True)
    for time in np.arange(1, steps + 1) / steps:
        balance = setup.step(time).balance
    # Not exact: width of the foot and height of the block are those of the deformed slice.
    pressed = 3.0 * PRESSURE / YOUNG
    assert setup.state.contact.withdrawal_resistance[0] == pytest.approx(force, rel=pressed)
    assert balance.axial[0] == pytest.approx(setup.state.contact.withdrawal_resistance[0], rel=1e-8)
    # The logarithm by the midpoint rule has the error (strain of a step)^2 / 12.
    strain = np.log(thickness)
    assert setup.state.generalized_strains[0] == pytest.approx(
        thickness - 1.0, rel=(strain / steps) ** 2 + pressed
    )
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert found.axial == pytest.approx(-MU * PRESSURE * WIDTH, rel=pressed)
    assert found.force[1] == pytest.approx(
        PRESSURE * WIDTH * (1.0 + setup.state.generalized_strains[0]), rel=pressed
    )


def test_axial_slip_reduces_in_plane_friction() -> None:
    """Friction is opposite to the slip, so a longer axial travel leaves less in the plane."""
    spring = Spring(1e-3)
    spring.reach = 1e-6
    setup = sliding_block(Coulomb(MU), "penalty", "quadrilateral", spring, 1e3)
    contact = setup.problem.contact
    object.__setattr__(contact.contact, "position", lambda t: 1e-4 * t)
    setup.step(0.5)
    setup.step(1.0)
    state = setup.state.contact
    assert np.hypot(*state.friction.T) == pytest.approx(MU * state.pressure, rel=1e-10)
    # In the plane the foot follows the top, 5e-7 m; along the strand it moves 5e-5 m.
    assert state.friction[:, 0] / state.friction[:, 1] == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("law", [Viscous(Tresca(0.3, P0), 0.5, P0, 1e-3, 0.4), Lubricant(1e7, 0.3)])
def test_viscous_return_satisfies_the_law(law: Any) -> None:
    """|tau| = tau_c + excess(slip rate), in the direction of the trial friction."""
    rng = np.random.default_rng(3)
    trial, stiffness, dt = rng.normal(size=(200, 2)) * 1e7, np.full(200, 1e13), 0.1
    pressure = np.where(rng.uniform(size=200) < 0.2, 0.0, 5e6)
    found = return_friction(law, trial, pressure, stiffness, dt)
    size, before = np.hypot(*found.traction.T), np.hypot(*trial.T)
    limit = law.threshold(pressure)[0]
    slides, unloaded = found.slides, pressure == 0.0
    assert slides.any() and not found.traction[unloaded].any() and not slides[unloaded].any()
    rate = (before - size) / (stiffness * dt)
    excess = law.excess(rate)[0]
    assert size[slides] == pytest.approx((limit + excess)[slides], rel=1e-9)
    sticks = ~slides & ~unloaded
    assert found.traction[sticks] == pytest.approx(trial[sticks])
    cross = found.traction[:, 0] * trial[:, 1] - found.traction[:, 1] * trial[:, 0]
    assert np.abs(cross).max() < 1e-9 * (before**2).max()


@pytest.mark.parametrize(
    "law",
    [Lubricant(1e5, n) for n in (0.0, 0.02, 8.0)]
    + [Viscous(Coulomb(0.3), share, P0, 0.06, n) for share in (0.01, 3.0) for n in (0.1, 4.0)],
)
def test_viscous_friction_is_solved_in_few_steps(law: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bisection gives the same root over many orders of slip, threshold and stiffness."""
    rng = np.random.default_rng(5)
    limit, more, stiffness = (10.0 ** rng.uniform(*r, 2000) for r in ((0, 7), (-9, 4), (4, 14)))
    size, counts = limit * (1.0 + more), []
    excess = type(law).excess
    monkeypatch.setattr(type(law), "threshold", lambda self, p: (p, np.ones_like(p)))
    monkeypatch.setattr(
        type(law), "excess", lambda self, rate: counts.append(len(rate)) or excess(self, rate)
    )
    object.__setattr__(law, "cap", 1e30)
    trial = np.column_stack([size, 0.0 * size])
    found = return_friction(law, trial, limit, stiffness, 0.1).traction[:, 0]
    assert sum(n > 0 for n in counts) <= 25
    low, high = limit.copy(), size.copy()
    for _ in range(80):
        middle = 0.5 * (low + high)
        below = middle - limit < excess(law, (size - middle) / (0.1 * stiffness))[0]
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    assert found == pytest.approx(0.5 * (low + high), rel=1e-12)


def test_derivatives_of_the_return_match_differences() -> None:
    rng = np.random.default_rng(4)
    trial, pressure = rng.normal(size=(50, 2)) * 3e6, 10.0 ** rng.uniform(3.0, 7.0, 50)
    stiffness = np.full(50, 1e13)
    laws = [law for law, _ in LAWS.values()]
    for law in [*laws, Viscous(Coulomb(0.1), 0.5, P0, 1e-3, 0.4), Lubricant(1e7, 0.3)]:
        here = return_friction(law, trial, pressure, stiffness, 0.1)
        for i, step in enumerate(((1.0, 0.0), (0.0, 1.0))):
            ends = [
                return_friction(law, trial + s * np.array(step), pressure, stiffness, 0.1).traction
                for s in (10.0, -10.0)
            ]
            found = (ends[0] - ends[1]) / 20.0
            assert here.by_trial[:, :, i] == pytest.approx(found, rel=1e-4, abs=2e-5)
        ends = [
            return_friction(law, trial, pressure + s, stiffness, 0.1).traction
            for s in (10.0, -10.0)
        ]
        assert here.by_pressure == pytest.approx((ends[0] - ends[1]) / 20.0, rel=1e-4, abs=2e-5)


@pytest.mark.parametrize(
    "law",
    [
        Coulomb(MU, cohesion=1e6),
        Tresca(0.3, P0),
        Viscous(Tresca(0.3, P0), 0.5, P0, 1e-3, 0.4),
        Lubricant(1e8, 0.3),
    ],
)
def test_friction_begins_continuously_with_the_pressure(law: Any) -> None:
    """Friction has neither a jump nor an infinite slope at the onset of contact."""
    pressure, ones = 10.0 ** np.arange(-3.0, 9.0), np.ones(12)
    trial = np.column_stack([1e9 * ones, 0.0 * ones])
    found = return_friction(law, trial, pressure, 1e13 * ones, 0.1).traction[:, 0]
    steps = np.diff(found) / np.diff(pressure)
    assert np.all(steps >= 0.0) and np.all(steps <= 2.0 + 1e-9)
    # The cap acts at low pressure only.
    limit = law.threshold(pressure)[0][-1]
    excess = law.excess(np.array([(1e9 - found[-1]) / 1e12]))
    assert found[-1] == pytest.approx(limit + (0.0 if excess is None else excess[0][0]), rel=1e-9)


@pytest.mark.parametrize(
    "make", [lambda: Coulomb(-0.1), lambda: Tresca(1.5, 1e6), lambda: Lubricant(np.nan, 1.0)]
)
def test_invalid_parameters_are_rejected(make: Any) -> None:
    with pytest.raises(ValueError, match="friction"):
        make()
