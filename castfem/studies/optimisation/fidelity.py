"""Levels of fidelity of a run, the idealised mould of a case, the numerical error of an optimum.

    thermal   temperature alone, on the section as cold: no mechanics, the mould follows the strand
    coarse    cells 1.5 times as large, coupling windows twice as long
    default   the case as it is
    fine      cells 0.625 times as large, coupling windows half as long

The error of a result is its grid convergence index (`castfem.studies.accuracy.estimate`): the
change to better levels, extrapolated to zero cell size with a factor of safety. For a purely
thermal search it is the change to the finest level, with the error of that level.

Costs and errors for the billet of chapter V: docs/mould_design.md. Equation numbers are those of
[Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.base.types import Array, Flags
from castfem.model.load import from_document
from castfem.model.mechanics import Way
from castfem.studies.accuracy.estimate import convergence_index
from castfem.studies.accuracy.sizes import DEFAULT, LEVELS

if TYPE_CHECKING:
    from castfem.model import Case


THERMAL = "thermal"
WORDS = (THERMAL, *LEVELS)
_WALL = "mould"  # value of a contact law that refers to mould.wall_temperature
# Only the liquid supports a shell without a wall; with this stiffness it bulges as in V.2.1.1.
_SUPPORT = {
    "liquid": "elastic",
    "liquid_stiffness": 1e-3,
    "mush": "geometric",
    "ferrostatic": "proportional",
}


def check_word(word: str) -> None:
    """Refuse an unknown level of fidelity."""
    if str(word) not in WORDS:
        near = units.nearest(str(word), WORDS)
        raise InputError(f"fidelity must be one of {', '.join(WORDS)}, got {word!r}{near}")


def at_level(case: Case, word: str) -> Case:
    """Return a case at a level of fidelity."""
    check_word(word)
    if word == DEFAULT:
        return case
    if word == THERMAL:
        return _changed(case, lambda tables: _remove_mould(tables, case, mechanics=False))
    level = LEVELS[word]

    def refine(tables: dict[str, Any]) -> None:
        mesh = tables["mesh"]
        for key in [key for key in mesh if key.endswith("_size")]:
            mesh[key] = units.format(level.cells * getattr(case.mesh, key), "m", "mm")
        if case.mechanics is not None:
            window = case.coupling.interval
            length, unit = (window.length, "m") if isinstance(window, Way) else (window, "s")
            tables["coupling"]["interval"] = units.format(level.window * length, unit, unit)

    return _changed(case, refine)


def idealised(case: Case) -> Case:
    """Return the case in its idealised mould (V.2.1), which follows the strand.

    There is no gap and no contact pressure; with mechanics the elastic liquid of the thesis
    supports the shell. A case without [mould] is returned unchanged.
    """
    if case.mould is None:
        return case
    return _changed(case, lambda tables: _remove_mould(tables, case, mechanics=True))


def _remove_mould(tables: dict[str, Any], case: Case, mechanics: bool) -> None:
    tables.pop("mould", None)
    tables.pop("quality", None)
    if mechanics and "mechanics" in tables:
        tables["mechanics"] |= {**_SUPPORT, "strain": "small"}
        tables["mechanics"].pop("mush", None)
    else:
        for key in ("mechanics", "coupling"):
            tables.pop(key, None)
    tables.get("output", {}).pop("fields", None)
    if case.mould is None or case.mould.wall_temperature is None:
        return
    wall = _over_time(case, case.mould.wall_temperature)
    for zone in tables["cooling"]:
        for law in zone["surface"]:
            if law.get("law") == "contact" and law.get("wall", _WALL) == _WALL:
                law["wall"] = wall


def _over_time(case: Case, wall: float | Table) -> str | dict[str, Any]:
    """Convert a wall temperature along the mould for a surface law: over time."""
    if not isinstance(wall, Table):
        return units.format(wall, "K", "degC")
    times = [case.casting.travel.time_at(position) for position in wall.arguments]
    return {"time": times, "time_unit": "s", "value": list(wall.values), "unit": "K"}


def _changed(case: Case, change: Callable[[dict[str, Any]], None]) -> Case:
    tables = case.document()
    change(tables)
    return from_document(tables, case.title)


@dataclass(frozen=True, slots=True)
class Tilt:
    """A change of the cost near an optimum that is linear in the variables."""

    centre: Array  #: the optimum (n,), fractions of the ranges
    slope: Array  #: slope of the cost along each variable (n,), SI over the range
    unknown: Flags  #: variables (n,) along which all runs have failed; the slope is 0 there

    @classmethod
    def fit(cls, centre: Array, shares: Array, change: Array) -> Tilt:
        """Fit changes (r,) at some points (r, n); NaN is ignored."""
        there = np.isfinite(change)
        columns = np.column_stack([np.ones(np.count_nonzero(there)), shares[there] - centre])
        slope = np.linalg.lstsq(columns, change[there], rcond=1e-8)[0][1:]
        return cls(centre, slope, ~np.any(columns[:, 1:] != 0.0, axis=0))


@dataclass(frozen=True, slots=True)
class NumericalError:
    """Known numerical error of cost and margins (1 + m,) at an optimum, SI."""

    finished: frozenset[str]  #: levels at which the best run has finished
    checked: str  #: the level among them that checks the optimum, "" for none
    moved: Array  #: cost and margins at that level minus those of the search; NaN without one
    below: Array  #: largest decrease without numerical error
    above: Array  #: largest increase without numerical error
    better: bool  #: whether the check is at a finer level than the search
    tilt: Tilt | None = None  #: change of the cost to the next level; None if not needed or unknown
    most: float = 0.0  #: largest factor on it that gives the numerical error
    untilted: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    #: along which variables (n,) the tilt is needed and not known; empty where it is not needed

    @property
    def known(self) -> bool:
        """Whether the best run has finished at another level."""
        return len(self.finished) > 1

    def tilted(self, places: Array, share: float) -> Array:
        """A fraction of the tilt at some points (r, n), minus that at the optimum (r,)."""
        if self.tilt is None:
            return np.zeros(len(places))
        return np.asarray(share * ((places - self.tilt.centre) @ self.tilt.slope))

    def with_tilt(self, fidelity: str, tilt: Tilt) -> NumericalError:
        """Return the error with the tilt from the level of the search to the next one."""
        other = next_of(fidelity)
        most = error({fidelity: 0.0, other: 1.0}, fidelity)
        sign = 1.0 if _is_better(other, fidelity) else -1.0
        return replace(self, tilt=tilt, most=sign * most, untilted=tilt.unknown)

    @classmethod
    def of(cls, fidelity: str, vectors: Mapping[str, Array]) -> NumericalError:
        """Return the error of a search at a level, from cost and margins (1 + m,) by level."""
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
    """Return the numerical error of a result by level, in its unit; NaN if unknown."""
    if fidelity == THERMAL:
        return max(_beside_thermal(values))
    own = LEVELS[fidelity].cells
    return convergence_index({LEVELS[w].cells / own: value for w, value in values.items()})


def sides(values: Mapping[str, float], fidelity: str) -> tuple[float, float]:
    """Return how far a result may decrease and increase without numerical error, 0 if unknown.

    A result that is monotonic over three levels or more has an error on that side only.
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
    """Possible decrease and increase of a purely thermal result at the finest level."""
    known = {word: v for word, v in values.items() if word != THERMAL and math.isfinite(v)}
    if not known:
        return math.nan, math.nan
    finest = min(known, key=lambda word: LEVELS[word].cells)
    own, off = error(known, finest), known[finest] - values[THERMAL]
    own = 0.0 if math.isnan(own) else own
    return max(0.0, own - off), max(0.0, off + own)
