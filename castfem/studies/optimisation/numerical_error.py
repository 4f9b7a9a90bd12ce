"""The numerical error of an optimum, by runs of its values at the other levels of fidelity.

The error of a result is its grid convergence index (`castfem.studies.accuracy.estimate`): what
better levels change, extrapolated to cells of no size with a factor of safety. For a search by
temperature alone it is what the finest level changes, with the error of that level.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from castfem.base.types import Array, Flags
from castfem.studies.accuracy.estimate import convergence_index
from castfem.studies.accuracy.sizes import LEVELS
from castfem.studies.optimisation.fidelity import THERMAL


@dataclass(frozen=True, slots=True)
class Tilt:
    """A change of the cost near an optimum that is linear in the variables."""

    centre: Array  #: the optimum (n,), shares of the ranges
    slope: Array  #: of the cost along each variable (n,), SI over the range
    unknown: Flags  #: along which variables (n,) all runs have failed; the slope is 0 there

    @classmethod
    def fit(cls, centre: Array, shares: Array, change: Array) -> Tilt:
        """Fit changes (r,) at some places (r, n); those that are NaN do not count."""
        there = np.isfinite(change)
        columns = np.column_stack([np.ones(np.count_nonzero(there)), shares[there] - centre])
        slope = np.linalg.lstsq(columns, change[there], rcond=1e-8)[0][1:]
        return cls(centre, slope, ~np.any(columns[:, 1:] != 0.0, axis=0))


@dataclass(frozen=True, slots=True)
class NumericalError:
    """What is known of the numerical error of cost and margins (1 + m,) at an optimum, SI."""

    finished: frozenset[str]  #: the levels at which the best run has finished
    checked: str  #: the one of them that checks the optimum, "" for none
    moved: Array  #: cost and margins at it less those of the search; NaN where there is none
    below: Array  #: how far below those of the search they may be without numerical error
    above: Array  #: how far above
    better: bool  #: whether the check is by a finer level than the search
    tilt: Tilt | None = None  #: change of the cost to the next level; None if not needed or known
    most: float = 0.0  #: by what it may have to be multiplied to be the numerical error
    untilted: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    #: along which variables (n,) the tilt is needed and not known; empty where it is not needed

    @property
    def known(self) -> bool:
        """Whether the best run has finished at another level."""
        return len(self.finished) > 1

    def tilted(self, places: Array, share: float) -> Array:
        """A share of the tilt at some places (r, n), less that at the optimum (r,)."""
        if self.tilt is None:
            return np.zeros(len(places))
        return np.asarray(share * ((places - self.tilt.centre) @ self.tilt.slope))

    def with_tilt(self, fidelity: str, tilt: Tilt) -> NumericalError:
        """The same with the tilt from the level of the search to the next one."""
        other = next_of(fidelity)
        most = error({fidelity: 0.0, other: 1.0}, fidelity)
        sign = 1.0 if _is_better(other, fidelity) else -1.0
        return replace(self, tilt=tilt, most=sign * most, untilted=tilt.unknown)

    @classmethod
    def of(cls, fidelity: str, vectors: Mapping[str, Array]) -> NumericalError:
        """The error of a search at a level, by cost and margins (1 + m,) of all levels, or NaN."""
        here = vectors[fidelity]
        finished = frozenset(word for word, v in vectors.items() if not np.isnan(v).any())
        checked = next((word for word in checks_of(fidelity) if word in finished), "")
        ends = np.array([
            sides({word: float(vector[i]) for word, vector in vectors.items()}, fidelity)
            for i in range(len(here))
        ])  # fmt: skip
        moved = vectors[checked] - here if checked else np.full_like(here, np.nan)
        better = bool(checked) and _is_better(checked, fidelity)
        return cls(finished, checked, moved, ends[:, 0], ends[:, 1], better)


def checks_of(fidelity: str) -> tuple[str, ...]:
    """Return the levels that may check those of a search, the best first: finer ones, if any."""
    others = sorted((w for w in LEVELS if w != fidelity), key=lambda word: LEVELS[word].cells)
    finer = [word for word in others if _is_better(word, fidelity)]
    return tuple(finer or others[:1])


def _is_better(word: str, fidelity: str) -> bool:
    return fidelity == THERMAL or LEVELS[word].cells < LEVELS[fidelity].cells


def next_of(fidelity: str) -> str:
    """Return the level next to that of a search: the next better one, if there is one."""
    return checks_of(fidelity)[-1]


def error(values: Mapping[str, float], fidelity: str) -> float:
    """Return the numerical error of a result by level, in its unit; NaN where it is not known."""
    if fidelity == THERMAL:
        return max(_beside_thermal(values))
    own = LEVELS[fidelity].cells
    return convergence_index({LEVELS[w].cells / own: value for w, value in values.items()})


def sides(values: Mapping[str, float], fidelity: str) -> tuple[float, float]:
    """Return how far below and above a result may lie without numerical error, 0 if not known.

    A result that changes in one direction over three levels or more has an error on that side only.
    """
    if fidelity == THERMAL:
        low, high = _beside_thermal(values)
        return (0.0, 0.0) if math.isnan(low) else (low, high)
    size = error(values, fidelity)
    if math.isnan(size):
        return 0.0, 0.0
    finest_last = sorted(values, key=lambda word: -LEVELS[word].cells)
    steps = np.diff([values[word] for word in finest_last if math.isfinite(values[word])])
    if len(steps) > 1 and np.all(steps >= 0.0):
        return 0.0, size
    if len(steps) > 1 and np.all(steps <= 0.0):
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
