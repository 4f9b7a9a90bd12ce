"""Total water of a zone, which may follow the casting speed; oscillation of the mould."""

from __future__ import annotations

import math
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.cli.plant_numbers import water_lines
from castfem.meshes import build as build_mesh
from castfem.model.build.simulation import build, case_steel
from castfem.model.mould import Oscillation
from castfem.physics.thermal import flux_laws
from castfem.physics.thermal.spray_correlations import CORRELATIONS
from castfem.physics.thermal.spray_flux import OfCorrelation

SURFACE = "cooling.0.surface"
SPEED, LENGTH = 0.06, 0.06
SPRAY = {"law": "spray", "correlation": "nozaki", "water_temperature": "25 degC"}


TO = {"cooling.0.to": "60 mm"}


def heat(law: dict[str, Any], **changes: Any) -> np.ndarray:
    keys = {k.replace("__", "."): v for k, v in changes.items()}
    case = small({SURFACE: [SPRAY | law], **TO, **keys})
    return castfem.run(case).history["heat_removed"].to_numpy()


def test_total_water_of_a_zone_is_divided_by_its_area() -> None:
    """300 L/min or 18 m3/h on 0.5 m2 are 10 L/m2s."""
    expected = heat({"water": "10 L/(m^2 s)"})
    for flow in ("300 L/min", "18 m^3/hour"):
        assert heat({"flow": flow, "area": "0.5 m^2"}) == pytest.approx(expected, rel=1e-12)


def test_default_area_is_that_of_the_faces() -> None:
    """It is the perimeter of the coarse section, with chords for arcs, times the zone length."""
    constant = small({SURFACE: [{"law": "flux", "value": "1 MW/m^2"}]})
    removed = float(castfem.run(constant).history["heat_removed"].iloc[-1])
    per_second = removed / (LENGTH / SPEED)
    perimeter = per_second / 1e6
    litres = 10.0 * perimeter * LENGTH * 60.0
    found = heat({"flow": f"{litres!r} L/min"})
    assert found == pytest.approx(heat({"water": "10 L/(m^2 s)"}), rel=1e-9)


def test_water_follows_the_casting_speed() -> None:
    table = {"speed": [2, 4], "speed_unit": "m/min", "value": [100, 300], "unit": "L/min"}
    at = heat({"flow": table, "area": "0.5 m^2"})
    assert at == pytest.approx(heat({"flow": "260 L/min", "area": "0.5 m^2"}), rel=1e-9)


def test_steps_end_where_the_speed_reaches_a_row() -> None:
    """From 2 to 4 m/min in 0.5 s the speed is 2.5 and 3.6 m/min after 0.125 and 0.4 s."""
    table = {"speed": [2.5, 3.6, 9], "speed_unit": "m/min", "value": [1, 3, 4], "unit": "L/min"}
    ramp = {"time": [0, 0.5], "time_unit": "s", "value": [2, 4], "unit": "m/min"}
    case = small({SURFACE: [SPRAY | {"flow": table}], **TO, "casting.speed": ramp})
    simulation = build(case, MPI.COMM_SELF)
    found = [time for time in simulation.zones.changes if time < 0.5]
    simulation.destroy()
    assert found == pytest.approx([0.125, 0.4], rel=1e-12)


def test_water_over_time_follows_its_table() -> None:
    table = {"time": [0, 1], "time_unit": "s", "value": [0, 400], "unit": "L/min"}
    ramp, mean = (
        heat({"flow": table, "area": "1 m^2"}),
        heat({"flow": "200 L/min", "area": "1 m^2"}),
    )
    half = len(ramp) // 2
    assert ramp[half] < 0.7 * mean[half] and 0.85 * mean[-1] < ramp[-1] < mean[-1]


@pytest.mark.parametrize("name", CORRELATIONS)
def test_a_zone_without_water_takes_no_heat(name: str) -> None:
    assert not heat({"correlation": name, "water": "0 L/(m^2 s)"}).any()


