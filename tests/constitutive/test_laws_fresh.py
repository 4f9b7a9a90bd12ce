"""Points with a stress and no history, solidified under load: they must answer smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.physics.constitutive.base import MaterialStep, equivalent_stress
from castfem.physics.constitutive.elasticity import Solidity
from castfem.physics.constitutive.parameters import load_elasticity, load_law

N = 4001


@pytest.mark.parametrize("celsius", [1100.0, 1300.0, 1449.0])
@pytest.mark.parametrize("dt", [0.2, 0.0125, 1e-4])
def test_a_small_load_on_a_fresh_point_makes_no_jump(celsius: float, dt: float) -> None:
    """Shear grows through the yield limit: the stress follows without a jump or a fall."""
    elastic = load_elasticity("elastic_steel", Solidity())
    law = load_law("norton_hoff_kozlowski", elastic)
    hot = np.full(N, celsius + 273.15)
    shear = 0.5 * float(elastic.young(hot[:1])[0]) / (1.0 + float(elastic.poisson(hot[:1])[0]))
    for carried in (0.2e6, 1.5e6, 4e6):
        stress = np.zeros((N, 4))
        stress[:, 3] = carried * np.sqrt(2.0 / 3.0)
        gain = np.linspace(0.0, 3e-6, N)  # Mandel shear strain
        strain = np.zeros((N, 4))
        strain[:, 3] = gain
        step = MaterialStep(strain, np.zeros(N), hot, hot, dt)
        found = law.integrate(step, stress, law.initial_state(N))
        q = equivalent_stress(found.stress)
        rise = np.diff(q) / (np.sqrt(6.0) * shear * np.diff(gain))  # 1: elastic
        assert rise.min() > -1e-3 and rise.max() < 1.2  # 3G/E of elasticity: docs/laws.md
