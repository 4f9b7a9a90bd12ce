"""Results of the benchmarks: CSV files, figures, and tables in a page of docs/."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.post.plots.style import look, new_figure

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks.md"
Row = Mapping[str, Any]
Columns = Mapping[str, str | Sequence[str]]
"""Heading of each column by its key, or heading and format of its numbers."""
_WORDS = {"": None, "True": True, "False": False}


@dataclass(frozen=True, slots=True)
class Output:
    """A folder with the layout of docs/: data/*.csv, figures/*.png and the page with the tables."""

    #: docs/ or another folder, into which the page is copied if it is missing
    folder: Path = PAGE.parent
    name: str = PAGE.name  #: file name of the page

    @property
    def page(self) -> Path:
        """Path of the page with the tables."""
        return self.folder / self.name

    def csv(self, name: str, rows: Sequence[Row]) -> None:
        """Write data/NAME.csv; the keys of the first row are the columns."""
        path = self.folder / "data" / f"{name}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows({k: _plain(v) for k, v in row.items()} for row in rows)

    def rows(self, name: str) -> list[dict[str, Any]]:
        """Read data/NAME.csv: numbers, flags, words, None for empty cells; [] without a file.

        Tables are made only from these rows, so that pages can be made again from the data.
        """
        path = self.folder / "data" / f"{name}.csv"
        if not path.is_file():
            return []
        with path.open(newline="", encoding="utf-8") as file:
            return [{k: _read(v) for k, v in row.items()} for row in csv.DictReader(file)]

    def figure(self, name: str, figure: Figure) -> Path:
        """Write figures/NAME.png."""
        path = self.folder / "figures" / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=110)
        return path

    def table(self, name: str, rows: Sequence[Row], columns: Columns) -> None:
        """Write a table between the markers NAME of the page; without rows keep the present one."""
        if rows:
            pairs = {k: (v, "g") if isinstance(v, str) else v for k, v in columns.items()}
            heads = {k: head for k, (head, _) in pairs.items()}
            self.insert(name, table(rows, heads, {k: form for k, (_, form) in pairs.items()}))

    def insert(self, name: str, text: str) -> None:
        """Write `text` between the markers NAME of the page.

        Raises:
            KeyError: The page has no such markers.
        """
        if not self.page.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            original = PAGE.with_name(self.name)
            self.page.write_text(original.read_text(encoding="utf-8"), encoding="utf-8")
        page = self.page.read_text(encoding="utf-8")
        pattern = re.compile(rf"(<!-- begin {name} -->\n).*?(<!-- end {name} -->)", re.DOTALL)
        if not pattern.search(page):
            raise KeyError(f"{self.page.name} has no place for '{name}'")
        page = pattern.sub(lambda m: f"{m[1]}{text.rstrip()}\n{m[2]}", page)
        self.page.write_text(page, encoding="utf-8")


def power(rows: Sequence[Row], cost: str) -> float:
    """Return the power of the number of cells with which a cost grows, over all rows."""
    cells, costs = (np.log([r[k] for r in rows]) for k in ("cells", cost))
    return float(np.polyfit(cells, costs, 1)[0])


def front(rows: Sequence[Row], key: str) -> tuple[list[float], list[float]]:
    """Return time and error of the runs that no other run beats in both."""
    best, times, errors = float("inf"), [], []
    for r in sorted(rows, key=lambda r: r["seconds"]):
        if r[key] < best:
            best = r[key]
            times.append(r["seconds"])
            errors.append(best)
    return times, errors


def table(rows: Sequence[Row], columns: Mapping[str, str], formats: Mapping[str, str]) -> str:
    """Return a Markdown table.

    Args:
        rows: Data.
        columns: Headings by key, in order.
        formats: Format of the numbers by key, as for `format`; default "g".
    """
    numeric = {k: all(not isinstance(r.get(k), str) for r in rows) for k in columns}
    lines = [
        "| " + " | ".join(columns.values()) + " |",
        "|" + "|".join("--:" if numeric[k] else ":--" for k in columns) + "|",
    ]
    for row in rows:
        cells = [written(row.get(k), formats.get(k, "g")) for k in columns]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def written(value: Any, form: str) -> str:
    """Return the text of a cell: a number in a format, a word unchanged, "" for None."""
    if value is None:
        return ""
    return value if isinstance(value, str) else format(value, form)


def _read(text: str) -> Any:
    """Return the inverse of `_plain`."""
    if text in _WORDS:
        return _WORDS[text]
    for kind, form in ((int, "d"), (float, ".9g")):
        try:
            value = kind(text)
        except ValueError:
            continue
        if format(value, form) == text:  # "1e-4" is a name, not a number
            return value
    return text


def _plain(value: Any) -> Any:
    """Return a float with nine digits for a CSV file, another value unchanged."""
    return f"{value:.9g}" if isinstance(value, float) else value


Panel = tuple[str, Sequence[Row], str, str]
"""Title, runs, key of the error, and its label.

A run has `seconds`, the error, `default`, and `colour`, `marker` and `size` of its point."""


def errors_over_time(
    panels: Sequence[Sequence[Panel]],
    legend: Sequence[tuple[str, str, str]],
    logarithmic: bool = True,
) -> Figure:
    """Draw each run as a point; the default is ringed, runs that no other beats are joined.

    Args:
        panels: Panels row by row.
        legend: Text, marker and colour of the entries.
        logarithmic: Whether the scale of the errors is logarithmic.
    """
    with look():
        figure = new_figure(8.6, 3.2 * len(panels))
        grid = figure.subplots(len(panels), len(panels[0]), squeeze=False)
        for axis, (title, rows, key, label) in zip(
            grid.flat, (panel for line in panels for panel in line), strict=True
        ):
            axis.plot(*front(rows, key), "-", color="#777777", linewidth=1.0)
            for row in rows:
                point, style = (row["seconds"], row[key]), {"color": row["colour"]}
                axis.plot(*point, row["marker"], markersize=row["size"], **style)
                if row["default"]:
                    axis.plot(*point, "o", markersize=15, fillstyle="none", color="black")
            axis.set(xscale="log", xlabel="processor time [s]", ylabel=f"error: {label}")
            axis.set_title(title)
            _plain_numbers(axis.xaxis)
            if logarithmic:
                axis.set_yscale("log")
                _plain_numbers(axis.yaxis)
            else:
                axis.set_ylim(bottom=0.0)
        handles = [
            figure.axes[0].plot([], [], mark, color=colour, label=words)[0]
            for words, mark, colour in legend
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=8)
    return figure


def _plain_numbers(axis: Axis) -> None:
    """Label an axis by numbers without powers of ten."""
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:e}"[0] in "25" else "")
