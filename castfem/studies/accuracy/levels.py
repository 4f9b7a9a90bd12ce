"""The sizes of a run by one word: cells and coupling windows over those of the case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

DEFAULT = "default"


@dataclass(frozen=True, slots=True)
class Level:
    """A level of accuracy.

    Attributes:
        cells: Size of the cells over that of the case.
        window: Length of the coupling windows over that of the case.
    """

    cells: float
    window: float


LEVELS: Mapping[str, Level] = {
    "coarse": Level(1.5, 2.0),
    DEFAULT: Level(1.0, 1.0),
    "fine": Level(0.625, 0.5),
}
"""The cheapest first."""
