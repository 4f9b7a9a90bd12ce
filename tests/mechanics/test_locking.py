"""Why the mean stress has a poorer rule: with one rule for all, cells lock (docs/mechanics.md)."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.physics.mechanics.quadrature_rules import Integration
from castfem.physics.mechanics.supports import SurfacePressure
from mechanics.setups import RING_GROUPS, SliceSetup, elastic, mapped, ring

INNER, OUTER, PRESSURE, E, NU = 0.02, 0.04, 1e7, 200e9, 0.499999
ONE_RULE = Integration(4, 4, linear=False)


def tube(cells: int, cell: str, rules: Integration | None, law: object = None) -> SliceSetup:
    """A quarter of a thick tube under inner pressure, in plane strain."""
    return SliceSetup(
        mapped(cells, cells, ring(INNER, OUTER), cell, 2, RING_GROUPS),
        law or elastic(E, NU),
        given={
            "planes": PlainPlanes(()),
            "integration": rules,
            "loads": (SurfacePressure(("inner",), lambda t: PRESSURE),),
        },
    )


def bore(setup: SliceSetup, nodal: Array) -> float:
    """Radial part of a nodal field at the bore."""
    places = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    at = int(np.argmin(np.abs(places - [INNER, 0.0]).sum(axis=1)))
    return float(nodal.reshape(-1, 2)[at, 0])


def lame_errors(setup: SliceSetup) -> tuple[float, float]:
    """Error of the bore's displacement, and of the mean stress (rms over the pressure)."""
    setup.step(1.0)
    share = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    exact = share * (1 + NU) / E * ((1 - 2 * NU) * INNER + OUTER**2 / INNER)
    mean = setup.stress[:, :3].mean(axis=1) - 2 * (1 + NU) / 3 * share
    moved = bore(setup, setup.state.displacement) / exact - 1
    return abs(moved), float(np.sqrt(np.mean(mean**2))) / PRESSURE


@pytest.mark.parametrize(
    ("cell", "displacement", "stress"), [("quadrilateral", 2e-4, 2e-4), ("triangle", 2e-3, 1e-2)]
)
def test_nearly_incompressible_tube(cell: str, displacement: float, stress: float) -> None:
    found = lame_errors(tube(4, cell, None))
    assert found[0] < displacement
    assert found[1] < stress
    locked = lame_errors(tube(4, cell, ONE_RULE))
    assert locked[0] > 5 * found[0]
    assert locked[1] > 0.5


def test_creep_of_a_tube() -> None:
    """The stationary speed of the bore under Norton's law; with one rule it stands still."""
    speeds = []
    for rules in (None, ONE_RULE):
        law = NortonCreep.constant(Elasticity.constant(20e9, 0.3), 1e-9, 1e6, 5.0)
        setup, time = tube(4, "quadrilateral", rules, law), 0.0
        for dt in 2.0 ** np.arange(20):
            time += dt
            setup.step(time)
        speeds.append(bore(setup, setup.state.rate) / 1.037924e-5)
    assert speeds[0] == pytest.approx(1.0, abs=5e-4)
    assert speeds[1] < 0.1
