"""Step control: milestones, rejection, reduction, limits; monotone temperature after a jump."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.physics.coupling.step_control import Adaptive, Proposal, StepControl, StepLength, rung
from castfem.physics.thermal import flux_laws
from castfem.physics.thermal.jump import Jump
from castfem.physics.thermal.stepper import DAMPING, ThermalStepper
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import Counts, RunState
from thermal.setups import ThermalSetup, constant_steel, strip
from thermal.test_extremes import CAST, SLACK, billet

BOUNDS = Adaptive(tolerance=1.0, first=1e-3, smallest=1e-5, largest=0.5)


class Stepping:
    """A step control with its current step length and the last proposal."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self.control = StepControl(*args, **options)
        self.length = self.control.first
        self.tried = Proposal(0.0, 0.0, self.length.step, False, self.length)
        self.end, self.accepts = self.control.end, self.control.accepts
        self.at_milestone = self.control.at_milestone

    @property
    def step(self) -> float:
        return self.length.step

    def propose(self, time: float) -> float:
        self.tried = self.control.propose(self.length, time)
        self.length = self.tried.length
        return self.tried.end

    def _taken(self, taken: float) -> Proposal:
        return replace(self.tried, taken=taken, length=self.length)

    def learn(self, taken: float, error: float) -> None:
        self.length = self.control.learn(self._taken(taken), error)

    def failed(self, taken: float, reason: str) -> None:
        self.length = self.control.failed(self._taken(taken), reason)


def advance(control: Stepping, error: float) -> list[float]:
    return steps_of(control, error, 100_000)


def steps_of(control: Stepping, error: float, most: int) -> list[float]:
    """Return the times of the steps to the end, at most `most` steps."""
    times = [0.0]
    while times[-1] < control.end and len(times) <= most:
        end = control.propose(times[-1])
        assert end > times[-1]
        control.learn(end - times[-1], error)
        times.append(end)
    return times


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.01, 9.99), max_size=8), st.sampled_from([0.05, 0.3, 20.0]))
def test_milestones_are_hit_exactly(stops: list[float], step: float) -> None:
    for control in (
        Stepping(10.0, stops, fixed=step),
        Stepping(10.0, stops, adaptive=BOUNDS),
    ):
        times = advance(control, 0.3)
        assert times[-1] == 10.0
        reached = sorted(set(times))
        for stop in stops:
            assert min(abs(t - stop) for t in reached) <= 1e-12 * 10.0


def test_adaptive_steps_grow_and_leave_no_short_last_step() -> None:
    times = advance(Stepping(100.0, adaptive=BOUNDS), 0.01)
    steps = [b - a for a, b in pairwise(times)]
    assert max(steps) == pytest.approx(0.5)
    assert min(steps[20:]) > 0.2


def test_fixed_step_is_reduced_for_its_error_and_recovers() -> None:
    """Reduced by the order of the error to a rung; a milestone does not change the length."""
    control = Stepping(100.0, [10.0, 10.01], fixed=1.0, tolerance=2.0, order=1.5)
    assert control.propose(0.0) == 1.0 and control.accepts(2.0) and not control.accepts(2.1)
    control.learn(1.0, 16.0)
    assert control.step == pytest.approx(0.2)  # 0.9 / 8^(1/1.5) = 0.225
    for _ in range(3):
        taken = control.propose(0.0)
        control.learn(taken, 0.1)
    assert control.step == 1.0
    control.learn(control.propose(0.0), 2.0)
    assert control.step == pytest.approx(0.8)
    control.learn(control.propose(10.0) - 10.0, 2.0)
    assert control.step == pytest.approx(0.8)
    free = Stepping(100.0, fixed=1.0)
    free.learn(free.propose(0.0), 1e9)
    assert free.step == 1.0


