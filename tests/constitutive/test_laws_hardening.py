"""Signed hardening and recovery, compared with separately solved differential equations.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.constitutive import (
    Elasticity,
    MaterialStep,
    NortonHoff,
    ThermoElastic,
    UnifiedSteel,
    equivalent_strain,
    equivalent_stress,
    load_law,
)
from castfem.physics.constitutive.flow_curves import Austenite
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.constitutive.hardening_laws import TENSOR
from castfem.physics.constitutive.uniaxial import AXIAL, pull

from .samples import ZERO, deviator, hardening_laws, random_states, steel_like, tensor

YOUNG, POISSON = 15e9, 0.3
EL = Elasticity.constant(YOUNG, POISSON)
HOT = 1100.0 + ZERO
LAWS = hardening_laws(steel_like())
ALL = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
Options = dict[str, Any]
SIGNED: Options = {"hardening": "signed"}
PLAIN: Options = {}


def austenite(options: Options = SIGNED) -> UnifiedSteel:
    """Return the law Kozlowski III without delta ferrite."""
    return UnifiedSteel(EL, 0.1, np.zeros_like, **options)


def hoff(options: Options, limit: float | None = 0.0) -> NortonHoff:
    """Return the law (163), viscous by default."""
    parameters = (Constant(v) for v in (40e6, 0.0, 0.14, 0.16))
    yield_limit = None if limit is None else Constant(limit)
    return NortonHoff(EL, *parameters, yield_limit, **options)


@ALL
def test_stress_lost_matches_flow(law: RadialReturn) -> None:
    """Hooke's law holds for the new elastic strain; dE/dt = flow - E/tau holds at step end."""
    elastic = ThermoElastic(law.elasticity)
    for step, stress, state in random_states(law, 5_000, 25, seed=2).parts():
        found = law.integrate(step, stress, state)
        trial = elastic.integrate(step, stress, np.empty((len(stress), 0)))
        c = law.coefficients(step.temperature_old, step.temperature)
        shear, share, fresh = c[:, 0], c[:, 5], c[:, 6] > 0.0
        grown = 1.0 + share * step.dt * c[:, 7]
        size = np.abs(trial.stress).max(axis=1)
        if law.symmetric:
            gained = grown * found.state[:, 0] - np.where(fresh, 0.0, state[:, 0])
            lost = (equivalent_stress(trial.stress) - equivalent_stress(found.stress)) / 3.0 / shear
            off = np.abs(gained - lost)
            scale = size / shear + grown * found.state[:, 0]
        else:
            before = np.where(fresh[:, None], 0.0, tensor(state))
            gain = grown[:, None] * tensor(found.state) - before
            lost_strain = deviator(trial.stress - found.stress) / (2.0 * shear)[:, None]
            off = np.abs(gain - lost_strain).max(axis=1)
            scale = size / shear + np.abs(before).max(axis=1)
            scale += grown * np.abs(tensor(found.state)).max(axis=1)
        assert (off <= 1e-10 * scale).all()
        mean = (found.stress - trial.stress)[:, :3].mean(axis=1)
        assert (np.abs(mean) <= 1e-12 * size).all()


def kozlowski_rate(stress: Array, tensor: Array) -> Array:
    """Return the rate of the strain tensor, 1/s: flow along the stress less the back stress."""
    c = Austenite.at(HOT, 0.1)
    size = np.sqrt(2.0 / 3.0 * tensor @ tensor)
    back = np.zeros(4)
    if size > 0.0:
        back = 2.0 / 3.0 * float(c.hardening) * size ** (float(c.hardening_exponent) - 1.0) * tensor
    active = stress - back
    level = np.sqrt(1.5 * active @ active)
    if level == 0.0:
        return np.zeros(4)
    rate = np.exp(float(c.ln_rate) + float(c.stress_exponent) * np.log(level))
    return np.asarray(1.5 * rate * active / level)


def exact(path: Callable[[float], Array], times: Array) -> Array:
    """Solve for the deviatoric stress (m, 4) of austenite at HOT under deviatoric strain rates."""
    shear = YOUNG / 2.0 / (1.0 + POISSON)

    def rates(t: float, y: Array) -> Array:
        flow = kozlowski_rate(y[:4], y[4:])
        return np.concatenate([2.0 * shear * (path(t) - flow), flow])

    found = np.zeros((len(times), 8))
    for k in range(1, len(times)):
        piece = solve_ivp(
            rates, times[k - 1 : k + 1], found[k - 1], method="Radau", rtol=1e-9,
            atol=[1e-2] * 4 + [1e-13] * 4,
        )  # fmt: skip
        assert piece.success
        found[k] = piece.y[:, -1]
    return found


AXIS = np.array([-0.5, -0.5, 1.0, 0.0])
SHEARING = np.array([0.6, -0.6, 0.0, 0.5])


