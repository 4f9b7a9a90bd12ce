"""Sections in their moulds: unequal sides, rounds, beam blanks, and parts by symmetry."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from runs.billet_runs import CASES, Kept, billet, cells, run_in_memory, simulated
from small_case import small

from castfem.base.types import Array
from castfem.model import load_case
from castfem.model.build import mechanics as build_mechanics
from castfem.physics.mould.wall import GapFunction, Wall
from castfem.runs.loop import TimeLoop

HALF = ("section.symmetry=half", "mesh.surface_size=3 mm", "mesh.corner_size=3 mm")
WHOLE = ("section.symmetry=whole", "mesh.surface_size=4 mm", "mesh.corner_size=4 mm")
SHORT = 'casting.length="90 mm"'
WEAK = 1e-4  # largest share of springs in the force of a side of the wall


def cooled(**sides: int) -> str:
    """Return the heat transfer, W/m2K, of all groups that begin with a name."""
    law = 'law="contact", gap_conductivity="0.15 W/(m K)", wall="160 degC"'
    laws = [f'{{{law}, on=["{on}"], coefficient="{h} W/(m^2 K)"}}' for on, h in sides.items()]
    return f"cooling.mould.surface=[{', '.join(laws)}]"


UNEQUAL = {
    HALF: cooled(wide_face_intrados=1600, wide_face_extrados=1000, corner=1600, narrow_face=1600),
    WHOLE: cooled(
        wide_face_intrados=1600, wide_face_extrados=1000, corner=1600,
        narrow_face_left=1600, narrow_face_right=1300,
    ),
}  # fmt: skip
AXES = {HALF: (1,), WHOLE: (0, 1)}  # along which only the wall holds the section


@dataclass(frozen=True)
class Drifting:
    """A mould that moves sideways as the strand goes down, or closes only on the right."""

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
    """Replace all moulds built from now on."""
    build = build_mechanics.build_mould
    monkeypatch.setattr(
        build_mechanics, "build_mould", lambda *given: Drifting(build(*given), **does)
    )


def forces(kept: Kept) -> tuple[Array, Array, Array]:
    """Return the forces of the wall, of springs (windows, 2), and of a side (windows,), N/m."""
    wall, springs, side = [], [], []
    for sample, state in zip(kept.samples[1:], kept.states[1:], strict=True):
        mechanics, contact = sample.mechanics, state.mechanical.contact  # type: ignore[union-attr]
        assert mechanics.balance.forces_error < 1e-6
        wall.append(mechanics.contact.force)
        springs.append(mechanics.balance.support)
        up = contact.normal[:, 1] > 0.5
        side.append(contact.pressure[up] @ contact.weight[up])
    return np.array(wall), np.array(springs), np.array(side)


def moved(kept: Kept) -> dict[str, float]:
    """Return the outward movement of the surface at the end of the run, m."""
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
def test_only_the_wall_holds_the_strand(part: tuple[str, ...], taper: str, extra: str) -> None:
    """With any unequal cooling of its sides, the forces of the wall on them cancel."""
    wall, springs, side = forces(run_in_memory(billet(taper, *part, UNEQUAL[part], SHORT, extra)))
    assert side.max() > 200.0
    # At large strain the summary leaves out the strand's thickness, which differs by 1e-4.
    rounding = 3e-4 if "large" in extra else 1e-7
    for axis in AXES[part]:
        assert np.abs(springs[:, axis]).max() < WEAK * side.max()
        assert np.abs(wall[:, axis] + springs[:, axis]).max() < rounding * side.max()


def test_strand_that_touches_nothing_stays_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with points of it held, which would not carry anything either."""
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


