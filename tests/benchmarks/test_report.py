"""Output of benchmarks: markers of a page, tables, CSV files."""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path

import pytest

from benchmarks.__main__ import tables
from benchmarks.kept_tables import kept_tables
from benchmarks.quoted import pages, quotations, rewrite, wrong
from benchmarks.report import PAGE, Output, front
from benchmarks.sensitivity_errors import within

TEXT = """# Page

<!-- begin one -->
old
<!-- end one -->

between

<!-- begin one more -->
<!-- end one more -->
"""


@pytest.fixture
def output(tmp_path: Path) -> Output:
    (tmp_path / "page.md").write_text(TEXT, encoding="utf-8")
    return Output(tmp_path, "page.md")


def test_text_is_only_between_its_markers(output: Output) -> None:
    output.insert("one", "| a \\1 |\n\n")
    page = output.page.read_text(encoding="utf-8")
    assert page == TEXT.replace("old\n", "| a \\1 |\n")
    output.insert("one", "| a \\1 |")
    assert output.page.read_text(encoding="utf-8") == page, "the second time changes nothing"
    output.insert("one more", "new")
    assert output.page.read_text(encoding="utf-8") == page.replace(
        "<!-- end one more", "new\n<!-- end one more"
    )


def test_unknown_marker_is_an_error_and_leaves_the_page(output: Output) -> None:
    with pytest.raises(KeyError, match=r"page\.md has no place for 'two'"):
        output.insert("two", "text")
    assert output.page.read_text(encoding="utf-8") == TEXT


def test_page_is_copied_to_another_folder(tmp_path: Path) -> None:
    original = PAGE.read_text(encoding="utf-8")
    output = Output(tmp_path / "new")
    output.insert("shares", "short")
    assert "<!-- begin shares -->\nshort\n<!-- end shares -->" in output.page.read_text("utf-8")
    assert PAGE.read_text(encoding="utf-8") == original


@pytest.mark.parametrize("page", ["benchmarks.md", "benchmarks_mechanics.md", "billet.md"])
def test_markers_of_the_pages_are_pairs_and_filled(page: str) -> None:
    text = PAGE.with_name(page).read_text(encoding="utf-8")
    begun, ended = (re.findall(rf"<!-- {word} (.+?) -->", text) for word in ("begin", "end"))
    assert begun == ended
    assert len(begun) == len(set(begun)) > 3 - len(kept_tables(text))
    assert not re.search(r"<!-- begin (.+?) -->\s*<!-- end", text)


def test_csv(output: Output) -> None:
    rows = [{"what": "a", "x": 1.23456789, "y": None}, {"what": "b", "x": 20.0, "y": 3}]
    output.csv("rows", rows)
    with (output.folder / "data" / "rows.csv").open(encoding="utf-8") as file:
        assert list(csv.DictReader(file)) == [
            {"what": "a", "x": "1.23456789", "y": ""},
            {"what": "b", "x": "20", "y": "3"},
        ]
    assert output.rows("rows") == [
        {"what": "a", "x": 1.23456789, "y": None},
        {"what": "b", "x": 20, "y": 3},
    ]
    odd = [{"what": "1e-4", "flag": True, "x": 1e-9, "y": float("inf")}]
    output.csv("odd", odd)
    assert output.rows("odd") == odd, "what somebody called 1e-4 is a word"
    assert output.rows("none") == []


def test_front_keeps_undominated_runs() -> None:
    rows = [{"seconds": s, "e": e} for s, e in ((3, 1.0), (1, 5.0), (2, 7.0), (4, 1.0), (5, 0.5))]
    assert front(rows, "e") == ([1, 3, 5], [5.0, 1.0, 0.5])


# Numbers on the pages agree with the data: every table is made again and compared