def test_step_grows_between_milestones_and_restarts_at_each() -> None:
    control = Stepping(40.0, [20.0], fixed=1.0, tolerance=2.0, order=1.5, most=6.0)
    times = steps_of(control, 1e-9, 99)
    steps = [b - a for a, b in pairwise(times)]
    assert steps == pytest.approx([1.0, 2.0, 4.0, 6.0, 3.5, 3.5] * 2)  # no short step at the end
    assert 20.0 in times and control.at_milestone(20.0) and not control.at_milestone(19.0)


def test_grown_step_is_reduced_no_further_than_its_setting() -> None:
    """For its error by the order, after a failure to a quarter; an error keeps the setting."""
    control = Stepping(100.0, fixed=1.0, tolerance=2.0, order=1.5, most=6.0)
    for start, taken in ((0.0, 1.0), (1.0, 2.0), (3.0, 4.0)):
        assert control.propose(start) - start == pytest.approx(taken)
        control.learn(taken, 1e-9)
    assert control.propose(7.0) - 7.0 == pytest.approx(6.0)
    control.learn(6.0, 4.0)
    assert control.propose(7.0) - 7.0 == pytest.approx(6.0 * 0.9 / 2.0 ** (1.0 / 1.5))
    control.learn(3.4, 1e9)
    assert control.propose(7.0) - 7.0 == 1.0 and control.step == 1.0
    control.learn(1.0, 1e-9)
    control.propose(8.0)
    control.failed(2.0, "no reason")
    assert control.propose(8.0) - 8.0 == 1.0
    control.failed(1.0, "no reason")
    assert control.propose(8.0) - 8.0 == pytest.approx(0.25)


@settings(max_examples=40, deadline=None)
@given(st.floats(1e-4, 99.0), st.floats(1e-3, 10.0))
def test_rungs_are_fixed_fractions_of_a_power_of_two(step: float, unit: float) -> None:
    found = rung(step, unit)
    assert found <= step * (1.0 + 1e-5) and found > step / 1.29
    assert rung(found, unit) == pytest.approx(found, rel=1e-12)  # a rung maps to itself
    part = np.log2(found / unit) % 1.0
    assert min(abs(part - np.log2(one)) for one in (1.0, 1.25, 1.6, 2.0)) < 1e-9 or part < 1e-9


@pytest.mark.parametrize("step", [6.3999936000063995, 2.0**-5 * (1.0 - 2.0**-53)])
def test_step_close_to_a_rung_has_one_below(step: float) -> None:
    assert 0.0 < rung(step, 0.1) <= step * (1.0 + 1e-5)


def test_similar_errors_give_the_same_steps() -> None:
    ends = []
    for error in (7.0, 7.2):
        control = Stepping(10.0, fixed=1.0, tolerance=2.0, order=1.5)
        control.learn(1.0, error)
        ends.append(steps_of(control, 1.9, 99))
    assert ends[0] == ends[1] and len(ends[0]) > 11


def test_rungs_of_steps_by_strand_length_divide_their_duration() -> None:
    """At a low speed a step may last longer by a factor that is no multiple of a rung."""
    control = Stepping(
        100.0, fixed=7.0, tolerance=2.0, order=1.5, longest=lambda time: 1.0, unit=1.0
    )
    assert control.propose(0.0) == 1.0
    control.learn(1.0, 16.0)
    assert control.step == pytest.approx(0.2)


def test_step_with_a_large_error_is_rejected_and_reduced() -> None:
    control = Stepping(10.0, adaptive=BOUNDS)
    assert not control.accepts(8.0)
    control.length = StepLength(0.4)
    control.learn(0.4, 8.0)
    assert control.step == pytest.approx(0.4 * 0.9 / 2.0)


def test_step_below_the_smallest_fails_with_its_key() -> None:
    control = Stepping(10.0, adaptive=BOUNDS)
    with pytest.raises(RunFailure, match=r"thermal\.time\.adaptive\.smallest"):
        for _ in range(50):
            control.learn(control.step, 1e9)


