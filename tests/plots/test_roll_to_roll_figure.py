"""The figure of the surface temperatures from roll to roll."""

from __future__ import annotations

from pathlib import Path

import pytest
from rolled_case import circuit, rolled, secondary

from castfem.model import load_case
from castfem.post.plots.figures import draw_figures
from castfem.post.plots.secondary import close_by, faces_met
from castfem.runs.loop import run

SLAB = Path(__file__).parents[2] / "cases" / "slab1200" / "sprays.toml"


def test_it_is_drawn_of_a_run_below_its_mould(tmp_path: Path) -> None:
    short = rolled(casting__length="0.2 m")
    run(short, tmp_path / "short")
    assert "roll_to_roll.png" not in [path.name for path in draw_figures(tmp_path / "short")]
    run(rolled(casting__length="0.5 m"), tmp_path / "run")
    drawn = {path.name: path for path in draw_figures(tmp_path / "run")}
    assert drawn["roll_to_roll.png"].stat().st_size > 10_000
    bare = rolled(secondary=None, cooling__0__to="0.25 m", casting__length="0.25 m")
    run(bare, tmp_path / "bare")
    assert "roll_to_roll.png" not in [path.name for path in draw_figures(tmp_path / "bare")]


def test_a_face_is_shown_what_it_meets() -> None:
    case = rolled(secondary=secondary(circuit=[circuit(on=["wide_face_intrados"])]))
    assert case.machine is not None
    met = faces_met(case, case.machine.pairs(), 0.65)
    kinds = {name: [stretch.kind for stretch in found] for name, found in met.items()}
    pitch = ["contact", "shade", "spray", "run_off"]
    assert kinds["intrados"] == ["shade", *pitch, *pitch]
    assert kinds["extrados"] == ["shade", "contact", "shade", "contact", "shade"]
    assert set(kinds["narrow face"]) == {"shade"}


def test_straightening_is_shown_close_by() -> None:
    case = load_case(SLAB)
    assert case.machine is not None
    rolls = case.machine.pairs()
    assert rolls is not None
    low, high = close_by(rolls, 0.8, 26.4)
    assert rolls.pairs[47].position < low < rolls.pairs[48].position
    assert rolls.pairs[56].position < high < rolls.pairs[57].position
    low, high = close_by(rolls, 0.8, 10.0)
    assert (low, high) == (pytest.approx(rolls.pairs[27].position), 10.0)
