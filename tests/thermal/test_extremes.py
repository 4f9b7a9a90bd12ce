"""Stiff and extreme problems: no over- or undershoot, no heat lost, no failed solve."""

from __future__ import annotations

import numpy as np
import pytest

from castfem import meshes
from castfem.physics.closed_forms import Neumann, ThreeZones
from castfem.physics.thermal import flux_laws
from thermal.setups import ThermalSetup, constant_steel, strip

WALL, CAST = 433.15, 1813.15
SLACK = 1e-5  # K


def billet(radius: float, cell: str = "quadrilateral", **sizes: float) -> meshes.SectionMesh:
    cells = {"surface_size": 0.5e-3, "core_size": 8e-3, **sizes}
    return meshes.build(
        shape="rectangle",
        width=0.125,
        height=0.125,
        corner_radius=radius,
        symmetry="quarter",
        cell=cell,
        order=1,
        **cells,
    )


def within_bounds(setup: ThermalSetup, low: float = WALL) -> bool:
    return setup.low >= low - SLACK and setup.high <= CAST + SLACK


@pytest.mark.parametrize(
    ("step", "scheme", "cell"),
    [
        (1e-5, "sdirk2", "quadrilateral"),
        (1e-5, "backward_euler", "triangle"),
        (1e-2, "sdirk2", "triangle"),
    ],
)
def test_sudden_quench_stays_within_bounds(step: float, scheme: str, cell: str) -> None:
    """A sudden h = 50 kW/m2K, with a tiny step and one a thousand times longer."""
    setup = ThermalSetup(
        billet(0.0, cell), constant_steel(1725.15, 1775.65, datum=CAST), CAST, scheme
    )
    changes = []
    setup.cool(
        ("wide", flux_laws.Contact(5e4, WALL, 0.15)), ("narrow", flux_laws.Contact(5e4, WALL, 0.15))
    )
    before = setup.state.point.temperature

    def watch() -> None:
        nonlocal before
        now = setup.state.point.temperature
        changes.append(float((now - before).max()))
        before = now

    setup.advance(50 * step, step, watch)
    assert within_bounds(setup)
    # Cooled from all sides by a constant wall, no point may become warmer.
    assert max(changes) < SLACK
    assert setup.worst_balance < 1e-9


@pytest.mark.parametrize("step", [1e-5, 10.0])
def test_quench_of_a_rounded_billet_stays_within_bounds(step: float) -> None:
    setup = ThermalSetup(billet(5e-3), constant_steel(1725.15, 1775.65, datum=CAST), CAST)
    law = flux_laws.Contact(5e4, WALL, 0.15)
    setup.cool(("wide", law), ("narrow", law), ("corner", law)).advance(20 * step, step)
    assert within_bounds(setup)
    assert setup.worst_balance < 1e-9


@pytest.mark.parametrize(("freezing_range", "step"), [(0.0, 0.1), (0.1, 0.1), (0.0, 1.0)])
def test_narrow_freezing_range_has_the_closed_form(freezing_range: float, step: float) -> None:
    """Down to isothermal freezing, the front is within a cell of the closed form."""
    solidus = 1494.35
    curve = constant_steel(
        solidus, solidus + freezing_range, rho=7500.0, c=661.0, k=33.0, datum=1550.0
    )
    setup = ThermalSetup(strip(0.06, 120), curve, 1550.0)
    setup.cool(("surface", flux_laws.PrescribedTemperature(1000.0))).advance(20.0, step)
    exact = Neumann((33.0, 661.0), (33.0, 661.0), 7500.0, 272e3, 1000.0, solidus, 1550.0)
    x, temperature = setup.along_x()
    # A vertex is solid after the front has passed its part of the strip, to half a cell beyond.
    solid = x[temperature < solidus].max() + 0.25e-3
    assert solid == pytest.approx(exact.front(20.0), abs=0.5e-3)
    assert setup.low >= 1000.0 - SLACK and setup.high <= 1550.0 + SLACK
    assert setup.worst_balance < 1e-9


def test_single_step_releases_all_latent_heat() -> None:
    """One step from liquid to cold solid conserves the heat exactly."""
    curve = constant_steel(1725.15, 1775.65, datum=CAST)
    setup = ThermalSetup(strip(0.02, 40), curve, CAST)
    setup.cool(("surface", flux_laws.Contact(1600.0, WALL, 0.15))).advance(1e4, 1e4)
    temperature = setup.state.point.temperature
    assert temperature.max() < 460.0
    mean = float(setup.problem.area @ temperature) / float(setup.problem.area.sum())
    expected = 7200.0 * (700.0 * (CAST - mean) + 272e3) * 0.02
    assert setup.state.removed / 0.5e-3 == pytest.approx(expected, rel=1e-12)
    assert setup.worst_balance < 1e-12