def test_fixed_step_recovers_after_a_failed_solve() -> None:
    control = Stepping(10.0, fixed=0.1)
    control.failed(0.1, "DIVERGED_MAX_IT")
    assert control.step == pytest.approx(0.025)
    for _ in range(5):
        control.learn(control.step, 0.0)
    assert control.step == 0.1
    with pytest.raises(RunFailure, match="DIVERGED_MAX_IT"):
        for _ in range(50):
            control.failed(control.step, "DIVERGED_MAX_IT")


def test_first_step_after_a_change_follows_its_expected_error() -> None:
    control = StepControl(10.0, adaptive=BOUNDS)

    def restarted(error_of_one_second: float, before: float = 0.4) -> float:
        return control.restart(StepLength(before), lambda s: error_of_one_second * s**2).step

    assert restarted(1e9) == BOUNDS.first
    assert restarted(0.0) == 0.4
    assert restarted(0.0, BOUNDS.first) == BOUNDS.largest  # no error is known yet
    assert restarted(0.0, BOUNDS.first / 3.0) == BOUNDS.first  # reduced for an earlier error
    allowed = (0.1 * BOUNDS.tolerance / 40.0) ** 0.5
    assert allowed / 2**0.75 < restarted(40.0) <= allowed
    assert StepControl(10.0, fixed=0.2).restart(StepLength(0.2), lambda s: 1e9 * s).step == 0.2


def test_expected_error_includes_prescribed_temperatures() -> None:
    curve = constant_steel(1450.0, 1500.0, datum=1400.0)
    simulation = ThermalSetup(strip(0.02, 10), curve, 1400.0)
    simulation.cool(("surface", flux_laws.PrescribedTemperature(500.0)))
    jump = Jump.of(simulation.stepper, replace(simulation.state, cooling_changed=True))
    short, long = jump.errors(np.array([1e-3, 2.0]))
    assert 0.0 < short < 1e-3 and long > 10.0


@pytest.mark.parametrize("scheme", ["sdirk2", "backward_euler"])
def test_error_expected_after_a_change_is_exact_for_one_mode(scheme: str) -> None:
    """With almost no conduction only the surface cools towards the ambient."""
    curve = constant_steel(1450.0, 1500.0, k=1e-6, datum=1400.0)
    simulation = ThermalSetup(strip(0.02, 10), curve, 1400.0, scheme)
    law = flux_laws.Convection(2e3, AMBIENT)
    stepper = simulation.cool(("surface", law)).stepper
    jump = Jump.of(stepper, replace(simulation.state, cooling_changed=True))
    per_area = 2.0 / 0.002  # half of the first cell is cooled from one side
    skin = np.argmin(jump.rate)
    assert jump.rate[skin] == pytest.approx(-2e3 * (1400.0 - AMBIENT) * per_area, rel=1e-6)
    assert jump.decay[skin] == pytest.approx(2e3 * per_area / (7200.0 * 700.0), rel=1e-6)
    for step in (0.05, 0.5, 2.0):
        found = stepper.step(jump.state(step), step)
        assert found.error == pytest.approx(jump.errors(np.array([step]))[0], rel=1e-5, abs=1e-8)
        assert not found.limited
        if step == 0.05:  # with the rates before the change the error is mostly the jump
            assert stepper.step(simulation.state, step).error > 20.0 * found.error


def test_smallest_step_continues_if_accepted() -> None:
    control = Stepping(10.0, adaptive=replace(BOUNDS, first=BOUNDS.smallest))
    times = steps_of(control, 0.9, 20)
    assert np.allclose(np.diff(times), BOUNDS.smallest, rtol=1e-9)


