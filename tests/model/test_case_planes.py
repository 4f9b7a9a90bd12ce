"""Generalized strains that a section has, and those that it has not."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case

COUPLED = Path(__file__).parents[2] / "cases" / "billet125" / "coupled.toml"
HALF = "section.symmetry=half"
MIRRORED = "the section is mirrored at {} = 0; leave it out, or give section.symmetry = {}"
AT_X = MIRRORED.format("x", '"whole"')
AT_Y = MIRRORED.format("y", '"half" or "whole"')


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["planes.a1=free"], f"planes.a1: {AT_X}"),
        (["planes.a2=0.1 1/m"], f"planes.a2: {AT_Y}"),
        (["planes.moment_y=1 kN m"], f"planes.moment_y: {AT_Y}"),
        (["planes.moment_x=1 kN m"], f"planes.moment_x: {AT_X}"),
        (["planes.moment_x=1 kN m", HALF], f"planes.moment_x: {AT_X}"),
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
