"""Tables on narrow screens."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


def keep_words(table: Table, width: int) -> None:
    """Let the cells of a table go on to the next line between words, where it is too wide.

    Args:
        table: Without an edge, of plain cells.
        width: Of the screen, in characters. Where not even the longest words have room together,
            the table stays as it is.
    """
    columns = table.columns
    needs, wishes = [], []
    for column in columns:
        cells = [str(column.header), *(str(cell) for cell in column.cells)]
        needs.append(max((len(word) for cell in cells for word in cell.split()), default=1))
        wishes.append(max((len(line) for cell in cells for line in cell.splitlines()), default=1))
    beside = sum(table.padding[i] for i in (1, 3))  # of each column
    room = width - len(columns) * beside - (len(columns) - 1 if table.box is not None else 0)
    spare = room - sum(needs)
    if sum(wishes) <= room or spare < 0:
        return
    for i in sorted(range(len(columns)), key=lambda i: wishes[i] - needs[i]):
        more = min(wishes[i] - needs[i], spare)
        columns[i].width = needs[i] + more
        spare -= more
