"""Numbers in the sentences of the pages, tied to the data they come from.

A number in running text is tied by a comment in front of it, which a reader does not see:

    the slice loses <!-- q: billet_moulds.csv[mould=+1 %/m].heat_removed_slice .1f -->136.4 kJ

The comment names a file of docs/data, the row by one or more columns, the column, and the format.
Two such cells may be divided, subtracted or compared in per cent (`%`: how much more the first is).
`python -m benchmarks tables` writes the numbers anew, a test finds one that differs from its data.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.report import PAGE, Output

_NUMBER = r"[-+]?\d[\d.]*(?:e[-+]?\d+)?"
_QUOTED = re.compile(rf"<!-- q: (.+?) ([-+]?\.?\d*[defg]) -->({_NUMBER})")
_CELL = re.compile(r"(\w+)\.csv\[(.*?)\]\.(.+)")
_SIGN = re.compile(r" ([-/%]) (?=\w+\.csv\[)")


@dataclass(frozen=True, slots=True)
class Quotation:
    """A number in a sentence.

    Attributes:
        line: Of the page, from 1.
        what: The cells it comes from.
        form: Its format.
        told: The number as it stands there.
    """

    line: int
    what: str
    form: str
    told: str


def pages(folder: Path) -> list[Path]:
    """The pages in a folder laid out as docs/, in the folders below it, and README beside docs/."""
    beside = folder.parent / "README.md"
    own = [beside] if folder.name == PAGE.parent.name and beside.is_file() else []
    return own + sorted(folder.rglob("*.md"))


def quotations(page: Path) -> list[Quotation]:
    """The tied numbers of a page."""
    return [
        Quotation(number, *found.groups())
        for number, text in enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
        for found in _QUOTED.finditer(text)
    ]


def wrong(folder: Path) -> list[str]:
    """Numbers of the pages in `folder` that differ from those of its data, a line each."""
    found = []
    for page in pages(folder):
        for one in quotations(page):
            where = f"{os.path.relpath(page, folder)}: line {one.line}"
            try:
                right = value(folder, one.what, one.form)
            except KeyError as error:
                found.append(f"{where}: {error.args[0]}")
                continue
            if right != one.told:
                found.append(f"{where}: {one.told} is quoted, {one.what} {one.form} is {right}")
    return found


def rewrite(folder: Path) -> None:
    """Write the tied numbers of the pages in `folder` anew; one without a cell stays (`wrong`)."""

    def anew(found: re.Match[str]) -> str:
        try:
            return f"<!-- q: {found[1]} {found[2]} -->{value(folder, found[1], found[2])}"
        except KeyError:
            return found[0]

    for page in pages(folder):
        text = page.read_text(encoding="utf-8")
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
