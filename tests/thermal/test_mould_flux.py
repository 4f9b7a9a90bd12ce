"""Measured heat of a mould: curves of flux and coefficient, across a gap, scaled to a total."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.base.tables import Table, celsius
from castfem.physics.thermal import flux_laws
from castfem.physics.thermal.mould_flux import (
    MOULD_FLUXES,
    NEAREST,
    WATER,
    CoefficientCurve,
    FluxCurve,
    heat_to_mould,
)

SURFACE = "cooling.0.surface"
WALL, KG = 433.15, 0.15
FLUX = {"law": "contact", "flux": "2 MW/m^2", "wall": "160 degC"}
SPEED, LENGTH = 0.06, 0.06
HOT = np.array([WALL + 2.0, WALL + 30.0, 900.0, 1400.0, 1750.0])


def contact(curve: Any, **more: Any) -> flux_laws.Contact:
    return flux_laws.Contact(coefficient=curve, wall=WALL, gap_conductivity=KG, **more)


def falling() -> Table:
    return celsius([200, 1000, 1400], [3e6, 2.5e6, 1e6])


def run(law: dict[str, Any]) -> Any:
    return castfem.run(small({SURFACE: [law], "cooling.0.to": "60 mm"})).history


def test_without_a_gap_the_flux_is_the_measured_one() -> None:
    flux, slope = contact(FluxCurve(2e6)).flux(HOT, 0.0)
    assert flux[1:] == pytest.approx(2e6, rel=1e-15)
    assert abs(slope[1:]).max() < 1e-9 * 2e6 / NEAREST


def test_gap_is_in_series_with_the_resistance_of_the_flux() -> None:
    gap = 0.2e-3
    flux, _ = contact(FluxCurve(2e6), gap=gap).flux(HOT, 0.0)
    excess = HOT[1:] - WALL
    assert flux[1:] == pytest.approx(excess / (excess / 2e6 + gap / KG), rel=1e-14)


def test_no_flux_cools_below_the_wall() -> None:
    law = contact(FluxCurve(2e6))
    assert law.ambient_range(0.0) == (WALL, WALL)
    flux, slope = law.flux(np.array([WALL - 5.0, WALL, WALL + 5.0]), 0.0)
    assert flux == pytest.approx([-1e6, 0.0, 1e6])
    assert slope == pytest.approx(2e6 / NEAREST)


@pytest.mark.parametrize("beside", [(), (flux_laws.Radiation(0.8, 400.0),)])
@pytest.mark.parametrize(
    "curve",
    [
        FluxCurve(2e6),
        CoefficientCurve(1600.0),
        FluxCurve(over_temperature=falling()),
        CoefficientCurve(over_temperature=celsius([200, 1000, 1400], [900, 1600, 3000])),
    ],
)
@pytest.mark.parametrize("gap", [0.0, 0.3e-3])
def test_slope_is_the_derivative(curve: Any, gap: float, beside: Any) -> None:
    law = contact(curve, gap=gap, beside=beside)
    warm = np.array([WALL + 3.0, 700.0, 1400.0, 1700.0])
    d = 1e-2
    slope = (law.flux(warm + d, 1.0)[0] - law.flux(warm - d, 1.0)[0]) / (2 * d)
    assert law.flux(warm, 1.0)[1] == pytest.approx(slope, rel=2e-6, abs=1e-3)


@pytest.mark.parametrize("gap", [0.0, 0.3e-3])
def test_constant_curve_is_the_constant_law(gap: float) -> None:
    beside = (flux_laws.Radiation(0.8, 400.0), flux_laws.Convection(20.0, 300.0))
    law, curve = (contact(c, gap=gap, beside=beside) for c in (1600.0, CoefficientCurve(1600.0)))
    for found, expected in zip(curve.flux(HOT, 0.0), law.flux(HOT, 0.0), strict=True):
        assert found == pytest.approx(expected, rel=1e-13)


def test_least_rise_of_a_falling_flux_is_its_slope() -> None:
    grid = np.arange(500.0, 1700.0)
    falls = contact(FluxCurve(over_temperature=falling()), gap=np.full(7, 1e-4))
    assert falls.least_rise(grid, 0.0) == pytest.approx(-1.5e6 / 400.0, rel=1e-6)
    rises = CoefficientCurve(over_temperature=celsius([200, 1400], [900, 3000]))
    assert contact(rises).least_rise(grid, 0.0) == 0.0
    assert contact(FluxCurve(2e6)).least_rise(grid, 0.0) == 0.0


def test_contact_with_a_flux_has_that_flux() -> None:
    expected = run({"law": "flux", "value": "2 MW/m^2"})
    for name in ("surface_temperature_corner", "heat_removed", "shell_mid_face"):
        assert run(FLUX)[name].to_numpy() == pytest.approx(
            expected[name].to_numpy(), rel=1e-9, abs=1e-6, nan_ok=True
        )


@pytest.mark.parametrize(
    ("key", "values", "unit"),
    [("flux", [3, 1.5], "MW/m^2"), ("coefficient", [2500, 1200], "W/(m^2 K)")],
)
def test_tables_over_position_and_time_are_equivalent(
    key: str, values: list[float], unit: str
) -> None:
    columns = {"value": values, "unit": unit}
    place = {"position": [0, 1e3 * LENGTH / 2], "position_unit": "mm", **columns}
    time = {"time": [0, LENGTH / SPEED / 2], "time_unit": "s", **columns}
    found, expected = (run({"law": "contact", key: t, "wall": "160 degC"}) for t in (place, time))
    assert found["heat_removed"].to_numpy() == pytest.approx(expected["heat_removed"].to_numpy())
    if key == "flux":
        per_unit = run(FLUX | {"flux": "1 MW/m^2"})["heat_removed"].iloc[-1]
        mean = (0.5 * (values[0] + values[1]) + values[1]) / 2
        assert found["heat_removed"].iloc[-1] / per_unit == pytest.approx(mean, rel=1e-3)


@pytest.mark.parametrize("name", ["value", "flux", "heat flux"])
def test_csv_file_over_position_is_read(tmp_path: Path, name: str) -> None:
    path = tmp_path / "flux.csv"
    path.write_text(f"position [mm], {name} [MW/m^2]\n0, 3\n30, 1.5\n")
    columns = {"position": [0, 0.03], "position_unit": "m", "value": [3, 1.5], "unit": "MW/m^2"}
    by_file, by_columns = ({**FLUX, "flux": t} for t in ({"file": str(path)}, columns))
    assert small({SURFACE: [by_file]}).cooling == small({SURFACE: [by_columns]}).cooling


@pytest.mark.parametrize("law", ["contact", "flux"])
def test_heat_is_scaled_to_that_of_the_water(law: str) -> None:
    curve = {"position": [0, 40], "position_unit": "mm", "value": [3, 1], "unit": "MW/m^2"}
    cooling = FLUX | {"flux": curve} if law == "contact" else {"law": "flux", "value": curve}
    power = run(cooling | {"power": "50 kW"})
    assert power["cooling_power"].iloc[-1] == pytest.approx(50.0, rel=1e-3)
    litres = 50e3 / (WATER * 5.0) * 6e4
    water = run(cooling | {"water": f"{litres!r} L/min", "water_rise": "5 K"})
    assert water["heat_removed"].to_numpy() == pytest.approx(power["heat_removed"].to_numpy())


def test_scale_is_that_of_the_complete_zone() -> None:
    """A run that ends in the middle of the mould has the same flux there."""
    law = FLUX | {"flux": "brimacombe", "power": "300 kW"}
    zones = [{"name": "mould", "to": "600 mm", "surface": [law]}, {"name": "below"}]
    heat = castfem.run(small({"cooling": zones})).history["heat_removed"].iloc[-1]
    times = np.linspace(0.0, 10.0, 20001)
    flux = np.array([MOULD_FLUXES["brimacombe"].formula(t) for t in times])
    complete, part = (np.trapezoid(flux[times <= t], times[times <= t]) for t in (10.0, 1.0))
    assert heat * SPEED == pytest.approx(300e3 * part / complete, rel=2e-3)


def test_published_fluxes_have_their_means() -> None:
    """Means over 20 s, MW/m2, computed by hand; the curve of Li and Thomas is continuous."""
    for name, mean in (("savage_pritchard", 1.681), ("brimacombe", 2.014), ("li_thomas", 1.884)):
        law = MOULD_FLUXES[name]
        heat = heat_to_mould(law.formula, lambda _: 1.0, (0.0, 20.0), law.kinks)
        assert heat / 20.0 == pytest.approx(1e6 * mean, rel=1e-3)
    formula = MOULD_FLUXES["li_thomas"].formula
    assert formula(1.0) == pytest.approx(formula(1.0 + 1e-9), rel=1e-4)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"law": "contact", "wall": "160 degC"}, "coefficient or flux is missing"),
        (FLUX | {"power": "50 kW", "water": "100 L/min"}, "power and water exclude each other"),
        (FLUX | {"water": "100 L/min"}, r'water needs water_rise, such as water_rise = "7 K"'),
        (FLUX | {"flux": "brimacomb"}, "did you mean brimacombe"),
        (
            {"law": "contact", "coefficient": "1600 W/(m^2 K)", "wall": "160 degC"}
            | {"power": "50 kW"},
            "a coefficient is known after the run alone",
        ),
        (
            FLUX
            | {
                "flux": {
                    "temperature": ["200 degC", "1400 degC"],
                    "value": [1, 2],
                    "unit": "MW/m^2",
                },
                "power": "50 kW",
            },
            "table over temperature is known after the run alone",
        ),
    ],
)
def test_contradicting_input_is_rejected(law: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        small({SURFACE: [law]})


def test_formula_beyond_its_range_is_rejected() -> None:
    with pytest.raises(InputError, match=r'"savage_pritchard" holds for 32 s .* after 60 s'):
        small({SURFACE: [FLUX | {"flux": "savage_pritchard"}], "casting.length": "3.6 m"})


def test_set_replaces_a_coefficient_by_a_flux() -> None:
    case = small().with_({f"{SURFACE}.0.flux": "2.2 MW/m^2"})
    (law,) = case.cooling[0].surface
    assert "coefficient" not in law.model_dump(exclude_none=True)
