"""The coupled billet does not know how much of its section is modelled."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import pytest

from castfem.case import load_case
from castfem.march import March
from castfem.scene import build_scene

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


def ends(symmetry: str) -> dict[str, float]:
    """What the run comes to: heat, stress, movement, contact."""
    case = load_case(CASE, (*COARSE, f'section.symmetry="{symmetry}"'))
    scene = build_scene(case, MPI.COMM_SELF)
    try:
        reading = March(scene).run()
    finally:
        scene.destroy()
    strained = reading.mechanics
    assert strained is not None and strained.contact is not None
    return {
        "heat": reading.removed,
        "peak": strained.peak,
        "strain": strained.strain,
        "corner": strained.moved["corner"],
        "gap": strained.contact.gap,
        "pressure": strained.contact.pressure,
        "share": strained.contact.share,
        "surface": float(reading.profiles["corner"].temperature[0]),
    }


@pytest.mark.parametrize("symmetry", ["half", "whole"])
def test_quarter_half_and_whole_are_one(symmetry: str) -> None:
    part, more = ends("quarter"), ends(symmetry)
    assert part["gap"] > 1e-6
    for name, value in part.items():
        assert more[name] == pytest.approx(value, rel=1e-6), name