DOCS = PAGE.parent
BEGIN = re.compile(r"<!-- begin (.+?) -->\n(.*?)<!-- end \1 -->", re.DOTALL)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the pages with empty blocks, filled from a copy of the data."""
    folder = tmp_path_factory.mktemp("docs")
    shutil.copytree(DOCS / "data", folder / "data")
    for page in DOCS.glob("*.md"):
        text = BEGIN.sub(r"<!-- begin \1 -->\n<!-- end \1 -->", page.read_text(encoding="utf-8"))
        (folder / page.name).write_text(text, encoding="utf-8")
    tables(folder)
    return folder


@pytest.mark.parametrize("page", sorted(p.name for p in DOCS.glob("*.md")))
def test_tables_are_those_of_the_data(page: str, made: Path) -> None:
    """Byte for byte; `python -m benchmarks tables` updates a page after a change of its data."""
    there, anew = (
        {m[1]: m[2] for m in BEGIN.finditer((folder / page).read_text(encoding="utf-8"))}
        for folder in (DOCS, made)
    )
    for name, text in there.items():
        assert anew[name] == text, f"{page}: {name}: regenerate it: python -m benchmarks tables"
        assert text.strip(), name


def test_changed_number_is_found(made: Path, tmp_path: Path) -> None:
    """The comparison finds a cell of the data that differs from the page."""
    shutil.copytree(made, tmp_path / "docs")
    data = tmp_path / "docs" / "data" / "caster.csv"
    text = data.read_text(encoding="utf-8")
    data.write_text(text.replace(text.splitlines()[1].split(",")[3], "16.5"), encoding="utf-8")
    tables(tmp_path / "docs")
    page = (tmp_path / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    assert page != (made / "benchmarks.md").read_text(encoding="utf-8")


def test_numbers_in_sentences_are_those_of_the_data() -> None:
    found = wrong(DOCS)
    assert not found, "\n".join(found)


def test_sentence_that_differs_from_its_data_is_found(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "runs.csv").write_text("run,heat,peak\nslow,9.1234,12\nfast,8,6\n")
    page = tmp_path / "page.md"
    sentence = "Slow takes <!-- q1 -->{} MJ out.\n\nq1: runs.csv[run=slow].heat .2f\n"
    page.write_text(sentence.format("9.12"))
    assert wrong(tmp_path) == []
    page.write_text(sentence.format("9.21"))
    (message,) = wrong(tmp_path)
    assert message == "page.md: line 1: 9.21 is quoted, runs.csv[run=slow].heat .2f is 9.12"
    ratio = "<!-- q1 -->{} times\n\nq1: runs.csv[run=slow].peak / runs.csv[run=fast].peak .1f\n"
    page.write_text(ratio.format("2.0"))
    assert wrong(tmp_path) == []
    page.write_text(sentence.format("9.12").replace("run=slow", "run=slower"))
    assert "no row with run=slower" in wrong(tmp_path)[0]


def test_source_of_a_number_is_at_the_end_of_its_page(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "runs.csv").write_text("run,heat\nslow,9.1234\n")
    page = tmp_path / "page.md"
    source = "\n<!-- numbers of this page\nq1: runs.csv[run=slow].heat .2f\n-->\n"
    page.write_text("It takes <!-- q1 -->9.21 MJ out.\n" + source)
    (message,) = wrong(tmp_path)
    assert message == "page.md: line 1: 9.21 is quoted, runs.csv[run=slow].heat .2f is 9.12"
    rewrite(tmp_path)
    assert wrong(tmp_path) == [] and "<!-- q1 -->9.12 MJ" in page.read_text()
    page.write_text("It takes <!-- q2 -->9.12 MJ out.\n" + source)
    unused, unknown = wrong(tmp_path)
    assert unused == "page.md: no sentence has q1"
    assert unknown.startswith("page.md: line 1: q2: write it as FILE.csv")


KEPT = """Text.

