"""Pictures of meshes."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import pytest

from castfem.meshes import build
from castfem.meshes.draw import draw

from .sections import BEAM, ROUNDED, SLAB, STRIP


@pytest.mark.parametrize(
    "parameters",
    [ROUNDED | {"order": 2}, SLAB | {"symmetry": "half"}, BEAM | {"cell": "triangle"}, STRIP],
)
def test_picture_shows_groups_in_colour(tmp_path: Path, parameters: dict[str, object]) -> None:
    picture = tmp_path / "mesh.png"
    draw(build(**parameters), picture)
    image = matplotlib.image.imread(picture)[..., :3]
    assert min(image.shape[:2]) > 400
    spread = image.max(axis=2) - image.min(axis=2)
    assert (spread > 0.4).mean() > 5e-4  # coloured boundary
    assert (image.min(axis=2) > 0.99).mean() > 0.3  # and paper left between the lines


def test_focus_must_be_a_probe(tmp_path: Path) -> None:
    mesh = build(**STRIP)
    draw(mesh, tmp_path / "mesh.svg", focus="mid_face", zoom=0.02)
    assert (tmp_path / "mesh.svg").stat().st_size > 1000
    with pytest.raises(ValueError, match="focus = 'corner' is no probe; choose one of mid_face"):
        draw(mesh, tmp_path / "other.png", focus="corner")