@pytest.mark.parametrize("how", ["rejected", "failed"])
def test_smallest_step_is_tried_before_the_run_fails(how: str) -> None:
    """A reduction from three times the smallest step is limited to the smallest."""

    def reject(taken: float) -> None:
        if how == "failed":
            control.failed(taken, "stuck")
        else:
            control.learn(taken, 1e9)

    control = Stepping(10.0, adaptive=replace(BOUNDS, first=3 * BOUNDS.smallest))
    reject(control.propose(0.0))
    assert control.propose(0.0) == BOUNDS.smallest
    with pytest.raises(RunFailure, match="1e-05 s"):
        reject(control.propose(0.0))


@pytest.mark.parametrize("error", [2.0, np.nan])
def test_remainder_before_a_milestone_is_divided_only_once(error: float) -> None:
    remainder = 0.5 * BOUNDS.smallest
    control = Stepping(1.0 + remainder, [1.0], adaptive=BOUNDS)
    assert control.propose(1.0) == control.end
    control.learn(remainder, error)
    part = control.propose(1.0) - 1.0
    assert 0.0 < part < remainder
    control.learn(part, 0.5)
    assert control.propose(1.0 + part) == control.end
    # The run fails if a part is still too long.
    control.propose(1.0)
    control.learn(remainder, error)
    part = control.propose(1.0) - 1.0
    with pytest.raises(RunFailure, match=r"thermal\.time\.adaptive\.smallest"):
        control.learn(part, error)


AMBIENT = 298.15
STEEL = constant_steel(1725.15, 1775.65, datum=CAST)
COARSE = ("mesh.surface_size='2 mm'", "mesh.corner_size='2 mm'", "output.fields=[]")
FIXED = "thermal.time.step='{}'"
ADAPTIVE = "thermal.time.adaptive={{tolerance='{}',first='1 ms',smallest='1e-6 s',largest='1 s'}}"


class Temperatures:
    """Recorder of the vertex temperatures after each step of a run, in place of output files."""

    def __init__(self) -> None:
        self.found: list[Array] = []

    def step(self, run: RunState, sample: object) -> None:
        self.found.append(run.state.thermal.point.temperature)

    @property
    def rise(self) -> float:
        """Return the largest rise of a vertex temperature within a step, K."""
        return float(np.diff(self.found, axis=0).max())


def cooled(*changes: str) -> tuple[Temperatures, Counts]:
    """Run the shipped billet with changes."""
    simulation = build(load_case("cases/billet125/thermal.toml", changes), MPI.COMM_SELF)
    temperatures = Temperatures()
    time_loop = TimeLoop(simulation, temperatures)  # type: ignore[arg-type]
    try:
        time_loop.run()
    finally:
        simulation.destroy()
    return temperatures, time_loop.run_state.counts


def convection(coefficient: str) -> str:
    """Return convection on all sides, from the meniscus on."""
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
def test_quenched_steel_never_warms(coefficient: str, stepping: str, jumps: bool) -> None:
    """Without damping a vertex went to 1542, 292, 438 degC at 30 kW/m2K."""
    temperatures, counts = cooled(convection(coefficient), stepping, *COARSE)
    assert temperatures.rise < SLACK
    assert counts.limited >= jumps
    assert counts.limited < 0.25 * counts.steps


def test_temperature_rebounds_without_a_look_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ThermalStepper, "_look_ahead", lambda *_: (False, None))
    temperatures, counts = cooled(convection("30 kW/(m^2 K)"), FIXED.format("0.5 s"), *COARSE)
    assert temperatures.rise > 100.0 and counts.limited == 0


def test_shipped_billet_is_not_damped() -> None:
    """Its first step also excites fast modes, but no vertex overshoots its steady temperature."""
    temperatures, counts = cooled("output.fields=[]", "casting.length='150 mm'")
    assert temperatures.rise < SLACK and counts.limited == 0


@pytest.mark.parametrize(("coefficient", "way"), [(3e4, 1.0), (50.0, -1.0)])
def test_temperature_is_monotone_after_a_change_of_zone(coefficient: float, way: float) -> None:
    """The skin tends to its new temperature without a rebound."""
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
    """The first step uses backward Euler, yet the error is of second order."""
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
