"""history.csv: complete rows, units in the header, resumed without a trace."""

from __future__ import annotations

import math
import resource
from pathlib import Path

import pytest

from castfem.base.errors import InputError, RunFailure
from castfem.runs.output.history import History, last_row, read_columns, read_history

COLUMNS = [("time", "s"), ("position", "m"), ("shell_mid_face", "mm"), ("newton", "-")]


def rows(count: int) -> list[dict[str, float]]:
    return [
        {"time": 0.1 * k, "position": 0.006 * k, "shell_mid_face": math.sqrt(k), "newton": 3}
        for k in range(count)
    ]


def write(path: Path, count: int) -> None:
    with History(path, COLUMNS) as history:
        for row in rows(count):
            history.append(row)


def test_reads_back_names_units_and_twelve_digits(tmp_path):
    write(tmp_path / "h.csv", 5)
    first = (tmp_path / "h.csv").read_text().splitlines()[0]
    assert first == "time [s],position [m],shell_mid_face [mm],newton [-]"
    table = read_history(tmp_path / "h.csv")
    assert list(table.columns) == [name for name, _ in COLUMNS]
    assert table.attrs["units"] == dict(COLUMNS)
    assert {str(kind) for kind in table.dtypes} == {"float64"}
    for row, found in zip(rows(5), table.to_dict("records"), strict=True):
        assert found == pytest.approx(row, rel=1e-11)


def test_columns_are_those_of_the_table(tmp_path):
    write(tmp_path / "h.csv", 5)
    table, columns = read_history(tmp_path / "h.csv"), read_columns(tmp_path / "h.csv")
    assert (columns.columns, list(columns)) == (tuple(table.columns), list(table))
    assert columns.attrs == table.attrs
    assert len(columns) == len(table) == 5
    assert "newton" in columns
    assert "shell" not in columns
    for name in columns:
        assert columns[name].dtype == float
        assert (columns[name] == table[name].to_numpy()).all()


def test_header_without_rows_has_empty_columns(tmp_path):
    write(tmp_path / "h.csv", 0)
    columns = read_columns(tmp_path / "h.csv")
    assert len(columns) == 0
    assert columns["newton"].shape == (0,)


def test_missing_and_infinite_values_are_empty_cells(tmp_path):
    with History(tmp_path / "h.csv", COLUMNS) as history:
        history.append({"time": 0.0, "shell_mid_face": math.inf, "newton": math.nan})
    assert (tmp_path / "h.csv").read_text().splitlines()[1] == "0,,,"
    table = read_history(tmp_path / "h.csv")
    assert table["time"][0] == 0.0
    assert table.iloc[0].isna().sum() == 3


def test_rows_are_on_disk_after_append(tmp_path):
    history = History(tmp_path / "h.csv", COLUMNS)
    for count, row in enumerate(rows(4), start=1):
        history.append(row)
        assert len(read_history(tmp_path / "h.csv")) == count
    history.close()


def test_unknown_columns_are_refused(tmp_path):
    with History(tmp_path / "h.csv", COLUMNS) as history, pytest.raises(ValueError, match="shel"):
        history.append({"time": 0.0, "shel": 1.0})
    assert len(read_history(tmp_path / "h.csv")) == 0


@pytest.mark.parametrize(
    "columns", [[], [("time", "s"), ("time", "s")], [("time", "s"), ("a,b", "m")]]
)
def test_headers_that_cannot_be_read_back_are_refused(tmp_path, columns):
    with pytest.raises(ValueError, match="column"):
        History(tmp_path / "h.csv", columns)


def test_resumed_history_equals_the_continuous_one(tmp_path):
    whole, cut = tmp_path / "whole.csv", tmp_path / "cut.csv"
    write(whole, 8)
    write(cut, 6)
    with cut.open("a") as file:
        file.write("0.6,0.03")  # a run killed in the middle of a row
    with History.resume(cut, 0.1 * 3, COLUMNS) as history:
        assert len(read_history(cut)) == 4
        for row in rows(8)[4:]:
            history.append(row)
    assert cut.read_bytes() == whole.read_bytes()


