"""Decimal commas in CSV files, as spreadsheets of many countries write them."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_case import small

from castfem.base.csv_files import read_csv
from castfem.base.errors import InputError

SURFACE = "cooling.0.surface"


def test_between_semicolons_a_comma_is_a_point(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("position [mm]; value; text\n0,5; -1,25e-3; 3,6 m/min\n1,5; ,5; [1,2]\n")
    rows = read_csv(path).rows
    assert rows[0].cells == ("0.5", "-1.25e-3", "3.6 m/min")
    assert rows[1].cells == ("1.5", ".5", "[1,2]")


def test_a_table_with_decimal_commas(tmp_path: Path) -> None:
    path = tmp_path / "flux.csv"
    path.write_text("position [mm]; value [MW/m^2]\n0; 2,5\n30,5; 1,25\n")
    law = {"law": "flux", "value": {"file": str(path)}}
    (found,) = small({SURFACE: [law]}).cooling[0].surface
    table = found.value  # type: ignore[attr-defined]
    assert table.values == (2.5e6, 1.25e6) and table.arguments == pytest.approx((0.0, 0.0305))


def test_between_commas_they_are_told(tmp_path: Path) -> None:
    path = tmp_path / "flux.csv"
    path.write_text("position [mm], value [MW/m^2]\n0, 2,5\n30, 1,25\n")
    law = {"law": "flux", "value": {"file": str(path)}}
    with pytest.raises(InputError, match=r"two numbers; numbers with decimal commas need semicol"):
        small({SURFACE: [law]})


def test_tabs_part_the_columns_as_semicolons_do(tmp_path: Path) -> None:
    path = tmp_path / "flux.csv"
    path.write_text("position [mm]\tvalue [MW/m^2]\n0\t2,5\n30,5\t1,25\n")
    assert read_csv(path).rows[1].cells == ("30.5", "1.25")
    law = {"law": "flux", "value": {"file": str(path)}}
    (found,) = small({SURFACE: [law]}).cooling[0].surface
    assert found.value.values == (2.5e6, 1.25e6)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            b"position, value [MW/m^2]\n0, 2\n30, 1\n",
            "flux.csv' line 1: position has no unit; write it in the header, such as 'position [mm",
        ),
        (
            b"position [mm], value [MW/m^2]\n0, nan\n30, 1\n",
            "flux.csv': 'value' line 2 (nan): a fi",
        ),
        (
            b"position [\xb5m], value [MW/m^2]\n0, 2\n",
            "is not UTF-8 text; save it in that encoding (CSV",
        ),
    ],
)
def test_what_is_wrong_with_a_table_in_a_file_names_it(
    tmp_path: Path, text: bytes, line: str
) -> None:
    path = tmp_path / "flux.csv"
    path.write_bytes(text)
    with pytest.raises(InputError) as error:
        small({SURFACE: [{"law": "flux", "value": {"file": str(path)}}]})
    (problem,) = error.value.problems
    assert line in problem and "name of a formula" not in problem
