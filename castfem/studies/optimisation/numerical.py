"""The numerical error at an optimum: its best run by the other levels of accuracy, too.

The error of a result is its grid convergence index (`castfem.studies.accuracy.estimate`): what
better levels change, extrapolated to cells of no size with a factor of safety. Of a search by
temperature alone it is what the finest level changes, with its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from castfem.base.types import Array, Flags
from castfem.studies.accuracy.estimate import convergence_index
from castfem.studies.accuracy.levels import LEVELS
from castfem.studies.optimisation.fidelity import THERMAL


@dataclass(frozen=True, slots=True)
class Tilt:
    """A change of the cost near an optimum that is linear in the variables.

    Attributes:
        centre: The optimum (n,), shares of the ranges.
        slope: Of the cost along each variable (n,), SI over the range.
        unknown: Along which variables (n,) no run has come through; the slope is 0 there.
    """

    centre: Array
    slope: Array
    unknown: Flags

    @classmethod
    def fit(cls, centre: Array, shares: Array, change: Array) -> Tilt:
        """Fit changes (r,) at some places (r, n); those that are NaN do not count."""
        there = np.isfinite(change)
        columns = np.column_stack([np.ones(np.count_nonzero(there)), shares[there] - centre])
        slope = np.linalg.lstsq(columns, change[there], rcond=1e-8)[0][1:]
        return cls(centre, slope, ~np.any(columns[:, 1:] != 0.0, axis=0))

    def __call__(self, shares: Array) -> Array:
        """The change (r,) at some places (r, n), less that at the optimum."""
        return np.asarray((shares - self.centre) @ self.slope)


@dataclass(frozen=True, slots=True)
class Numerical:
    """What is known of the numerical error of cost and margins at an optimum, SI.

    Attributes:
        through: The levels at which the best run has come through.
        checked: The one of them that checks the optimum, "" for none.
        moved: Cost and margins by it less those of the search (1 + m,); NaN where there is none.
        below: How far below those of the search they may be without numerical error (1 + m,).
        above: How far above.
        better: Whether that is a finer level than that of the search.
        tilt: How the cost by the next better level, less that of the search, changes near the
            optimum; None where bounds hold all variables, or runs have failed.
        most: By what it may have to be multiplied to be the numerical error.
        untilted: Along which variables (n,) that is needed and not known, for runs have failed;
            empty where it is not needed.
    """

    through: frozenset[str]
    checked: str
    moved: Array
    below: Array
    above: Array
    better: bool
    tilt: Tilt | None = None
    most: float = 0.0
    untilted: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))

    @property
    def known(self) -> bool:
        """Whether another level has come through."""
        return len(self.through) > 1

    def tilted(self, places: Array, share: float) -> Array:
        """Return a share of what the cost changes by at some places (r, n) near the optimum (r,).

        Args:
            places: Shares of the ranges.
            share: Of the change from the level of the search to the next better one.
        """
        return np.zeros(len(places)) if self.tilt is None else share * self.tilt(places)

    def with_tilt(self, fidelity: str, tilt: Tilt) -> Numerical:
        """Return it with how the cost by the next level differs near the optimum."""
        other = next_of(fidelity)
        most = error({fidelity: 0.0, other: 1.0}, fidelity)
        finer = _is_better(other, fidelity)
        return replace(self, tilt=tilt, most=most if finer else -most, untilted=tilt.unknown)

    @classmethod
    def of(cls, fidelity: str, vectors: Mapping[str, Array]) -> Numerical:
        """Return what cost and margins by several levels tell of those by the level of a search.

        Args:
            fidelity: The level of the search.
            vectors: Cost and margins (1 + m,) by level, that of the search among them; NaN where a
                run has failed.
        """
        here = vectors[fidelity]
        through = frozenset(word for word, v in vectors.items() if not np.isnan(v).any())
        checked = next((word for word in checks_of(fidelity) if word in through), "")
        ends = np.array([
            sides({word: float(vector[i]) for word, vector in vectors.items()}, fidelity)
            for i in range(len(here))
        ])  # fmt: skip
        moved = vectors[checked] - here if checked else np.full_like(here, np.nan)
        better = bool(checked) and _is_better(checked, fidelity)
        return cls(through, checked, moved, ends[:, 0], ends[:, 1], better)


def checks_of(fidelity: str) -> tuple[str, ...]:
    """Return the levels that may check those of a search, the best first: finer ones, if any."""
    others = sorted((w for w in LEVELS if w != fidelity), key=lambda word: LEVELS[word].cells)
    finer = [word for word in others if _is_better(word, fidelity)]
    return tuple(finer or others[:1])


def _is_better(word: str, fidelity: str) -> bool:
    """Whether a level is better than that of a search, as all are than temperature alone."""
    return fidelity == THERMAL or LEVELS[word].cells < LEVELS[fidelity].cells


def next_of(fidelity: str) -> str:
    """Return the level next to that of a search: the next better one, if there is one."""
    return checks_of(fidelity)[-1]


def error(values: Mapping[str, float], fidelity: str) -> float:
    """Return the numerical error of a result, in its unit; NaN where nothing is known.

    Args:
        values: The result by level.
        fidelity: The level whose error it is.
    """
    if fidelity == THERMAL:
        low, high = _beside_thermal(values)
        return max(low, high)
    own = LEVELS[fidelity].cells
    return convergence_index({LEVELS[w].cells / own: value for w, value in values.items()})


def sides(values: Mapping[str, float], fidelity: str) -> tuple[float, float]:
    """Return how far below and above a result may lie without numerical error, 0 if not known.

    Where it goes one way over three levels or more it goes on that way, and the error has one side.
    """
    if fidelity == THERMAL:
        low, high = _beside_thermal(values)
        return (0.0, 0.0) if math.isnan(low) else (low, high)
    size = error(values, fidelity)
    if math.isnan(size):
        return 0.0, 0.0
    finest_last = sorted(values, key=lambda word: -LEVELS[word].cells)
    known = [values[word] for word in finest_last if math.isfinite(values[word])]
    steps = np.diff(known)
    if len(known) > 2 and np.all(steps >= 0.0):
        return 0.0, size
    if len(known) > 2 and np.all(steps <= 0.0):
        return size, 0.0
    return size, size


def _beside_thermal(values: Mapping[str, float]) -> tuple[float, float]:
    """How far below and above a result by temperature alone that of the finest level may lie."""
    known = {word: v for word, v in values.items() if word != THERMAL and math.isfinite(v)}
    if not known:
        return math.nan, math.nan
    finest = min(known, key=lambda word: LEVELS[word].cells)
    own, off = error(known, finest), known[finest] - values[THERMAL]
    own = 0.0 if math.isnan(own) else own
    return max(0.0, own - off), max(0.0, off + own)
