"""Properties of every law: odd, independent of pressure, monotone in the strain rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive import (
    MaterialStep,
    NortonHoff,
    Response,
    ThermoElastic,
    equivalent_strain,
    equivalent_stress,
)
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.constitutive.hardening_laws import Hardening
from castfem.physics.constitutive.kernel import constants

from .samples import FADING, deviator, every_law, random_states, tensor

LAWS = every_law()
ALL = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
RATE_DEPENDENT = [k for k in LAWS if k not in ("elastic",) and not k.startswith("plastic")]
RECOVERING = [
    k for k, v in LAWS.items() if isinstance(v, Hardening) and v.recovery_time is not None
]
ONE = np.array([1.0, 1.0, 1.0, 0.0])


def parts(law: RadialReturn, seed: int) -> list[tuple[MaterialStep, Array, Array]]:
    return random_states(law, 1500, 10, seed).parts()


def step_of(step: MaterialStep, strain: Array, thermal: Array, dt: float) -> MaterialStep:
    return MaterialStep(strain, thermal, step.temperature_old, step.temperature, dt)


def scale(law: RadialReturn, step: MaterialStep, stress: Array) -> Array:
    """Return the size of the trial stress (n, 1), the scale of rounding errors."""
    c = law.coefficients(step.temperature_old, step.temperature)
    size = 3.0 * np.maximum(c[:, 0], c[:, 1]) * np.abs(step.strain_increment).max(axis=1)
    size += 3.0 * c[:, 1] * np.abs(step.thermal_increment)
    carried = np.abs(stress).max(axis=1) * np.maximum(1.0, np.maximum(c[:, 3], c[:, 4]))
    return np.asarray((size + carried)[:, None])


def opposite(law: RadialReturn, state: Array) -> Array:
    """Return the state of material strained the opposite way: p has no sign, a tensor has."""
    reversed_state = state.copy()
    if law.signed:
        reversed_state[:, :3] *= -1.0
    return reversed_state


def back_stress(law: RadialReturn, c: Array, state: Array) -> Array:
    """Return X = 2/3 f1 r^(f2 - 1) E (n, 4) of signed austenite, 0 for other laws."""
    if not (law.signed and law.kind == constants.STEEL):
        return np.zeros((len(state), 4))
    strain = law.strain(state)
    factor, exponent = c[:, constants.HARDENING], c[:, constants.HARDENING_EXPONENT] - 1.0
    level = (1.0 - c[:, constants.DELTA_WEIGHT]) * factor
    level[strain > 0.0] *= strain[strain > 0.0] ** exponent[strain > 0.0]
    return np.asarray(2.0 / 3.0 * level[:, None] * tensor(state))


@ALL
def test_response_is_odd(law: RadialReturn) -> None:
    """Reversed strain, thermal strain, stress and state tensors give the reversed response.

    Work, tangent and accumulated strains stay the same.
    """
    for step, stress, state in parts(law, 21):
        found = law.integrate(step, stress, state)
        reversed_step = step_of(step, -step.strain_increment, -step.thermal_increment, step.dt)
        opposed = law.integrate(reversed_step, -stress, opposite(law, state))
        np.testing.assert_array_equal(opposed.stress, -found.stress)
        np.testing.assert_array_equal(opposed.state, opposite(law, found.state))
        np.testing.assert_array_equal(opposed.dissipation, found.dissipation)
        np.testing.assert_array_equal(opposed.tangent, found.tangent)


@ALL
def test_pressure_changes_only_the_mean_stress(law: RadialReturn) -> None:
    """An additional volume change changes only the mean stress, by Hooke's law."""
    rng = np.random.default_rng(5)
    for step, stress, state in parts(law, 22):
        volume = rng.uniform(-1e-3, 1e-3, len(stress))
        compressed = step_of(
            step, step.strain_increment + volume[:, None] * ONE, step.thermal_increment, step.dt
        )
        found, other = law.integrate(step, stress, state), law.integrate(compressed, stress, state)
        c = law.coefficients(step.temperature_old, step.temperature)
        more = (3.0 * c[:, 1] * c[:, 5] * volume)[:, None] * ONE
        size = scale(law, compressed, stress)
        assert (np.abs(other.stress - found.stress - more) <= 1e-10 * size).all()
        if state.shape[1]:
            elastic = size[:, 0] / c[:, 0]
            strains = 3 if law.signed else 1
            off = np.abs(other.state - found.state)[:, :strains].max(axis=1)
            assert (off <= 1e-10 * elastic).all()


@ALL
def test_work_is_stress_times_flow(law: RadialReturn) -> None:
    """The dissipation of a step is q dp; for a law with a tensor it is (s - X):dE.

    The work of the back stress is stored. The flow is the growth of the state plus its recovery
    in the step, E (1 + dt/tau) - E_old.
    """
    for step, stress, state in parts(law, 23):
        found = law.integrate(step, stress, state)
        if not state.shape[1]:
            assert not found.dissipation.any()
            continue
        c = law.coefficients(step.temperature_old, step.temperature)
        virgin = c[:, constants.FRESH] > 0.0
        grown = 1.0 + c[:, constants.SHARE] * step.dt * c[:, constants.RECOVERY]
        back = back_stress(law, c, found.state)
        active = deviator(found.stress) - back
        level, strain = equivalent_stress(active), grown * law.strain(found.state)
        if law.signed:
            before = np.where(virgin[:, None], 0.0, tensor(state))
            gained = grown[:, None] * tensor(found.state) - before
            expected, flow = np.sum(active * gained, axis=1), equivalent_strain(gained)
        else:
            flow = np.abs(grown * found.state[:, 0] - np.where(virgin, 0.0, state[:, 0]))
            expected = level * flow
        # q is a difference of large mean and back stresses, dp a difference of large flows.
        noise = 1e-13 * (np.abs(found.stress) + np.abs(back)).max(axis=1) * flow
        noise += 1e-13 * level * strain
        assert (np.abs(found.dissipation - expected) <= 1e-9 * expected + noise).all()


