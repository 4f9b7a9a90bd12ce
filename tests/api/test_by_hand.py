"""The page "castfem by hand" does what it says: the parts give what a case file gives."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import castfem
from castfem.model import load_case

ROOT = Path(__file__).parents[2]
# What the page leaves out, and its mesh and steps.
AS_BY_HAND = (
    "casting.length=150 mm",
    "mesh.surface_size=2 mm",
    "mesh.corner_size=2 mm",
    "mesh.face_size=8 mm",
    "mesh.core_size=12 mm",
    "mesh.surface_depth=5 mm",
    "mesh.core_depth=20 mm",
    "thermal.time.step=0.1 s",
    "coupling.interval=0.1 s",
    "coupling.passes=1",
    "coupling.follow_shape=false",
    "coupling.dissipation=0",
    "output.every=1 h",
    "output.figures=false",
)


def test_the_page_computes_what_the_case_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs" / "by_hand.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 45
    found: dict[str, Any] = {}
    exec(compile(code, "docs/by_hand.md", "exec"), found)
    assert capsys.readouterr().out.startswith("heat removed 0.6")
    case = load_case(ROOT / "cases" / "billet125" / "taper_0.toml", AS_BY_HAND)
    with castfem.run(case, tmp_path / "run") as result:
        history = result.history.iloc[-1]
    heat, strain = found["hot"].removed, found["strained"].generalized_strains[0]
    assert history["time"] == pytest.approx(found["hot"].time)
    assert 4.0 * heat == pytest.approx(history["heat_removed"], rel=1e-9)
    assert strain == pytest.approx(history["axial_strain"], rel=1e-7)
