"""docs/commands.md is what the commands tell of themselves."""

from __future__ import annotations

from pathlib import Path

from castfem.cli.reference_page import markdown_page

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"


def test_the_page_is_that_of_the_commands() -> None:
    mend = "python -m castfem.cli.reference_page docs/commands.md"
    assert PAGE.read_text(encoding="utf-8") == markdown_page(), mend


def test_what_an_option_takes_and_whether_it_is_needed() -> None:
    page = markdown_page()
    assert "| `--to` `DATA.csv` | What was measured (docs/calibrate.md). Required. |" in page
    assert "| `--no-figures` | Do not draw the figures. |" in page
    assert r"by default results/\<family\>/\<name\>." in page
