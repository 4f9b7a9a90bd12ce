"""The Jacobian and finite differences of the residual; forces by operators and by forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep, ThermoElastic
from castfem.physics.mechanics.force_operators import ForceOperators
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.machine_bending import BentPlanes
from castfem.physics.mechanics.slice_definition import Ferrostatic
from castfem.physics.mechanics.supports import SurfacePressure, Traction
from mechanics.setups import SliceSetup, elastic, expansion, mapped, skewed

FREE = ("left", "bottom", "right", "top")
STEEL = Elasticity.constant(200e9, 0.3)
# Moduli that change eightfold over the section, and also within a cell.
SOFT = Elasticity(lambda T: 200e9 * np.exp(-T / 50.0), lambda T: 0.2 + 1e-3 * T)
LAWS = {
    "elastic": elastic(),
    "softening": ThermoElastic(SOFT),
    "creep": NortonCreep.constant(STEEL, 1e-2, 1e8, 3.0),
}
PLANES: dict[str, Any] = {
    "all free": PlainPlanes(("a0", "a1", "a2", "across")),
    "bent": BentPlanes(lambda t: 0.5 * t, 0.03),
    "imposed": PlainPlanes((), {"a0": lambda t: 0.05 * t}),
}


def jacobians(setup: SliceSetup, size: float) -> tuple[Array, Array, int]:
    """Return the Jacobian and finite differences at a random state in the second of two steps."""
    problem, rng = setup.problem, np.random.default_rng(1)
    vector = problem.solver.x.duplicate()
    n = vector.getLocalSize()

    def residual(unknowns: Array) -> Array:
        vector.setArray(unknowns)
        out = vector.duplicate()
        problem.residual(vector, out)
        return np.array(out.getArray())

    first = size * rng.uniform(-1, 1, n)
    heat = setup.field(lambda x, y: 100 + 1000 * x)
    problem.begin(setup.state, 0.5, heat)
    residual(first)
    old = setup.stepper._state(setup.state, 0.5, heat)
    problem.begin(old, 1.0, setup.field(lambda x, y: 200 + 500 * y))
    at = first + size * rng.uniform(-1, 1, n)
    residual(at)
    problem.jacobian(vector, problem.solver.snes.getJacobian()[1])
    operator = problem.bordered.operator
    columns, differences = np.zeros((n, n)), np.zeros((n, n))
    unit, image = vector.duplicate(), vector.duplicate()
    step = 1e-5 * size
    for j in range(n):
        direction = np.zeros(n)
        direction[j] = 1.0
        unit.setArray(direction)
        operator.mult(unit, image)
        columns[:, j] = image.getArray()
        forward, backward = residual(at + step * direction), residual(at - step * direction)
        differences[:, j] = (forward - backward) / (2 * step)
    free = np.ones(n, dtype=bool)
    free[problem.constraints.dofs] = False
    return columns[np.ix_(free, free)], differences[np.ix_(free, free)], problem.free


# All combinations of cells, strain and planes; laws, which enter by their tangent only, alternate.
CASES = [
    (cell, large, list(LAWS)[(i + j + k) % len(LAWS)], planes)
    for i, cell in enumerate(("quadrilateral", "triangle"))
    for j, large in enumerate((False, True))
    for k, planes in enumerate(PLANES)
]


@pytest.mark.parametrize(("cell", "large", "law", "planes"), CASES)
def test_jacobian_matches_differences(cell: str, large: bool, law: str, planes: str) -> None:
    setup = SliceSetup(
        mapped(2, 2, skewed(0.1, 0.06), cell, groups=FREE),
        LAWS[law],
        expansion(1e-5),
        settings={
            "planes": PLANES[planes],
            "large_strain": large,
            "ferrostatic": Ferrostatic(lambda t: 5e6 * t, lambda T: np.clip(1 - T / 300, 0, 1)),
            "loads": (
                SurfacePressure(("right",), lambda t: 1e9 * t),
                Traction(("top",), lambda t: (1e6, 2e6)),
            ),
        },
    )
    exact, found, free = jacobians(setup, 1e-3 if large else 2e-5)
    assert np.abs(exact - found).max() < 2e-7 * np.abs(found).max()
    if free:
        tail, head = slice(-free, None), slice(None, -free)
        blocks = ((tail, head), (head, tail), (tail, tail))
        for block in blocks:
            assert np.abs(exact - found)[block].max() < 2e-6 * np.abs(found[block]).max()
    if not large and planes != "bent":
        # Symmetry is required by the Cholesky factorisation at small strain.
        assert np.abs(exact - exact.T).max() < 1e-13 * np.abs(exact).max()


def test_laws_change_volume_elastically() -> None:
    """The split into deviator and mean stress requires this."""
    from castfem.physics.constitutive.base import MaterialStep

    law = LAWS["creep"]
    assert not isinstance(law, ThermoElastic)
    rng = np.random.default_rng(0)
    n = 50
    step = MaterialStep(
        rng.normal(size=(n, 4)) * 1e-3, np.zeros(n), np.full(n, 300.0), np.full(n, 300.0), 1.0
    )
    tangent = law.integrate(step, np.zeros((n, 4)), law.initial_state(n)).tangent
    one = np.array([1.0, 1.0, 1.0, 0.0])
    bulk = tangent[:, :3, :3].sum(axis=(1, 2)) / 9
    for side in (tangent @ one, np.einsum("i,nij->nj", one, tangent)):
        assert np.abs(side - 3 * bulk[:, None] * one).max() < 1e-10 * bulk.max()


GROUPS = ("left", "bottom", "right", "top")


def evaluated(setup: SliceSetup) -> Array:
    """Evaluate a random motion in a cooling step; return the temperatures of the vertices, K."""
    problem = setup.problem
    heat = setup.field(lambda x, y: 300.0 + 4000.0 * x + 2000.0 * y)
    problem.begin(setup.state, 1.0, heat)
    vector = problem.solver.x.duplicate()
    vector.setArray(1e-5 * np.random.default_rng(1).standard_normal(vector.getLocalSize()))
    problem.residual(vector, vector.duplicate())
    return heat


def pressed(cell: str, order: int, outside: str) -> SliceSetup:
    """Set up a skewed block under liquid pressure with all generalized strains free."""
    solid = Ferrostatic(
        lambda t: 2e6 * t,
        lambda t: np.clip(t / 1000.0, 0.0, 1.0),
        outside=outside,  # type: ignore[arg-type]
    )
    return SliceSetup(
        mapped(3, 2, skewed(0.1, 0.06), cell, order=order, groups=GROUPS),
        elastic(),
        expansion(1e-5),
        settings={"planes": PlainPlanes(("a0", "a1", "a2", "across")), "ferrostatic": solid},
    )


@pytest.mark.parametrize("outside", ["free", "held"])
@pytest.mark.parametrize(
    ("cell", "order"), [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 1)]
)
def test_force_operators_match_the_forms(cell: str, order: int, outside: str) -> None:
    """Nodal forces and work on the planes by stress, inner pressure and supported liquid."""
    setup = pressed(cell, order, outside)
    heat = evaluated(setup)
    problem, state = setup.problem, setup.problem.residual_state
    operators = ForceOperators(problem)
    nodal, work = operators.of_stress(problem.response.stress[None])
    inside, on_planes = operators.of_pressure(problem.pressure[:, None])
    nodal, work = nodal[:, 0] + inside[:, 0], work[:, 0] + on_planes[:, 0]
    if outside == "held":
        liquid = problem.slice.ferrostatic
        vertices = liquid.pressure(heat, 1.0)
        nodal += operators.of_held_liquid(vertices[:, None])[:, 0]
    assert np.abs(state.forces).max() > 1.0
    assert np.abs(nodal - state.forces).max() < 1e-12 * np.abs(nodal).max()
    expected = problem.planes.work_on(np.eye(4))
    assert np.abs(work - expected).max() < 1e-12 * np.abs(expected).max()


def test_strain_operator_matches_the_step() -> None:
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
    expected = problem.kinematics.increments()[0]
    found = operators.strains(motion[:, None], strains[:, None])[0]
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
