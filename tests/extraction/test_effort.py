"""The effort on the slice: from a curve of resistance, and coupled to the state of the slice."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.machine.extraction.drives import StrandStopsError
from castfem.physics.machine.extraction.effort import (
    CoupledResistance,
    KnownResistance,
    Pairs,
    Passing,
    Withdrawal,
)

PLACES = [1.0, 1.2, 1.5, 1.8, 2.2]
STEPS = [2e3, 3e3, 4e3, 5e3, 6e3]
CAPACITIES = np.array([0.0, 0.0, 7e3, 0.0, math.inf])
NOTHING = Passing(0.0, 0.0, np.zeros(0))


def test_curve_acts_above_a_pair_and_a_drive_below_it() -> None:
    effort = KnownResistance(PLACES, STEPS, CAPACITIES)
    start = effort.initial(0.0)
    assert start == Withdrawal()
    at = {s: effort.force(start, s) for s in (0.5, 0.8, 0.9, 1.0, 1.1, 1.5, 1.65, 1.8, 2.2, 2.6, 9)}
    expected = {0.5: 0, 0.8: 0, 0.9: 1e3, 1.0: 2e3, 1.1: 3.5e3, 1.5: 9e3, 1.65: 8e3, 1.8: 7e3}
    assert at == pytest.approx(expected | {2.2: 13e3, 2.6: 0.0, 9: 0.0}, abs=1e-9)
    for s in np.linspace(0.0, 3.0, 61):
        found = effort.after(start, float(s), NOTHING)
        assert found.effort == pytest.approx(found.force, abs=1e-9)
        assert found.pairs == sum(place <= s + 1e-9 for place in PLACES)
    assert effort.after(start, 3.0, NOTHING).resistance == pytest.approx(sum(STEPS))
    assert effort.after(start, 3.0, NOTHING).drives == pytest.approx(sum(STEPS))
    assert effort.contains_work


@dataclass
class Rolls:
    """Rolls with prescribed forces that record the calls."""

    forces: list[float]
    calls: list[tuple[int, float]] = field(default_factory=list)

    def on_pair(self, index: int, temperature: Array, added: float) -> float:
        self.calls.append((index, float(temperature[0])))
        return self.forces[index] + added


def coupled(
    forces: list[float], bending: str = "equilibrium", pays: bool = True, locked: int = -1
) -> CoupledResistance:
    mu = np.where(np.arange(5) == locked, 0.30, 0.015)
    pairs = Pairs((0, 1, 2, 3, 4), np.array(PLACES), mu, np.array([0.0, 0.0, 3e3, 0.0, math.inf]))
    return CoupledResistance(pairs, Rolls(forces), bending, pays_work=pays)


def go(
    effort: CoupledResistance, moment=lambda s: 0.0, work=lambda s: 0.0
) -> dict[float, Withdrawal]:
    """Return the states every 10 mm, which includes the pairs."""
    state, found = effort.initial(0.0), {}
    for s in np.round(np.linspace(0.01, 3.0, 300), 2).tolist():
        force = effort.force(state, s)
        state = effort.after(state, s, Passing(moment(s), work(s), np.array([s])))
        found[s] = state
        assert state.force == pytest.approx(force, abs=30.0)  # the force used in the step
    return found


def test_coupled_resistance_without_bending_is_a_curve() -> None:
    """From the second pair on it is the known resistance with the same steps."""
    forces = [1e5, 2e5, 3e5, 4e5, 5e5]
    seen = go(coupled(forces))
    steps = [0.015 * force for force in forces]
    curve = KnownResistance(PLACES, steps, np.array([0.0, 0.0, 3e3, 0.0, math.inf]))
    for s, state in seen.items():
        if 1.2 <= s <= 2.2:
            assert state.force == pytest.approx(curve.force(state, s), abs=1e-6)
            assert state.resistance == pytest.approx(curve.after(state, s, NOTHING).resistance)
    assert seen[3.0].friction == pytest.approx(sum(steps))
    assert seen[3.0].effort == pytest.approx(0.0, abs=1e-9)
    assert seen[3.0].drives == pytest.approx(sum(steps))


def test_roll_forces_use_the_current_slice() -> None:
    effort = coupled([1e5] * 5)
    go(effort)
    calls = effort._bulging.calls  # type: ignore[attr-defined]
    assert [i for i, _ in calls] == [0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert [s for _, s in calls] == pytest.approx(np.repeat(PLACES, 2)[:9].tolist())


def test_locked_pair_resists_twenty_times_as_much() -> None:
    free, locked = (go(coupled([1e5] * 5, locked=n))[3.0] for n in (-1, 3))
    assert locked.friction - free.friction == pytest.approx(19.0 * 0.015 * 1e5)


def test_change_of_moment_loads_the_adjacent_rolls() -> None:
    """The moment increases over one pitch: equal and opposite forces at its ends."""
    moment = lambda s: 60e3 * float(np.interp(s, [1.2, 1.5], [0.0, 1.0]))  # noqa: E731
    seen = go(coupled([0.0] * 5), moment)
    force = 60e3 / 0.3
    assert seen[1.49].friction == 0.0
    assert seen[1.5].friction == pytest.approx(0.015 * force)  # of the pair at 1.2 m
    assert seen[1.8].friction == pytest.approx(2 * 0.015 * force)
    assert seen[3.0].friction == pytest.approx(2 * 0.015 * force)
    hinged = go(coupled([0.0] * 5, "hinges"), moment)
    assert hinged[3.0].friction == pytest.approx(0.015 * 60e3 * (1 / 0.3 + 1 / 0.4 + 1 / 0.4))


def test_work_of_bending_is_done_once_by_the_drives() -> None:
    """The effort includes it; the force does not, as the balance adds it; a drive takes both."""
    work = lambda s: -4e3 * float(np.interp(s, [1.0, 1.4], [0.0, 1.0]))  # noqa: E731
    seen = go(coupled([1e5] * 5), work=work)
    for s in (1.2, 1.4, 1.5):
        state = seen[s]
        assert state.effort == pytest.approx(state.force - work(s))
    # 4.5 kN of friction and 4 kN of work act on a drive of 3 kN.
    assert seen[1.8].drives == pytest.approx(3e3)
    assert seen[1.8].effort == pytest.approx(4 * 1.5e3 + 4e3 - 3e3)
    assert seen[3.0].drives == pytest.approx(5 * 1.5e3 + 4e3)
    assert seen[3.0].effort == pytest.approx(0.0, abs=1e-6)
    axial = go(coupled([1e5] * 5, pays=False), work=work)
    assert axial[3.0].drives == pytest.approx(5 * 1.5e3)


def test_strand_that_would_stop_during_the_run_is_reported() -> None:
    effort = coupled([1e6] * 5)
    effort._pairs.capacities[4] = 10e3
    with pytest.raises(StrandStopsError, match=r"resist with 15 kN, .* with 13 kN at most") as end:
        go(effort)
    assert end.value.exit_status == 2
    effort._pairs.capacities[4] = 80e3
    go(effort)


def test_effort_may_start_below_some_pairs() -> None:
    effort = coupled([1e5] * 5)
    assert effort.initial(1.5).pairs == 3
    assert KnownResistance(PLACES, STEPS, CAPACITIES).initial(1.5).effort == 9e3


def test_state_is_restored_exactly_from_a_checkpoint() -> None:
    states = go(coupled([1e5 / 3.0] * 5), lambda s: 7e4 / 3.0 * s, lambda s: -1e3 * s / 7.0)
    for state in states.values():
        assert Withdrawal.restored(json.loads(json.dumps(asdict(state)))) == state


@pytest.mark.parametrize("kind", ["known", "coupled"])
def test_machine_with_a_single_pair(kind: str) -> None:
    if kind == "known":
        effort = KnownResistance([1.0], [5e3], np.array([math.inf]))
        assert [effort.force(Withdrawal(), s) for s in (0.0, 0.5, 1.0)] == [0.0, 2.5e3, 5e3]
        return
    pairs = Pairs((0,), np.array([1.0]), np.array([0.015]), np.array([math.inf]))
    single = CoupledResistance(pairs, Rolls([1e5]), "equilibrium")
    state = single.after(single.initial(0.0), 1.0, COLD)
    assert state.friction == pytest.approx(1.5e3)
    assert single.force(state, 2.0) == pytest.approx(0.0)


COLD = Passing(0.0, 0.0, np.array([0.0]))
