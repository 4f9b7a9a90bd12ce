"""Derivatives of the temperatures, compared with differences of runs on fixed steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from sensitivity.replay import (
    Followed,
    bare,
    built,
    differences,
    enthalpy,
    followed,
    replayed,
)

from castfem.model.build.start import starting_state
from castfem.studies.sensitivity.followed_run import follow

MOULD = (
    "cooling.mould.coefficient", "cooling.mould.wall", "casting.superheat", "casting.speed",
    "steel.conductivity", "steel.specific_heat", "steel.latent_heat", "steel.solidus",
    "steel.liquidus", "casting.length",
)  # fmt: skip
SPRAYED = {
    "cooling": [
        {
            "name": "mould",
            "to": "10 mm",
            "surface": [
                {"law": "flux", "value": {
                    "position": [0.0, 5.0, 10.0], "position_unit": "mm",
                    "value": [2.5, 2.0, 1.2], "unit": "MW/m^2"}},
            ],
        },
        {
            "name": "foot",
            "to": "20 mm",
            "surface": [
                {"law": "spray", "correlation": "nozaki", "machine_factor": 4,
                 "water": "12 L/(m^2 s)", "water_temperature": "25 degC"},
                {"law": "radiation", "emissivity": 0.8, "ambient": "25 degC"},
            ],
        },
        {
            "name": "air",
            "surface": [
                {"law": "radiation", "emissivity": 0.8, "ambient": "25 degC"},
                {"law": "convection", "ambient": "30 degC", "coefficient": {
                    "temperature": [200.0, 1700.0], "temperature_unit": "degC",
                    "value": [900.0, 600.0], "unit": "W/(m^2 K)"}},
            ],
        },
    ],
    "casting.length": "30 mm",
}  # fmt: skip
BELOW = (
    "cooling.mould.value", "cooling.foot.water", "cooling.foot.water_temperature",
    "cooling.foot.emissivity", "cooling.air.convection.coefficient",
    "cooling.air.radiation.ambient", "cooling.foot.to", "casting.speed",
)  # fmt: skip
HELD = {
    "cooling": [
        {"name": "mould", "surface": [{"law": "temperature", "value": "1100 degC"}]}
    ],
    "thermal.time": {"scheme": "backward_euler", "step": "0.1 s"},
}  # fmt: skip
LONG = {
    "thermal.time": {"step": "0.5 s"},
    "mesh.surface_size": "1 mm",
    "mesh.corner_size": "1 mm",
    "cooling.0.surface.0.coefficient": "8000 W/(m^2 K)",
}


def off(run: Followed, number: int, share: float) -> float:
    """Return the largest difference of derivative and difference quotient, over the derivative."""
    parameter = run.derivatives.variations[number].parameter
    by = share * (10.0 if parameter.unit in ("degC", "K") else abs(parameter.value))
    found, known = differences(run, number, by, enthalpy), run.derivatives.thermal.enthalpy[number]
    return float(np.abs(found - known).max() / np.abs(known).max())


def check(changes: Mapping[str, Any], names: tuple[str, ...]) -> Followed:
    """Compare each derivative with difference quotients, whose error must fall as its square."""
    run = followed(bare(changes), *names)
    for number, name in enumerate(names):
        coarse, fine = off(run, number, 1e-3), off(run, number, 1e-4)
        assert fine < 1e-6, name
        assert fine < 0.02 * coarse or coarse < 1e-6, name  # both are rounding then
    return run


def test_mould_steel_and_casting() -> None:
    run = check({"casting.length": "18 mm"}, MOULD)
    lost = -run.derivatives.thermal.enthalpy @ run.simulation.problem.volume
    assert run.derivatives.thermal.removed[0] == pytest.approx(lost[0], rel=1e-12)


def test_sprays_radiation_tables_and_positions_of_zones() -> None:
    check(SPRAYED, BELOW)


def test_solidus_computed_from_carbon_until_it_is_named() -> None:
    """On one side the conductivity bends with the heat capacity, on the other near it."""
    steel = {"steel.name": "plain_carbon_linear", "steel.composition": {"C": 0.25}}
    check({**steel, "casting.length": "40 mm"}, ("steel.solidus", "steel.liquidus"))


def test_given_temperatures_by_backward_euler() -> None:
    run = check(HELD, ("cooling.mould.value", "steel.conductivity", "casting.speed"))
    assert {stages for _, stages in run.ends} == {1}


def test_isothermal_freezing_at_constant_temperature() -> None:
    """Temperatures of freezing vertices have no derivative, their enthalpies have."""
    names = ("cooling.mould.coefficient", "casting.superheat", "steel.conductivity")
    melt = {"steel.name": "neumann_steel", "casting.superheat": "5 K", "casting.length": "30 mm"}
    run = check(melt, names)
    assert np.any(run.state.point.temperature_slope == 0.0)


def test_damped_steps_are_differentiated_as_taken() -> None:
    run = check(LONG, ("cooling.mould.coefficient", "casting.superheat", "casting.speed"))
    assert {stages for _, stages in run.ends} == {2, 4}


def test_heat_removed_is_that_of_the_runs() -> None:
    """The heat through the surface, which the derivative computes from the enthalpies."""
    run = followed(bare(SPRAYED), "cooling.foot.water", "casting.speed")
    for number, by in enumerate((0.01, 1e-3)):
        above, below = (replayed(run, number, sign * by)[0].removed for sign in (1.0, -1.0))
        slope = (above - below) / (2.0 * by)
        assert run.derivatives.thermal.removed[number] == pytest.approx(slope, rel=1e-6)


def test_errors_have_a_minimum() -> None:
    """Truncation falls as the square of the step, and rounding grows with its inverse."""
    run = followed(bare({"casting.length": "15 mm"}), "steel.conductivity")
    errors = [off(run, 0, share) for share in (4e-3, 4e-4, 4e-5, 4e-11)]
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.05)
    assert errors[2] < 1e-8 < errors[3]


def test_repeated_step_begins_with_the_marked_state() -> None:
    """A failed coupling window is cut back: its temperatures begin again."""
    simulation = built(bare())
    slopes, state = follow(simulation, ["casting.superheat"]).thermal, starting_state(simulation)
    simulation.problem.set_cooling(simulation.zones.cooling(0))
    slopes.mark(state)
    length = simulation.steps.control.first
    simulation.steps.one(state, length)
    first = slopes.enthalpy
    simulation.steps.one(state, length)
    assert first is not slopes.enthalpy and np.array_equal(first, slopes.enthalpy)


@pytest.mark.mpi
def test_ranks_agree() -> None:
    case, names = bare({"casting.length": "15 mm"}), MOULD[2:6]
    single, together = followed(case, *names), followed(case, *names, comm=MPI.COMM_WORLD)
    assert together.derivatives.thermal.removed == pytest.approx(
        single.derivatives.thermal.removed, rel=1e-8
    )
    for number in range(len(names)):
        one = single.simulation.section.gather(single.derivatives.thermal.enthalpy[number])
        many = together.simulation.section.gather(together.derivatives.thermal.enthalpy[number])
        if MPI.COMM_WORLD.rank == 0:
            assert one is not None and many is not None
            assert np.abs(many - one).max() < 1e-8 * np.abs(one).max()