def reversing(t: float) -> Array:
    """Return the strain rate of tension, compression, rest, tension: 1e-3 1/s or 0."""
    return AXIS * (1e-3 if t < 5.0 else -1e-3 if t < 9.0 else 0.0 if t < 14.0 else 1e-3)


def turning(t: float) -> Array:
    """Return a strain rate whose direction rotates, with a rest."""
    if 8.0 <= t < 10.0:
        return np.zeros(4)
    return np.asarray(1e-3 * (np.cos(0.5 * t) * AXIS + np.sin(0.5 * t) * SHEARING))


def stepped(law: RadialReturn, path: Callable[[float], Array], end: float, steps: int) -> Array:
    """Integrate a point in equal steps: deviatoric stress and strain tensor (steps + 1, 8)."""
    stress, state = np.zeros((1, 4)), law.initial_state(1)
    heat, dt = np.full(1, HOT), end / steps
    found = np.zeros((steps + 1, 8))
    for k in range(steps):
        gauss = [(k + 0.5 + s * 0.5 / np.sqrt(3.0)) * dt for s in (-1.0, 1.0)]
        strain = 0.5 * dt * (path(gauss[0]) + path(gauss[1]))
        answer = law.integrate(
            MaterialStep(strain[None], np.zeros(1), heat, heat, dt), stress, state
        )
        stress, state = answer.stress, answer.state
        found[k + 1] = np.concatenate([deviator(stress)[0], tensor(state)[0]])
    return found


