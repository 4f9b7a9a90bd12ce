"""Every law is finite, dissipative and consistent at any state; its tangent is exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive import MaterialStep, Response, ThermoElastic, equivalent_stress
from castfem.physics.constitutive.base import rotation
from castfem.physics.constitutive.flow_laws import RadialReturn

from . import numpy_laws
from .samples import every_law, hardening_laws, random_states, steel_like

LAWS = every_law()
ALL = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
PLAIN = {k: v for k, v in LAWS.items() if k != "elastic" and k not in hardening_laws(steel_like())}
ACCUMULATING = pytest.mark.parametrize("law", PLAIN.values(), ids=PLAIN.keys())


@ALL
def test_response_to_random_states_is_valid(law: RadialReturn) -> None:
    flowing = 0
    for step, stress, state in random_states(law, 100_000, 300, seed=1).parts():
        found = law.integrate(step, stress, state)
        for part in (found.stress, found.tangent, found.state, found.dissipation):
            assert np.isfinite(part).all()
        assert (found.dissipation >= 0.0).all()
        size = np.abs(found.tangent).max(axis=(1, 2), keepdims=True)
        if law.symmetric:
            assert (np.abs(found.tangent - found.tangent.transpose(0, 2, 1)) <= 1e-13 * size).all()
        flowing += found.flows.sum()
    assert flowing == 0 or flowing > 20_000  # the sample has elastic and flowing points


@ACCUMULATING
def test_return_is_radial_and_matches_the_flow(law: RadialReturn) -> None:
    """Radial return: q = q_trial - 3G dp in the direction of the elastic trial stress."""
    elastic = ThermoElastic(law.elasticity)
    for step, stress, state in random_states(law, 20_000, 100, seed=2).parts():
        found = law.integrate(step, stress, state)
        trial = elastic.integrate(step, stress, np.empty((len(stress), 0)))
        c = law.coefficients(step.temperature_old, step.temperature)
        shear, fresh = c[:, 0], c[:, 6] > 0.0
        gained = found.state[:, 0] - np.where(fresh, 0.0, state[:, 0])
        q, q_trial = equivalent_stress(found.stress), equivalent_stress(trial.stress)
        lost = q_trial - 3.0 * shear * gained
        scale = np.abs(trial.stress).max(axis=1) + 3.0 * shear * found.state[:, 0] + 1e-30
        assert (np.abs(q - lost) <= 1e-10 * scale).all()
        mean = found.stress[:, :3].mean(axis=1) - trial.stress[:, :3].mean(axis=1)
        assert (np.abs(mean) <= 1e-14 * scale).all()
        dots = np.sum(_deviator(found.stress) * _deviator(trial.stress), axis=1)
        sizes = np.linalg.norm(_deviator(found.stress), axis=1)
        sizes *= np.linalg.norm(_deviator(trial.stress), axis=1)
        pure = (q > 1e-9 * scale) & (q_trial > 1e-9 * scale)
        np.testing.assert_allclose(dots[pure], sizes[pure], rtol=1e-10)
        assert (gained[~found.flows] == 0.0).all()


def _deviator(stress: Array) -> Array:
    d = stress.copy()
    d[:, :3] -= stress[:, :3].mean(axis=1)[:, None]
    return d


@ALL
def test_tangent_is_the_derivative(law: RadialReturn) -> None:
    """Central differences agree to 1e-5 where a step length is free of kinks and rounding.

    A step length is trusted if rounding can change its quotient by 3e-6 at most, if no point begins
    or ceases to flow within it, and if the two one-sided quotients agree to 1e-5 (they do not
    where loading turns to unloading).
    """
    trusted = 0
    for step, stress, state in random_states(law, 3000, 30, seed=3).parts():
        error, fine = _tangent_error(law, step, stress, state)
        trusted += fine.sum()
        assert (error[fine] < 1e-5).all(), error[fine].max()
    assert trusted > 0.8 * 3000


def _tangent_error(
    law: RadialReturn, step: MaterialStep, stress: Array, state: Array
) -> tuple[Array, Array]:
    """Return the smallest relative error over several step lengths, and where it is trusted."""
    c = law.coefficients(step.temperature_old, step.temperature)

    def respond(strain: Array) -> Response:
        moved = MaterialStep(
            strain, step.thermal_increment, step.temperature_old, step.temperature, step.dt
        )
        return law.integrate(moved, stress, state, coefficients=c)

    base = step.strain_increment
    here = respond(base)
    stiff = np.abs(here.tangent).max(axis=(1, 2))
    size = np.maximum(np.linalg.norm(base, axis=1), 1e-10)
    carried = np.abs(stress).max(axis=1) * np.maximum(c[:, 3], c[:, 4])
    noise = 1e-15 * (np.abs(here.stress).max(axis=1) + stiff * size + carried)
    best, trusted = np.full(len(base), np.inf), np.zeros(len(base), dtype=bool)
    for relative in 10.0 ** np.arange(-1.0, -6.5, -0.5):
        h = relative * size
        quotient, kink = np.empty_like(here.tangent), np.zeros(len(base))
        for k in range(4):
            up, down = base.copy(), base.copy()
            up[:, k] += h
            down[:, k] -= h
            above, below = respond(up), respond(down)
            plus, minus = above.stress, below.stress
            yields = (above.flows != here.flows) | (below.flows != here.flows)
            quotient[:, :, k] = (plus - minus) / (up[:, k] - down[:, k])[:, None]
            bend = np.abs(plus + minus - 2.0 * here.stress).max(axis=1) / (h * stiff)
            kink = np.maximum(kink, np.where(yields, 1.0, bend))
        fine = (noise / (h * stiff) < 3e-6) & (kink < 1e-5)
        error = np.abs(quotient - here.tangent).max(axis=(1, 2)) / stiff
        best[fine] = np.minimum(best, error)[fine]
        trusted |= fine
    return best, trusted


@ALL
def test_rotated_input_gives_rotated_response(law: RadialReturn) -> None:
    turn = rotation(0.7)
    for step, stress, state in random_states(law, 2000, 20, seed=4).parts():
        found = law.integrate(step, stress, state)
        turned = MaterialStep(
            step.strain_increment @ turn.T, step.thermal_increment, step.temperature_old,
            step.temperature, step.dt,
        )  # fmt: skip
        turned_state = law.turned(state, np.full(len(state), 0.7))
        of_turned = law.integrate(turned, stress @ turn.T, turned_state)
        trial = np.abs(found.tangent).max(axis=(1, 2)) * np.abs(step.strain_increment).max(axis=1)
        scale = (np.abs(stress).max(axis=1) + trial + np.abs(found.stress).max(axis=1))[:, None]
        assert (np.abs(of_turned.stress - found.stress @ turn.T) <= 1e-9 * scale).all()


def test_rotation_is_that_of_a_tensor() -> None:
    angle, s = 0.4, np.array([3.0, -1.0, 2.0, np.sqrt(2.0) * 0.7])
    tensor = np.array([[3.0, 0.7], [0.7, -1.0]])
    r = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = r @ tensor @ r.T
    expected = [turned[0, 0], turned[1, 1], 2.0, np.sqrt(2.0) * turned[0, 1]]
    np.testing.assert_allclose(rotation(angle) @ s, expected, rtol=1e-14)


@ALL
def test_points_are_independent_and_output_arrays_reused(law: RadialReturn) -> None:
    step, stress, state = random_states(law, 50, 1, seed=6).parts()[0]
    out = Response.empty(50, state.shape[1])
    found = law.integrate(step, stress, state, out=out)
    assert found is out
    i = slice(17, 18)
    point = MaterialStep(
        step.strain_increment[i], step.thermal_increment[i], step.temperature_old[i],
        step.temperature[i], step.dt,
    )  # fmt: skip
    single = law.integrate(point, stress[i], state[i])
    np.testing.assert_array_equal(single.stress, out.stress[i])
    np.testing.assert_array_equal(single.tangent, out.tangent[i])
    np.testing.assert_array_equal(single.state, out.state[i])


@pytest.mark.parametrize("name", ["plastic", "hoff", "hoff signed"])
def test_rounding_does_not_choose_the_tangent(name: str) -> None:
    """A point that neither flows nor is loaded by more than rounding errors is elastic."""
    law, rng, n = LAWS[name], np.random.default_rng(8), 10_000
    elastic, heat, nothing = ThermoElastic(law.elasticity), np.full(n, 1690.0), np.zeros(n)
    size = 10.0 ** rng.uniform(-7.0, -2.0, (n, 1))
    pull = MaterialStep(size * rng.standard_normal((n, 4)), nothing, heat, heat, 0.5)
    solidified = elastic.integrate(pull, np.zeros((n, 4)), np.empty((n, 0))).stress
    rest = replace(pull, strain_increment=np.zeros((n, 4)))
    begun = law.integrate(rest, solidified, law.initial_state(n))
    noise = replace(rest, strain_increment=1e-16 * size * rng.standard_normal((n, 4)))
    found = law.integrate(noise, begun.stress, begun.state)
    expected = elastic.integrate(noise, begun.stress, np.empty((n, 0)))
    q, trial = equivalent_stress(found.stress), equivalent_stress(expected.stress)
    still = np.abs(q - trial) < 5e-13 * trial
    assert still.sum() > 100
    np.testing.assert_allclose(found.tangent[still], expected.tangent[still], rtol=1e-9)


@ALL
def test_zero_load_gives_zero_response(law: RadialReturn) -> None:
    none = np.zeros(3)
    heat = np.array([300.0, 1500.0, 1850.0])
    step = MaterialStep(np.zeros((3, 4)), none, heat, heat, 0.1)
    found = law.integrate(step, np.zeros((3, 4)), law.initial_state(3))
    assert not found.stress.any() and not found.flows.any() and not found.state.any()
    assert np.isfinite(found.tangent).all()


@ALL
def test_invalid_input_spoils_its_point_only(law: RadialReturn) -> None:
    """A diverging outer iteration may pass any values: the call returns, other points are right."""
    step, stress, state = random_states(law, 6, 1, seed=9).parts()[0]
    fine = law.integrate(step, stress, state)
    strain = step.strain_increment.copy()
    strain[1], strain[3], strain[4] = np.nan, np.inf, 1e200
    bad = MaterialStep(
        strain, step.thermal_increment, step.temperature_old, step.temperature, step.dt
    )
    found = law.integrate(bad, stress, state)
    assert np.isnan(found.stress[1]).all() and not np.isfinite(found.stress[3]).all()
    for i in (0, 2, 5):
        np.testing.assert_array_equal(found.stress[i], fine.stress[i])


def test_independent_numpy_scheme_agrees() -> None:
    for law in numpy_laws.laws().values():
        step, stress, state = numpy_laws.material_points(law)
        found = law.integrate(step, stress, state)
        reference = numpy_laws.numpy_response(law, step, stress, state)
        size = np.abs(found.stress).max(axis=1, keepdims=True)
        assert (np.abs(found.stress - reference.stress) <= 1e-10 * size).all()
        stiff = np.abs(found.tangent).max(axis=(1, 2), keepdims=True)
        assert (np.abs(found.tangent - reference.tangent) <= 1e-8 * stiff).all()
        np.testing.assert_allclose(found.state, reference.state, rtol=1e-8, atol=1e-14)
        np.testing.assert_allclose(found.dissipation, reference.dissipation, rtol=1e-6, atol=1e-6)


def test_time_step_must_be_positive() -> None:
    law = LAWS["steel"]
    one = np.full(1, 1300.0)
    for dt in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="time step must be positive"):
            law.integrate(
                MaterialStep(np.zeros((1, 4)), np.zeros(1), one, one, dt),
                np.zeros((1, 4)),
                law.initial_state(1),
            )
