"""The coupled billet does not know how much of its section is modelled, nor by which cells."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from mpi4py import MPI

import pytest

from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop

CASE = Path(__file__).parents[2] / "cases" / "billet125" / "taper_0.toml"
COARSE = (
    'mesh.surface_size="2.5 mm"',
    'mesh.corner_size="2.5 mm"',
    'mesh.face_size="12 mm"',
    'mesh.core_size="18 mm"',
    'coupling.interval="0.2 s"',
    'casting.length="120 mm"',
    "output.fields=[]",
)
RUBBING = ("mould.contact=nitsche", "mould.friction.law=coulomb", "mould.friction.coefficient=0.3")


@lru_cache
def ends(*changes: str) -> dict[str, float]:
    """What the run comes to: heat, stress, movement, contact."""
    simulation = build(load_case(CASE, (*COARSE, *changes)), MPI.COMM_SELF)
    try:
        sample = TimeLoop(simulation).run()
    finally:
        simulation.destroy()
    strained = sample.mechanics
    assert strained is not None and strained.contact is not None
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
def test_quarter_half_and_whole_are_one(symmetry: str, touch: tuple[str, ...]) -> None:
    part, more = (ends(f'section.symmetry="{name}"', *touch) for name in ("quarter", symmetry))
    assert part["gap"] > 1e-6 and (part["friction"] < 0.0) == bool(touch)
    for name, value in part.items():
        times = (2, 4)[symmetry == "whole"] if name == "friction" else 1  # of the part modelled
        assert more[name] == pytest.approx(times * value, rel=1e-6), name
