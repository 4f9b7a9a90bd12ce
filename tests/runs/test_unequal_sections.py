"""Half and whole sections in moulds: the wall holds the strand, and nothing else does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from runs.billet_runs import Kept, billet, run_in_memory

from castfem.base.types import Array
from castfem.model.build import mechanics as build_mechanics
from castfem.physics.mould.wall import GapFunction, Wall

HALF = ("section.symmetry=half", "mesh.surface_size=3 mm", "mesh.corner_size=3 mm")
WHOLE = ("section.symmetry=whole", "mesh.surface_size=4 mm", "mesh.corner_size=4 mm")
SHORT = 'casting.length="90 mm"'
WEAK = 1e-4  # of the force of a side of the wall: what springs may carry


def cooled(**sides: int) -> str:
    """Heat transfer, W/m2K, of all groups that begin with a name."""
    law = 'law="contact", gap_conductivity="0.15 W/(m K)", wall="160 degC"'
    given = [f'{{{law}, on=["{on}"], coefficient="{h} W/(m^2 K)"}}' for on, h in sides.items()]
    return f"cooling.mould.surface=[{', '.join(given)}]"


UNEQUAL = {
    HALF: cooled(wide_face_intrados=1600, wide_face_extrados=1000, corner=1600, narrow_face=1600),
    WHOLE: cooled(
        wide_face_intrados=1600, wide_face_extrados=1000, corner=1600,
        narrow_face_left=1600, narrow_face_right=1300,
    ),
}  # fmt: skip
AXES = {HALF: (1,), WHOLE: (0, 1)}  # along which nothing but the wall holds the section


@dataclass(frozen=True)
class Drifting:
    """A mould that moves sideways as the strand goes down, or closes on the right alone."""

    wall: Wall  #: the mould at rest
    by: tuple[float, float] = (0.0, 0.0)  #: its movement over the way, m/m
    closing: float = 0.0  #: of the right side

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        found = self.wall.gap_function(points - np.array(self.by) * position, normals, position)
        right = found.normal[:, 0] > 0.99
        return replace(found, gap=found.gap - right * self.closing * position)

    def temperature(self, position: float) -> float:
        return self.wall.temperature(position)


def in_a_wall_that(monkeypatch: pytest.MonkeyPatch, **does: Any) -> None:
    """Let all moulds built from now on do so."""
    build = build_mechanics.build_mould
    monkeypatch.setattr(
        build_mechanics, "build_mould", lambda *given: Drifting(build(*given), **does)
    )


def forces(kept: Kept) -> tuple[Array, Array, Array]:
    """Of the wall, of the springs (windows, 2), and of a side of the wall (windows,), N/m."""
    wall, springs, side = [], [], []
    for sample, state in zip(kept.samples[1:], kept.states[1:], strict=True):
        mechanics, contact = sample.mechanics, state.mechanical.contact  # type: ignore[union-attr]
        assert mechanics is not None and mechanics.balance is not None and contact is not None
        assert mechanics.contact is not None
        assert mechanics.balance.forces_error < 1e-6
        wall.append(mechanics.contact.force)
        springs.append(mechanics.balance.support)
        up = contact.normal[:, 1] > 0.5
        side.append(contact.pressure[up] @ contact.weight[up])
    return np.array(wall), np.array(springs), np.array(side)


def moved(kept: Kept) -> dict[str, float]:
    """Outward movement of the surface where the run ended, m."""
    assert kept.samples[-1].mechanics is not None
    return kept.samples[-1].mechanics.moved


@pytest.mark.parametrize(
    ("part", "taper", "extra"),
    [
        (WHOLE, "taper_1", 'casting.length="120 mm"'),
        (HALF, "taper_0", "mechanics.strain=large"),
        (HALF, "taper_0", "mould.contact=nitsche"),
    ],
    ids=["whole", "half, large strain", "half, nitsche"],
)
def test_the_wall_alone_holds_the_strand(part: tuple[str, ...], taper: str, extra: str) -> None:
    """However unequal its sides are cooled, the forces of the wall on them cancel."""
    wall, springs, side = forces(run_in_memory(billet(taper, *part, UNEQUAL[part], SHORT, extra)))
    assert side.max() > 200.0
    # At large strain the summary leaves out the strand's thickness, which differs by 1e-4.
    rounding = 3e-4 if "large" in extra else 1e-7
    for axis in AXES[part]:
        assert np.abs(springs[:, axis]).max() < WEAK * side.max()
        assert np.abs(wall[:, axis] + springs[:, axis]).max() < rounding * side.max()


def test_a_strand_that_touches_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stays where it is, as if points of it were held: those would carry nothing either."""
    case = billet("taper_minus_3", *WHOLE, UNEQUAL[WHOLE], SHORT)
    springs = run_in_memory(case)
    make = build_mechanics.MechanicalProblem
    monkeypatch.setattr(
        build_mechanics, "MechanicalProblem", lambda *a, **k: make(*a, **(k | {"springs": None}))
    )
    points = run_in_memory(case)
    assert springs.value("contact_share") == 0.0
    assert springs.value("gap_mid_face") > 5e-5
    assert moved(springs) == pytest.approx(moved(points), abs=1e-8)
    assert springs.value("von_mises_max") == pytest.approx(points.value("von_mises_max"), rel=1e-4)
    assert np.abs(forces(springs)[1]).max() < 1e-6


