"""Laws, random states and helpers shared by the tests of the laws.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from castfem.base.tables import Constant, celsius
from castfem.base.types import Array
from castfem.physics.constitutive import (
    Elasticity,
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
from castfem.physics.constitutive.hardening_laws import RATE, TENSOR

ZERO = 273.15
SOLIDUS, LIQUIDUS = 1723.0, 1775.0
FADING = celsius([700, 1000, 1400], [1e4, 100.0, 0.1], logarithmic=True)  # s
STRENGTH = celsius([800, 1000, 1200, 1400], [108e6, 55e6, 30e6, 17e6], logarithmic=True)


def steel_like(ratio: float = 1e-6) -> Elasticity:
    """Return the elasticity of steel from cold solid to liquid."""
    return load_elasticity(solidity=Solidity.between(SOLIDUS, LIQUIDUS, stiffness_ratio=ratio))


def hoff(
    elasticity: Elasticity, p1: float, p3: float, p4: float, limit: float | None = None
) -> NortonHoff:
    """Return law (163) with a strength over temperature and constant exponents."""
    yield_limit = None if limit is None else Constant(limit)
    return NortonHoff(elasticity, STRENGTH, Constant(p1), Constant(p3), Constant(p4), yield_limit)


def every_law() -> dict[str, RadialReturn]:
    """Return all laws, some with extreme parameters, with `steel_like` elasticity."""
    el = steel_like()
    return {
        "elastic": ThermoElastic(el),
        "plastic": PerfectlyPlastic(el, celsius([1000, 1494], [20e6, 1e4])),
        "plastic, 1000-fold in 0.1 K": PerfectlyPlastic(
            el, celsius([1200.0, 1200.1], [20e6, 2e4], logarithmic=True)
        ),
        "creep n=5": NortonCreep.constant(el, 1e-3, 20e6, 5.0),
        "creep n=50": NortonCreep.constant(el, 1e-3, 20e6, 50.0),
        "hoff": load_law("norton_hoff_kozlowski", el),
        "hoff p1<0 p4<0": load_law("norton_hoff_kozlowski_p1", el),
        "hoff p3=0.02 p4=0.6": hoff(el, 8.0, 0.02, 0.6),
        "hoff p3=1 p4=0": hoff(el, -10.0, 1.0, 0.0),
        "hoff softening": hoff(el, 50.0, 0.15, -0.01),
        "viscous": hoff(el, -10.0, 0.15, 0.1, 0.0),
        "viscous p3=0.02 softening": hoff(el, 30.0, 0.02, 0.6, 0.0),
        "yield limit": hoff(el, 3.0, 0.15, 0.2, 10e6),
        "steel": load_law("kozlowski_zhu", el, carbon=0.08),
        "steel mixed": load_law("kozlowski_zhu_mixed", el, carbon=0.12),
        **hardening_laws(el),
    }


def hardening_laws(el: Elasticity) -> dict[str, RadialReturn]:
    """Return laws with signed hardening, with recovery, or with both."""
    steel = load_law("kozlowski_zhu", el, carbon=0.08)
    blend = replace(steel, blend=0.2)
    fitted = load_law("norton_hoff_kozlowski", el)
    steep = hoff(el, 8.0, 0.02, 0.6)
    viscous = hoff(el, -10.0, 0.15, 0.1, 0.0)
    limited = hoff(el, 3.0, 0.15, 0.2, 10e6)
    return {
        "steel signed": replace(steel, hardening="signed"),
        "steel recovering": replace(steel, recovery_time=FADING),
        "steel blend signed recovering": replace(blend, hardening="signed", recovery_time=FADING),
        "hoff signed": replace(fitted, hardening="signed"),
        "hoff recovering": replace(fitted, recovery_time=FADING),
        "hoff p3=0.02 p4=0.6 signed recovering": replace(
            steep, hardening="signed", recovery_time=FADING
        ),
        "viscous signed recovering": replace(viscous, hardening="signed", recovery_time=FADING),
        "yield limit signed": replace(limited, hardening="signed"),
    }


def tensor(state: Array) -> Array:
    """Return the strain tensors of states of a signed law as Mandel vectors (n, 4)."""
    xx, yy, xy = state[:, :3].T
    return np.column_stack([xx, yy, -(xx + yy), xy])


def deviator(stress: Array) -> Array:
    """Return the deviators of Mandel vectors (n, 4)."""
    return stress - stress[:, :3].mean(axis=1)[:, None] * np.array([1.0, 1.0, 1.0, 0.0])


@dataclass(frozen=True)
class States:
    """Random initial values of a step for n points in groups that share a time step."""

    temperature_old: Array
    temperature: Array
    strain: Array
    thermal: Array
    stress: Array
    state: Array
    dt: Array
    group: npt.NDArray[np.intp]

    def parts(self) -> list[tuple[MaterialStep, Array, Array]]:
        """Return the step, stress and state of each group."""
        groups = []
        for g in np.unique(self.group):
            i = self.group == g
            step = MaterialStep(
                self.strain[i], self.thermal[i], self.temperature_old[i], self.temperature[i],
                float(self.dt[i][0]),
            )  # fmt: skip
            groups.append((step, self.stress[i], self.state[i]))
        return groups


def random_states(law: RadialReturn, n: int, groups: int, seed: int) -> States:
    """Return states: 20-1600 degC, 1e-8-1e2 1/s, strains 0-1, steps 1e-6-1e3 s, up to 10 GPa."""
    rng = np.random.default_rng(seed)
    old = rng.uniform(293.0, 1873.0, n)
    new = np.where(rng.random(n) < 0.5, old, rng.uniform(293.0, 1873.0, n))
    group = np.sort(rng.integers(0, groups, n))
    dt = (10.0 ** rng.uniform(-6.0, 3.0, groups))[group]
    strain = _directions(rng, n) * (10.0 ** rng.uniform(-8.0, 2.0, n) * dt)[:, None]
    stress = _directions(rng, n) * 10.0 ** rng.uniform(0.0, 10.0, n)[:, None]
    stress[rng.random(n) < 0.1] = 0.0
    # Half of the points are strained along their stress, as in proportional loading.
    along = rng.random(n) < 0.5
    size = np.linalg.norm(stress, axis=1)[along][:, None]
    sign = rng.choice([-1.0, 1.0], along.sum())[:, None]
    length = np.linalg.norm(strain[along], axis=1)[:, None]
    strain[along] = np.where(size > 0.0, sign * length * stress[along] / np.maximum(size, 1.0), 0.0)
    state = law.initial_state(n)
    if state.shape[1] > 0:
        state[:, 0] = np.where(rng.random(n) < 0.2, 0.0, 10.0 ** rng.uniform(-8.0, 0.0, n))
    if RATE in law.state_names:
        rate = np.where(rng.random(n) < 0.2, 0.0, 10.0 ** rng.uniform(-10.0, 3.0, n))
        state[:, law.state_names.index(RATE)] = rate
    if law.state_names[:3] == TENSOR:
        # One third along the stress, one third against it, one third in a random direction.
        random = _directions(rng, n)
        random[:, :3] -= random[:, :3].mean(axis=1)[:, None]
        along = deviator(stress)
        length = np.linalg.norm(along, axis=1)[:, None]
        with np.errstate(invalid="ignore"):
            aligned = np.where(length > 0.0, along / length, random)
        kind = rng.integers(0, 3, n)[:, None]
        way = np.where(kind == 0, aligned, np.where(kind == 1, -aligned, random))
        state[:, :3] = state[:, :1] * way[:, (0, 1, 3)]
    thermal = np.where(new < SOLIDUS, rng.uniform(-1e-2, 1e-2, n), 0.0)
    return States(old, new, strain, thermal, stress, state, dt, group)


def _directions(rng: np.random.Generator, n: int) -> Array:
    d = rng.normal(size=(n, 4))
    return d / np.linalg.norm(d, axis=1)[:, None]


def one(
    law: RadialReturn, strain: list[float], dt: float = 1.0, temperature: float = 1273.15,
    stress: Array | None = None, state: Array | None = None,
) -> Response:  # fmt: skip
    """Return the response of a single point at constant temperature."""
    t = np.full(1, temperature)
    step = MaterialStep(np.array([strain]), np.zeros(1), t, t, dt)
    return law.integrate(
        step,
        np.zeros((1, 4)) if stress is None else stress,
        law.initial_state(1) if state is None else state,
    )


def norton_relaxation(
    time: npt.ArrayLike, stress: float, young: float, factor: float, exponent: float
) -> Array:
    """Return the stress of a bar of fixed length in Norton creep, Pa; `factor`: rate at 1 Pa."""
    m = exponent - 1.0
    loss = m * young * factor * stress**m * np.asarray(time, float)
    return np.asarray(stress * (1.0 + loss) ** (-1.0 / m))
