"""Linearised contact, compared with differences of contact evaluated at moved states."""

from __future__ import annotations

import numpy as np
import pytest
from mechanics.setups import SliceSetup

from castfem.base.types import Array
from castfem.physics.contact.linearised import GivenChanges, LinearisedContact, WallMet
from castfem.physics.contact.state import CONTACT, OPEN, SLIP
from castfem.physics.mechanics.force_operators import ForceOperators
from contact.test_tangent import at_a_round_wall, touching

SIZE = 2e-5


def begin_second_step(setup: SliceSetup) -> Array:
    """Begin the second of two steps at a random state; return its unknowns."""
    problem, rng = setup.problem, np.random.default_rng(1)
    count = problem.owned + problem.free
    heat = setup.field(lambda x, y: 100 + 1000 * x)
    first = SIZE * rng.uniform(-1, 1, count)
    problem.begin(setup.state, 0.5, heat)
    residual(setup, first)
    setup.state = setup.stepper._state(setup.state, 0.5, heat)
    problem.begin(setup.state, 1.0, setup.field(lambda x, y: 200 + 500 * y))
    return first + SIZE * rng.uniform(-1, 1, count)


def residual(setup: SliceSetup, local: Array) -> tuple[Array, Array]:
    """Return the forces of contact only (owned,), and their work on generalized strains (4,)."""
    problem = setup.problem
    vector = problem.solver.x.duplicate()
    vector.setArray(local)
    problem.residual(vector, vector.duplicate())
    state = problem.residual_state
    stress = ForceOperators(problem).of_stress(problem.response.stress[None])
    return state.forces - stress[0][:, 0], problem.interactions.work_on(np.eye(4))


@pytest.mark.parametrize("friction", ["none", "coulomb", "viscous", "lubricant"])
@pytest.mark.parametrize("method", ["penalty", "nitsche"])
def test_changes_of_forces_and_state_match_differences(method: str, friction: str) -> None:
    """For open, sticking and sliding points: forces, work on the planes, and the new state."""
    setup = touching("quadrilateral", False, method, friction, SIZE)
    problem, at = setup.problem, begin_second_step(setup)
    direction = np.random.default_rng(2).uniform(-1, 1, len(at))
    wall, old = problem.contact, setup.state
    assert wall is not None and old.contact is not None
    residual(setup, at)
    status = wall.status[0].copy(), wall.status[1].copy()
    scaled = problem.planes.scaled
    strains = scaled.generalized_strains(at[problem.owned :])
    before = old.displacement, old.generalized_strains
    contact = LinearisedContact(wall, old.contact, (at[: problem.owned], strains), before)
    motion = direction[: problem.owned, None]
    along = scaled.directions @ direction[problem.owned :, None]
    stress = liquid = None
    if wall.stress is not None:
        strain = wall.stress.strained.increments(motion[:, 0], along[:, 0])
        stress = np.einsum("nij,nj->ni", wall.stress.response.tangent, strain)[:, :, None]
        liquid = np.zeros((len(strain), 1))
    unchanged = GivenChanges.none(wall.facets.count, 1)
    found = contact.changes(unchanged, wall.strand.changes(motion, along), stress, liquid)
    nodal, work = contact.forces(found)
    step = 1e-6 * SIZE
    ends, states = [], []
    for sign in (1.0, -1.0):
        ends.append(residual(setup, at + sign * step * direction))
        states.append(wall.state().numbers())
        assert all(np.array_equal(*pair) for pair in zip(wall.status, status, strict=True))
    assert {OPEN, SLIP} <= set(wall.state().status.tolist())
    for change, (up, down) in zip((nodal[:, 0], work[:, 0]), zip(*ends, strict=True), strict=True):
        expected = (up - down) / (2.0 * step)
        assert np.abs(change - expected).max() < 1e-6 * np.abs(expected).max()
    for name, values in found.numbers().items():
        with np.errstate(invalid="ignore"):
            expected = (states[0][CONTACT + name] - states[1][CONTACT + name]) / (2.0 * step)
        expected = np.nan_to_num(expected)
        error = np.abs(values[..., 0] - expected).max()
        assert error <= 1e-6 * np.abs(expected).max() + 1e-9, name


def test_change_of_gap_and_normal_matches_differences() -> None:
    """On a round wall that is oblique to the surface of the strand."""
    wall = at_a_round_wall(large=False).problem.contact
    rng, size = np.random.default_rng(0), 1e-5
    still = np.zeros(wall.strand.gradients.shape[1])
    motion = 1e-4 * rng.standard_normal(len(still))
    turned = np.array([[np.cos(0.2), np.sin(0.2)], [-np.sin(0.2), np.cos(0.2)]])
    strand = wall.facets.normal @ turned
    wall.strand.facing = lambda *motion: (strand, np.ones(len(strand)))  # type: ignore[method-assign]
    change = rng.standard_normal(len(still))
    here = WallMet(wall.strand, wall.contact.wall, 0.0, (motion, np.zeros(4)))
    normal, gap = here.change(wall.strand.changes(change[:, None], np.zeros((4, 1))))
    ends = [
        WallMet(wall.strand, wall.contact.wall, 0.0, (motion + sign * size * change, np.zeros(4)))
        for sign in (1.0, -1.0)
    ]
    assert np.isfinite(here.gap).all()
    expected = (ends[0].gap - ends[1].gap) / (2.0 * size)
    assert np.abs(gap[:, 0] - expected).max() < 1e-7 * np.abs(expected).max()
    expected = (ends[0].normal - ends[1].normal) / (2.0 * size)
    assert np.abs(normal[:, :, 0] - expected).max() < 1e-6 * np.abs(expected).max()
    assert np.abs(expected).max() > 1.0
