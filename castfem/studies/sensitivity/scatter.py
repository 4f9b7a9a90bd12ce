"""The error of a derivative: how far it is scattered while the shell grows through the cells.

A front goes through a mesh by steps: a vertex cools fast once all round it is solid, then the next.
With it go shell, temperatures, stress and gap, and their derivatives rise and fall from cell to
cell. Runs whose parameter differs have their fronts at other places within a cell, so that a
difference of two of them has about the scatter that a single run has on its way. The derivatives
are read each time the shell has grown by a part of a cell; what a smooth curve leaves of them over
the last cells is their scatter (docs/sensitivity.md has it beside differences of runs).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from castfem.base.types import Array

CELLS = 12.0  # over which it is taken
APART = 0.25  # of a cell, by which the shell grows from one reading to the next
FEWEST = 8  # readings with which it is known
TIMES = 2.5  # the scatter (rms): nine of ten differences of runs lie within
_POWERS = 2  # of the smooth curve


@dataclass(slots=True)
class Scatter:
    """Derivatives along the way through one zone.

    Attributes:
        zone: Index of the cooling.
        rows: Depth of the shell, size of the cell there (m), and all derivatives, of each reading.
    """

    zone: int = -1
    rows: list[list[float]] = field(default_factory=list)

    def due(self, zone: int, depth: float, cell: float) -> bool:
        """Whether the shell has grown enough for another reading."""
        if zone != self.zone or not np.isfinite(cell):
            self.zone, self.rows = zone, []
        if not np.isfinite(cell):
            return False
        return not self.rows or abs(depth - self.rows[-1][0]) >= APART * cell

    def add(self, depth: float, cell: float, slopes: Sequence[float]) -> None:
        """Take in a reading; what lies too far back is dropped."""
        self.rows.append([depth, cell, *slopes])
        self.rows = [row for row in self.rows if abs(row[0] - depth) <= CELLS * cell]

    def errors(self, count: int) -> Array:
        """Errors of all derivatives (count,), NaN where there are too few readings of one."""
        found = np.full(count, np.nan)
        if len(self.rows) < FEWEST:
            return found
        table = np.array(self.rows)
        depth, slopes = table[:, 0], table[:, 2:]
        curve = np.vander((depth - depth[-1]) / table[-1, 1], _POWERS + 1)
        known = np.isfinite(slopes).all(axis=0)
        rest = slopes[:, known] - curve @ np.linalg.lstsq(curve, slopes[:, known], rcond=None)[0]
        free = len(table) - _POWERS - 1
        found[known] = TIMES * np.sqrt((rest**2).sum(axis=0) / free)
        return found
