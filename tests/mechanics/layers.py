"""A solidifying shell as layers with a common strain: an integration independent of castfem.

The half-space of Weiner and Boley with the exact temperature (one-phase Stefan) and steel that
flows by Kozlowski's model III and Zhu's power law, both coded here from the published formulas.
In each layer the stresses along y and z are equal and the stress across it is 0, so that

    ds/dt = E/(1 - nu) (de/dt - alpha dT/dt - sign(s)/2 dp/dt),     dp/dt = f(|s|, p, T),

after the layer has frozen; zero force on the shell gives de/dt. LSODA integrates these ordinary
differential equations until the next layer freezes. Units: MPa, degC, m, s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import erf

from castfem.base.types import Array

SURFACE, MELTING = 1000.0, 1494.4
STIFFNESS, ALPHA = 40e3 / 0.7, 2e-5
DIFFUSIVITY, FRONT = 33.0 / (7500.0 * 661.0), 0.66577951  # of St = 661 * 494.4 / 272e3
RISE = (MELTING - SURFACE) / erf(FRONT)


def austenite(stress: Array, strain: Array, kelvin: Array, carbon: float) -> Array:
    """Return the strain rate of Kozlowski's model III, 1/s."""
    f1 = 130.5 - 5.128e-3 * kelvin
    f2 = -0.6289 + 1.114e-3 * kelvin
    f3 = 8.132 - 1.540e-3 * kelvin
    factor = 46550.0 + 71400.0 * carbon + 12000.0 * carbon**2
    excess = np.maximum(stress - f1 * strain**f2, 0.0)
    return np.asarray(factor * excess**f3 * np.exp(-44650.0 / kelvin))


def delta_ferrite(stress: Array, strain: Array, kelvin: Array, carbon: float) -> Array:
    """Return the strain rate of Zhu's power law, 1/s."""
    level = 13678.0 * carbon**-0.0556 * (kelvin / 300.0) ** -5.52
    hardened = level * (1.0 + 1000.0 * strain) ** (-9.4156e-5 * kelvin + 0.3495)
    return np.asarray(0.1 * (stress / hardened) ** (1.0 / (1.617e-4 * kelvin - 0.06166)))


def mixture(stress: Array, strain: Array, kelvin: Array, carbon: float) -> Array:
    """Return the rate at which both phases carry a stress by their fractions, 1/s; bisected."""
    place = np.clip((kelvin - 1667.15) / 101.0, 1e-9, 1.0)  # carbon of each by the lever rule
    delta = np.clip((0.18 * place - carbon) / (0.08 * place), 0.0, 1.0)
    slow, fast = np.full_like(stress, -60.0), np.full_like(stress, 5.0)
    back = (130.5 - 5.128e-3 * kelvin) * strain ** (-0.6289 + 1.114e-3 * kelvin)
    # Each phase carries (rate / its rate at 1 MPa)^exponent; computed by logarithms.
    own = [np.log(austenite(back + 1.0, strain, kelvin, carbon)),
           np.log(delta_ferrite(np.ones_like(stress), strain, kelvin, carbon))]  # fmt: skip
    power = 1.0 / (8.132 - 1.540e-3 * kelvin), 1.617e-4 * kelvin - 0.06166
    for _ in range(36):  # to 1e-9 of the rate
        middle = 0.5 * (slow + fast)
        carried = (1.0 - delta) * (back + np.exp(power[0] * (middle - own[0])))
        carried += delta * np.exp(power[1] * (middle - own[1]))
        slow, fast = (
            np.where(carried < stress, middle, slow),
            np.where(carried < stress, fast, middle),
        )
    return np.exp(slow)


def turns_to_delta(carbon: float) -> float:
    """Return the temperature above which more than a tenth of the solid is delta ferrite, degC.

    Lever rule between the lines from 1394 degC to 0.10 %C and to 0.18 %C at 1495 degC.
    """
    if carbon > 0.17:
        return np.inf  # austenite freezes
    return float(1394.0 + 101.0 * carbon / (0.18 - 0.1 * (0.18 - 0.10)))


@dataclass(frozen=True)
class Shell:
    """Result for the layers: depth [m], stress [MPa] and flow p of each, and the common strain."""

    depth: Array
    stress: Array
    flow: Array
    strain: float


def shell(
    times: list[float], carbon: float, layer: float = 0.05e-3, mixed: bool = False
) -> list[Shell]:
    """Integrate shells to increasing times; `layer` in m, `mixed` for the mixture of phases."""
    count = int(2.0 * FRONT * np.sqrt(DIFFUSIVITY * times[-1]) / layer + 0.5)
    depth = layer * (np.arange(count) + 0.5)
    freezing = (depth / (2.0 * FRONT)) ** 2 / DIFFUSIVITY
    limit = turns_to_delta(carbon)

    def rates(time: float, unknown: Array) -> Array:
        """Return the rates of stresses, flows and common strain of the frozen layers."""
        n = len(unknown) // 2
        stress, flow = unknown[:n], np.maximum(unknown[n : 2 * n], 0.0)
        zeta = depth[:n] / (2.0 * np.sqrt(DIFFUSIVITY * time))
        celsius = SURFACE + RISE * erf(zeta)
        cooling = -RISE * np.exp(-(zeta**2)) * zeta / (np.sqrt(np.pi) * time)
        now = np.abs(stress), flow, celsius + 273.15, carbon
        if mixed:
            flowing = mixture(*now)
        else:
            flowing = np.where(celsius > limit, delta_ferrite(*now), austenite(*now))
        fixed = STIFFNESS * (-ALPHA * cooling - 0.5 * np.sign(stress) * flowing)
        common = -fixed.mean()
        return np.concatenate([fixed + common, flowing, [common / STIFFNESS]])

    unknown, begin, frozen = np.zeros(1), 0.0, 0
    found: list[Shell] = []
    for time in np.sort(np.concatenate([freezing, times])):
        if frozen:
            answer = solve_ivp(rates, (begin, time), unknown, "LSODA", rtol=1e-6, atol=1e-8)
            assert answer.success, answer.message
            unknown = answer.y[:, -1]
        begin = float(time)
        if begin in times:
            parts = unknown[:frozen], unknown[frozen:-1]
            found.append(Shell(depth[:frozen], *parts, float(unknown[-1])))
        else:
            stress, flow, strain = np.split(unknown, [frozen, 2 * frozen])
            unknown = np.concatenate([stress, [0.0], flow, [0.0], strain])
            frozen += 1
    return found
