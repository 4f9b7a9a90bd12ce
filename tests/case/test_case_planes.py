"""Motions of the planes that a section has, and those that it has not."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.case import load_case
from castfem.errors import InputError

COUPLED = Path(__file__).parents[2] / "cases" / "billet125" / "coupled.toml"
HALF = "section.symmetry=half"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["planes.a1=free"], "planes.a1: symmetry keeps a1 at zero; leave it out, or model more"),
        (["planes.a2=0.1 1/m"], "planes.a2: symmetry keeps a2 at zero"),
        (["planes.moment_y=1 kN m"], "planes.moment_y: symmetry keeps a2 at zero"),
        (["planes.moment_x=1 kN m", HALF], "planes.moment_x: symmetry keeps a1 at zero"),
        (["planes.across=0.001"], "planes.across: is for a strip; other sections widen by"),
    ],
)
def test_what_the_section_does_not_have(changes: list[str], said: str) -> None:
    with pytest.raises(InputError) as caught:
        load_case(COUPLED, [c.replace("planes", "mechanics.planes") for c in changes])
    (problem,) = caught.value.problems
    assert said in problem


@pytest.mark.parametrize(
    "changes",
    [
        ["mechanics.planes.a1=0 1/m", "mechanics.planes.moment_x=0 kN m"],
        ["mechanics.planes.a2=free", "mechanics.planes.moment_y=1 kN m", HALF],
        ["mechanics.planes.a1=0.1 1/m", "section.symmetry=whole"],
    ],
)
def test_what_it_has(changes: list[str]) -> None:
    load_case(COUPLED, changes)
