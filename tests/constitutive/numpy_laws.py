"""Flow laws in vectorised numpy: an independent check of the compiled kernel.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from castfem.base.tables import Constant
from castfem.base.tables import celsius as rows
from castfem.base.types import Array
from castfem.physics.constitutive import (
    MaterialStep,
    NortonCreep,
    NortonHoff,
    PerfectlyPlastic,
    Response,
    Solidity,
    ThermoElastic,
    load_elasticity,
    load_law,
)
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.constitutive.kernel import constants as k

POINTS = 1000
DT = 0.1  # s
NEWTON = 60


def laws() -> dict[str, RadialReturn]:
    """Return the laws to compare, by name."""
    elasticity = load_elasticity(solidity=Solidity.between(1766.0, 1798.0))
    hoff = load_law("norton_hoff_kozlowski", elasticity)
    assert isinstance(hoff, NortonHoff)
    return {
        "thermo-elastic": ThermoElastic(elasticity),
        "perfectly plastic": PerfectlyPlastic(elasticity, rows([900, 1500], [24e6, 1e5])),
        "Norton creep": NortonCreep.constant(elasticity, 1e-3, 20e6, 5.0),
        "Norton-Hoff, automatic yield limit": hoff,
        "Norton-Hoff, viscous": replace(hoff, yield_limit=Constant(0.0)),
        "Kozlowski III and Zhu, 0.08 %C": load_law("kozlowski_zhu", elasticity, carbon=0.08),
        "mixed by fraction, 0.12 %C": load_law("kozlowski_zhu_mixed", elasticity, carbon=0.12),
    }


def material_points(law: RadialReturn) -> tuple[MaterialStep, Array, Array]:
    """Return a step of strained points, their stress and their state.

    Temperatures are 900 to 1550 degC and change by 2 K in the step. Every other point is unloaded
    at half its strain rate; the others are strained further at 2e-4 to 2e-3 1/s.
    """
    rng = np.random.default_rng(5)
    temperature = rng.uniform(1173.0, 1823.0, POINTS)
    direction = rng.normal(size=(POINTS, 4))
    direction[:, :3] -= direction[:, :3].mean(axis=1)[:, None]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    strain = direction * rng.uniform(2e-4, 2e-3, POINTS)[:, None] * DT
    none = np.zeros(POINTS)
    stress, state = np.zeros((POINTS, 4)), law.initial_state(POINTS)
    for _ in range(30):
        step = MaterialStep(strain, none, temperature, temperature, DT)
        response = law.integrate(step, stress, state)
        stress, state = response.stress, response.state
    strain[::2] *= -0.5
    return MaterialStep(strain, none, temperature + 2.0, temperature, DT), stress, state


def numpy_response(law: RadialReturn, step: MaterialStep, stress: Array, state: Array) -> Response:
    """Integrate a step like `Law.integrate`, with array operations."""
    c = law.coefficients(step.temperature_old, step.temperature)
    share, shear2 = c[:, k.SHARE], 2.0 * c[:, k.SHEAR]
    old_mean = stress[:, :3].mean(axis=1)
    strain = share[:, None] * step.strain_increment
    mean_strain = strain[:, :3].mean(axis=1)
    mean = c[:, k.CARRY_MEAN] * old_mean + 3.0 * c[:, k.BULK] * (
        mean_strain - step.thermal_increment
    )
    unit = np.array([1.0, 1.0, 1.0, 0.0])
    carried = c[:, k.CARRY_DEVIATOR, None] * (stress - old_mean[:, None] * unit)
    deviator = carried + shear2[:, None] * (strain - mean_strain[:, None] * unit)
    length = np.linalg.norm(deviator, axis=1)
    trial = np.sqrt(1.5) * length
    before = np.sqrt(1.5) * np.linalg.norm(carried, axis=1)
    fresh = c[:, k.FRESH] > 0.0
    old = np.where(fresh[:, None], 0.0, state)
    new = old.copy()
    equivalent, kept = trial.copy(), np.ones_like(trial)
    if law.kind != k.ELASTIC:
        solve = _automatic if law.kind == k.CURVE_AUTOMATIC else _by_increment
        equivalent, kept = solve(law.kind, c, old, new, trial, before, share * step.dt)
    increment = (trial - equivalent) / (1.5 * shear2)
    if law.kind != k.ELASTIC:
        new[:, 0] = old[:, 0] + increment
    scale = np.where(increment > 0.0, equivalent / np.maximum(trial, 1e-300), 1.0)
    normal = deviator / np.maximum(length, 1e-300)[:, None]
    projector = np.eye(4) - np.outer(unit, unit) / 3.0
    tangent = (shear2 * share * scale)[:, None, None] * projector
    tangent += ((shear2 * share) * (kept - scale))[:, None, None] * (
        normal[:, :, None] * normal[:, None, :]
    )
    tangent += (c[:, k.BULK] * share)[:, None, None] * np.outer(unit, unit)
    total = scale[:, None] * deviator + mean[:, None] * unit
    return Response(total, tangent, new, equivalent * increment, increment > 0.0)


def _flow_stress(kind: int, c: Array, old: Array, trial: Array, z: Array, ln_dt: Array) -> tuple:
    """Return the flow stress at dp = exp(z) and its derivatives by z and by the trial stress."""
    dp, none = np.exp(z), np.zeros_like(z)
    if kind == k.PLASTIC:
        return c[:, k.YIELD_STRESS], none, none
    if kind == k.CREEP:
        s = np.exp((z - ln_dt - c[:, k.LN_FACTOR]) / c[:, k.EXPONENT])
        return s, s / c[:, k.EXPONENT], none
    if kind == k.STEEL:
        p, f2, w = old + dp, c[:, k.HARDENING_EXPONENT], c[:, k.DELTA_WEIGHT]
        back = c[:, k.HARDENING] * p**f2
        viscous = np.exp((z - ln_dt - c[:, k.LN_GAMMA_RATE]) / c[:, k.GAMMA_EXPONENT])
        hard, m, n = 1.0 + 1000.0 * p, c[:, k.DELTA_HARDENING], c[:, k.DELTA_EXPONENT]
        delta = np.exp(c[:, k.LN_DELTA_LEVEL] + (z - ln_dt) / n) * hard**m
        slope = (1.0 - w) * (back * f2 * dp / p + viscous / c[:, k.GAMMA_EXPONENT])
        slope += w * delta * (1.0 / n + m * 1000.0 * dp / hard)
        return (1.0 - w) * (back + viscous) + w * delta, slope, none
    young, shear3 = c[:, k.YOUNG], 3.0 * c[:, k.SHEAR]
    e = np.minimum(old + dp + (trial - shear3 * dp) / young, c[:, k.LARGEST_STRAIN])
    by_e = c[:, k.STRAIN_EXPONENT] / e - c[:, k.SOFTENING]
    s = np.exp(
        c[:, k.LN_LEVEL] + c[:, k.STRAIN_EXPONENT] * np.log(e) - c[:, k.SOFTENING] * e
        + c[:, k.RATE_EXPONENT] * (z - ln_dt + k.LN_SQRT3)
    )  # fmt: skip
    slope = s * (c[:, k.RATE_EXPONENT] + by_e * (1.0 - shear3 / young) * dp)
    return s, slope, s * by_e / young


def _by_increment(
    kind: int, c: Array, old: Array, new: Array, trial: Array, before: Array, dt: Array
) -> tuple[Array, Array]:
    """Solve for ln dp by a bracketed Newton method for all points at once."""
    shear3, ln_dt = 3.0 * c[:, k.SHEAR], np.log(dt)
    p = old[:, 0]
    tiny = np.full_like(trial, -300.0)
    high = np.log(np.maximum(trial, 1e-250) / shear3)
    low = np.minimum(tiny, high - 1.0)
    least = _flow_stress(kind, c, p, trial, low, ln_dt)[0]
    flows = trial > np.maximum(least, 1e-250)
    z = high.copy()
    for _ in range(NEWTON):
        s, slope, _by = _flow_stress(kind, c, p, trial, z, ln_dt)
        total = s + shear3 * np.exp(z)
        excess = np.log(total) - np.log(np.maximum(trial, 1e-250))
        high, low = np.where(excess > 0.0, z, high), np.where(excess > 0.0, low, z)
        step = excess * total / (slope + shear3 * np.exp(z))
        proposed = z - step
        inside = (proposed > low) & (proposed <= high)
        z = np.where(inside, proposed, 0.5 * (low + high))
        if not np.any(flows & (np.abs(step) > 1e-13 * (1.0 + np.abs(z)))):
            break
    dp = np.where(flows, np.exp(z), 0.0)
    _s, slope, by_trial = _flow_stress(kind, c, p, trial, z, ln_dt)
    kept = (slope + shear3 * dp * by_trial) / (slope + shear3 * np.maximum(dp, 1e-300))
    return trial - shear3 * dp, np.where(flows, kept, 1.0)


def _remembered_rate(a: Array, ln_old: Array, m: Array, stiff: Array, total: Array) -> tuple:
    """Return ln r of the rate r with a (r/old)^m + stiff r = total, and d ln r / d total."""
    goal = np.log(np.maximum(total, 1e-250))
    y = goal - np.log(stiff)
    ln_a = np.log(np.maximum(a, 1e-250))
    y = np.where(a > 0.0, np.minimum(y, ln_old + (goal - ln_a) / m), y)
    for _ in range(NEWTON):
        left = np.where(a > 0.0, np.exp(np.minimum(ln_a + m * (y - ln_old), 600.0)), 0.0)
        right = stiff * np.exp(y)
        rise = (m * left + right) / (left + right)
        step = (np.log(left + right) - goal) / rise
        y = y - step
        if np.all(np.abs(step) <= 1e-13 * (1.0 + np.abs(y))):
            break
    return y, 1.0 / (np.exp(goal) * rise)


def _automatic(
    kind: int, c: Array, old: Array, new: Array, trial: Array, before: Array, dt: Array
) -> tuple[Array, Array]:
    """Solve the law (163) with its automatic yield limit."""
    shear3, young, m = 3.0 * c[:, k.SHEAR], c[:, k.YOUNG], c[:, k.RATE_EXPONENT]
    drive, p, stiff = trial - before, old[:, 0], young * dt

    def factor(e: Array) -> tuple[Array, Array]:
        e = np.clip(e, 1e-300, c[:, k.LARGEST_STRAIN])
        p4, p1 = c[:, k.STRAIN_EXPONENT], c[:, k.SOFTENING]
        return p4 * np.log(e) - p1 * e, p4 / e - p1

    ln_before = np.log(np.maximum(before, 1e-250))
    ln_old = (ln_before - c[:, k.LN_LEVEL] - factor(p + before / young)[0]) / m - k.LN_SQRT3
    memory = old[:, 1] > 0.0
    ln_old = np.maximum(ln_old, np.where(memory, np.log(np.maximum(old[:, 1], 1e-300)), -1e300))

    def curve(dp: Array, drive: Array) -> tuple[Array, Array, Array, Array]:
        gain = np.maximum(drive - (shear3 - young) * dp, 0.0)
        y, by_total = _remembered_rate(before, ln_old, m, stiff, before + gain)
        ln_factor, by_e = factor(p + dp + (trial - shear3 * dp) / young)
        s = np.exp(c[:, k.LN_LEVEL] + ln_factor + m * (y + k.LN_SQRT3))
        by_rate = np.where(gain > 0.0, m * by_total, 0.0)
        by_dp = s * (by_e * (1.0 - shear3 / young) - by_rate * (shear3 - young))
        return s, by_dp, s * (by_e / young + by_rate), y

    s, by_dp, by_trial, y = curve(np.zeros_like(trial), drive)
    flows = trial > s * (1.0 + k.ON_CURVE)
    dp = np.where(flows, (trial - s) / shear3, 0.0)
    back = curve(np.zeros_like(trial), np.abs(drive))[3]
    elastic_rate = np.where(drive < 0.0, back, y)
    low, high = np.zeros_like(trial), trial / shear3
    for _ in range(NEWTON):
        s, by_dp, by_trial, y = curve(dp, drive)
        excess = np.where(flows, trial - shear3 * dp - s, 0.0)
        low, high = np.where(excess > 0.0, dp, low), np.where(excess > 0.0, high, dp)
        step = excess / (shear3 + by_dp)
        if np.all(np.abs(step) <= 1e-13 * dp):
            break
        proposed = dp + step
        dp = np.where((proposed >= low) & (proposed <= high), proposed, 0.5 * (low + high))
    new[:, 1] = np.exp(np.where(flows, y, elastic_rate))
    kept = 1.0 - shear3 * (1.0 - by_trial) / (shear3 + by_dp)
    return trial - shear3 * dp, np.where(flows, kept, 1.0)
