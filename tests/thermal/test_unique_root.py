"""Unique roots under boiling, invalid laws, and exact inverses of T(H) and theta(H)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small_case
from hypothesis import given, settings
from hypothesis import strategies as st

import castfem
from castfem import meshes
from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.thermal.flux_laws import Convection, Radiation, SurfaceLaw
from castfem.physics.thermal.spray_correlations import wendelstorf
from castfem.physics.thermal.unique_root import Branch

from .setups import ThermalSetup, constant_steel

# Changes for a strip with boiling: the steam film ends between 600 and 550 degC.
BOILING: dict[str, Any] = {
    "casting.length": "2 m",
    "casting.temperature": "1000 degC",
    "cooling.0.name": "water",
    "cooling.0.surface": [
        {
            "law": "convection",
            "ambient": "25 degC",
            "coefficient": {
                "temperature": [100, 550, 600, 1200],
                "temperature_unit": "degC",
                "value": [9000, 9000, 600, 600],
                "unit": "W/(m^2 K)",
            },
        }
    ],
    "output.every": "1 h",
}


@pytest.fixture
def strip() -> castfem.Case:
    return small_case.strip(BOILING)


def quenched(case: castfem.Case) -> tuple[float, float]:
    """Run a case; return the end of film boiling, s, and the heat removed, J/m."""
    with castfem.run(case) as result:
        history = result.history
        name = next(n for n in history.columns if n.startswith("surface_temperature"))
        time, surface = history["time"].to_numpy(), history[name].to_numpy()
        below = int(np.argmax(surface < 550.0))
        assert surface[below] < 550.0
        return float(time[below]), result.quantities["heat_removed"]


def test_film_boiling_ends_at_the_right_time_for_any_step(strip: castfem.Case) -> None:
    fine, heat = quenched(strip.with_({"thermal.time.step": "0.2 s"}))
    for step in ("1 s", "10 s"):
        when, removed = quenched(strip.with_({"thermal.time.step": step}))
        assert when == pytest.approx(fine, rel=0.05)
        assert removed == pytest.approx(heat, rel=2e-3)


def test_backward_euler_stays_on_the_film_branch(strip: castfem.Case) -> None:
    euler = {"thermal.time.scheme": "backward_euler"}
    fine, _ = quenched(strip.with_({"thermal.time.step": "0.2 s", **euler}))
    when, _ = quenched(strip.with_({"thermal.time.step": "10 s", **euler}))
    assert when == pytest.approx(fine, rel=0.2)  # first order, but the same branch


def test_no_flux_cools_below_absolute_zero(strip: castfem.Case, tmp_path: Path) -> None:
    flux = [{"law": "flux", "value": "2.5 MW/m^2"}]
    with pytest.raises(RunFailure, match="below absolute zero"):
        castfem.run(strip.with_({"cooling.water.surface": flux}), tmp_path / "run")
    result = castfem.api.Result(tmp_path / "run")
    assert result.summary.status == "failed"
    assert result.history.filter(like="temperature").to_numpy().min() > -273.15


def test_law_that_heats_beyond_its_surroundings_is_rejected(
    strip: castfem.Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    from castfem.physics.thermal import spray_correlations

    heating = spray_correlations.Correlation(
        lambda water, cold, surface: np.full_like(surface, -500.0)
    )
    monkeypatch.setitem(spray_correlations.CORRELATIONS, "nozaki", heating)
    spray = {"law": "spray", "water": "5 L/(m^2 s)", "water_temperature": "25 degC"}
    case = strip.with_({"cooling.water.surface": [{**spray, "correlation": "nozaki"}]})
    with pytest.raises(RunFailure, match="though there is nothing hotter than 1000 degC"):
        castfem.run(case)


@pytest.mark.parametrize("value", ["20 degC", "999 degC", "1300 degC"])
def test_adaptive_steps_follow_a_jump_of_temperature(strip: castfem.Case, value: str) -> None:
    prescribed = {"cooling.water.surface": [{"law": "temperature", "value": value}]}
    case = strip.with_({"casting.length": "100 mm", **prescribed})
    adaptive = castfem.run(case)
    fine = castfem.run(case.with_({"thermal.time.step": "10 ms"}))
    found, exact = (r.quantities["heat_removed"] for r in (adaptive, fine))
    assert found == pytest.approx(exact, rel=5e-3)
    assert adaptive.summary.steps["accepted"] < 200.0


def test_zero_emissivity_radiates_nothing() -> None:
    hot = np.array([500.0, 1500.0])
    for law in (Radiation(0.0, 300.0), Radiation(0.8, 300.0, 0.0), Radiation(0.0, 300.0, 0.0)):
        flux, slope = law.flux(hot, 0.0)
        assert (flux == 0.0).all() and (slope == 0.0).all()


def test_more_water_never_heats() -> None:
    surface = np.linspace(400.0, 1800.0, 200)
    most = wendelstorf(30.0, 298.15, surface)
    for water in (35.0, 72.0, 80.0, 500.0):
        np.testing.assert_array_equal(wendelstorf(water, 298.15, surface), most)
    assert most.min() > 0.0


@dataclass(frozen=True)
class BoilingPeak(SurfaceLaw):
    """The flux q = q0 exp(-((T - T0)/w)^2), with its least slope at T0 + w/sqrt(2)."""

    peak: float = 5e6
    at: float = 873.15
    width: float = 200.0

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        off = (temperature - self.at) / self.width
        flux = self.peak * np.exp(-(off**2))
        return flux, -2.0 * off / self.width * flux

    def least_rise(self, temperatures: Array, time: float) -> float:
        return float(self.flux(temperatures, time)[1].min())

    def ambient_range(self, time: float) -> tuple[float, float]:
        return 298.15, 298.15


def test_stage_length_keeps_any_law_on_its_branch() -> None:
    """Tau w (-dq/dT) < M dH/dT at the least slope, -sqrt(2/e) q0/w = -21 444 W/(m2 K)."""
    law = BoilingPeak()
    problem = boiling_strip(law).problem
    steepest = np.sqrt(2.0 / np.e) * law.peak / law.width
    assert steepest == pytest.approx(21444.0, rel=1e-4)
    hot, cold = (
        problem.curve.at(problem.curve.enthalpy(np.full_like(problem.area, law.at + off)))
        for off in (200.0, 100.0)
    )
    (patch,) = (one for one, _ in problem.cooling.laws)
    storage = problem.volume[patch.dofs] / hot.temperature_slope[patch.dofs]
    exact = (storage / (patch.weights * steepest)).min()
    branch = Branch(problem)
    assert branch.longest_stage(hot, cold, 0.0, np.inf) == pytest.approx(exact, rel=1e-3)
    rising = problem.curve.at(problem.curve.enthalpy(np.full_like(problem.area, law.at - 100.0)))
    assert branch.longest_stage(rising, rising, 0.0, np.inf) == np.inf


def boiling_strip(law: SurfaceLaw) -> ThermalSetup:
    """Set up a strip of 10 mm with constant properties, cooled by a law at its end."""
    mesh = meshes.build(
        shape="strip", length=0.01, width=0.002, surface_size=1e-3, core_size=2e-3,
        cell="quadrilateral", order=1,
    )  # fmt: skip
    return ThermalSetup(mesh, constant_steel(1723.15, 1773.15), 1273.15).cool(("surface", law))


def test_stage_length_is_proportional_to_the_filled_volume() -> None:
    """Tau w (-dq/dT) < M dH/dT, with M the volume filled by the steel of the vertex."""
    law = Convection(lambda t: np.interp(t, [823.15, 873.15], [9000.0, 600.0]), 298.15)
    problem = boiling_strip(law).problem
    hot, cold = (
        problem.curve.at(problem.curve.enthalpy(np.full_like(problem.area, t)))
        for t in (870.0, 830.0)
    )
    branch = Branch(problem)
    full = branch.longest_stage(hot, cold, 0.0, np.inf)
    problem.fill(np.full_like(problem.area, 0.5))
    assert branch.longest_stage(hot, cold, 0.0, np.inf) == pytest.approx(0.5 * full, rel=1e-12)


def random_curve(seed: int, straight: bool = False) -> ThermalCurve:
    rng = np.random.default_rng(seed)
    n, m = rng.integers(3, 9), rng.integers(2, 6)
    t = np.sort(rng.uniform(300, 2000, n))
    tk = np.sort(rng.uniform(250, 2100, m))
    tk[0], tk[-1] = 250.0, 2100.0
    jump = np.where(rng.random(n) < 0.3, rng.uniform(0, 2e9, n), 0.0)
    left, right = rng.uniform(1e6, 6e6, (2, n - 1))
    k_left, k_right = rng.uniform(10, 50, (2, m - 1))
    if straight:
        right, k_right = left, k_left
    capacity = (t, left, right, rng.uniform(0, 5e7, n - 1), jump)
    return ThermalCurve(capacity, (tk, k_left, k_right), rng.choice([None, 1500.0]))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_inverse_and_slopes_are_exact(seed: int, straight: bool) -> None:
    curve = random_curve(seed, straight)
    assert (curve.lines() is not None) == straight
    rng = np.random.default_rng(seed + 1)
    temperature = rng.uniform(200, 2300, 200)
    temperature = temperature[np.abs(temperature[:, None] - curve.knots).min(axis=1) > 0.1]
    enthalpy = curve.enthalpy(temperature)
    point = curve.at(enthalpy)
    assert point.temperature == pytest.approx(temperature, abs=1e-8)
    step = 1e3
    up, down = curve.at(enthalpy + step), curve.at(enthalpy - step)
    assert point.temperature_slope == pytest.approx(
        (up.temperature - down.temperature) / (2 * step), rel=1e-4
    )
    assert point.conduction_slope == pytest.approx(
        (up.conduction - down.conduction) / (2 * step), rel=2e-3
    )
    assert curve.conductivity(temperature) == pytest.approx(
        point.conduction_slope / point.temperature_slope, rel=1e-9
    )


def test_isothermal_jump_is_flat() -> None:
    t = np.array([300.0, 1500.0, 2000.0])
    curve = ThermalCurve(
        (t, np.full(2, 5e6), np.full(2, 5e6), np.zeros(2), np.array([0.0, 2e9, 0.0])),
        (np.array([300.0, 2000.0]), np.array([30.0]), np.array([30.0])),
    )
    solid, molten = curve.enthalpy(1500.0, side="left"), curve.enthalpy(1500.0)
    assert molten - solid == pytest.approx(2e9)
    between = curve.at(np.linspace(solid + 1.0, molten - 1.0, 7))
    assert np.all(between.temperature == 1500.0)
    assert np.all(between.temperature_slope == 0.0)
    assert np.all(between.conduction_slope == 0.0)


def test_enthalpy_is_zero_at_the_datum() -> None:
    t = np.array([300.0, 2000.0])
    k = np.array([30.0])
    curve = ThermalCurve(
        (t, np.array([4e6]), np.array([6e6]), np.zeros(1), np.zeros(2)), (t, k, k), datum=1234.0
    )
    assert curve.enthalpy(1234.0) == 0.0
    assert curve.at(np.zeros(1)).conduction[0] == 0.0
    assert curve.at(np.zeros(1)).temperature[0] == pytest.approx(1234.0)


def test_negative_capacity_is_rejected() -> None:
    t = np.array([300.0, 2000.0])
    k = np.array([30.0])
    with pytest.raises(ValueError, match="positive"):
        ThermalCurve((t, np.array([-1.0]), np.array([1.0]), np.zeros(1), np.zeros(2)), (t, k, k))
