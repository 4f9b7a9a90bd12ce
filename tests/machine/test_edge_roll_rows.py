"""Rolls at the narrow faces as rows of a file: reading, errors and warnings."""

from __future__ import annotations

from pathlib import Path

import pytest
from rolls_of_file import HEADER, ROWS, SLAB, case, rolls_of

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.model.load import read_case

EDGED = (*(f"{row}, " for row in ROWS), "1.0, 100, , , , , narrow", "1.3, 100, 1190, , , , narrow")


def test_rows_with_a_side_are_edge_rolls(tmp_path: Path) -> None:
    """They do not change the strand line, are numbered separately, and are read back."""
    plain, edged = case(tmp_path), case(tmp_path, EDGED, f"{HEADER}, side")
    rolls = rolls_of(edged)
    assert rolls.pairs == rolls_of(plain).pairs and rolls_of(plain).edges is None
    assert [(p.position, p.diameter) for p in rolls.edges.pairs] == [(1.0, 0.1), (1.3, 0.1)]
    assert [rolls.edges.aperture(i, 1.2) for i in (0, 1)] == [1.2, 1.19]
    assert rolls.place(3).endswith("line 6, roll 4")
    assert rolls.edges.place(1).endswith("line 8, edge roll 2")
    (tmp_path / "again.toml").write_text(edged.resolved_toml())
    again = load_case(tmp_path / "again.toml")
    assert again == edged and again.physics_hash() == edged.physics_hash() != plain.physics_hash()
    lost = edged.with_({"machine.defect": [{"kind": "lost", "roll": 2}]})
    assert rolls_of(lost).edges == rolls.edges


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("1.0, 100, , , , , left", r"line 7, row 5: side \(left\): wide, as without it, or narrow"),
        ("1.0, 100, , 8, , , narrow", r"row 5: radius_extrados \(8\): of a roll at the"),
        ("1.0, 100, , , yes, , narrow", r"row 5: driven \(yes\): of a roll at the narrow face"),
        ("0.7, 100, , , , , narrow", r"line 7, edge roll 1: position \(0\.7 m\) lies within"),
        ("1.0, , , , , , narrow", r"line 7, edge roll 1: diameter \(\): is empty"),
        ("1.0, 100, 1.196, , , , narrow", r"edge roll 1: aperture \(1\.196 mm\): the section.*"
         "measures 1200 mm; is its unit right"),
        ("1.0, 0.1, , , , , narrow", r"rolls: \(0\.1 mm\) is beyond what rolls have"),
    ],
)  # fmt: skip
def test_invalid_edge_rolls_are_rejected(tmp_path: Path, row: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        case(tmp_path, (*EDGED[:4], row), f"{HEADER}, side")
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize(("name", "unit"), [("side", "mm"), ("driven", "kN")])
def test_column_of_words_with_a_unit_is_rejected(tmp_path: Path, name: str, unit: str) -> None:
    heading = f"{HEADER}, side".replace(name, f"{name} [{unit}]")
    message = f"line 2: column '{name}' holds words and has no unit; leave out {unit}"
    with pytest.raises(InputError, match=message):
        case(tmp_path, EDGED, heading)


@pytest.mark.parametrize("name", ["copper200/round", "beam_blank"])
def test_only_a_rectangle_has_edge_rolls(tmp_path: Path, name: str) -> None:
    (tmp_path / "rolls.csv").write_text(
        "position [m], diameter [mm], side\n0.9, 100, wide\n1.2, 100, wide\n1.0, 100, narrow\n"
    )
    path = SLAB.parents[2] / "benchmarks" / f"{name}.toml"
    path = path if path.is_file() else SLAB.parents[1] / f"{name}.toml"
    rolls = f"machine.rolls={tmp_path}/rolls.csv"
    with pytest.raises(InputError) as caught:
        load_case(path, [rolls])
    shape = name.rpartition("/")[2]
    message = (
        f'edge roll 1: only a section of shape "rectangle" has rolls there, not a "{shape}"; leave'
    )
    assert message in str(caught.value)


def test_machine_of_edge_rolls_only_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no rolls of the wide faces"):
        case(tmp_path, EDGED[4:], f"{HEADER}, side")


def test_edge_rolls_without_load_give_a_warning() -> None:
    """Rolls carry no load on faces that follow the apertures."""
    rolls = [f"machine.rolls={SLAB.parent / 'edge_rolls.csv'}"]
    message = "machine.rolls: the rolls at the narrow faces carry no load"
    assert any(message in t for t in read_case(SLAB.parent / "coarse.toml", rolls).warnings)
    assert not any(message in t for t in read_case(SLAB.parent / "slab.toml", rolls).warnings)


@pytest.mark.parametrize(("aperture", "far"), [("1185", False), ("1400", True), ("5000", True)])
def test_edge_rolls_that_do_not_fit_the_width_give_a_warning(
    tmp_path: Path, aperture: str, far: bool
) -> None:
    """The slab is 1200 mm wide."""
    (tmp_path / "edged.csv").write_text(
        (SLAB.parent / "edge_rolls.csv").read_text().replace(
            "952.500, 100, ,", f"952.500, 100, {aperture},"
        )
    )  # fmt: skip
    rolls = f"machine.rolls={tmp_path}/edged.csv"
    warnings = read_case(SLAB.parent / "slab.toml", [rolls]).warnings
    message = f"edge roll 1: aperture ({aperture} mm) of a section 1200 mm wide"
    assert any(message in t for t in warnings) == far