def test_mould_that_moves_sideways_moves_the_strand(
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


def test_mould_that_closes_on_one_side(monkeypatch: pytest.MonkeyPatch) -> None:
    """The strand moves to the left: it is strained as in a mould that closes on both sides."""
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


def test_section_held_on_one_side() -> None:
    """Without a mould: no free motion remains, and the added support is symmetric."""
    held = 'mechanics.held=[{on=["narrow_face_left"], component="x"}]'
    kept = run_in_memory(billet("idealised", *WHOLE, SHORT, held))
    found = moved(kept)
    assert found["narrow_face_left"] == pytest.approx(0.0, abs=1e-12)
    assert abs(found["narrow_face"]) > 1e-5
    assert found["mid_face_extrados"] == pytest.approx(found["mid_face"], rel=1e-6)
    assert found["corner_extrados"] == pytest.approx(found["corner"], rel=1e-6)
    mechanics = kept.samples[-1].mechanics
    assert abs(mechanics.balance.support[1]) < 1e-6


# A round in a straight mould, where the gap controls the heat: the full one as its quarter


# A round in a mould, as changes of the billet.
ROUND: dict[str, Any] = {
    "casting.length": "200 mm",
    "section": {"shape": "round", "diameter": "150 mm"},
    "mesh": {"order": 2, "surface_size": "3 mm", "face_size": "10 mm", "core_size": "10 mm"},
    "cooling.0.surface.0.gap_conductivity": "0.15 W/(m K)",
    "thermal.time.step": "0.25 s",
    "mechanics": {},
    "mould": {"length": "200 mm", "taper": "0 %/m"},
    "coupling": {"interval": "0.25 s"},
    "output": {"figures": False, "fields": []},
}


def test_gap_of_a_round_is_that_of_its_quarter() -> None:
    """Windows are repeated, with relaxation by sums over the surface: equal for each vertex."""
    case = small(ROUND)
    quarter, whole = (
        run_in_memory(case.with_({"section.symmetry": part})) for part in ("quarter", "whole")
    )
    for kept in (quarter, whole):
        assert kept.summary.steps["coupling iterations"] > len(kept.samples)
    assert whole.value("heat_removed") == pytest.approx(quarter.value("heat_removed"), rel=1e-7)


# A beam blank in its mould: the surface is concave between web and flange


BEAM_BLANK = f"""
extends = "{CASES / "tapered.toml"}"

[casting]
speed = "1 m/min"
length = "40 mm"

[section]
shape = "beam_blank"
width = "400 mm"
height = "300 mm"
web_thickness = "100 mm"
flange_thickness = "60 mm"
root_thickness = "90 mm"
fillet_radius = "20 mm"
shoulder_radius = "15 mm"
corner_radius = "10 mm"

[mesh]
surface_size = "4 mm"
corner_size = "6 mm"
surface_depth = "4 mm"
face_size = "20 mm"
core_size = "20 mm"

[mould]
taper = "1 %/m"

[coupling]
interval = "0.6 s"

[output]
fields = []
figures = false
"""


def test_beam_blank_in_its_mould(tmp_path: Path) -> None:
    """Forces and heat balance; the wall is not penetrated and takes the pressure of the liquid."""
    (tmp_path / "beam_blank.toml").write_text(BEAM_BLANK)
    kept = run_in_memory(load_case(tmp_path / "beam_blank.toml"))
    for sample in kept.samples[1:]:
        mechanics = sample.mechanics
        contact = mechanics.contact
        assert contact is not None and contact.penetration < 1e-6 and contact.share > 0.5
        assert mechanics.balance.forces_error < 1e-6 and mechanics.balance.axial_error < 1e-6
        assert abs(sample.balance) < 1e-9
        # The lines of symmetry take the force of the wall.
        left = mechanics.balance.support + contact.force
        assert np.abs(left).max() < 1e-6 * np.abs(contact.force).max()
    # At first there is next to no shell: one pressure, on half the width and half the web.
    first = kept.samples[1].mechanics
    assert first.contact.force[1] / first.contact.force[0] == pytest.approx(200 / 50, rel=0.01)
    assert kept.summary.balances["heat"]["whole"].value < 1e-9


# The coupled billet does not depend on the modelled part of its section


CASE = Path(__file__).parents[2] / "cases" / "billet125" / "taper_0.toml"
COARSE = (
    *cells(2.5, 12, 18), "coupling.interval=0.2 s", "casting.length=120 mm", "output.fields=[]",
)  # fmt: skip
RUBBING = ("mould.contact=nitsche", "mould.friction.law=coulomb", "mould.friction.coefficient=0.3")


@lru_cache
def ends(*changes: str) -> dict[str, float]:
    """Return the results of a run at its end: heat, stress, movement, contact."""
    with simulated(load_case(CASE, (*COARSE, *changes))) as simulation:
        sample = TimeLoop(simulation).run()
    strained = sample.mechanics
    return {
        "heat": sample.removed,
        "peak": strained.peak,
        "strain": strained.strain,
        "corner": strained.moved["corner"],
        "gap": strained.contact.gap,
        "pressure": strained.contact.pressure,
        "share": strained.contact.share,
        "surface": float(sample.profiles["corner"].temperature[0]),
        "friction": strained.contact.axial,
    }


@pytest.mark.parametrize(
    ("symmetry", "touch"), [("whole", ()), ("half", RUBBING)], ids=["penalty", "nitsche, friction"]
)
def test_quarter_half_and_full_section_agree(symmetry: str, touch: tuple[str, ...]) -> None:
    part, more = (ends(f'section.symmetry="{name}"', *touch) for name in ("quarter", symmetry))
    assert part["gap"] > 1e-6 and (part["friction"] < 0.0) == bool(touch)
    for name, value in part.items():
        times = (2, 4)[symmetry == "whole"] if name == "friction" else 1  # of the part modelled
        assert more[name] == pytest.approx(times * value, rel=1e-6), name