def test_incomplete_row_is_not_read(tmp_path):
    write(tmp_path / "h.csv", 3)
    text = (tmp_path / "h.csv").read_text()
    (tmp_path / "h.csv").write_text(text[:-3])
    assert len(read_history(tmp_path / "h.csv")) == 2


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        ("a,b\n1,2\n", "line 1 is not"),
        ("time [s],a [m]\n1,2\nx,3\n", "'x' is not a number"),
        ("time [s],a [m],a [m]\n1,2,3\n", "two columns are called a"),
        ("time [s],a [m]\n2,2\n1,3\n", "times do not increase"),
        ("time [s],a [m]\n1,2\n,3\n", "times do not increase"),
        (b"\xff\xfe\x00\n", "cannot be read"),
    ],
)
def test_invalid_history_is_an_input_error(tmp_path, content, message):
    path = tmp_path / "h.csv"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=message) as error:
        read_history(path)
    assert str(path) in error.value.problems[0]


def test_resume_with_other_columns_is_an_input_error(tmp_path):
    write(tmp_path / "h.csv", 3)
    with pytest.raises(InputError, match="other columns"):
        History.resume(tmp_path / "h.csv", 1.0, COLUMNS[:-1])
    with (tmp_path / "h.csv").open("a") as file:
        file.write("none,1,2,3\n")
    with pytest.raises(InputError, match="line 5 has no time"):
        History.resume(tmp_path / "h.csv", 1.0)


def test_resumed_history_has_all_its_rows(tmp_path):
    path = tmp_path / "history.csv"
    with History(path, [("time", "s"), ("size", "m")]) as history:
        for step in range(5):
            history.append({"time": 0.1 * step})
        history.sync()
    lines = path.read_text().splitlines(keepends=True)
    History.resume(path, 0.3, rows=4).close()
    assert path.read_text() == "".join(lines[:5])
    for damaged in (lines[:2] + lines[3:5], lines[:4], lines[:3] + lines[2:5]):
        path.write_text("".join(damaged))
        with pytest.raises(InputError, match=r"has \d rows to 0\.3 s, of 4 that were"):
            History.resume(path, 0.3, rows=4)
        assert path.read_text() == "".join(damaged)
    path.write_text("".join([*lines[:2], lines[3], lines[3], lines[4]]))
    with pytest.raises(InputError, match="its times do not increase"):
        History.resume(path, 0.3, rows=4)


def test_full_disk_leaves_complete_rows(tmp_path):
    history = History(tmp_path / "h.csv", COLUMNS)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, before[1]))
    try:
        with pytest.raises(RunFailure, match=r"h\.csv: cannot be written \(.*free some space"):
            for row in rows(100):
                history.append(row)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    history.close()
    content = (tmp_path / "h.csv").read_text()
    assert content.endswith("\n")
    assert len(read_history(tmp_path / "h.csv")) == content.count("\n") - 1 > 0


def test_resume_without_a_history_names_the_fix(tmp_path):
    with pytest.raises(InputError, match=r"h\.csv: no such file; run again without --resume"):
        History.resume(tmp_path / "h.csv", 1.0)


@pytest.mark.parametrize("columns", [2, 400])
def test_last_row_is_that_of_the_table(tmp_path: Path, columns: int) -> None:
    """For any length of a row, and with an incomplete row of a killed run after it."""
    path = tmp_path / "history.csv"
    names = [("time", "s"), *((f"c{i}", "mm") for i in range(columns))]
    with History(path, names) as history:
        assert last_row(path) is None
        for time in range(5):
            row = {name: -math.pi * 1e-300 * (time + 1) for name, _ in names}
            history.append({**row, "time": float(time), "c1": math.nan})
            found = last_row(path)
            assert found is not None and found[1] == dict(names)
            assert found[0]["time"] == time and math.isnan(found[0]["c1"])
    with path.open("a") as file:
        file.write("5,1.2")
    row, table = last_row(path)[0], read_history(path)
    assert list(row) == list(table) and row["c0"] == table["c0"].iloc[-1]
    with path.open("a") as file:
        file.write("\n")
    with pytest.raises(InputError, match="cells of the header"):
        last_row(path)