@pytest.mark.parametrize("ratio", [1e-3, 1e3])
def test_conductivity_ratio_of_a_thousand_is_exact(ratio: float) -> None:
    """In a steady wall of liquid and solid the conduction integral is linear on any mesh."""
    curve = constant_steel(1500.0, 1500.0, k=(30.0, 30.0 * ratio))
    setup = ThermalSetup(strip(0.05, 25), curve, 1600.0)
    setup.cool(
        ("surface", flux_laws.PrescribedTemperature(1000.0)),
        ("core_end", flux_laws.PrescribedTemperature(1800.0)),
    ).advance(1e9, 1e8)
    flux = (30.0 * 500.0 + 30.0 * ratio * 300.0) / 0.05
    x, temperature = setup.along_x()
    front = 30.0 * 500.0 / flux
    solid = x < front - 1e-9
    assert temperature[solid] == pytest.approx(1000.0 + flux * x[solid] / 30.0, abs=1e-5)
    liquid = x > front + 1e-9
    exact = 1500.0 + flux * (x[liquid] - front) / (30.0 * ratio)
    assert temperature[liquid] == pytest.approx(exact, abs=1e-5)


def test_rapidly_alternating_coefficient_is_stable() -> None:
    mesh = billet(0.0, surface_size=1e-3)
    setup = ThermalSetup(mesh, constant_steel(1725.15, 1775.65, datum=CAST), CAST)
    time = 0.0
    for i in range(200):
        law = flux_laws.Contact(3000.0 if i % 2 == 0 else 300.0, WALL, 0.15)
        setup.cool(("wide", law), ("narrow", law))
        time += 0.1
        setup.advance(time, 0.1)
    assert within_bounds(setup)
    assert setup.worst_balance < 1e-9
    # Except in the oscillating skin, the heat removed is that of the mean coefficient.
    mean = ThermalSetup(mesh, constant_steel(1725.15, 1775.65, datum=CAST), CAST)
    law = flux_laws.Contact(1650.0, WALL, 0.15)
    mean.cool(("wide", law), ("narrow", law)).advance(20.0, 0.1)
    assert setup.state.removed == pytest.approx(mean.state.removed, rel=0.03)


def test_radiation_from_1500_to_20_degrees_is_stable() -> None:
    setup = ThermalSetup(strip(0.05, 50), constant_steel(1650.0, 1700.0, datum=1773.15), 1773.15)
    setup.cool(("surface", flux_laws.Radiation(0.9, 293.15)))
    setup.advance(1.0, 0.01).advance(1e4, 50.0)
    assert setup.worst_balance < 1e-9
    setup.advance(1e8, 1e6)
    assert setup.low >= 293.15 - SLACK and setup.high <= 1773.15 + SLACK
    assert setup.state.point.temperature == pytest.approx(293.15, abs=0.01)


def test_steps_outside_the_bounds_are_repeated() -> None:
    """For a step of many decay times of the skin SDIRK2 itself ends colder than the wall."""
    setup = ThermalSetup(strip(2e-3, 8), constant_steel(1725.15, 1775.65, datum=1500.0), 1500.0)
    setup.cool(("surface", flux_laws.Contact(5e4, WALL, 0.15)))
    result = setup.stepper.step(setup.state, 5.0)
    assert result.limited
    raw = setup.stepper._sdirk2(setup.state, 5.0, (0.0, 2000.0))[-1].point.temperature
    assert raw.min() < WALL - 1.0
    assert result.state.point.temperature.min() >= WALL - SLACK


def test_total_heat_is_exact_for_any_step() -> None:
    """1 or 200 steps to a uniform final temperature remove the same heat."""
    alloy = ThreeZones(30.0, 7200.0, 700.0, 272e3, 1000.0, 1450.0, 1500.0, 1540.0)
    removed = []
    for steps in (1, 30, 200):
        curve = constant_steel(alloy.solidus, alloy.liquidus, datum=alloy.initial)
        setup = ThermalSetup(strip(0.02, 20), curve, alloy.initial)
        setup.cool(("surface", flux_laws.PrescribedTemperature(1000.0))).advance(1e8, 1e8 / steps)
        removed.append(setup.state.removed)
    assert np.ptp(removed) / removed[0] < 1e-6


