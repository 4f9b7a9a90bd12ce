"""Forces by operators are those of the compiled forms."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.physics.mechanics.definition import Ferrostatic
from castfem.physics.mechanics.force_operators import ForceOperators
from castfem.physics.mechanics.planes import PlainPlanes
from mechanics.setups import SliceSetup, elastic, expansion, mapped, skewed

GROUPS = ("left", "bottom", "right", "top")


def evaluated(setup: SliceSetup) -> Array:
    """Moves it at random through a step in which it cools; temperatures of the vertices, K."""
    problem = setup.problem
    heat = setup.field(lambda x, y: 300.0 + 4000.0 * x + 2000.0 * y)
    problem.begin(setup.state, 1.0, heat)
    vector = problem.solver.x.duplicate()
    vector.setArray(1e-5 * np.random.default_rng(1).standard_normal(vector.getLocalSize()))
    problem.residual(vector, vector.duplicate())
    return heat


def pressed(cell: str, order: int, outside: str) -> SliceSetup:
    """A skewed block, warm on one side, that liquid presses on; all generalized strains free."""
    solid = Ferrostatic(
        lambda t: 2e6 * t,
        lambda t: np.clip(t / 1000.0, 0.0, 1.0),
        outside=outside,  # type: ignore[arg-type]
    )
    return SliceSetup(
        mapped(3, 2, skewed(0.1, 0.06), cell, order=order, groups=GROUPS),
        elastic(),
        expansion(1e-5),
        given={"planes": PlainPlanes(("a0", "a1", "a2", "across")), "ferrostatic": solid},
    )


@pytest.mark.parametrize("outside", ["free", "held"])
@pytest.mark.parametrize(
    ("cell", "order"), [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 1)]
)
def test_forces_and_work_are_those_of_the_forms(cell: str, order: int, outside: str) -> None:
    """Stress, pressure inside, and liquid held from outside; nodes and planes."""
    setup = pressed(cell, order, outside)
    heat = evaluated(setup)
    problem, state = setup.problem, setup.problem.residual_state
    assert state is not None
    operators = ForceOperators(problem)
    nodal, work = operators.of_stress(problem.response.stress[None])
    inside, on_planes = operators.of_pressure(problem.pressure[:, None])
    nodal, work = nodal[:, 0] + inside[:, 0], work[:, 0] + on_planes[:, 0]
    if outside == "held":
        liquid = problem.slice.ferrostatic
        assert liquid is not None
        vertices = liquid.pressure(heat, 1.0)
        nodal += operators.of_held_liquid(vertices[:, None])[:, 0]
    assert np.abs(state.forces).max() > 1.0
    assert np.abs(nodal - state.forces).max() < 1e-12 * np.abs(nodal).max()
    known = problem.planes.work_on(np.eye(4))
    assert np.abs(work - known).max() < 1e-12 * np.abs(known).max()


def test_strain_is_that_of_the_step() -> None:
    setup = pressed("quadrilateral", 2, "free")
    evaluated(setup)
    problem, rng = setup.problem, np.random.default_rng(0)
    motion = 1e-5 * rng.standard_normal(dof_values.owned_of(problem.space))
    strains = 1e-5 * rng.standard_normal(4)
    problem.fields.u.x.array[:] = problem.fields.u_old.x.array + motion
    problem.fields.generalized_strains.value[:] = (
        problem.fields.generalized_strains_old.value + strains
    )
    operators = ForceOperators(problem)
    known, found = (
        problem.kinematics.increments()[0],
        operators.strains(motion[:, None], strains[:, None]),
    )
    assert np.abs(found[0] - known).max() < 1e-12 * np.abs(known).max()
