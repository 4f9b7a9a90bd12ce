"""One line on a run: what, how much, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.shown_units import place_said, said

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, slots=True)
class Remark:
    """One line: what, how much, and where.

    Attributes:
        what: Of which quantity.
        value: In `unit`.
        unit: As in history.csv.
        where: Place and position, for a reader.
        name: Of the column, where its unit may be chosen by it.
        resolution: How exactly the cells resolve it, in `unit`; None where that is not known.
    """

    what: str
    value: float
    unit: str
    where: str
    name: str = ""
    resolution: float | None = None


def in_mm(position: float) -> str:
    """A position below the meniscus."""
    return place_said(position, near=".0f", far=".2f")


def at_place(position: float, table: pandas.DataFrame) -> str:
    """A position and the time when the slice is there."""
    time = float(np.interp(position, table["position"], table["time"]))
    digits = ".3g" if time < 1e3 else ".0f"  # 1100 s, not 1.1e+03 s
    return f"{in_mm(position)}, t = {said(time, 's', digits, 'time')}"
