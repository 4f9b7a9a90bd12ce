"""The linear systems of a stage: solved by iteration, factored where that fails."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from castfem import meshes
from castfem.physics.thermal import flux_laws
from castfem.physics.thermal.problem import FACTORED
from thermal.setups import ThermalSetup, constant_steel

STEEL = constant_steel(1725.0, 1775.0, datum=1815.0)


def cooled(step: float, **options: Any) -> ThermalSetup:
    mesh = meshes.build(
        "rectangle", width=0.125, height=0.125, corner_radius=0.005, symmetry="quarter",
        surface_size=1e-3, core_size=8e-3, cell="quadrilateral",
    )  # fmt: skip
    setup = ThermalSetup(mesh, STEEL, 1815.0, options=options)
    names = [g for g in mesh.groups if not g.startswith("symmetry")]
    setup.cool(*((name, flux_laws.Contact(1600.0, 433.15, 0.15)) for name in names))
    return setup.advance(10.0, step)


def test_iterating_is_as_good_as_factorising() -> None:
    iterated = cooled(0.25)
    factored = cooled(0.25, ksp_type="preonly", pc_type="lu")
    assert FACTORED not in iterated.problem._solvers
    one, other = (s.state.point.temperature for s in (iterated, factored))
    assert np.abs(one - other).max() < 1e-6
    assert iterated.state.removed == pytest.approx(factored.state.removed, rel=1e-9)
    # Newton's method does not feel it.
    assert iterated.problem.iterations <= factored.problem.iterations + 3


def test_where_iterating_fails_it_factorises() -> None:
    failing = cooled(1.0, ksp_max_it=1, ksp_rtol=1e-12)
    sound = cooled(1.0)
    assert FACTORED in failing.problem._solvers
    one, other = (s.state.point.temperature for s in (failing, sound))
    assert np.abs(one - other).max() < 1e-6


@pytest.mark.parametrize("step", [1e3, 1e5])
def test_steps_far_too_long(step: float) -> None:
    """Close to a steady state in one step: the stage is almost a Laplacian."""
    setup = cooled(10.0)
    setup.advance(10.0 + step, step)
    temperature = setup.state.point.temperature
    assert temperature.min() > 433.15 - 1e-3
    assert temperature.max() < 1815.0 + 1e-3
    assert abs(setup.results[-1].balance) < 1e-9
