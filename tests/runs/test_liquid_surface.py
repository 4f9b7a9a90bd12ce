"""Surfaces that stay liquid, or freeze at once, follow the wall."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from runs.billet_runs import CASES, COARSE, Kept, run_in_memory
from runs.test_unequal_sections import BEAM_BLANK

from castfem.model import load_case
from castfem.model.build.simulation import build

HALF = 0.08
DENSITY = 7400.0
BILLET = """
title = "billet"

[casting]
speed = "3.6 m/min"
length = "{length}"
superheat = "60 K"

[steel]
name = "carbon_042"

[section]
shape = "rectangle"
width = "160 mm"
height = "160 mm"
corner_radius = "6 mm"
symmetry = "quarter"

[mesh]
order = 2
cell = "{cell}"
surface_size = "{size}"
corner_size = "{size}"
face_size = "10 mm"
core_size = "14 mm"

[[cooling]]
name = "mould"

[[cooling.surface]]
{cooling}

[thermal.time]
step = "0.25 s"

[mechanics]

[mould]
length = "300 mm"
taper = "{taper}"
contact = "{contact}"

[coupling]
interval = "0.25 s"

[output]
figures = false
fields = []
"""
MILD = """law = "contact"
coefficient = "400 W/(m^2 K)"
gap_conductivity = "0.15 W/(m K)"
wall = "160 degC"
"""
GIVEN = """law = "temperature"
value = "1000 degC"
"""


def cast(folder: Path, **values: str) -> Kept:
    """Run a billet in a mould, with values of the template replaced."""
    simulation = {"length": "150 mm", "cell": "quadrilateral", "size": "3 mm", "cooling": MILD}
    path = folder / "billet.toml"
    path.write_text(BILLET.format(**{**simulation, "contact": "penalty", **values}))
    return run_in_memory(load_case(path))


@pytest.mark.parametrize(
    ("cell", "taper", "contact"),
    [("triangle", "3 %/m", "penalty"), ("quadrilateral", "-3 %/m", "nitsche")],
)
def test_liquid_follows_the_wall_and_presses_on_it(
    tmp_path: Path, cell: str, taper: str, contact: str
) -> None:
    """The full surface, with the pressure of its depth, and at the cost of a linear problem."""
    kept = cast(tmp_path, cell=cell, taper=taper, contact=contact)
    assert kept.summary.steps["coupling windows cut back"] == 0.0
    assert kept.summary.steps["Newton iterations, mechanics"] <= 4 * len(kept.samples)
    for sample in kept.samples[1:]:
        assert sample.shell["mid_face"] == 0.0 and sample.mechanics is not None
        touch = sample.mechanics.contact
        assert touch is not None and touch.share == 1.0 and touch.gap < 1e-9
        head = DENSITY * 9.81 * sample.position
        # The stretch of the surface is taken by a substitute stiffness of 30 times the pressure.
        assert touch.force == pytest.approx([-head * HALF] * 2, rel=1e-3)
    moved = kept.states[-1].mechanical
    assert np.abs(moved.displacement).max() < 1.5 * 0.03 * 0.3 * HALF


@pytest.mark.parametrize(("mush", "most"), [("none", 1e-7), ("skeleton", 2e-7)])
def test_hollow_surface_stays_in_place(tmp_path: Path, mush: str, most: float) -> None:
    """Liquid without stiffness does not creep round the fillets, three times as far each window.

    A skeleton, which carries load as soon as the surface is mushy, creeps a little under the wall.
    """
    path = tmp_path / "beam_blank.toml"
    path.write_text(BEAM_BLANK)
    changes = ("coupling.interval=0.25 s", "casting.length=30 mm", "mould.taper=0 %/m")
    changes += (f"mechanics.mush={mush}",)
    kept = run_in_memory(load_case(path, changes))
    assert kept.samples[-1].shell["mid_face"] == 0.0
    first, last = (s.mechanical for s in (kept.states[1], kept.states[-1]))
    # After it has moved from the mesh's facets to the wall's arcs.
    assert np.abs(first.displacement).max() > 1e-8
    assert np.abs(last.displacement - first.displacement).max() < most


def test_surface_frozen_from_the_first_instant(tmp_path: Path) -> None:
    """A shell of 1000 degC at the meniscus, in a wall that closes on it."""
    kept = cast(tmp_path, cooling=GIVEN, taper="3 %/m", size="4 mm", length="15 mm")
    assert kept.value("shell_mid_face") > 0.5e-3
    for sample in kept.samples[1:]:
        mechanics = sample.mechanics
        assert mechanics.contact is not None and mechanics.contact.penetration < 1e-5
        assert mechanics.balance.forces_error < 1e-6 and mechanics.balance.axial_error < 1e-6


def test_shell_that_remelts_off_its_wall_is_a_breakout() -> None:
    """Reported with place and gap; not near the wall, nor for liquid that was never solid."""
    case = load_case(CASES / "taper_minus_3.toml", COARSE)
    simulation = build(case, MPI.COMM_SELF)
    problem, steel = simulation.mechanics.problem, simulation.steel  # type: ignore[union-attr]
    try:
        contact, owned = problem.contact, simulation.section.owned
        solid, liquid = (np.full(owned, steel.solidus + by) for by in (-20.0, 5.0))
        fresh = contact.initial()
        off = replace(fresh, gap=np.full_like(fresh.gap, 1.2e-3))
        contact.begin(off, 1.0, 1.1, solid, liquid)
        assert "a breakout: the shell melts open at x = " in contact.liquid.breakout()
        assert "1.2 mm off the wall" in contact.liquid.breakout()
        for state, before in ((replace(off, gap=off.gap / 100.0), solid), (off, liquid)):
            contact.begin(state, 1.0, 1.1, before, liquid)
            assert contact.liquid.breakout() == ""
        hot = simulation.stepper.initial(steel.solidus + 5.0).point.temperature
        old = replace(simulation.mechanics.initial(1.0, solid), interactions=(off,))  # type: ignore[union-attr]
        result = simulation.mechanics.step(old, 1.1, hot)  # type: ignore[union-attr]
        assert result.refused and "breakout" in result.reason
    finally:
        simulation.destroy()
