"""What every law must be whatever its numbers: odd, blind to pressure, monotone in the rate."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.constitutive import MaterialStep, ThermoElastic, equivalent_stress
from castfem.constitutive.flow_laws import RadialReturn
from castfem.values.types import Array

from .samples import every_law, random_states

LAWS = every_law()
ALL = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
RATE_DEPENDENT = [k for k in LAWS if k not in ("elastic",) and not k.startswith("plastic")]
ONE = np.array([1.0, 1.0, 1.0, 0.0])


def parts(law: RadialReturn, seed: int) -> list[tuple[MaterialStep, Array, Array]]:
    return random_states(law, 3000, 20, seed).parts()


def step_of(step: MaterialStep, strain: Array, thermal: Array, dt: float) -> MaterialStep:
    return MaterialStep(strain, thermal, step.temperature_old, step.temperature, dt)


def scale(law: RadialReturn, step: MaterialStep, stress: Array) -> Array:
    """Size of the trial stress, to measure rounding by (n, 1)."""
    c = law.coefficients(step.temperature_old, step.temperature)
    size = 3.0 * np.maximum(c[:, 0], c[:, 1]) * np.abs(step.strain_increment).max(axis=1)
    size += 3.0 * c[:, 1] * np.abs(step.thermal_increment)
    carried = np.abs(stress).max(axis=1) * np.maximum(1.0, np.maximum(c[:, 3], c[:, 4]))
    return np.asarray((size + carried)[:, None])


@ALL
def test_the_opposite_gives_the_opposite(law: RadialReturn) -> None:
    """Strain, thermal strain and stress turned around: the stress too; state and work the same."""
    for step, stress, state in parts(law, 21):
        found = law.integrate(step, stress, state)
        turned = step_of(step, -step.strain_increment, -step.thermal_increment, step.dt)
        other = law.integrate(turned, -stress, state)
        np.testing.assert_array_equal(other.stress, -found.stress)
        np.testing.assert_array_equal(other.state, found.state)
        np.testing.assert_array_equal(other.dissipation, found.dissipation)
        np.testing.assert_array_equal(other.tangent, found.tangent)


@ALL
def test_pressure_changes_nothing_but_the_mean(law: RadialReturn) -> None:
    """A change of volume more in the step: deviator, flow and work stay, the mean is Hooke's."""
    rng = np.random.default_rng(5)
    for step, stress, state in parts(law, 22):
        volume = rng.uniform(-1e-3, 1e-3, len(stress))
        squeezed = step_of(
            step, step.strain_increment + volume[:, None] * ONE, step.thermal_increment, step.dt
        )
        found, other = law.integrate(step, stress, state), law.integrate(squeezed, stress, state)
        c = law.coefficients(step.temperature_old, step.temperature)
        more = (3.0 * c[:, 1] * c[:, 5] * volume)[:, None] * ONE
        size = scale(law, squeezed, stress)
        assert (np.abs(other.stress - found.stress - more) <= 1e-10 * size).all()
        if state.shape[1]:
            elastic = size[:, 0] / c[:, 0]
            assert (np.abs(other.state - found.state)[:, 0] <= 1e-10 * elastic).all()


@ALL
def test_work_is_stress_times_flow(law: RadialReturn) -> None:
    """The dissipation of a step is q dp."""
    for step, stress, state in parts(law, 23):
        found = law.integrate(step, stress, state)
        if not state.shape[1]:
            assert not found.dissipation.any()
            continue
        fresh = law.coefficients(step.temperature_old, step.temperature)[:, 6] > 0.0
        flow = found.state[:, 0] - np.where(fresh, 0.0, state[:, 0])
        expected = equivalent_stress(found.stress) * flow
        # q is the difference of large means, dp that of large flows.
        noise = 1e-13 * np.abs(found.stress).max(axis=1) * flow
        noise += 1e-13 * equivalent_stress(found.stress) * found.state[:, 0]
        assert (np.abs(found.dissipation - expected) <= 1e-9 * expected + noise).all()


@pytest.mark.parametrize("name", RATE_DEPENDENT)
def test_more_time_flows_more(name: str) -> None:
    """The same strain in more time: never a higher stress, for virgin material."""
    law = LAWS[name]
    rng = np.random.default_rng(7)
    n = 500
    heat = rng.uniform(900.0, 1700.0, n)
    strain = rng.normal(size=(n, 4)) * 10.0 ** rng.uniform(-5.0, -1.0, n)[:, None]
    none, stress, state = np.zeros(n), np.zeros((n, 4)), law.initial_state(n)
    before = np.full(n, np.inf)
    trial = ThermoElastic(law.elasticity).integrate(
        MaterialStep(strain, none, heat, heat, 1.0), stress, np.empty((n, 0))
    )
    first = equivalent_stress(trial.stress)
    for dt in 10.0 ** np.arange(-12.0, 7.0):
        found = law.integrate(MaterialStep(strain, none, heat, heat, float(dt)), stress, state)
        q = equivalent_stress(found.stress)
        assert (q <= np.minimum(before, first) * (1.0 + 1e-10)).all()
        before = q
