"""Numbers in the sentences of the pages, tied to the data they come from.

A number in running text is tied by a comment in front of it, which a reader does not see; another
comment, at the end of the page, says where its number comes from:

    the slice loses <!-- q1 -->136.4 kJ

    <!-- numbers of this page
    q1: billet_moulds.csv[mould=+1 %/m].heat_removed_slice .1f
    -->

That is a file of docs/data, the row by one or more columns, the column, and the format. Two such
cells may be divided, subtracted or compared in per cent (`%`: how much more the first is).
`python -m benchmarks tables` writes the numbers anew, a test finds one that differs from its data.
Tables of finished studies are held to their data by `kept_tables`.
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

    line: int  #: of the page, from 1
    what: str  #: the cells it comes from
    form: str  #: its format
    told: str  #: the number as it stands there


def pages(folder: Path) -> list[Path]:
    """The pages in a folder laid out as docs/, in the folders below it, and README beside docs/."""
    beside = folder.parent / "README.md"
    own = [beside] if folder.name == PAGE.parent.name and beside.is_file() else []
    return own + sorted(folder.rglob("*.md"))


def quotations(page: Path) -> list[Quotation]:
    """The tied numbers of a page; without a source where it says none."""
    text = page.read_text(encoding="utf-8")
    known = _defined(text)
    return [
        Quotation(text.count("\n", 0, found.start()) + 1, *_source(found, known), found[2])
        for found in _QUOTED.finditer(text)
    ]


def _defined(text: str) -> dict[str, tuple[str, str]]:
    """Cells and format by number, as the end of a page has them."""
    return {number: (what, form) for number, what, form in _DEFINED.findall(text)}


def _source(found: re.Match[str], known: Mapping[str, tuple[str, str]]) -> tuple[str, str]:
    """Cells and format of a quotation."""
    return known.get(found[1], (f"q{found[1]}", "g"))


def wrong(folder: Path) -> list[str]:
    """Numbers of pages in `folder`, in sentences and kept tables, that its data have otherwise."""
    found = []
    for page in pages(folder):
        text = page.read_text(encoding="utf-8")
        unused = set(_defined(text)) - {one[1] for one in _QUOTED.finditer(text)}
        name = os.path.relpath(page, folder)
        found += [f"{name}: no sentence has q{number}" for number in sorted(unused)]
        for one in quotations(page):
            where = f"{name}: line {one.line}"
            try:
                right = value(folder, one.what, one.form)
            except KeyError as error:
                found.append(f"{where}: {error.args[0]}")
                continue
            if right != one.told:
                found.append(f"{where}: {one.told} is quoted, {one.what} {one.form} is {right}")
        for table in kept_tables(text):
            found += [f"{name}: line {table.line}: {what}" for what in table.wrong(folder)]
    return found


def rewrite(folder: Path) -> None:
    """Write the tied numbers of the pages in `folder` anew; one without a cell stays (`wrong`)."""
    for page in pages(folder):
        text = page.read_text(encoding="utf-8")
        known = _defined(text)

        def anew(found: re.Match[str], known: Mapping[str, Any] = known) -> str:
            try:
                number = value(folder, *_source(found, known))
            except KeyError:
                return found[0]
            return found[0].removesuffix(found[2]) + number

        if (made := _QUOTED.sub(anew, text)) != text:
            page.write_text(made, encoding="utf-8")


def value(folder: Path, what: str, form: str) -> str:
    """The number that a comment asks for, as text.

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