@pytest.mark.parametrize("path", [reversing, turning])
def test_austenite_matches_kozlowski_with_signed_strain(path: Callable[[float], Array]) -> None:
    """Compared with the differential equation the error is of first order, also as flow rotates."""
    end, marks = 18.0, 18
    times = np.linspace(0.0, end, marks + 1)
    goal = exact(path, times)[:, :4]
    size = np.abs(goal).max()
    off = [
        (stepped(austenite(), path, end, steps)[:: steps // marks, :4] - goal) / size
        for steps in (720, 1440, 2880)
    ]
    errors = [np.abs(o).max() for o in off]
    assert errors[2] < 4e-3
    assert errors[0] / errors[1] > 1.8 and errors[1] / errors[2] > 1.8
    assert np.abs(2.0 * off[2] - off[1]).max() < 3e-4  # extrapolated to a step of zero


def test_unloaded_bar_creeps_back() -> None:
    """Without stress the back stress drives the flow: d e/dt = -C (f1 e^f2)^f3."""
    c = Austenite.at(HOT, 0.1)
    law = austenite()
    state = np.array([[-0.005, -0.005, 0.0]])
    heat, stress, dt = np.full(1, HOT), np.zeros((1, 4)), 20.0
    shear = YOUNG / 2.0 / (1.0 + POISSON)
    for _ in range(2000):
        # Newton's method for the strain that keeps the bar free of stress.
        strain = np.zeros((1, 4))
        for _ in range(30):
            step = MaterialStep(strain, np.zeros(1), heat, heat, dt)
            found = law.integrate(step, stress, state)
            strain = strain - np.linalg.solve(found.tangent, found.stress[:, :, None])[:, :, 0]
            if np.abs(found.stress).max() < 1e-9 * shear * 1e-3:
                break
        assert found.dissipation[0] >= 0.0
        state, stress = found.state, found.stress

    def rate(_t: float, e: Array) -> Array:
        back = float(c.hardening) * np.maximum(e, 0.0) ** float(c.hardening_exponent)
        with np.errstate(divide="ignore"):
            return np.asarray(-np.exp(float(c.ln_rate) + float(c.stress_exponent) * np.log(back)))

    goal = solve_ivp(rate, (0.0, 2000 * dt), [0.01], method="Radau", rtol=1e-9, atol=1e-12).y[0, -1]
    assert goal < 0.95 * 0.01
    assert 0.01 - law.strain(state)[0] == pytest.approx(0.01 - goal, rel=1e-2)


def test_work_of_austenite_is_dissipated_or_stored() -> None:
    """The work of flow is the dissipation plus the energy stored by the back stress.

    The stored energy is f1 r^(1 + f2) / (1 + f2). A step uses the back stress at its end, so the
    work is larger by a part that vanishes with the step.
    """
    c = Austenite.at(HOT, 0.1)
    m = 1.0 + float(c.hardening_exponent)
    excess = []
    for steps in (200, 400, 800):
        law, end = austenite(), 18.0
        stress, state, heat = np.zeros((1, 4)), law.initial_state(1), np.full(1, HOT)
        work = lost = 0.0
        for k in range(steps):
            strain = turning((k + 0.5) * end / steps)[None] * end / steps
            step = MaterialStep(strain, np.zeros(1), heat, heat, end / steps)
            found = law.integrate(step, stress, state)
            gain = tensor(found.state) - tensor(state)
            stored = [float(c.hardening) * law.strain(s)[0] ** m / m for s in (found.state, state)]
            spent = float(np.sum(found.stress * gain))
            assert found.dissipation[0] >= 0.0
            assert spent >= (found.dissipation[0] + stored[0] - stored[1]) * (1.0 - 1e-9) - 1e-9
            work, lost = work + spent, lost + float(found.dissipation[0])
            stress, state = found.stress, found.state
        excess.append((work - lost - stored[0]) / work)
    assert 0.0 < excess[2] < 1e-3
    assert excess[0] / excess[1] > 1.7 and excess[1] / excess[2] > 1.7


@pytest.mark.parametrize("make", [austenite, hoff, lambda h: hoff(h, None)])
def test_monotonic_loading_is_independent_of_sign(make: Callable[[Options], RadialReturn]) -> None:
    time = np.linspace(0.0, 20.0, 101)
    one, two = (pull(make(h), time, 1e-3 * time, HOT) for h in (PLAIN, SIGNED))
    np.testing.assert_allclose(two.axial_stress, one.axial_stress, rtol=1e-9)
    flow = make(SIGNED).strain(two.state[-1])
    np.testing.assert_allclose(flow, one.state[-1, :, 0], rtol=1e-9)


def test_reversed_flow_follows_the_virgin_curve() -> None:
    """Signed law (163): after a reversal p counts as 0 until the strain is reversed."""
    law = hoff(SIGNED, None)
    time = np.linspace(0.0, 20.0, 2001)
    axial = np.where(time < 10.0, 1e-3 * time, 2e-2 - 1e-3 * time)
    found = pull(law, time, axial, HOT)
    virgin = pull(law, time[:1001], 1e-3 * time[:1001], HOT)
    limit = virgin.axial_stress[virgin.flows[:, 0].argmax(), 0]
    back = -found.axial_stress[(time > 13.0) & (time < 19.0), 0]
    # With e = q/E the stress is where the elastic line crosses the curve, until p is reversed.
    np.testing.assert_allclose(back, limit, rtol=2e-3)
    hardened = pull(hoff(PLAIN, None), time, axial, HOT)
    assert -hardened.axial_stress[-1, 0] > 1.5 * back[-1]


@pytest.mark.parametrize("signed", [False, True])
def test_recovery_balances_hardening(signed: bool) -> None:
    """At a constant rate p tends to rate tau for any step; at rest p falls as exp(-t/tau)."""
    tau, rate = 20.0, 1e-3
    hardening = SIGNED if signed else PLAIN
    fading: Options = {**hardening, "recovery_time": Constant(tau)}
    law = austenite(fading)
    c = Austenite.at(HOT, 0.1)
    for steps in (40, 400):
        time = np.linspace(0.0, 400.0, steps + 1)
        found = pull(law, time, rate * time, HOT)
        strain = law.strain(found.state[-1])
        assert strain[0] == pytest.approx(rate * tau, rel=1e-6)
        assert found.axial_stress[-1, 0] == pytest.approx(float(c.stress(rate * tau, rate)), 1e-6)
    state = found.state[-1]
    heat = np.full(1, HOT)
    for _ in range(400):
        step = MaterialStep(np.zeros((1, 4)), np.zeros(1), heat, heat, 0.05)
        # Without stress nothing flows; the strain only recovers.
        state = hoff(fading).integrate(step, np.zeros((1, 4)), state).state
    remaining = hoff(hardening).strain(state)[0] / (rate * tau)
    assert remaining == pytest.approx(np.exp(-1.0), rel=2e-3)


@ALL
def test_states_rotate_with_the_material(law: RadialReturn) -> None:
    state = random_states(law, 500, 1, seed=8).state
    angle = np.linspace(-3.0, 3.0, 500)
    turned = law.turned(state, angle)
    np.testing.assert_allclose(law.strain(turned), law.strain(state), rtol=1e-12)
    if law.state_names[:3] == TENSOR:
        np.testing.assert_allclose(law.strain(state), equivalent_strain(tensor(state)), rtol=1e-12)
        np.testing.assert_allclose(law.turned(turned, -angle), state, atol=1e-12)
        assert np.abs(turned - state).max() > 0.1
    else:
        assert turned is state


def test_peak_stress_converges_with_the_step() -> None:
    """A bar of fixed length under an oscillating temperature: peaks of fine and coarse steps."""
    peaks = []
    for n in (50, 100, 200):
        turn = 2.0 * np.pi * np.arange(6 * n + 1) / n
        heat = 950.0 + ZERO + 75.0 * np.sin(turn)
        law = load_law("norton_hoff_kozlowski", steel_like(), carbon=0.1)
        assert isinstance(law, NortonHoff)
        found = pull(
            replace(law, **SIGNED), turn * 12.5 / (2.0 * np.pi), np.zeros_like(turn), heat,
            thermal_strain=15e-6 * (heat - heat[0]),
        )  # fmt: skip
        peaks.append(found.stress[:, 0, AXIAL].max())
    assert abs(peaks[2] - peaks[1]) < 0.7 * abs(peaks[1] - peaks[0])
    assert peaks[0] == pytest.approx(peaks[2], rel=1e-2)
