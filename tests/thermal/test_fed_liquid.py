"""Heat in a slice that solidifies while strained: liquid is fed, solid keeps its mass."""

from __future__ import annotations

import numpy as np
import pytest

from castfem import meshes
from castfem.fem.probes import Profile
from castfem.physics.closed_forms import ThreeZones
from castfem.physics.materials import load_steel
from castfem.physics.thermal import flux_laws
from thermal.setups import ThermalSetup, constant_steel, strip

ALLOY = ThreeZones(30.0, 7200.0, 700.0, 272e3, 1000.0, 1450.0, 1500.0, 1540.0)
TIME = 10.0


def chilled(along: float, across: float, axial: float, fed: bool = True) -> ThermalSetup:
    """Strain a liquid strip uniformly, then chill it at its end for 10 s."""
    curve = constant_steel(ALLOY.solidus, ALLOY.liquidus, datum=ALLOY.initial)
    mesh = strip(0.06, 150)
    setup = ThermalSetup(mesh, curve, ALLOY.initial, moves=True, solidus=ALLOY.solidus)
    setup.move(lambda x: np.array([along * x[0], across * x[1]]), axial)
    if fed:
        setup.state = setup.stepper.feed(setup.state)
    setup.cool(("surface", flux_laws.PrescribedTemperature(ALLOY.surface)))
    return setup.advance(TIME, 0.1)


def fronts(setup: ThermalSetup) -> tuple[float, float]:
    """Return the depths of solidus and liquidus on the undeformed strip, m."""
    profile = Profile(*setup.along_x())
    return profile.isotherm_depth(ALLOY.solidus), profile.isotherm_depth(ALLOY.liquidus)


EXACT = tuple(2.0 * eta * np.sqrt(TIME) for eta in ALLOY.fronts())


@pytest.mark.parametrize(("across", "axial"), [(0.0, 0.0), (0.1, 0.05), (-0.1, 0.0), (0.0, -0.08)])
def test_strain_normal_to_the_heat_flow_keeps_the_fronts(across: float, axial: float) -> None:
    """The heat removed is proportional to the deformed area."""
    setup = chilled(0.0, across, axial)
    assert fronts(setup) == pytest.approx(EXACT, abs=0.06e-3)
    area = (1.0 + across) * (1.0 + axial)
    width = 0.06 / 150
    assert setup.state.removed / width == pytest.approx(area * ALLOY.heat(TIME), rel=1e-3)


@pytest.mark.parametrize("along", [0.1, -0.1])
def test_strain_along_the_heat_flow_keeps_the_fronts_in_space(along: float) -> None:
    """Liquid strained along the heat flow solidifies at its position in space."""
    setup = chilled(along, 0.0, 0.0)
    found = [(1.0 + along) * depth for depth in fronts(setup)]
    assert found == pytest.approx(EXACT, abs=0.06e-3)


def test_liquid_without_feeding_solidifies_too_fast() -> None:
    """Stretched by e, more area conducts the heat of the same mass.

    So the fronts are deeper by the factor sqrt(1 + e).
    """
    stretched = fronts(chilled(0.0, 0.21, 0.0, fed=False))
    assert stretched == pytest.approx([1.1 * depth for depth in EXACT], abs=0.07e-3)


def insulated(axial: float) -> tuple[ThermalSetup, float]:
    """Cool steel of temperature-dependent density to about 900 degC, then insulate it."""
    steel = load_steel("plain_carbon", composition={"C": 0.2})
    start = steel.liquidus + 30.0
    curve = steel.thermal_curve(400.0, start + 2.0, start, poured=start)
    mesh = meshes.build(
        shape="rectangle", width=0.01, height=0.01, surface_size=1e-3, core_size=1e-3,
        cell="quadrilateral", order=1,
    )  # fmt: skip
    setup = ThermalSetup(mesh, curve, start, moves=True, solidus=steel.solidus)
    setup.move(lambda x: np.zeros((2, x.shape[1])), axial)
    setup.state = setup.stepper.feed(setup.state)
    setup.cool(("", flux_laws.PrescribedFlux(1e6))).advance(13.0, 0.1)
    setup.cool().advance(60.0, 1.0)
    low, high = setup.state.extremes
    assert high - low < 1e-3 and high < 1250.0
    enthalpy = steel.properties["enthalpy"]
    per_mass = float(enthalpy(start) - enthalpy(0.5 * (low + high)))
    return setup, float(steel.density(steel.solidus, "below")) * 0.25e-4 * per_mass


@pytest.mark.parametrize("axial", [0.0, 0.03])
def test_solid_keeps_its_mass(axial: float) -> None:
    """The heat removed is rho(solidus) A0 (h0 - h) of the volume that solidified."""
    setup, expected = insulated(axial)
    assert setup.state.removed == pytest.approx((1.0 + axial) * expected, rel=1e-6)


def test_straining_the_solid_moves_no_heat() -> None:
    setup, expected = insulated(0.0)
    temperature = setup.state.point.temperature
    setup.move(lambda x: np.array([0.02 * x[0], -0.05 * x[1]]), 0.1)
    setup.state = setup.stepper.feed(setup.state)
    setup.advance(61.0, 1.0)
    assert setup.state.fed == 0.0
    assert setup.state.point.temperature == pytest.approx(temperature, abs=1e-3)
    assert setup.state.removed == pytest.approx(expected, rel=1e-6)
