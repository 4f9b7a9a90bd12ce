"""Tables of numbers: columns with units, CSV files, and what is wrong with them."""

from __future__ import annotations

import csv

import pytest

from castfem.base.errors import InputError
from castfem.model import Table, load_case

ROWS = """
[cooling.surface.emissivity]
temperature = [20, 900, 1500]
temperature_unit = "degC"
value = [0.8, 0.85, 0.9]
"""


def test_columns_with_units_once(write, sound):
    table = load_case(write(sound + ROWS)).cooling[1].surface[0].emissivity
    assert table == Table("temperature", (293.15, 1173.15, 1773.15), (0.8, 0.85, 0.9))


def test_linear_between_and_constant_beyond():
    table = Table("time", (0.0, 2.0, 4.0), (1.0, 3.0, 0.0))
    assert [table(t) for t in (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 9.0)] == [1, 1, 2, 3, 1.5, 0, 0]


def test_units_in_the_cells_and_over_time(write, sound):
    text = sound + (
        '[[cooling.surface]]\nlaw = "flux"\n'
        'value = { time = ["0 s", "50 ms"], value = ["2 MW/m^2", "1500 kW/m^2"] }\n'
    )
    assert load_case(write(text)).cooling[1].surface[1].value == Table(
        "time", (0.0, 0.05), (2e6, 1.5e6)
    )


def test_csv_beside_the_file_that_names_it(write, sound, tmp_path, monkeypatch):
    write("# measured\ntemperature [degC], value\n20, 0.8\n1500, 0.9\n", "data/e.csv")
    write(sound + 'emissivity = { file = "e.csv" }\n', "data/base.toml")
    path = write('extends = "data/base.toml"\n')
    monkeypatch.chdir("/")
    table = load_case(path).cooling[1].surface[0].emissivity
    assert table == Table("temperature", (293.15, 1773.15), (0.8, 0.9))


def test_semicolons_and_units(write, sound):
    write("time [ms];value [kW/m^2]\n0;5\n20;6\n", "q.csv")
    text = sound.replace(
        'law = "radiation"\nambient = "25 degC"', 'law = "flux"\nvalue.file = "q.csv"'
    )
    assert load_case(write(text)).cooling[1].surface[0].value == Table(
        "time", (0.0, 0.02), (5e3, 6e3)
    )


def test_cells_of_a_file_may_have_their_own_unit(write, sound):
    """Those without have that of the column, which is not needed where there are none."""
    write("time [ms], value [kW/m^2]\n0, 5\n20, 0.006 MW/m^2\n", "q.csv")
    text = sound.replace(
        'law = "radiation"\nambient = "25 degC"', 'law = "flux"\nvalue.file = "q.csv"'
    )
    table = Table("time", (0.0, 0.02), (5e3, 6e3))
    assert load_case(write(text)).cooling[1].surface[0].value == table
    write("time, value\n0 s, 5 kW/m^2\n20 ms, 6 kW/m^2\n", "q.csv")
    assert load_case(write(text)).cooling[1].surface[0].value == table
    write("time, value [kW/m^2]\n0 s, 5\n20, 6\n", "q.csv")
    with pytest.raises(InputError, match="time has no unit; write it in the header"):
        load_case(write(text))


def test_hundred_rows_survive_the_resolved_case(write, sound):
    rows = [(20 + 14.7 * i, 0.1 + i / 137) for i in range(100)]
    path = write(name="e.csv", text="")
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([("temperature [degC]", "value"), *rows])
    case = load_case(write(sound + 'emissivity.file = "e.csv"\n'))
    again = load_case(write(case.resolved_toml(), "again/case.toml"))
    assert again == case
    assert len(again.cooling[1].surface[0].emissivity.arguments) == 100


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('{ temperature = [], temperature_unit = "degC", value = [] }', "'temperature' is empty"),
        (
            '{ temperature = [900, 20], temperature_unit = "degC", value = [0.8, 0.9] }',
            "must increase from row to row; row 2 does not exceed row 1",
        ),
        (
            '{ temperature = [20, nan], temperature_unit = "degC", value = [0.8, 0.9] }',
            "'temperature' row 2 (nan): a finite number",
        ),
        (
            '{ temperature = [20, 30], temperature_unit = "degC", value = [0.8, 1.3] }',
            "'value' row 2 (1.3): must not be above 1",
        ),
        (
            '{ temperature = [20, 30], temperature_unit = "degC", value = [0.8] }',
            "2 rows of temperature, but 1 of value",
        ),
        (
            "{ temperature = [20, 30], value = [0.8, 0.9] }",
            'name the unit of the column once, temperature_unit = "degC"',
        ),
        ('{ temperature = ["20 degC", "30 degC"] }', "needs the column 'value'"),
        (
            '{ temprature = ["0 s", "1 s"], value = [0.8, 0.9] }',
            "did you mean temperature?",
        ),
        ('{ file = "missing.csv" }', "cannot read the table"),
    ],
)
def test_bad_table(write, sound, table, said):
    with pytest.raises(InputError) as caught:
        load_case(write(sound + f"emissivity = {table}\n"))
    assert len(caught.value.problems) == 1
    assert "cooling.1.surface.0.emissivity" in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("T [degC], value\n20, 0.8\n30, 0.9\n", "the first line of"),
        ("temperature [degC], value\n20, 0.8\n30\n", "line 3"),
        ("# dry\n\ntemperature [degC], value\n20, 0.8\n# wet\nx, 0.9\n", "line 6"),
        ("temperature [degC], value\n# one\n20, 0.8\n20, 0.9\n", "line 4 does not exceed line 3"),
        ("temperature [degC], value\n\n20, nan\n30, 0.9\n", "'value' line 3 (nan): a finite"),
        ('temperature [degC], value\n"1,200", 0.8\n1300, 0.9\n', "thousands without a mark"),
    ],
)
def test_bad_csv(write, sound, text, said):
    write(text, "e.csv")
    with pytest.raises(InputError) as caught:
        load_case(write(sound + 'emissivity = { file = "e.csv" }\n'))
    assert said in str(caught.value)
