"""The laws in a solidifying half-space, by the closed form of Weiner and Boley (1963).

All points of a strip across the shell have the same two in-plane strains and no stress across it.
The temperature is exact, so only the laws and their time integration are tested: freezing, thermal
strain from the solidus on, yield stress falling with temperature, unloading, yield in reverse.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.special import erf

from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.constitutive import (
    Elasticity,
    MaterialStep,
    NortonHoff,
    Response,
    Solidity,
    load_elasticity,
    load_law,
)
from castfem.physics.constitutive.flow_laws import RadialReturn

from .samples import ZERO

DIFFUSIVITY = 33.0 / (7500.0 * 661.0)
COLD, MELTING = 1000.0 + ZERO, 1494.4 + ZERO
SOLIDUS, LIQUIDUS = 1494.35 + ZERO, 1494.45 + ZERO
ALPHA, FRONT = 2e-5, 0.665780
# Ends of the three zones and the strain rate of the closed form (re-derived, to rounding).
COMPRESSED, STRETCHED, SPEED = 0.147449, 0.263898, -4.053264e-3


def temperature(x: Array, t: float) -> Array:
    """Return the one-phase Stefan solution, K; the melt is at 1495 degC."""
    if t <= 0.0:
        return np.full_like(x, 1495.0 + ZERO)
    zeta = x / (2.0 * np.sqrt(DIFFUSIVITY * t))
    solid = COLD + (MELTING - COLD) * erf(zeta) / erf(FRONT)
    return np.where(zeta < FRONT, solid, 1495.0 + ZERO)


def weiner_boley(x: Array, t: float) -> Array:
    """Return the in-plane stress of the closed form, MPa."""
    zeta = x / (2.0 * np.sqrt(DIFFUSIVITY * t))

    def hot(z: Array | float) -> Array:
        return np.asarray(1000.0 + 494.4 * erf(z) / erf(FRONT))

    yields = 20.0 * (1494.4 - hot(zeta)) / 494.4
    last = 20.0 * (1494.4 - hot(STRETCHED)) / 494.4
    modulus = 40e3 / 0.7
    strain = SPEED * np.log(zeta / STRETCHED) + ALPHA * (hot(zeta) - hot(STRETCHED))
    inner = np.where(zeta < STRETCHED, last - modulus * strain, yields)
    return np.where(zeta < COMPRESSED, -yields, np.where(zeta < FRONT, inner, 0.0))


@dataclass
class Strip:
    """Points across a strip, integrated over time.

    Attributes:
        law: Law of the steel.
        x: Depths of the points, m.
        iterations: Newton iterations of each step.
        stress: Mandel components: across the shell, two in-plane, shear.
    """

    law: RadialReturn
    x: Array

    def __post_init__(self) -> None:
        n = len(self.x)
        self.stress, self.state = np.zeros((n, 4)), self.law.initial_state(n)
        self.iterations: list[int] = []
        self.across, self.along, self.time = np.zeros(n), 0.0, 0.0
        self.heat = temperature(self.x, 0.0)

    def advance(self, dt: float, end: float) -> Strip:
        """Integrate to a time, s."""
        while self.time < end - 1e-9:
            self._advance(dt)
        return self

    def _advance(self, dt: float) -> None:
        """Solve for the in-plane strain by bracketed Newton: the force of the strip is monotone."""
        heat = temperature(self.x, self.time + dt)
        solid = [np.minimum(t - SOLIDUS, 0.0) for t in (self.heat, heat)]
        thermal = ALPHA * (solid[1] - solid[0])
        coefficients = self.law.coefficients(self.heat, heat)

        def respond() -> Response:
            strain = np.zeros((len(self.x), 4))
            strain[:, 0], strain[:, 1:3] = self.across, self.along
            step = MaterialStep(strain, thermal, self.heat, heat, dt)
            return self.law.integrate(step, self.stress, self.state, coefficients=coefficients)

        low, high = -np.inf, np.inf
        self.iterations.append(0)
        for _ in range(100):
            self.iterations[-1] += 1
            found, side = self._free_across(respond)
            force = found.stress[:, 1].mean()
            if abs(force) < 1e-2 or high - low < 1e-15:
                break
            low, high = (low, self.along) if force > 0.0 else (self.along, high)
            c = found.tangent
            stiff = (c[:, 1, 1] + c[:, 1, 2] - c[:, 1, 0] * side).mean()
            move = np.clip(-force / stiff, -1e-3, 1e-3) if stiff > 0.0 else np.nan
            new = self.along + move
            new = new if low < new < high else 0.5 * (low + high)
            self.across -= side * (new - self.along)
            self.along = new
        else:
            raise AssertionError("the strip found no balance")
        self.stress, self.state, self.heat = found.stress, found.state, heat
        self.time += dt

    def _free_across(self, respond: object) -> tuple[Response, Array]:
        """Solve for zero stress across; return the response and d(across) / d(along)."""
        assert callable(respond)
        for _ in range(60):
            found = respond()
            c, residual = found.tangent, found.stress[:, 0]
            scale = np.maximum(1e-3 * c[:, 0, 0], np.abs(found.stress).max(axis=1))
            if (np.abs(residual) <= 1e-10 * scale).all():
                break
            self.across = self.across - residual / c[:, 0, 0]
        return found, (c[:, 0, 1] + c[:, 0, 2]) / c[:, 0, 0]


def strip(law: RadialReturn, cell: float, width: float = 10e-3) -> Strip:
    return Strip(law, (np.arange(round(width / cell)) + 0.5) * cell)


def freezing(ratio: float = 1e-6) -> Solidity:
    return Solidity.between(SOLIDUS, LIQUIDUS, stiffness_ratio=ratio)


@pytest.mark.parametrize(("cell", "error"), [(0.1e-3, 0.0015), (0.5e-3, 0.03)])
def test_strip_has_the_stress_of_weiner_and_boley(cell: float, error: float) -> None:
    """The rms error over the shell at 5 s, relative to 20 MPa, with steps of 0.1 s."""
    law = load_law("weiner_boley", Elasticity.constant(40e9, 0.3, freezing()))
    found = strip(law, cell).advance(0.1, 5.0)
    shell = found.x < FRONT * 2.0 * np.sqrt(DIFFUSIVITY * 5.0)
    expected = weiner_boley(found.x[shell], 5.0)
    both = found.stress[shell][:, 1:3] / 1e6
    assert np.sqrt(np.mean((both[:, 0] - expected) ** 2)) < error * 20.0
    np.testing.assert_allclose(both[:, 0], both[:, 1], atol=1e-6)
    assert np.abs(found.stress[~shell]).max() < 2e4  # the melt carries nothing


def test_closed_form_has_the_published_values() -> None:
    x = np.array([1e-9, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) * 1e-3
    table = [-20.0, -17.0149, -2.0916, 11.1986, 8.4924, 5.9232, 3.5397, 1.3614]
    np.testing.assert_allclose(weiner_boley(x, 5.0), table, atol=2e-4)


@pytest.mark.parametrize("name", ["norton_hoff_kozlowski", "kozlowski_zhu"])
def test_shorter_steps_need_fewer_iterations_and_agree(name: str) -> None:
    law = load_law(name, load_elasticity(solidity=freezing()), carbon=0.27)
    runs = [strip(law, 0.25e-3).advance(dt, 3.0) for dt in (0.3, 0.1, 0.0333333333333)]
    means = [np.mean(run.iterations) for run in runs]
    assert means[0] > means[1] > means[2] and means[2] < 3.5
    assert max(max(run.iterations) for run in runs) < 25
    x = runs[2].x
    shell = (x > 1e-3) & (x < 5.5e-3)  # the surface keeps stress from the sudden start
    gaps = [np.std(run.stress[shell, 1] - runs[2].stress[shell, 1]) for run in runs[:2]]
    assert gaps[1] < 0.6 * gaps[0] and gaps[1] < 0.3e6


def test_automatic_and_viscous_limits_agree_on_a_shell() -> None:
    """The two readings of (163) differ by a few per cent of the stress, not more."""
    automatic = load_law("norton_hoff_kozlowski", load_elasticity(solidity=freezing()))
    assert isinstance(automatic, NortonHoff)
    viscous = replace(automatic, yield_limit=Constant(0.0))
    a, b = (strip(law, 0.25e-3).advance(0.1, 3.0).stress[:, 1] for law in (automatic, viscous))
    assert np.abs(a - b).max() < 0.05 * np.abs(a).max()
