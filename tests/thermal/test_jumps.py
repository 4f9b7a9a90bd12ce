"""After a cooling has jumped the temperature goes one way, step by step, and stays accurate."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.physics.thermal import flux_laws
from castfem.physics.thermal.stepper import DAMPING, ThermalStepper
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import Counts, RunState
from thermal.setups import ThermalSetup, constant_steel, strip
from thermal.test_extremes import CAST, SLACK, billet

AMBIENT = 298.15
STEEL = constant_steel(1725.15, 1775.65, datum=CAST)
COARSE = ("mesh.surface_size='2 mm'", "mesh.corner_size='2 mm'", "output.fields=[]")
FIXED = "thermal.time.step='{}'"
ADAPTIVE = "thermal.time.adaptive={{tolerance='{}',first='1 ms',smallest='1e-6 s',largest='1 s'}}"


class Temperatures:
    """Temperatures of all vertices after each step of a run, in place of its files."""

    def __init__(self) -> None:
        self.found: list[Array] = []

    def step(self, run: RunState, sample: object) -> None:
        """Keep them."""
        self.found.append(run.state.thermal.point.temperature)

    @property
    def rise(self) -> float:
        """How much warmer a vertex has become within a step, K."""
        return float(np.diff(self.found, axis=0).max())


def cooled(*changes: str) -> tuple[Temperatures, Counts]:
    """The shipped billet, changed, after its run."""
    simulation = build(load_case("cases/billet125/thermal.toml", changes), MPI.COMM_SELF)
    temperatures = Temperatures()
    time_loop = TimeLoop(simulation, temperatures)  # type: ignore[arg-type]
    try:
        time_loop.run()
    finally:
        simulation.destroy()
    return temperatures, time_loop.run_state.counts


def convection(coefficient: str) -> str:
    """All round, from the meniscus on."""
    law = f"{{law='convection',coefficient='{coefficient}',ambient='25 degC'}}"
    return f"cooling.mould.surface=[{law}]"


@pytest.mark.parametrize(
    ("coefficient", "stepping", "jumps"),
    [
        ("30 kW/(m^2 K)", FIXED.format("0.5 s"), True),
        ("8 kW/(m^2 K)", FIXED.format("2 s"), True),
        ("1.6 kW/(m^2 K)", FIXED.format("0.5 s"), False),
        ("30 kW/(m^2 K)", ADAPTIVE.format("5 K"), False),
    ],
)
def test_steel_that_is_quenched_never_warms(coefficient: str, stepping: str, jumps: bool) -> None:
    """From the meniscus on, freezing, all round: 1542, 292, 438 degC it went at 30 kW/m2K."""
    temperatures, counts = cooled(convection(coefficient), stepping, *COARSE)
    assert temperatures.rise < SLACK
    assert counts.limited >= jumps
    assert counts.limited < 0.25 * counts.steps


def test_without_a_look_ahead_it_would_come_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ThermalStepper, "_look_ahead", lambda *_: (False, None))
    temperatures, counts = cooled(convection("30 kW/(m^2 K)"), FIXED.format("0.5 s"), *COARSE)
    assert temperatures.rise > 100.0 and counts.limited == 0


def test_a_billet_as_shipped_is_not_damped() -> None:
    """Its first step wakes fast modes too, but no vertex is carried past its rest."""
    temperatures, counts = cooled("output.fields=[]", "casting.length='150 mm'")
    assert temperatures.rise < SLACK and counts.limited == 0


@pytest.mark.parametrize(("coefficient", "way"), [(3e4, 1.0), (50.0, -1.0)])
def test_a_zone_downstream_cools_or_warms_one_way(coefficient: float, way: float) -> None:
    """The skin goes to where the new cooling takes it and does not come back."""
    simulation = ThermalSetup(billet(0.0, surface_size=2e-3), STEEL, CAST)
    faces = ("wide", "narrow")
    simulation.cool(*((face, flux_laws.Contact(1600.0, 433.15, 0.15)) for face in faces)).advance(
        5.0, 0.5
    )
    skin = simulation.surface.patch(simulation.section.required(list(faces))).dofs
    found = [simulation.state.point.temperature[skin]]
    simulation.cool(*((face, flux_laws.Convection(coefficient, AMBIENT)) for face in faces))
    simulation.advance(7.0, 0.5, lambda: found.append(simulation.state.point.temperature[skin]))
    assert (way * np.diff(found, axis=0)).max() < DAMPING.rebound
    assert (way * (found[0] - found[1])).min() > 50.0
    assert simulation.results[-1].limited is False
    assert simulation.worst_balance < 1e-9


def test_second_order_returns_after_a_jump() -> None:
    """Each run takes its first step with backward Euler; its error falls by four all the same."""
    curve = constant_steel(1450.0, 1500.0, datum=1400.0)

    def final(step: float) -> tuple[Array, int]:
        simulation = ThermalSetup(strip(0.02, 10), curve, 1400.0)
        simulation.cool(("surface", flux_laws.Convection(3e4, AMBIENT))).advance(8.0, step)
        return simulation.along_x()[1], sum(r.limited for r in simulation.results)

    steps = np.array([2.0, 1.0, 0.5])
    exact = final(0.02)[0]
    found = [final(step) for step in steps]
    assert [limited for _, limited in found] == [1, 1, 1]
    errors = [np.abs(temperature - exact).max() for temperature, _ in found]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 1.8, errors
