"""Solidification, contact and radiation, compared with closed forms, and the observed order.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from castfem.base.constants import STEFAN_BOLTZMANN
from castfem.fem.probes import Profile
from castfem.physics.closed_forms import Neumann, ThreeZones
from castfem.physics.thermal import flux_laws
from thermal.setups import ThermalSetup, constant_steel, strip

ALLOY = ThreeZones(30.0, 7200.0, 700.0, 272e3, 1000.0, 1450.0, 1500.0, 1540.0)


def alloy_setup(cells: int, scheme: str = "sdirk2") -> ThermalSetup:
    curve = constant_steel(ALLOY.solidus, ALLOY.liquidus, datum=ALLOY.initial)
    setup = ThermalSetup(strip(0.12, cells), curve, ALLOY.initial, scheme)
    return setup.cool(("surface", flux_laws.PrescribedTemperature(ALLOY.surface)))


def errors(setup: ThermalSetup, time: float) -> tuple[float, float, float]:
    """Return the largest temperature error, K, and the errors of both fronts, m."""
    x, temperature = setup.along_x()
    eta_s, eta_l = ALLOY.fronts()
    profile = Profile(x, temperature)
    return (
        float(np.abs(temperature - ALLOY.temperature(x, time)).max()),
        profile.isotherm_depth(ALLOY.solidus) - 2 * eta_s * np.sqrt(time),
        profile.isotherm_depth(ALLOY.liquidus) - 2 * eta_l * np.sqrt(time),
    )


def test_similarity_solution_has_the_published_values() -> None:
    eta = ALLOY.fronts()
    assert eta == pytest.approx((1.38273926e-3, 1.80380195e-3), rel=1e-8)
    depths = np.array([5.0, 10.0, 20.0, 30.0, 40.0]) * 1e-3
    published = [1275.4061, 1485.0392, 1530.9657, 1539.1929, 1539.9667]
    assert ALLOY.temperature(depths, 10.0) == pytest.approx(published, abs=1e-4)


def test_alloy_solidifies_as_the_similarity_solution() -> None:
    setup = alloy_setup(400)  # cells of 0.3 mm
    for time in (10.0, 40.0):
        temperature, solid, liquid = errors(setup.advance(time, 0.05), time)
        assert temperature < 0.5
        assert max(abs(solid), abs(liquid)) < 0.1e-3
        assert setup.state.removed / 0.3e-3 == pytest.approx(ALLOY.heat(time), rel=1e-4)
    assert setup.worst_balance < 1e-9


def test_scheme_is_of_second_order_in_space() -> None:
    cells = np.array([50, 100, 200, 400])
    found = []
    for n in cells:
        setup = alloy_setup(int(n)).advance(60.0, 0.2)
        x, temperature = setup.along_x()
        difference = temperature - ALLOY.temperature(x, 60.0)
        found.append(np.sqrt(np.mean(difference**2)))
    # Kinks of T(H) between vertices make the errors of single meshes scatter about the slope.
    order = -np.polyfit(np.log(cells), np.log(found), 1)[0]
    assert order > 1.8, found


@pytest.mark.parametrize(("scheme", "least"), [("backward_euler", 0.95), ("sdirk2", 1.9)])
def test_scheme_has_its_order_in_time_without_freezing(scheme: str, least: float) -> None:
    """Smooth cooling of a solid has no kinks of T(H)."""
    curve = constant_steel(1450.0, 1500.0, k=30.0, datum=1400.0)

    def final(step: float, scheme: str) -> np.ndarray:
        setup = ThermalSetup(strip(0.02, 20), curve, 1400.0, scheme)
        cooling = flux_laws.PrescribedFlux(lambda t: 4e5 * np.sin(0.3 * t) ** 2)
        return setup.cool(("surface", cooling)).advance(8.0, step).along_x()[1]

    steps = np.array([1.0, 0.5, 0.25, 0.125])
    exact = final(0.01, "sdirk2")
    found = [np.abs(final(s, scheme) - exact).max() for s in steps]
    assert np.polyfit(np.log(steps), np.log(found), 1)[0] > least, found


@pytest.mark.parametrize(
    ("initial", "root"), [(1494.4, 0.665780), (1550.0, 0.616196)], ids=["one-phase", "two-phase"]
)
def test_stefan_problem_has_its_closed_form(initial: float, root: float) -> None:
    exact = Neumann((33.0, 661.0), (33.0, 661.0), 7500.0, 272e3, 1000.0, 1494.4, initial)
    assert exact.root() == pytest.approx(root, abs=2e-6)
    curve = constant_steel(1494.35, 1494.45, rho=7500.0, c=661.0, k=33.0, datum=initial)
    start = max(initial, 1494.45)
    setup = ThermalSetup(strip(0.06, 200), curve, start)
    setup.cool(("surface", flux_laws.PrescribedTemperature(1000.0))).advance(21.0, 0.05)
    x, temperature = setup.along_x()
    front = Profile(x, temperature).isotherm_depth(1494.35)
    # The front stays at a vertex until its latent heat is released: up to a cell of 0.3 mm.
    assert front == pytest.approx(exact.front(21.0), abs=0.15e-3)
    assert np.abs(temperature - exact.temperature(x, 21.0)).max() < 6.0
    assert np.abs(temperature - exact.temperature(x, 21.0)).mean() < 1.0


def test_stefan_front_converges() -> None:
    exact = Neumann((33.0, 661.0), (33.0, 661.0), 7500.0, 272e3, 1000.0, 1494.4, 1550.0)
    curve = constant_steel(1494.35, 1494.45, rho=7500.0, c=661.0, k=33.0, datum=1550.0)
    found = []
    for cells in (50, 100, 200):
        setup = ThermalSetup(strip(0.06, cells), curve, 1550.0)
        heat = []
        setup.cool(("surface", flux_laws.PrescribedTemperature(1000.0)))
        setup.advance(21.0, 0.05, lambda h=heat, s=setup: h.append(s.state.removed))
        times = np.array([0.05 * (i + 1) for i in range(len(heat))])
        late = times > 5.0
        width = 0.06 / cells
        slope = 33.0 * 494.4 / np.sqrt(np.pi * 33.0 / (7500.0 * 661.0))
        from scipy.special import erf

        expected = 2 * np.sqrt(times) * slope / erf(exact.root())
        found.append(np.abs(np.array(heat)[late] / width / expected[late] - 1).max())
    assert found[2] < 2e-3
    assert found[0] / found[2] > 3.0, found


def test_steady_wall_between_fluids_is_exact() -> None:
    """Steady conduction with h on both sides is reached with very long steps."""
    curve = constant_steel(1800.0, 1850.0, k=25.0)
    setup = ThermalSetup(strip(0.05, 30), curve, 800.0)
    setup.cool(
        ("surface", flux_laws.Convection(500.0, 300.0)),
        ("core_end", flux_laws.Convection(900.0, 1400.0)),
    ).advance(1e8, 1e7)
    flux = (1400.0 - 300.0) / (1 / 500.0 + 0.05 / 25.0 + 1 / 900.0)
    x, temperature = setup.along_x()
    exact = 300.0 + flux / 500.0 + flux * x / 25.0
    assert temperature == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize("gap", [0.0, 0.5e-3])
def test_contact_and_gap_are_resistances_in_series(gap: float) -> None:
    """(301): both are in series with the conduction in the steel."""
    curve = constant_steel(1800.0, 1850.0, k=25.0)
    setup = ThermalSetup(strip(0.05, 20), curve, 800.0)
    setup.cool(
        ("surface", flux_laws.Contact(1600.0, 433.15, 0.15, gap)),
        ("core_end", flux_laws.PrescribedTemperature(1700.0)),
    ).advance(1e8, 1e7)
    flux = (1700.0 - 433.15) / (0.05 / 25.0 + 1 / 1600.0 + gap / 0.15)
    assert setup.along_x()[1][0] == pytest.approx(1700.0 - flux * 0.05 / 25.0, abs=1e-6)


def test_radiation_balances_conduction() -> None:
    curve = constant_steel(1800.0, 1850.0, k=25.0)
    setup = ThermalSetup(strip(0.05, 20), curve, 1500.0)
    law = flux_laws.Radiation(0.8, 293.15)
    setup.cool(("surface", law), ("core_end", flux_laws.PrescribedTemperature(1700.0))).advance(
        1e8, 1e6
    )
    sigma = STEFAN_BOLTZMANN
    exact = brentq(
        lambda t: 0.8 * sigma * (t**4 - 293.15**4) - 25.0 / 0.05 * (1700.0 - t), 293.15, 1700.0
    )
    assert setup.along_x()[1][0] == pytest.approx(exact, abs=1e-6)


def test_radiation_cools_a_lump_as_its_closed_form() -> None:
    """A body without internal resistance in cold surroundings: T^-3 = T0^-3 + 3 A t."""
    curve = constant_steel(1800.0, 1850.0, k=1e7, datum=1500.0)
    setup = ThermalSetup(strip(0.01, 4), curve, 1500.0)
    setup.cool(("surface", flux_laws.Radiation(0.8, 1e-3))).advance(100.0, 0.5)
    rate = 0.8 * STEFAN_BOLTZMANN / (7200.0 * 700.0 * 0.01)
    exact = (1500.0**-3 + 3 * rate * 100.0) ** (-1 / 3)
    assert setup.along_x()[1].mean() == pytest.approx(exact, abs=0.01)


def test_radiation_factor_of_a_gap_is_exact() -> None:
    """(33) computed by hand: m = 1.5, a = 400 /m, d = 1 mm, emissivities 0.8 and 0.4."""
    law = flux_laws.Radiation(0.8, 433.15, 0.4, 1.5, 400.0, 1e-3)
    resistance = 0.75 * 400.0 * 1e-3 + 1.25 + 2.5 - 1.0
    assert law.factor(np.array([1500.0]))[0] == pytest.approx(
        2.25 * 5.670374419e-8 / resistance, rel=1e-12
    )


BESIDE = (flux_laws.Radiation(0.8, 420.0, 0.4, 1.5, 400.0), flux_laws.Convection(50.0, 300.0))


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-4, 1e-3, np.inf])
def test_parallel_heat_flows_across_a_gap(gap: float) -> None:
    """Only contact where the strand touches (35); across a gap three flows in parallel (36).

    The temperature between the contact resistance and the gap follows from a heat balance.
    """
    t, conduction = 1500.0, 0.15 / gap if gap else np.inf
    gamma = flux_laws.Radiation(0.8, 420.0, 0.4, 1.5, 400.0, gap).factor(np.array([t]))[0]
    h = gamma * (t**2 + 420.0**2) * (t + 420.0)  # (34)

    def balance(m: float) -> float:
        crossing = conduction * (m - 433.15) + h * (m - 420.0) + 50.0 * (m - 300.0)
        return 1600.0 * (t - m) - crossing

    between = brentq(balance, 300.0, t, xtol=1e-12) if gap else 433.15
    law = flux_laws.Contact(1600.0, 433.15, 0.15, gap, beside=BESIDE)
    assert law.flux(np.array([t]), 0.0)[0][0] == pytest.approx(1600.0 * (t - between), rel=1e-10)
    assert law.ambient_range(0.0) == (300.0, 433.15)


def test_opening_gap_never_increases_the_flux() -> None:
    """The flux is also continuous at the loss of contact."""
    gap = np.concatenate([[-1e-5, 0.0], np.geomspace(1e-9, 1e-1, 200)])
    law = flux_laws.Contact(1600.0, 433.15, 0.15, gap, beside=(flux_laws.Radiation(0.8, 433.15),))
    flux, _ = law.flux(np.full(len(gap), 1500.0), 0.0)
    conducted = flux_laws.Contact(1600.0, 433.15, 0.15, gap).flux(np.full(len(gap), 1500.0), 0.0)[0]
    assert flux[0] == flux[1] == conducted[0]
    assert flux[2] == pytest.approx(flux[1], rel=1e-4)
    assert (np.diff(flux[1:]) < 0.0).all()
    assert (flux[2:] > conducted[2:]).all()


@pytest.mark.parametrize(
    "law",
    [
        flux_laws.Convection(lambda t: 200.0 + 0.1 * t, 300.0),
        flux_laws.Contact(1600.0, 433.15, 0.15, 0.2e-3),
        flux_laws.Radiation(lambda t: 0.6 + 1e-4 * t, 300.0),
        flux_laws.Radiation(0.8, 300.0, 0.5, 1.2, 300.0, 1e-3),
        *(
            flux_laws.Contact(1600.0, 433.15, 0.15, gap, beside=BESIDE)
            for gap in (0.0, 2e-4, np.inf)
        ),
    ],
)
def test_slope_of_the_flux_matches_differences(law: flux_laws.SurfaceLaw) -> None:
    temperature = np.linspace(600.0, 1700.0, 12)
    _, slope = law.flux(temperature, 1.0)
    high, low = (law.flux(temperature + d, 1.0)[0] for d in (0.1, -0.1))
    assert slope == pytest.approx((high - low) / 0.2, rel=1e-5)


def test_heat_generated_inside_warms_an_insulated_body() -> None:
    curve = constant_steel(1450.0, 1500.0, datum=1200.0)
    # By default a stage is solved to 1e-7 K.
    setup = ThermalSetup(strip(0.02, 10), curve, 1200.0, options={"ksp_rtol": 1e-12})
    setup.problem.set_source(np.full_like(setup.problem.area, 2e6))
    setup.advance(30.0, 1.0)
    assert setup.along_x()[1] == pytest.approx(1200.0 + 2e6 * 30.0 / (7200.0 * 700.0), abs=1e-9)
    assert setup.worst_balance < 1e-12


def test_heat_generated_between_cold_walls_is_a_parabola() -> None:
    curve = constant_steel(1450.0, 1500.0, k=25.0, datum=1200.0)
    setup = ThermalSetup(strip(0.02, 10), curve, 1200.0)
    setup.problem.set_source(np.full_like(setup.problem.area, 5e7))
    wall = flux_laws.PrescribedTemperature(1200.0)
    setup.cool(("surface", wall), ("core_end", wall)).advance(1e5, 1e4)
    x, temperature = setup.along_x()
    assert temperature == pytest.approx(1200.0 + 5e7 * x * (0.02 - x) / 50.0, abs=1e-6)
    assert setup.worst_balance < 1e-9