@pytest.mark.parametrize("decays", [0.3, 1.0, 2.0])
def test_what_a_step_of_an_exponential_decay_is_off_by_over_its_estimate(decays: float) -> None:
    """A millimetre that conducts so well that it has one temperature, against exp(-t)."""
    size, unit = 1e-3, 7200.0 * 700.0 * 1e-6  # of time, s: density, heat capacity, size over h
    curve = constant_steel(300.0, 300.5, k=5000.0, latent=1.0)
    setup = ThermalSetup(strip(size, 1), curve, 1500.0)
    setup.cool(("surface", flux_laws.Convection(1000.0, 400.0))).advance(0.04 * unit, 1e-3 * unit)
    before, begin = setup.state.point.temperature.mean(), setup.state.time
    setup.advance(begin + decays * unit, decays * unit)
    off = setup.state.point.temperature.mean() - 400.0 - (before - 400.0) * np.exp(-decays)
    assert 3.5 < abs(off) / setup.results[-1].error < 7.0


@pytest.mark.parametrize("scheme", ["sdirk2", "backward_euler"])
def test_the_flux_is_that_of_conduction_once_a_given_temperature_has_jumped(scheme: str) -> None:
    """From the first step on, in which the heat of the surface itself leaves as well."""
    size, kelvin = 1e-3, 1173.15
    setup = ThermalSetup(strip(0.02, 20), constant_steel(1700.0, 1750.0), CAST, scheme)
    setup.cool(("surface", flux_laws.PrescribedTemperature(kelvin)))
    for _ in range(3):
        setup.advance(setup.state.time + 0.01, 0.01)
        state = setup.state
        flow = setup.problem.surface_flow(state.point, state.rate, state.time).sum()
        _, along = setup.along_x()
        steepest = 30.0 * np.abs(np.diff(along)).max() / size
        assert flow / size == pytest.approx(steepest, rel=1e-6)


def test_heat_is_exact_where_two_given_temperatures_meet() -> None:
    """The corner of a sharp billet has the later one, and its heat counts once."""
    setup = ThermalSetup(billet(0.0, surface_size=4e-3), constant_steel(1700.0, 1750.0), CAST)
    hotter, colder = map(flux_laws.PrescribedTemperature, (1300.0, 1200.0))
    setup.cool(("wide_face", hotter), ("narrow_face", colder)).advance(20.0, 0.5)
    x, y = setup.section.vertex_space.tabulate_dof_coordinates()[: setup.section.owned, :2].T
    temperature = setup.state.point.temperature
    assert temperature[(x > 0.0624) & (y > 0.0624)] == pytest.approx(1200.0)
    assert temperature[(x < 0.0624) & (y > 0.0624)] == pytest.approx(1300.0)
    lost = setup.problem.volume @ (setup.curve.enthalpy(CAST) - setup.state.enthalpy)
    assert setup.state.removed == pytest.approx(lost, rel=1e-9)


@pytest.mark.parametrize(
    ("radius", "cell", "least", "most"),
    [
        (0.0, "quadrilateral", 0.0, 1e-12),
        (5e-3, "triangle", 0.0, 1e-12),
        (5e-3, "quadrilateral", 0.01, 0.07),
    ],
)
def test_conduction_is_an_m_matrix_on_suitable_meshes(
    radius: float, cell: str, least: float, most: float
) -> None:
    """Exactly on rectangles and Delaunay triangles, nearly on quadrilaterals at an arc."""
    setup = ThermalSetup(billet(radius, cell), constant_steel(1725.15, 1775.65), CAST)
    matrix = setup.problem._laplacian
    starts, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    others = rows != columns
    share = (values[others] / matrix.getDiagonal().getArray()[rows[others]]).max()
    assert least <= max(share, 0.0) <= most


def test_overshoot_at_an_arc_is_below_a_tenth_of_a_kelvin() -> None:
    """Only the corner is quenched: positive off-diagonal entries violate the maximum principle."""
    curve = constant_steel(1725.15, 1775.65, datum=CAST)
    mesh = billet(5e-3, surface_size=1e-3, corner_size=1e-3)
    setup = ThermalSetup(mesh, curve, CAST, "backward_euler")
    setup.cool(("corner", flux_laws.Convection(3e4, 298.15))).advance(1.0, 0.01)
    assert CAST < setup.high < CAST + 0.1
