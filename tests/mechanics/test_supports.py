"""Supports of a section in its plane: the fewest fixed points, or springs in a mould."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from castfem import meshes
from castfem.base.types import Array
from castfem.physics.contact.settings import Contact
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.supports import SPRING, PrescribedDisplacement, Traction
from castfem.physics.mould import Mould, RoundCavity, Taper, same
from mechanics.casting import STEEL, CastSetup
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped

SIDES = ("left", "bottom", "right", "top")
WIDTH, HEIGHT = 0.1, 0.06
YOUNG, ALPHA = 200e9, 1e-5

# Fixed components on sides, and the number of fixed points that are still needed.
HELD = {
    "nothing": ((), 3),
    "x on the left": ((("left", 0),), 1),
    "y on the top": ((("top", 1),), 1),
    "y on the left": ((("left", 1),), 2),
    "x on top and bottom": ((("top", 0), ("bottom", 0)), 1),
    "x on the left, y on the bottom": ((("left", 0), ("bottom", 1)), 0),
    "x and y on the left": ((("left", 0), ("left", 1)), 0),
}


def block(*held: tuple[str, int], groups: Any = SIDES, **settings: Any) -> SliceSetup:
    """Set up a rectangle centred on the origin that expands with its temperature."""
    options, springs = settings.pop("options", {}), settings.pop("springs", False)
    shape = box(WIDTH, HEIGHT, -0.5 * WIDTH, -0.5 * HEIGHT)
    return SliceSetup(
        mapped(4, 4, shape, groups=groups),
        elastic(YOUNG),
        expansion(ALPHA),
        options=options,
        springs=SPRING if springs else None,
        settings={
            "held": tuple(PrescribedDisplacement((side,), i) for side, i in held),
            **settings,
        },
    )


@pytest.mark.parametrize("name", list(HELD))
def test_fewest_points_are_fixed(name: str) -> None:
    held, points = HELD[name]
    sides, sprung = block(*held), block(*held, springs=True)
    springs = sprung.problem.constraints.springs
    assert (0 if springs is None else len(springs.dofs)) == points
    fixed = sides.problem.constraints.fixed
    assert len(fixed) == len(sprung.problem.constraints.fixed) + points
    assert np.array_equal(fixed, sprung.problem.constraints.dofs)


@pytest.mark.parametrize("mirrors", [("x",), ("y",), ("x", "y")])
def test_lines_of_symmetry_reduce_the_springs(mirrors: tuple[str, ...]) -> None:
    named = {"left": "x", "bottom": "y"}
    groups = [f"symmetry_{named[s]}" if named.get(s) in mirrors else s for s in SIDES]
    springs = block(groups=tuple(groups), springs=True).problem.constraints.springs
    assert (0 if springs is None else len(springs.dofs)) == 2 - len(mirrors)


@pytest.mark.parametrize(("springs", "large"), [(False, True), (True, False)])
@pytest.mark.parametrize("name", ["nothing", "x on the left", "y on the top"])
def test_supported_sections_expand_freely(name: str, large: bool, springs: bool) -> None:
    """Without stress, force or rotation, uniformly about the middle of the fixed side."""
    middle = {"x on the left": (-0.5 * WIDTH, 0.0), "y on the top": (0.0, 0.5 * HEIGHT)}
    setup = block(*HELD[name][0], springs=springs, large_strain=large)
    result = setup.step(1.0, 100.0)
    assert result.newton <= 3
    constrained = YOUNG * ALPHA * 100.0
    assert np.abs(setup.stress).max() < 1e-7 * constrained
    assert np.abs(result.balance.support).max() < 1e-7 * constrained * HEIGHT
    places = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    expected = (places - middle.get(name, (0.0, 0.0))) * ALPHA * 100.0
    error = np.abs(setup.state.displacement.reshape(-1, 2) - expected).max()
    assert error < (1e-3 if large else 1e-6) * np.abs(expected).max()


def pushed(force: float) -> SliceSetup:
    """Set up half a section held along y only by its spring, with a force on its top."""
    groups = ("symmetry_x", "bottom", "right", "top")
    load = Traction(("top",), lambda t: (0.0, force / WIDTH))
    return block(groups=groups, springs=True, loads=(load,), planes=PlainPlanes(()))


def test_springs_are_weak_and_their_force_is_reported() -> None:
    """In each step a force displaces the section rigidly by the force over the stiffness."""
    stiffness = SPRING * YOUNG
    setup = pushed(1.0)
    for step in (1.0, 2.0):
        result = setup.step(step)
        assert result.balance.support == pytest.approx([0.0, -1.0], abs=1e-6)
        assert result.balance.forces_error < 1e-6
        moved = setup.state.displacement.reshape(-1, 2)
        # The spring of each step starts at the end of the last step.
        assert moved[:, 1] == pytest.approx(step / stiffness, rel=1e-5)


OPTIONS: dict[str, dict[str, Any]] = {
    "default": {},
    "petsc": {"pc_type": "lu", "pc_factor_mat_solver_type": "petsc"},
}


@pytest.mark.parametrize("options", list(OPTIONS))
def test_springs_have_no_effect_without_contact(options: str) -> None:
    """A nonuniformly strained section moves as if points were fixed."""

    def uneven(x: Array, y: Array) -> Array:
        return np.asarray(100.0 + 3e3 * x + 5e3 * y + 1e6 * x * y)

    points, springs = (block(springs=s, options=OPTIONS[options]) for s in (False, True))
    for time in (1.0, 2.0, 3.0):
        for setup in (points, springs):
            result = setup.step(time, lambda x, y, t=time: t * uneven(x, y))
            assert result.newton <= 3
    size = np.abs(points.state.displacement).max()
    assert np.abs(springs.state.displacement - points.state.displacement).max() < 1e-5 * size
    assert np.abs(springs.stress - points.stress).max() < 1e-7 * np.abs(points.stress).max()


def test_full_round_does_not_rotate_in_its_mould() -> None:
    """Springs and fixed points give the same result, as the forces of the wall balance.

    Contact begins with a shell: for liquid the wall is 1e6 times stiffer, and Newton's method does
    not find the first points in contact with steps of this length.
    """
    begin = 8.0
    mesh = meshes.build(
        "round", symmetry="whole", diameter=0.16, surface_size=5e-3, core_size=1.4e-2
    )
    wall = Mould(RoundCavity(0.16), 0.6, same(Taper.single(0.06, 0.6)), None, None)
    contact = Contact(wall, mesh.groups, lambda time: 0.06 * (time - begin))

    def cast(springs: float | None) -> CastSetup:
        setup = CastSetup(mesh, springs=springs, interactions=(contact,)).frozen(begin, 0.5)
        assert setup.thermal.low < STEEL.solidus - 200.0
        return setup.advance(begin + 1.0, 0.25)

    pinned, sprung = (cast(springs) for springs in (None, SPRING))
    wall_contact = sprung.problem.contact
    assert wall_contact.now.pressure.max() > 1e4
    assert [r.newton for r in sprung.results] == [r.newton for r in pinned.results]
    size = np.abs(pinned.moved).max()
    assert size > 1e-5
    assert np.abs(sprung.moved - pinned.moved).max() < 1e-5 * size