@pytest.mark.parametrize("name", CORRELATIONS)
def test_water_that_runs_out_cools_a_zone_as_it_cools_under_a_nozzle(name: str) -> None:
    """In proportion to the water, below the least that was measured."""
    law = flux_laws.Sprayed(CORRELATIONS[name], lambda time: time, 10.0, 298.15)
    warm, least = np.array([700.0, 1100.0, 1400.0]), CORRELATIONS[name].water[0]
    assert not np.any(law.flux(warm, 0.0))
    for share in (0.1, 0.7) if least > 0.0 else ():
        expected = share * law.flux(warm, least)[0]
        assert law.flux(warm, share * least)[0] == pytest.approx(expected)
    nozzles = OfCorrelation(CORRELATIONS[name], 298.15)
    for water in (0.05, 2.0, 8.0):
        h = nozzles(np.full_like(warm, water), warm)
        assert law.flux(warm, water)[0] == pytest.approx(h * (warm - 298.15), rel=1e-12)


def test_slope_with_changing_water_matches_differences() -> None:
    law = flux_laws.Sprayed(CORRELATIONS["sasaki"], lambda t: 5.0 * t, 10.0, 298.15)
    warm, d = np.array([700.0, 1100.0, 1400.0]), 0.1
    slope = (law.flux(warm + d, 1.5)[0] - law.flux(warm - d, 1.5)[0]) / (2 * d)
    assert law.flux(warm, 1.5)[1] == pytest.approx(slope, rel=1e-6)
    grid = np.arange(400.0, 1600.0)
    assert law.least_rise(grid, 0.0) == law.flux(grid, 2.0)[1].min()


def steel_passing() -> float:
    """Return the mass per length of the full section at the density of the solidus, kg/m."""
    case = small()
    mesh, steel = build_mesh(**case.mesh_parameters()), case_steel(case)
    return float(mesh.multiplicity * mesh.exact_area * steel.density(steel.solidus, "below"))


def test_specific_water_is_the_flow_per_mass_of_steel() -> None:
    litres = 2.0 * steel_passing() * 3.6  # a minute, of 2 L/kg at 3.6 m/min
    by_flow = heat({"flow": f"{litres!r} L/min"}, casting__speed="3.6 m/min")
    by_mass = heat({"specific": "2 L/kg"}, casting__speed="3.6 m/min")
    assert by_mass == pytest.approx(by_flow, rel=1e-12)


def test_specific_water_follows_the_speed() -> None:
    """It is equal to a flow proportional to the speed, while the speed increases."""
    ramp = {"time": [0, 1], "time_unit": "s", "value": [2, 4], "unit": "m/min"}
    litres = [0.0, 2.0 * steel_passing() * 4.0]
    table = {"speed": [0, 4], "speed_unit": "m/min", "value": litres, "unit": "L/min"}
    by_flow = heat({"flow": table}, casting__speed=ramp)
    assert heat({"specific": "2 L/kg"}, casting__speed=ramp) == pytest.approx(by_flow, rel=1e-9)


def test_zones_take_shares_of_a_total() -> None:
    expected = heat({"specific": "2 L/kg"})
    assert heat({"share": 1.0}, water__specific="2 L/kg") == pytest.approx(expected, rel=1e-12)
    bent = {"time": [0, 0.2, 0.4], "time_unit": "s", "value": [1, 3, 2], "unit": "L/min"}
    simulation = build(
        small({SURFACE: [SPRAY | {"share": 1.0}], **TO, "water.flow": bent}), MPI.COMM_SELF
    )
    assert {0.2, 0.4} <= set(simulation.zones.changes)
    simulation.destroy()
    halves = [SPRAY | {"share": 0.5, "on": [name]} for name in ("wide_face", "narrow_face")]
    with pytest.raises(InputError, match=r"make 0\.5, not 1"):
        small({SURFACE: halves[:1], **TO, "water.specific": "2 L/kg"})
    small({SURFACE: halves, **TO, "water.specific": "2 L/kg"})


def test_check_prints_litres_per_kilogram() -> None:
    case = small({SURFACE: [SPRAY | {"specific": "2 L/kg"}], **TO})
    lines = water_lines(case, case_steel(case), build_mesh(**case.mesh_parameters()))
    assert all(line.split()[-2:] == ["2", "L/kg"] for line in lines[1:])
    assert lines[-1].split()[:2] == ["in", "all"]


