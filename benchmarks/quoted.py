"""Numbers in the sentences of the pages, linked to the data they come from.

A number in running text is marked by a comment in front of it, which a reader does not see; another
comment, at the end of the page, names its source:

    the slice loses <!-- q1 -->136.4 kJ

    <!-- numbers of this page
    q1: billet_moulds.csv[mould=+1 %/m].heat_removed_slice .1f
    -->

The source is a file of docs/data, the row by one or more columns, the column, and the format. Two
cells may be divided, subtracted or compared in per cent (`%`: how much larger the first is).
`python -m benchmarks tables` rewrites the numbers; a test finds those that differ from their data.
Tables of finished studies are compared with their data by `kept_tables`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.kept_tables import kept_tables
from benchmarks.report import PAGE, Output

_NUMBER = r"[-+]?\d[\d.]*(?:e[-+]?\d+)?"
_FORM = r"[-+]?\.?\d*[defg]"
_QUOTED = re.compile(rf"<!-- q(\d+) -->({_NUMBER})")
_DEFINED = re.compile(rf"^q(\d+): (.+) ({_FORM})$", re.MULTILINE)
_CELL = re.compile(r"(\w+)\.csv\[(.*?)\]\.(.+)")
_SIGN = re.compile(r" ([-/%]) (?=\w+\.csv\[)")


@dataclass(frozen=True, slots=True)
class Quotation:
    """A number in a sentence."""

    line: int  #: line of the page, from 1
    what: str  #: cells of the data that it comes from
    form: str  #: format of the number
    text: str  #: the number in the page


def pages(folder: Path) -> list[Path]:
    """Return the pages in a folder with the layout of docs/ and below it, and README.md."""
    readme = folder.parent / "README.md"
    first = [readme] if folder.name == PAGE.parent.name and readme.is_file() else []
    return first + sorted(folder.rglob("*.md"))


def quotations(page: Path) -> list[Quotation]:
    """Return the marked numbers of a page; one without a source has its marker as `what`."""
    text = page.read_text(encoding="utf-8")
    sources = _sources(text)
    return [
        Quotation(text.count("\n", 0, match.start()) + 1, *_source(match, sources), match[2])
        for match in _QUOTED.finditer(text)
    ]


def _sources(text: str) -> dict[str, tuple[str, str]]:
    """Return cells and format by number, from the end of a page."""
    return {number: (what, form) for number, what, form in _DEFINED.findall(text)}


def _source(match: re.Match[str], sources: Mapping[str, tuple[str, str]]) -> tuple[str, str]:
    """Return cells and format of a marked number."""
    return sources.get(match[1], (f"q{match[1]}", "g"))


def wrong(folder: Path) -> list[str]:
    """Return a message for each number in sentences and kept tables that differs from the data."""
    messages = []
    for page in pages(folder):
        text = page.read_text(encoding="utf-8")
        unused = set(_sources(text)) - {match[1] for match in _QUOTED.finditer(text)}
        name = os.path.relpath(page, folder)
        messages += [f"{name}: no sentence has q{number}" for number in sorted(unused)]
        for quoted in quotations(page):
            where, source = f"{name}: line {quoted.line}", f"{quoted.what} {quoted.form}"
            try:
                right = value(folder, quoted.what, quoted.form)
            except KeyError as error:
                messages.append(f"{where}: {error.args[0]}")
                continue
            if right != quoted.text:
                messages.append(f"{where}: {quoted.text} is quoted, {source} is {right}")
        for table in kept_tables(text):
            messages += [f"{name}: line {table.line}: {what}" for what in table.wrong(folder)]
    return messages


def rewrite(folder: Path) -> None:
    """Rewrite the marked numbers of the pages in `folder`; one without a cell is kept (`wrong`)."""
    for page in pages(folder):
        text = page.read_text(encoding="utf-8")
        sources = _sources(text)

        def updated(match: re.Match[str], sources: Mapping[str, Any] = sources) -> str:
            try:
                number = value(folder, *_source(match, sources))
            except KeyError:
                return match[0]
            return match[0].removesuffix(match[2]) + number

        if (rewritten := _QUOTED.sub(updated, text)) != text:
            page.write_text(rewritten, encoding="utf-8")


def value(folder: Path, what: str, form: str) -> str:
    """Return the number of a source as text.

    Raises:
        KeyError: There is no such cell, or no number in it.
    """
    first, *more = _SIGN.split(what)
    number = _cell(folder, first)
    if more:
        sign, second = more[0], _cell(folder, more[1])
        if sign == "-":
            number -= second
        else:
            number = number / second if sign == "/" else 100.0 * (number / second - 1.0)
    return format(int(number) if form.endswith("d") else number, form)


def _cell(folder: Path, what: str) -> float:
    parts = _CELL.fullmatch(what)
    if parts is None:
        raise KeyError(f"{what}: write it as FILE.csv[COLUMN=VALUE].COLUMN")
    name, chosen, column = parts.groups()
    rows = Output(folder).rows(name)
    if not rows:
        raise KeyError(f"{what}: there is no data/{name}.csv")
    for pair in chosen.split(";"):
        key, _, wanted = pair.partition("=")
        rows = [r for r in rows if _text(r.get(key)) == wanted]
        if not rows:
            raise KeyError(f"{what}: no row with {pair}")
    if len(rows) > 1:
        raise KeyError(f"{what}: {len(rows)} rows are meant by [{chosen}]")
    found = rows[0].get(column)
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise KeyError(f"{what}: no number in column {column}")
    return float(found)


def _text(cell: Any) -> str:
    return format(cell, ".9g") if isinstance(cell, float) else str(cell)