def test_a_mould_that_moves_sideways_takes_the_strand_along(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By 0.45 mm and 0.18 mm: it is strained as in the mould at rest."""
    case = billet("taper_1", *WHOLE, SHORT)
    rest = run_in_memory(case)
    in_a_wall_that(monkeypatch, by=(5e-3, 2e-3))
    along = run_in_memory(case)
    expected = moved(rest)
    for name, normal in (("narrow_face", (1, 0)), ("narrow_face_left", (-1, 0)),
                         ("mid_face", (0, 1)), ("mid_face_extrados", (0, -1))):  # fmt: skip
        shift = 0.09 * np.dot(normal, (5e-3, 2e-3))
        assert moved(along)[name] == pytest.approx(expected[name] + shift, abs=2e-8), name
    for name in ("von_mises_max", "axial_strain", "contact_share", "heat_removed"):
        assert along.value(name) == pytest.approx(rest.value(name), rel=5e-4), name


def test_a_mould_that_closes_on_one_side(monkeypatch: pytest.MonkeyPatch) -> None:
    """The strand gives way to the left: it is strained as in a mould that closes on both."""
    case = billet("taper_0", *WHOLE, SHORT)
    with monkeypatch.context() as patch:
        in_a_wall_that(patch, closing=10e-3)
        one = run_in_memory(case)
    in_a_wall_that(monkeypatch, closing=10e-3, by=(5e-3, 0.0))
    both = run_in_memory(case)
    wall, _, side = forces(one)
    assert np.abs(wall).max() < WEAK * side.max()
    assert moved(one)["narrow_face"] == pytest.approx(-0.9e-3, abs=1e-6)
    assert moved(one)["narrow_face_left"] == pytest.approx(0.0, abs=1e-6)
    assert moved(both)["narrow_face_left"] == pytest.approx(-0.45e-3, abs=1e-6)
    for name in ("von_mises_max", "axial_strain", "contact_share", "heat_removed"):
        assert one.value(name) == pytest.approx(both.value(name), rel=1e-4), name


def test_a_section_held_on_one_side_alone() -> None:
    """Without a mould: nothing is left loose, and what is added leaves it even about its middle."""
    held = 'mechanics.held=[{on=["narrow_face_left"], component="x"}]'
    kept = run_in_memory(billet("idealised", *WHOLE, SHORT, held))
    found = moved(kept)
    assert found["narrow_face_left"] == pytest.approx(0.0, abs=1e-12)
    assert abs(found["narrow_face"]) > 1e-5
    assert found["mid_face_extrados"] == pytest.approx(found["mid_face"], rel=1e-6)
    assert found["corner_extrados"] == pytest.approx(found["corner"], rel=1e-6)
    mechanics = kept.samples[-1].mechanics
    assert mechanics is not None and mechanics.balance is not None
    assert abs(mechanics.balance.support[1]) < 1e-6
