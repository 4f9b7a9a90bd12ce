"""A billet whose liquid is fed goes on from a checkpoint as if it had never been stopped."""

from __future__ import annotations

from pathlib import Path

import pytest
from interrupted import history_of

from castfem.model import load_case

CASES = Path(__file__).parents[2] / "cases" / "billet125"
COARSE = (
    "mesh.surface_size=2 mm", "mesh.corner_size=2 mm", "mesh.face_size=10 mm",
    "mesh.core_size=10 mm", "coupling.interval=0.4 s", "casting.length=240 mm",
    "output.figures=false", "output.fields=[]",
)  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The history of a run that was never stopped."""
    return history_of(load_case(CASES / "taper_1.toml", COARSE), tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("steps", [3, 6])
def test_it_goes_on_byte_for_byte(tmp_path: Path, whole: bytes, steps: int) -> None:
    """Whether the checkpoint stands before or after another layer of cells has begun to freeze."""
    assert history_of(load_case(CASES / "taper_1.toml", COARSE), tmp_path, steps) == whole
