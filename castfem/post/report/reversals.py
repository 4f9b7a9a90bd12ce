"""What goes back on the way down: a shell that melts again, a surface that heats up."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.shown_units import said
from castfem.base.types import Array
from castfem.post.plots.history import curves, unit_of
from castfem.post.report.remark import Remark, in_mm

if TYPE_CHECKING:
    import pandas

REMELTED = "shell melted again"
_MELTED = 0.1  # mm; a shell that loses less on the way is not named
_REHEATED = 5.0  # K; surfaces that heat up by less are not named


def remelting(table: pandas.DataFrame, position: Array) -> Iterator[Remark]:
    """Where the shell has become thinner on the way down, by the most at any probe.

    A shell that is gone again lets the steel out: what follows is a strand without a breakout.
    """
    best: tuple[float, str, int, int, str] | None = None
    for label, _, column in curves(table, "shell"):
        shell = table[column].to_numpy()
        lost = np.fmax.accumulate(shell) - shell
        if not np.isfinite(lost).any():
            continue
        end = int(np.nanargmax(lost))
        start = int(np.nanargmax(shell[: end + 1]))
        if best is None or lost[end] > best[0]:
            best = float(lost[end]), label, start, end, column
    if best is None or best[0] < _MELTED:
        return
    value, label, start, end, column = best
    rest = float(table[column].iloc[end])
    left = f"where {said(rest, unit_of(table, column), '.2g', column)} are left"
    if rest <= 0.0:
        left = "where none is left: a sign of a breakout"
    where = f"{label}, from {in_mm(position[start])} to {in_mm(position[end])}, {left}"
    yield Remark(REMELTED, value, unit_of(table, column), where, column)


def reheating(table: pandas.DataFrame, position: Array) -> Iterator[Remark]:
    """The largest rise of a surface temperature on the way down."""
    best: tuple[float, str, int, int] | None = None
    for label, _, column in curves(table, "surface_temperature"):
        values = table[column].to_numpy()
        coldest = np.fmin.accumulate(values)
        rise = values - coldest
        if not np.isfinite(rise).any():
            continue
        end = int(np.nanargmax(rise))
        start = int(np.nanargmin(values[: end + 1]))
        if best is None or rise[end] > best[0]:
            best = float(rise[end]), label, start, end
    if best is None or best[0] < _REHEATED:
        return
    value, label, start, end = best
    where = f"{label}, from {in_mm(position[start])} to {in_mm(position[end])}"
    yield Remark("largest reheating of the surface", value, "K", where)