def virgin_loads() -> tuple[Array, Array]:
    """Return temperatures (n,) and strain increments (n, 4) of about 1e-5 to 0.2."""
    rng, n = np.random.default_rng(7), 500
    heat = rng.uniform(900.0, 1700.0, n)
    return heat, rng.normal(size=(n, 4)) * 10.0 ** rng.uniform(-5.0, -1.0, n)[:, None]


def strained(law: RadialReturn, heat: Array, strain: Array, dt: float) -> Response:
    """Return the response of material that was never strained before."""
    step = MaterialStep(strain, np.zeros(len(heat)), heat, heat, dt)
    return law.integrate(step, np.zeros((len(heat), 4)), law.initial_state(len(heat)))


def curve_strain(law: RadialReturn, heat: Array, found: Response) -> Array:
    """Return the strain e = p + q/E at which a flow curve is evaluated."""
    young = law.coefficients(heat, heat)[:, constants.YOUNG]
    return np.asarray(law.strain(found.state) + equivalent_stress(found.stress) / young)


def peak_strain(law: RadialReturn, heat: Array) -> Array:
    """Return the strain p4/p1 of the maximum of a flow curve; infinite without a maximum."""
    peak = np.full(len(heat), np.inf)
    if isinstance(law, NortonHoff):
        p1, p4 = law.p1(heat), law.p4(heat)
        peak[p1 > 0.0] = np.maximum(p4 / np.where(p1 > 0.0, p1, 1.0), 0.0)[p1 > 0.0]
    return peak


@pytest.mark.parametrize("name", RATE_DEPENDENT)
def test_slower_strain_gives_no_higher_stress(name: str) -> None:
    """The same strain in a longer time never gives a higher stress in virgin material.

    A law that recovers from softening is the exception: recovery removes the strain that softened
    it, so it is stronger after a slow strain beyond the maximum of its curve than after a fast one.
    """
    law = LAWS[name]
    heat, strain = virgin_loads()
    elastic = ThermoElastic(law.elasticity)
    first = equivalent_stress(strained(elastic, heat, strain, 1.0).stress)
    before, softened = first, np.zeros(len(heat), dtype=bool)
    for dt in 10.0 ** np.arange(-12.0, 7.0):
        found = strained(law, heat, strain, float(dt))
        q = equivalent_stress(found.stress)
        most = np.where(softened, first, np.minimum(before, first))
        assert (q <= most * (1.0 + 1e-10)).all()
        before = q
        if name in RECOVERING:
            softened = curve_strain(law, heat, found) > peak_strain(law, heat)


@pytest.mark.parametrize("name", RECOVERING)
def test_slower_strain_with_slower_recovery_is_no_stronger(name: str) -> None:
    """With the recovery time scaled by the duration, no slower strain gives a higher stress."""
    law = LAWS[name]
    assert isinstance(law, Hardening)
    heat, strain = virgin_loads()
    for part in (1e-3, 1e-1, 10.0):
        before = np.full(len(heat), np.inf)
        for dt in 10.0 ** np.arange(-12.0, 7.0):

            def time(t: Array, scale: float = float(dt) / part) -> Array:
                return np.asarray(scale * FADING(t))

            found = strained(replace(law, recovery_time=time), heat, strain, float(dt))
            q = equivalent_stress(found.stress)
            assert (q <= before * (1.0 + 1e-10)).all()
            before = q


@pytest.mark.parametrize("name", [k for k in RECOVERING if isinstance(LAWS[k], NortonHoff)])
def test_recovery_undoes_hardening_and_softening(name: str) -> None:
    """With more recovery the step is weaker below the maximum of the curve, stronger beyond."""
    law = LAWS[name]
    assert isinstance(law, NortonHoff)
    heat, strain = virgin_loads()
    peak, weaker, stronger = peak_strain(law, heat), 0, 0
    found = strained(replace(law, recovery_time=None), heat, strain, 1.0)
    for scale in 10.0 ** np.arange(5.0, -5.0, -0.5):

        def time(t: Array, scale: float = float(scale)) -> Array:
            return np.asarray(scale * FADING(t))

        more = strained(replace(law, recovery_time=time), heat, strain, 1.0)
        q, before = equivalent_stress(more.stress), equivalent_stress(found.stress)
        below = curve_strain(law, heat, found) <= peak
        beyond = curve_strain(law, heat, more) >= peak
        assert (q <= before * (1.0 + 1e-10))[below].all()
        assert (q >= before * (1.0 - 1e-10))[beyond].all()
        weaker += (q < 0.99 * before)[below].sum()
        stronger += (q > 1.01 * before)[beyond].sum()
        found = more
    assert weaker > 500
    assert (stronger > 20) == bool(np.isfinite(peak).any())