@pytest.mark.parametrize(
    ("speed", "most"),
    [
        ("1.5 m/min", 150.0),  # not the 300 L/min of a speed that does not occur
        ({"time": [0, 9], "time_unit": "s", "value": [1, 3.5], "unit": "m/min"}, 300.0),
        ({"time": [0, 9], "time_unit": "s", "value": [3.5, 5], "unit": "m/min"}, 250.0),
    ],
)
def test_largest_water_is_that_of_the_speeds_that_occur(speed: Any, most: float) -> None:
    table = {"speed": [1, 3, 4], "speed_unit": "m/min", "value": [100, 300, 200], "unit": "L/min"}
    case = small({SURFACE: [SPRAY | {"flow": table}], **TO, "casting.speed": speed})
    lines = water_lines(case, case_steel(case), build_mesh(**case.mesh_parameters()))
    assert lines[1].split()[1] == f"{most:g}"


def test_total_needs_the_end_of_its_zone() -> None:
    """Otherwise the local water would depend on the casting length of the run."""
    for law in ({"specific": "2 L/kg"}, {"flow": "9 L/min"}):
        with pytest.raises(InputError, match=r"surface\.0 .*has no end; give the zone its end"):
            small({SURFACE: [SPRAY | law]})
    small({SURFACE: [SPRAY | {"flow": "9 L/min", "area": "1 m^2"}]})
    with pytest.raises(InputError, match="the heat is that of the whole zone"):
        small({SURFACE: [{"law": "flux", "value": "1 MW/m^2", "power": "9 kW"}]})


def test_zone_below_the_run_has_no_water() -> None:
    """A zone without an end must not be counted with a negative length."""
    zones = [
        {"name": "a", "to": "0.1 m", "surface": [SPRAY | {"water": "5 L/(m^2 s)"}]},
        {"name": "b", "surface": [SPRAY | {"water": "5 L/(m^2 s)"}]},
    ]
    case = small({"cooling": zones})
    lines = water_lines(case, case_steel(case), build_mesh(**case.mesh_parameters()))
    assert [line.split()[0] for line in lines] == ["largest", "a", "in"]


@pytest.mark.parametrize(
    ("water", "message"),
    [
        ({}, "specific or flow is missing"),
        ({"specific": "1 L/kg", "flow": "1 L/min"}, "specific and flow exclude each other"),
        ({"specific": "1 L/kg"}, "no zone and no circuit takes a share"),
    ],
)
def test_incomplete_total_is_rejected(water: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        small({"water": water})


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"water": "5 L/(m^2 s)", "flow": "100 L/min"}, "water and flow exclude each other"),
        ({"water": "5 L/(m^2 s)", "area": "1 m^2"}, "the sprayed area of the water of a zone"),
        ({"flow": "5 L/(m^2 s)"}, "water flow is needed"),
        ({"specific": "5 L/min"}, "water per mass of steel is needed, such as .0.8 L/kg"),
        ({"specific": "1 L/kg", "share": 0.3}, "specific and share exclude each other"),
        ({"share": 1.0}, r"is a share of \[water\], which is missing"),
    ],
)
def test_contradicting_water_is_rejected(law: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        small({SURFACE: [SPRAY | law]})


def test_negative_strip_time_of_a_sine_is_exact() -> None:
    """The reference samples the time in which the mould moves faster than the strand."""
    mould = Oscillation.model_validate({"stroke": "6 mm", "frequency": "150 1/min"})
    speed, period = 1.2 / 60.0, 60.0 / 150.0
    times = (np.arange(200000) + 0.5) / 200000 * period
    down = math.pi * mould.frequency * mould.stroke * np.cos(2 * math.pi * times / period)
    assert mould.negative_strip(speed) == pytest.approx((down > speed).mean() * period, rel=1e-4)
    assert mould.negative_strip(0.05) == 0.0


@pytest.mark.parametrize(
    ("face", "present", "needed"),
    [
        ("wide_face_extrados", "quarter", "half"),
        ("narrow_face_left", "quarter", "whole"),
        ("narrow_face_left", "half", "whole"),
    ],
)
def test_different_faces_need_a_larger_section(face: str, present: str, needed: str) -> None:
    law = SPRAY | {"water": "5 L/(m^2 s)", "on": [face]}
    message = rf'a {present} are alike: section\.symmetry = "{needed}" has'
    with pytest.raises(InputError, match=message):
        small({SURFACE: [law], "section.symmetry": present})
    larger = small({SURFACE: [law], "section.symmetry": needed})
    assert larger.cooling[0].surface[0].on == (face,)
    with pytest.raises(InputError) as caught:
        small({SURFACE: [law | {"on": ["wide_faces"]}]})
    assert "are alike" not in str(caught.value)
