"""Large strain: objectivity, simple shear, tension to 60 %, follower pressure, curved strand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive.base import rotation
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure
from mechanics.setups import RING_GROUPS, SliceSetup, box, elastic, mapped, ring, skewed

FREE = ("left", "bottom", "right", "top")
E, NU = 200e9, 0.3
SHEAR = 0.5 * E / (1 + NU)


def driven(
    gradient: Callable[[float], Array],
    stretch: Callable[[float], float] = lambda t: 0.0,
    cell: str = "quadrilateral",
) -> SliceSetup:
    """A block whose whole boundary follows a deformation gradient over time."""
    held = tuple(
        PrescribedDisplacement(FREE, i, lambda p, t, i=i: p @ (gradient(t) - np.eye(2))[i])  # type: ignore[misc]
        for i in range(2)
    )
    planes = PlainPlanes((), {"a0": stretch})
    mesh = mapped(2, 2, skewed(0.1, 0.07), cell, groups=FREE)
    given = {"held": held, "planes": planes, "pin": False, "large_strain": True}
    return SliceSetup(mesh, elastic(E, NU), given=given, extrapolate=False, tolerance=1e-10)


def turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("degrees", [90.0, 210.0])
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_rigid_rotation_turns_the_stress(cell: str, degrees: float) -> None:
    """A stressed block turned in three steps: its stress turns with it, to rounding."""
    stretch = np.array([[1.02, 0.01], [0.0, 0.97]])
    final = np.radians(degrees)
    setup = driven(
        lambda t: (
            turn(final * max(t - 1, 0.0) / 3) @ (np.eye(2) + min(t, 1.0) * (stretch - np.eye(2)))
        ),
        lambda t: 0.01 * min(t, 1.0),
        cell,
    )
    setup.step(1.0)
    before = setup.stress.copy()
    assert np.abs(before).max() > 1e9
    for time in (2.0, 3.0, 4.0):
        setup.step(time)
    expected = before @ rotation(final).T
    assert np.abs(setup.stress - expected).max() < 1e-9 * np.abs(before).max()


def test_simple_shear_follows_jaumann() -> None:
    """S12 = G sin(gamma), s11 = G (1 - cos(gamma)), to second order in the step."""
    amount = 2.0

    def error(steps: int) -> float:
        setup = driven(lambda t: np.array([[1.0, amount * t], [0.0, 1.0]]))
        for i in range(steps):
            setup.step((i + 1) / steps)
        exact = SHEAR * np.array(
            [1 - np.cos(amount), np.cos(amount) - 1, 0.0, np.sqrt(2) * np.sin(amount)]
        )
        return float(np.abs(setup.stress - exact).max() / SHEAR)

    errors = np.array([error(n) for n in (10, 20, 40)])
    assert errors[-1] < 2e-3
    assert np.log2(errors[:-1] / errors[1:]).min() > 1.9


@pytest.mark.parametrize("axial", [True, False])
def test_tension_at_constant_true_strain_rate(axial: bool) -> None:
    """To 60 % along the strand or across it: the true stress, area of the deformed bar."""
    rate, end = 1e-3, 0.6
    law = NortonCreep.constant(Elasticity.constant(20e9, NU), 1e-9, 1e6, 5.0)
    flow = 1e6 * (rate / 1e-9) ** 0.2
    mesh = mapped(2, 2, box(0.01, 0.02))

    def stretch(t: float) -> float:
        return float(np.exp(rate * t) - 1)

    given: dict[str, object] = {"large_strain": True}
    if axial:
        given["planes"] = PlainPlanes((), {"a0": stretch})
    else:
        given["held"] = (PrescribedDisplacement(("right",), 0, lambda p, t: p[:, 0] * stretch(t)),)
    setup = SliceSetup(mesh, law, given=given)
    for time in np.linspace(0.0, end / rate, 121)[1:]:
        result = setup.step(float(time))
    along = 2 if axial else 0
    others = [i for i in range(4) if i != along]
    assert setup.stress[:, along] == pytest.approx(flow, rel=1e-5)
    assert np.abs(setup.stress[:, others]).max() < 1e-6 * flow
    elastic_part = flow / 20e9
    volume = np.exp(elastic_part * (1 - 2 * NU))
    thin = np.sqrt(volume / np.exp(end))
    if axial:
        assert result.balance is not None
        area = 0.01 * 0.02 * thin**2
        assert result.balance.axial[0] == pytest.approx(flow * area, rel=1e-4)
        tip = setup.displacement(lambda x, y: np.isclose(x, 0.01) & np.isclose(y, 0.02))[0]
        assert tip == pytest.approx([0.01 * (thin - 1), 0.02 * (thin - 1)], rel=1e-4)
    else:
        assert 1 + setup.state.generalized_strains[0] == pytest.approx(thin, rel=1e-4)


def test_elastic_tension_gives_hookes_law_of_true_strain() -> None:
    """Sigma = E ln(stretch), to second order in the step."""
    errors = []
    for steps in (4, 8):
        setup = SliceSetup(
            mapped(1, 1, box(0.01, 0.01)),
            elastic(E, NU),
            given={"large_strain": True, "planes": PlainPlanes((), {"a0": lambda t: 0.5 * t})},
        )
        for i in range(steps):
            setup.step((i + 1) / steps)
        errors.append(abs(setup.stress[0, 2] / (E * np.log(1.5)) - 1))
    assert errors[-1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_small_motion_is_that_of_small_strain() -> None:
    """Both formulations agree to first order in the strain."""

    def tube(large: bool, pressure: float) -> Array:
        setup = SliceSetup(
            mapped(3, 3, ring(0.02, 0.03), "quadrilateral", 2, RING_GROUPS),
            elastic(E, NU),
            given={
                "large_strain": large,
                "loads": (SurfacePressure(("inner",), lambda t: pressure * t),),
            },
        )
        setup.step(1.0)
        return setup.state.displacement / pressure

    differences = [
        np.abs(tube(True, p) - tube(False, p)).max() / np.abs(tube(False, p)).max()
        for p in (1e8, 1e7)
    ]
    assert differences[0] < 0.01
    assert differences[1] == pytest.approx(0.1 * differences[0], rel=0.05)


def test_tube_growing_under_pressure() -> None:
    """A crept thin tube at twice its radius: hoop stress p r / t of the tube as it is then."""
    pressure, law = 2e5, NortonCreep.constant(Elasticity.constant(20e9, NU), 1e-9, 1e6, 3.0)
    setup = SliceSetup(
        mapped(1, 6, ring(0.0495, 0.0505), "quadrilateral", 2, RING_GROUPS),
        law,
        given={
            "large_strain": True,
            "planes": PlainPlanes(()),
            "loads": (SurfacePressure(("inner",), lambda t: min(t, 1.0) * pressure),),
        },
    )
    time, radius, speed = 0.0, 0.0495, 0.0
    while radius < 0.075:
        dt = 1.0 if time == 0.0 else 0.02 * radius / speed
        time += dt
        setup.step(time)
        at = setup.displacement(lambda x, y: np.isclose(y, 0.0) & np.isclose(x, 0.0495))[0]
        speed = max((0.0495 + at[0] - radius) / dt, 1e-9)
        radius = 0.0495 + at[0]
    outer = 0.0505 + setup.displacement(lambda x, y: np.isclose(y, 0) & np.isclose(x, 0.0505))[0][0]
    assert outer**2 - radius**2 == pytest.approx(0.0505**2 - 0.0495**2, rel=1e-3)
    normal = setup.places / np.hypot(*setup.places.T)[:, None]
    c, s = normal.T
    stress = setup.stress
    hoop = stress[:, 0] * s * s + stress[:, 1] * c * c - np.sqrt(2) * stress[:, 3] * c * s
    assert hoop.mean() == pytest.approx(pressure * radius / (outer - radius), rel=2e-3)
