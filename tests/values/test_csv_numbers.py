"""Meaning of a cell of a CSV file, and additions of spreadsheets around the numbers."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from small_case import small

from castfem.base import units
from castfem.base.csv_files import UnreadableError, read_csv
from castfem.base.errors import InputError
from castfem.base.quantities import Kind
from castfem.base.result_registry import declared
from castfem.base.table_notation import Curve
from castfem.physics.machine.roll_table import read_rolls
from castfem.studies.calibration.measured import read_measured

FLUX = Curve(Kind("W/m^2", "MW/m^2"), over="position")


def written(folder: Path, text: str) -> Path:
    path = folder / "a.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "a [mm]\tb [degC]\n1,200\t1,045\n",
            'line 2: "1,200" can be 1200 or 1.200, and no number of the file tells which; write '
            "1200, or 1,2000 with four decimals",
        ),
        ("a;b [kg/m^3]\n20;7,850\n", 'line 2: "7,850" can be 7850 or 7.850'),
        ("a;b\n20;7,850 kg/m^3\n", 'line 2: "7,850 kg/m^3" can be 7850 or 7.850, and no'),
        ("a;b\n0,5;1\n# note\n2;1.5\n", 'line 2: "0,5" has a comma, "1.5" in line 4 a point'),
        ("a;b\n0,5;1.234,5\n", 'line 2: "1.234,5" has thousands separators; write it without'),
    ],
)
def test_ambiguous_numbers_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UnreadableError) as error:
        read_csv(written(tmp_path, text))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "cells"),
    [
        ("a;b\n1,200;0,5\n", ("1.200", "0.5")),  # by 0,5 the comma is the decimal mark
        ("a\tb\n1.200\t1.045\n", ("1.200", "1.045")),  # no decimal commas in the file
        ("a;b\n1.200;0.500\n", ("1.200", "0.500")),
        ("a;b\n1200;1045\n", ("1200", "1045")),
        ("a;b\n2024.03.12;1200\n", ("2024.03.12", "1200")),
        ("a;b\n1,2e3;5\n", ("1.2e3", "5")),
    ],
)
def test_one_number_decides_the_decimal_mark(
    tmp_path: Path, text: str, cells: tuple[str, ...]
) -> None:
    assert read_csv(written(tmp_path, text)).rows[0].cells == cells


@pytest.mark.parametrize(
    "text",
    [
        "position [m];value [MW/m^2];;;\n0;2,5;;;\n;;;;\n0,3;1,25;;;\n;;;;\n;;;;\n",
        "sep=;\nposition [m];value [MW/m^2]\n0;2,5\n0,3;1,25\n",
        "\ufeffsep=;\r\nposition [m];value [MW/m^2];\r\n0;2,5;\r\n0,3;1,25;\r\n;;\r\n",
        "sep=\t\nposition [m]\tvalue [MW/m^2]\t\n0\t2.5\t\n0.3\t1.25\n",
        '"sep=,"\nposition [m],value [MW/m^2],,\n0,2.5,,\n,,,\n0.3,1.25,,\n',
        "sep=|\nposition [m]|value [MW/m^2]\n0|2,5\n0,3|1,25\n",
    ],
)
def test_additions_of_spreadsheets_are_ignored(tmp_path: Path, text: str) -> None:
    table = FLUX.read({"file": str(written(tmp_path, text))})
    assert table.arguments == (0.0, 0.3) and table.values == (2.5e6, 1.25e6)  # type: ignore[union-attr]


def test_files_without_a_table_are_refused_at_once(tmp_path: Path) -> None:
    """An unclosed quotation mark extends to the end of the file, a pipe forever."""
    path = written(tmp_path, "a [mm],b\n1,2\n3," + 200_000 * "4" + "\n")
    with pytest.raises(UnreadableError, match=r"^line 3: .*larger.*; is a quotation mark missing"):
        read_csv(path)
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(UnreadableError, match="is a pipe, not a file"):
        read_csv(tmp_path / "pipe.csv")


def test_rolls_and_measurements_allow_empty_cells(tmp_path: Path) -> None:
    text = "sep=;\nposition [m];diameter [mm];;\n0,8;150;;\n;;;\n1,1;150;;\n;;;\n"
    pairs = read_rolls({"file": str(written(tmp_path, text))}).pairs
    assert [(pair.position, pair.diameter) for pair in pairs] == [(0.8, 0.15), (1.1, 0.15)]
    text = "position [m];shell_mid_face [mm];;\n0,8;12,5;;\n;;;\n1,1;14;;\n;;;\n"
    found = read_measured(written(tmp_path, text))
    assert [(m.position, m.value) for m in found] == [(0.8, 0.0125), (1.1, 0.014)]


def test_line_of_a_cell_is_that_of_the_file(tmp_path: Path) -> None:
    text = "sep=;\n\nposition [m];diameter [mm];\n;;\n0,8;150;\n;;\n1,1;thick;\n"
    with pytest.raises(ValueError, match=r"a.csv' line 7, roll 2: diameter \(thick\)"):
        read_rolls({"file": str(written(tmp_path, text))})


def test_every_column_of_a_history_is_a_measurement(tmp_path: Path) -> None:
    """Name and unit as in History, and a value that converts back from SI."""
    columns = [d for d in declared() if d.column and d.name != "position"]
    assert "-" in {d.unit for d in columns} and len({d.unit for d in columns}) > 12
    for d in columns:
        name = d.named("mid_face" if d.each else "")
        text = f"position [m],{name} [{d.unit}]\n0.8,2.5\n"
        (found,) = read_measured(written(tmp_path, text))
        assert found.name == name and d.in_unit(found.value) == pytest.approx(2.5), name


def test_number_may_have_the_unit_one(tmp_path: Path) -> None:
    emissivity = Curve(Kind("1", label="emissivity", sample="0.8"), over="temperature")
    path = written(tmp_path, "temperature [degC], value [-]\n700, 0.8\n900, 0.85\n")
    in_file, in_case = (
        emissivity.read(given)
        for given in (
            {"file": str(path)},
            {
                "temperature": [700, 900],
                "temperature_unit": "degC",
                "value": [0.8, 0.85],
                "unit": "-",
            },
        )
    )
    assert in_file == in_case and in_file.values == (0.8, 0.85)  # type: ignore[union-attr]
    assert units.parse("0.8 -", "1") == 0.8
    with pytest.raises(ValueError, match="needs its unit"):
        units.parse("0.8 -", "m")


# Decimal commas in CSV files, as spreadsheets of many countries write them


SURFACE = "cooling.0.surface"


def test_comma_between_semicolons_is_a_decimal_mark(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("position [mm]; value; text\n0,5; -1,25e-3; 3,6 m/min\n1,5; ,5; [1,2]\n")
    rows = read_csv(path).rows
    assert rows[0].cells == ("0.5", "-1.25e-3", "3.6 m/min")
    assert rows[1].cells == ("1.5", ".5", "[1,2]")


def test_decimal_commas_between_commas_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "flux.csv"
    path.write_text("position [mm], value [MW/m^2]\n0, 2,5\n30, 1,25\n")
    law = {"law": "flux", "value": {"file": str(path)}}
    with pytest.raises(InputError, match=r"two numbers; numbers with decimal commas need semicol"):
        small({SURFACE: [law]})


def test_tabs_separate_columns_as_semicolons(tmp_path: Path) -> None:
    path = tmp_path / "flux.csv"
    path.write_text("position [mm]\tvalue [MW/m^2]\n0\t2,5\n30,5\t1,25\n")
    assert read_csv(path).rows[1].cells == ("30.5", "1.25")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (b"position, value [MW/m^2]\n0, 2\n30, 1\n",
         "flux.csv' line 1: position has no unit; write it in the header, such as 'position [mm"),
        (b"position [mm], value [MW/m^2]\n0, nan\n30, 1\n",
         "flux.csv': 'value' line 2 (nan): a fi"),
        (b"position [\xb5m], value [MW/m^2]\n0, 2\n",
         "is not UTF-8 text; save it in that encoding (CSV"),
    ],
)  # fmt: skip
def test_fault_of_a_table_names_its_file(tmp_path: Path, text: bytes, line: str) -> None:
    path = tmp_path / "flux.csv"
    path.write_bytes(text)
    with pytest.raises(InputError) as error:
        small({SURFACE: [{"law": "flux", "value": {"file": str(path)}}]})
    (problem,) = error.value.problems
    assert line in problem and "name of a formula" not in problem