<!-- data runs.csv -->
| run | heat [MJ] | from, to [K] |
|:--|--:|:--|
| **slow** | 9.12 | 1 to 2.5 |
| fast, 2 mm | 8.0 |  |
"""
RUNS = "run,heat,low,high\nslow,9.1234,1,2.52\nfast,8,,\n"


@pytest.mark.parametrize(
    ("text", "other", "error"),
    [
        ("", "", ""),
        ("9.12", "9.21", "page.md: line 3: heat [MJ]: no column has 9.21 in runs.csv"),
        ("2.5", "2.6", "page.md: line 3: from, to [K]: no column has 2.6 in runs.csv"),
        ("| 8.0 |", "| 9.12 |", "page.md: line 3: heat [MJ]: no column has 9.12 in runs.csv"),
        ("| fast, 2 mm | 8.0 |  |\n", "", "page.md: line 3: 1 rows, runs.csv has 2"),
        ("runs.csv", "no.csv", "page.md: line 3: 2 rows, no.csv has 0"),
        ("data runs.csv", "data runs.csv rows 2 1", "page.md: line 3: heat [MJ]: no column"),
    ],
)
def test_table_of_a_finished_study_agrees_with_its_file(
    tmp_path: Path, text: str, other: str, error: str
) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "runs.csv").write_text(RUNS)
    (tmp_path / "page.md").write_text(KEPT.replace(text, other, 1) if text else KEPT)
    found = wrong(tmp_path)
    assert found[0].startswith(error) if error else not found, found


def test_transposed_table_agrees_with_its_file(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "runs.csv").write_text(RUNS)
    turned = (
        "<!-- data runs.csv transposed -->\n|  | slow | fast |\n|:--|--:|--:|\n| heat | {} | 8 |\n"
    )
    page = tmp_path / "page.md"
    page.write_text(turned.format("9.123"))
    assert not wrong(tmp_path)
    page.write_text(turned.format("9.124"))
    assert wrong(tmp_path) == ["page.md: line 1: heat: no column has 9.124 in runs.csv"]


def test_changed_digits_of_kept_tables_are_found() -> None:
    """Every table is read; digits in words of the first column may differ from the file."""
    tried = missed = 0
    for page in pages(DOCS):
        text = page.read_text(encoding="utf-8")
        tables = text.split("<!-- data ")[1:]
        assert len(kept_tables(text)) == len(tables), page.name
        for rest in tables:
            table = "<!-- data " + re.split(r"\n(?!\|)", rest, maxsplit=1)[0] + "\n"
            begin = re.search(r"\n\|[-:|]+\n", table)
            for digit in list(re.finditer(r"\d", table[begin.end() :]))[::7]:
                place = begin.end() + digit.start()
                other = str((int(digit[0]) + 3) % 10)
                (changed,) = kept_tables(table[:place] + other + table[place + 1 :])
                tried += 1
                missed += not changed.wrong(DOCS)
    assert missed < 0.05 * tried


def test_pages_quote_numbers() -> None:
    assert sum(len(quotations(page)) for page in pages(DOCS)) > 10
    assert any(page.name == "README.md" for page in pages(DOCS))


@pytest.mark.parametrize("place", ["how_to/page.md", "../README.md"])
def test_pages_in_other_folders_are_compared_too(tmp_path: Path, place: str) -> None:
    """A different number is found there, and rewritten."""
    folder = tmp_path / "docs"
    (folder / "data").mkdir(parents=True)
    (folder / "data" / "runs.csv").write_text("run,heat\nslow,9.1234\n")
    page = folder / place
    page.parent.mkdir(exist_ok=True)
    page.write_text("It takes <!-- q1 -->9.21 MJ out.\n\nq1: runs.csv[run=slow].heat .2f\n")
    (message,) = wrong(folder)
    assert message.startswith(f"{place}: line 1: 9.21 is quoted")
    rewrite(folder)
    assert wrong(folder) == [] and "-->9.12 MJ" in page.read_text()


def test_no_line_begins_with_a_comment() -> None:
    """Markdown would take such a line for HTML and split the sentence."""
    for page in pages(DOCS):
        for line in page.read_text(encoding="utf-8").splitlines():
            assert not re.match(r"\s*<!-- q\d", line), (page.name, line)


def test_most_differences_are_within_the_stated_error() -> None:
    rows = Output(DOCS).rows("sensitivity_errors")
    known = [row["within"] for row in rows if row["within"] != "error unknown"]
    assert len(known) == 42 and known.count("yes") == 39
    for row in rows:
        apart = [row["near"], row["far"]]
        assert within(row["derivative"], row["error"], apart) == row["within"]
