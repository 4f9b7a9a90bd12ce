"""A slab whose rolls are in a CSV file."""

from __future__ import annotations

from pathlib import Path

from castfem.model import Case, load_case
from castfem.physics.machine.rolls import Rolls

SLAB = Path(__file__).parents[1] / "cases" / "slab1200" / "thermal.toml"
HEADER = "position [m], diameter [mm], aperture [mm], radius_extrados [m], driven, capacity [kN]"
ROWS = (
    "0.9, 150, 222, straight, no,",
    "1.2, 150, 222, , no,",
    "1.5, 200, 222, 8, yes, 120",
    "1.8, 200, 221, 8, yes,",
)


def case(tmp_path: Path, rows: tuple[str, ...] = ROWS, header: str = HEADER) -> Case:
    return load_case(written(tmp_path, rows, header))


def written(tmp_path: Path, rows: tuple[str, ...] = ROWS, header: str = HEADER) -> Path:
    (tmp_path / "mine.csv").write_text("\n".join(["# ours", header, *rows]) + "\n")
    (tmp_path / "mine.toml").write_text(f'extends = "{SLAB}"\n[machine]\nrolls = "mine.csv"\n')
    return tmp_path / "mine.toml"


def rolls_of(loaded: Case) -> Rolls:
    found = loaded.machine.pairs()
    assert found is not None
    return found
