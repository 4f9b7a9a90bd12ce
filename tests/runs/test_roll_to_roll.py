"""Cooling from roll to roll: equal to zones written by hand, and no heat or water is lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from interrupted import history_of
from rolled_case import SECONDARY, circuit, rolled, secondary
from runs.billet_runs import simulated

from castfem.base.types import Array
from castfem.model import Case
from castfem.model.build.secondary import SecondaryCooling, rows_of
from castfem.model.build.simulation import build
from castfem.physics.machine.spray_layout import footprint, scale_water
from castfem.physics.thermal.boundary import Surface
from castfem.physics.thermal.spray_flux import RollShare, SprayWater
from castfem.runs.loop import TimeLoop

FAN = {"name": "flat", "angle": "150 deg", "angle_along": "20 deg", "correlation": "nozaki"}
LENGTH = footprint(0.1, np.deg2rad(20.0))  # m, length of a spray
WIDTH = footprint(0.1, np.deg2rad(150.0))  # m, wider than the face


def cooled(case: Case) -> tuple[Array, float, float]:
    """Return the temperatures at the end, heat removed and the heat balance."""
    with simulated(case, MPI.COMM_WORLD) as simulation:
        sample = TimeLoop(simulation).run()
        temperature = sample.state.thermal.point.temperature.copy()
        return temperature, sample.removed, abs(sample.balance)


def by_hand(case: Case) -> Case:
    """Return the same zones written into [[cooling]], one after another, to the second pitch."""
    table, machine = case.secondary, case.machine
    rolls = machine.pairs()
    assert rolls is not None
    water = 1e3 * (20e-3 / 60.0) / table.circuit[0].nozzles() / LENGTH / WIDTH
    radiation = {"law": "radiation", "emissivity": 0.8, "ambient": "60 degC"}
    narrow = radiation | {"on": ["narrow_face"]}
    wide: dict[str, dict[str, Any]] = {
        "spray": {
            "law": "spray", "water": f"{float(water)!r} kg/(m^2 s)", "correlation": "nozaki",
            "water_temperature": "25 degC", "on": ["wide_face"],
        },
        "run_off": {
            "law": "convection", "coefficient": "150 W/(m^2 K)", "ambient": "25 degC",
            "on": ["wide_face"],
        },
        "contact": {
            "law": "convection", "coefficient": "1200 W/(m^2 K)", "ambient": "150 degC",
            "on": ["wide_face"],
        },
    }  # fmt: skip
    half = 0.25 * float(np.deg2rad(20.0)) * 0.12
    zones, names = [case.document()["cooling"][0]], iter(range(100))

    def zone(to: float | None, kind: str) -> None:
        laws = [narrow, wide["contact"]] if kind == "contact" else [radiation]
        laws += [wide[kind]] if kind in ("spray", "run_off") else []
        name = {"name": f"{kind} {next(names)}"}
        zones.append(name | ({} if to is None else {"to": f"{to!r} m"}) | {"surface": laws})

    for number in range(2):
        roll, after = (rolls.pairs[number + k].position for k in (0, 1))
        zone(roll - half, "run_off" if number else "shade")
        zone(roll + half, "contact")
        zone(0.5 * (roll + after - LENGTH), "shade")
        zone(0.5 * (roll + after + LENGTH), "spray")
    zone(None, "run_off")
    return rolled(cooling=zones, secondary=None, casting__length="0.65 m")


def test_cooling_equals_zones_written_by_hand() -> None:
    case = rolled(secondary=secondary(nozzle=[FAN]), casting__length="0.65 m")
    ours, heat, balance = cooled(case)
    theirs, expected_heat, _ = cooled(by_hand(case))
    assert ours == pytest.approx(theirs, abs=1e-6)
    assert heat == pytest.approx(expected_heat, rel=1e-11)
    assert balance < 1e-9


def cooling_of(case: Case, share: float = 1.0) -> SecondaryCooling:
    simulation = build(case, MPI.COMM_SELF)
    surface = Surface(simulation.section)
    rows = scale_water(rows_of(case), "all", 2, 3, share)
    found = SecondaryCooling(case, simulation.machine, simulation.steel, surface, 0.25, rows)
    simulation.destroy()
    return found


def sprayed(cooling: SecondaryCooling, time: float) -> list[float]:
    """Return the water on the modelled part of each stretch under a spray, m3/s."""
    found = []
    for held in cooling.coolings:
        laws = [(p, law) for p, law in held.laws if isinstance(law, SprayWater)]
        if laws:
            parts = [float(p.weights @ np.sum(law.flows(time), axis=0)) for p, law in laws]
            found.append(1e-3 * LENGTH * sum(parts))
    return found


def test_all_water_of_a_circuit_reaches_the_strand() -> None:
    """A narrow spray on fine cells: four gaps, two faces; half of each is modelled."""
    fan = FAN | {"angle": "60 deg", "edge": 1.0}
    case = rolled(
        secondary=secondary(nozzle=[fan]), mesh__face_size="2 mm", mesh__surface_size="2 mm"
    )
    cooling = cooling_of(case)
    assert len(sprayed(cooling, 0.0)) == 4
    assert 2.0 * sum(sprayed(cooling, 0.0)) == pytest.approx(20e-3 / 60.0, rel=2e-3)


def test_water_of_some_nozzles_at_two_thirds() -> None:
    whole = cooling_of(rolled())
    worn = cooling_of(rolled(), 0.66)
    ratio = np.divide(sprayed(worn, 0.0), sprayed(whole, 0.0))
    assert ratio == pytest.approx([1.0, 0.66, 1.0, 1.0])


def test_water_follows_speed_and_time() -> None:
    """The steps end at the speeds of the rows of its table while the strand slows down."""
    speed = {"time": [0, 10, 20], "time_unit": "s", "value": [2.0, 2.0, 1.0], "unit": "m/min"}
    flow = {"speed": [1.0, 1.5, 2.0], "speed_unit": "m/min", "value": [6, 10, 20], "unit": "L/min"}
    case = rolled(secondary=secondary(circuit=[circuit(flow=flow)]), casting__speed=speed)
    cooling = cooling_of(case)
    assert 15.0 in np.round(cooling.changes, 9)  # 1.5 m/min
    first = [sprayed(cooling, t)[0] for t in (0.0, 12.5, 15.0, 20.0)]
    assert np.divide(first, first[0]) == pytest.approx([1.0, 0.75, 0.5, 0.3])
    flow = {"time": [0, 5, 20], "time_unit": "s", "value": [0, 10, 40], "unit": "L/min"}
    timed = cooling_of(rolled(secondary=secondary(circuit=[circuit(flow=flow)])))
    assert set(timed.changes) == {0.0, 5.0, 20.0}
    assert sprayed(timed, 12.5)[0] == pytest.approx(2.5 * sprayed(timed, 5.0)[0])


def test_steps_end_at_speeds_of_the_water_table() -> None:
    """In a table of speed whose first row is at time 0."""
    speed = {"time": [0, 10], "time_unit": "s", "value": [1.0, 2.0], "unit": "m/min"}
    flow = {"speed": [1.0, 1.5, 2.0], "speed_unit": "m/min", "value": [6, 10, 20], "unit": "L/min"}
    case = rolled(secondary=secondary(circuit=[circuit(flow=flow)]), casting__speed=speed)
    cooling = cooling_of(case)
    assert cooling.changes == pytest.approx([5.0])


def test_water_falls_off_the_extrados() -> None:
    """On a horizontal strand it stays only on the intrados."""
    segment = SECONDARY | {"falls_off": "20 deg", "run_off": "900 W/(m^2 K)"}
    bent = {
        "first": "300 mm",
        "segment": [
            {"rolls": 1, "pitch": "200 mm", "diameter": "120 mm", "radius": "1 m"},
            {"rolls": 4, "pitch": "200 mm", "diameter": "120 mm", "radius": "1 m"},
        ],
    }

    def surface(case: Case) -> dict[str, float]:
        simulation = build(case, MPI.COMM_WORLD)
        sample = TimeLoop(simulation).run()
        simulation.destroy()
        return {name: profile.temperature[0] for name, profile in sample.profiles.items()}

    found = surface(rolled(secondary=segment, machine=bent))
    assert found["mid_face_extrados"] > found["mid_face_intrados"] + 20.0
    found = surface(rolled(secondary=segment))  # its machine goes straight down
    assert found["mid_face_extrados"] == pytest.approx(found["mid_face"], abs=1e-6)


def test_roll_takes_its_share() -> None:
    """Of the heat of a pitch: exactly with a constant surface temperature, else nearly."""
    contact = {"angle": "20 deg", "share": 0.1}
    cooling = cooling_of(rolled(secondary=secondary(contact=contact)))
    rolls = [law for c in cooling.coolings for _, law in c.laws if isinstance(law, RollShare)]
    assert len(rolls) == 10  # of five rolls, on two faces
    whole, bare = (
        cooled(rolled(secondary=secondary(contact=given)))[1] for given in (contact, None)
    )
    assert 0.0 < (whole - bare) / whole < 0.1


def test_run_resumes_byte_for_byte(tmp_path: Path) -> None:
    """In the middle of a spray, byte for byte."""
    case = rolled(thermal__time={"adaptive": {"tolerance": "0.05 K"}}, casting__length="0.7 m")
    whole = history_of(case, tmp_path / "whole")
    assert whole == history_of(case, tmp_path / "parts", 60) and whole.count(b"\n") > 80


def _table(low: float, high: float) -> dict[str, Any]:
    """Return a nozzle with h = 400 W/m2K at 10 L/(m2 s), known between two temperatures."""
    columns = {
        "temperature": [low, low, high, high], "temperature_unit": "degC",
        "water": [0, 50, 0, 50], "water_unit": "L/(m^2 s)",
        "value": [0, 2000, 0, 2000], "unit": "W/(m^2 K)",
    }  # fmt: skip
    return {"name": "flat", "angle": "120 deg", "angle_along": "20 deg", "table": columns}


@pytest.mark.parametrize(
    ("range_", "sides"),
    [((20.0, 1600.0), []), ((1300.0, 1600.0), ["to 1600"]), ((20.0, 500.0), ["to 500"]),
     ((1300.0, 1310.0), ["to 1310", "to 1310"])],
)  # fmt: skip
def test_surface_beyond_the_nozzle_table_is_reported_once(
    range_: tuple[float, float], sides: list[str], told: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    cooled(rolled(secondary=secondary(nozzle=[_table(*range_)]), casting__length="0.75 m"))
    lines = [one.getMessage() for one in told.records if "its coefficient is known" in one.message]
    assert len(lines) == len(sides)
    for line, side in zip(lines, sides, strict=True):
        assert line.startswith("secondary.nozzle.0.table: the surface under 'flat' has ")
        assert side in line and "beyond, the end value is used" in line


@pytest.mark.mpi
def test_ranks_report_the_same_surface(told: pytest.LogCaptureFixture) -> None:
    cooled(rolled(secondary=secondary(nozzle=[_table(1300.0, 1600.0)]), casting__length="0.6 m"))
    lines = [one.getMessage() for one in told.records if "its coefficient is known" in one.message]
    assert len(lines) == 1 and len(set(MPI.COMM_WORLD.allgather(lines[0]))) == 1
