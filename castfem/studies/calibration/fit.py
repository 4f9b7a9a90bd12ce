"""Fits keys of a case to measurements by weighted least squares within bounds.

The sum of squares of (computed - measured)/error is minimised by Gauss-Newton in a trust region
(scipy's `trf`). Derivatives are differences over a hundredth of the range of each key; their runs
are made in parallel. The intervals follow from the derivatives at the end, by Student's t: they
hold for independent errors and a correct case.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base import units
from castfem.base.atomic_files import write_csv, write_json, write_text
from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError, RunFailure
from castfem.base.shown_quantity import Quantity, from_si, unit_of_difference
from castfem.base.types import Array
from castfem.model.load import value_of
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.results.labels import quantities_at
from castfem.studies.calibration.measured import (
    Measured,
    is_of_probe,
    residuals,
    thermocouples,
    value_at,
)
from castfem.studies.mould_fit.coupled import CopperTemperatures
from castfem.studies.optimisation.evaluator import Ended, Evaluator, variant
from castfem.studies.sweep.workers import nothing

if TYPE_CHECKING:
    from castfem.model import Case

CSV_NAME, JSON_NAME, CASE_NAME = "calibration.csv", "calibration.json", "calibrated.toml"


@dataclass(frozen=True, slots=True)
class FitSettings:
    """Settings of the least squares and of its intervals."""

    step: float = 0.01  #: step of the difference quotients, relative to the range of a key
    #: distance from a bound, relative to the range, within which a value is held by it
    near: float = 1e-3
    #: relative change of the sum of squares, or of the keys, at which the fit ends
    close: float = 1e-4
    evaluations: int = 20  #: largest number of evaluations of the derivatives
    confidence: float = 0.95  #: probability of the intervals


SETTINGS = FitSettings()
_SAMPLE = "KEY=LOW..HIGH UNIT, such as casting.speed=2..4 m/min"

Residuals = Callable[[Sequence[Mapping[str, str]]], list[Array]]
"""Residuals (n,) for each of several sets of values, text by key."""


@dataclass(frozen=True, slots=True)
class Free:
    """A key to fit, with its bounds."""

    key: str
    low: float
    high: float
    unit: str = ""  #: unit of the bounds; "" for plain numbers

    def text(self, value: float) -> str:
        """A value as text for a case file, with all significant digits."""
        return f"{value:.8g} {self.unit}".strip()


@dataclass(frozen=True, slots=True)
class Fitted:
    """The result for one key, in its unit."""

    free: Free
    start: float
    moved: bool  #: whether the case's value lies outside the bounds, of which `start` is one
    value: float
    interval: float  #: half the 95 % interval; NaN if the data do not determine it
    held: bool  #: whether it is at a bound, so that the interval means little


@dataclass(frozen=True, slots=True)
class Fit:
    """The result of a fit."""

    keys: tuple[Fitted, ...]
    correlation: Array  #: correlation of the keys (p, p)
    start: Array  #: residuals at the start (n,)
    end: Array  #: residuals at the end
    spread: float
    """Root of the sum of squares over n - p: 1 if data and stated errors agree; without stated
    errors the scatter of the data."""
    converged: bool


@dataclass(frozen=True, slots=True)
class Calibration:
    """A case fitted to measurements."""

    case: Case  #: with the fitted values, and the original followed length
    fit: Fit
    measured: list[Measured]
    before: list[Quantity]  #: computed values at the start
    after: list[Quantity]  #: computed values at the end
    runs: int  #: number of runs made


def read_free(assignment: str) -> Free:
    """Return a key with its bounds from a text such as `KEY=800..3000 W/(m^2 K)`."""
    where = f'--free "{assignment}"'
    key, equals, bounds = assignment.partition("=")
    low, dots, high = bounds.partition("..")
    if not equals or not dots or not key.strip():
        raise InputError(f"{where}: write {_SAMPLE}")
    try:
        (least, own), (most, unit) = units.split(low.strip()), units.split(high.strip())
        ends = float(least), float(most)
    except ValueError:
        raise InputError(f"{where}: bounds are numbers; write {_SAMPLE}") from None
    if own and own != unit:
        raise InputError(f"{where}: both bounds need the same unit; write {_SAMPLE}")
    if not ends[0] < ends[1]:
        raise InputError(f"{where}: the lower bound must be below the upper one")
    return Free(key.strip(), *ends, unit)


def fit(
    residuals: Residuals, keys: Sequence[Free], start: Sequence[float], *, errors_known: bool
) -> Fit:
    """Fit some keys.

    Args:
        residuals: Residuals (computed - measured)/error; runs the case.
        keys: Keys to fit.
        start: Start values in their units; moved into the bounds.
        errors_known: Whether measurement errors are given; otherwise they are estimated from the
            residuals of the best fit.
    """
    from scipy.optimize import least_squares

    p = len(keys)
    low, size = np.array([k.low for k in keys]), np.array([k.high - k.low for k in keys])

    def at(point: Array) -> dict[str, str]:
        values = low + size * point
        return {k.key: k.text(float(v)) for k, v in zip(keys, values, strict=True)}

    def slopes(point: Array) -> Array:
        """Derivatives of the residuals by the scaled keys (n, p), inwards at an upper bound."""
        steps = np.where(point + SETTINGS.step > 1.0, -SETTINGS.step, SETTINGS.step)
        base, *moved = residuals([at(point), *(at(point + step) for step in np.diag(steps))])
        return np.column_stack([(m - base) / s for m, s in zip(moved, steps, strict=True)])

    given = (np.asarray(start, float) - low) / size
    begin = np.clip(given, 0.0, 1.0)
    (first,) = residuals([at(begin)])
    if len(first) < p:
        raise InputError(
            f"{len(first)} measured values cannot determine {p} keys; give more, or fit fewer"
        )
    found = least_squares(
        lambda point: residuals([at(point)])[0], begin, jac=slopes, bounds=(0.0, 1.0),
        method="trf", ftol=SETTINGS.close, xtol=SETTINGS.close, gtol=1e-10,
        max_nfev=SETTINGS.evaluations,
    )  # fmt: skip
    left = len(first) - p
    spread = math.sqrt(float(found.fun @ found.fun) / left) if left else math.nan
    half, correlation = _uncertainty(found.jac, spread, left, errors_known)
    held = np.minimum(found.x, 1.0 - found.x) < SETTINGS.near
    first_values, values, moved = low + size * begin, low + size * found.x, given != begin
    columns = zip(keys, first_values, moved, values, size * half, held, strict=True)
    fitted = tuple(
        Fitted(k, float(a), bool(m), float(b), float(c), bool(d)) for k, a, m, b, c, d in columns
    )
    return Fit(fitted, correlation, first, np.asarray(found.fun), spread, bool(found.status > 0))


def _uncertainty(
    slopes: Array, spread: float, left: int, errors_known: bool
) -> tuple[Array, Array]:
    """Half the 95 % intervals of the scaled keys (p,), and their correlation (p, p).

    NaN for keys that the data do not separate, and for all keys if errors are unknown and there are
    no more data than keys.
    """
    from scipy import stats

    p = slopes.shape[1]
    unknown = np.full(p, np.nan)
    if np.linalg.matrix_rank(slopes) < p:
        return unknown, np.full((p, p), np.nan)
    covariance = np.linalg.inv(slopes.T @ slopes)
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    tail = 0.5 + 0.5 * SETTINGS.confidence
    if errors_known:
        return float(stats.norm.ppf(tail)) * deviation, correlation
    if not left:
        return unknown, correlation
    return float(stats.t.ppf(tail, left)) * spread * deviation, correlation


def calibrate(
    case: Case,
    measured: list[Measured],
    keys: Sequence[Free],
    evaluator: Evaluator,
    ended: Ended = nothing,
) -> Calibration:
    """Fit keys of a case to measured values.

    Args:
        case: The case; the fit starts from its values if they are plain quantities.
        measured: Values from `castfem.studies.calibration.measured`.
        keys: Keys to fit, with their bounds.
        evaluator: Evaluator of `followed(case, measured)`, which makes the runs.
        ended: Called with each run and its outcome.
    """
    known: dict[str, list[Quantity]] = {}

    def many(values: Sequence[Mapping[str, str]]) -> list[Array]:
        cases = [variant(evaluator.case, one) for one in values]
        found = evaluator.evaluate(cases, values, ended)
        for one, case_, run in zip(values, cases, found, strict=True):
            if run.failed or run.folder is None:
                raise RunFailure(f"the run with {_text(one)} failed: {run.message}")
            known[_text(one)] = computed(case_, run.folder, measured)
        return [residuals(measured, known[_text(one)]) for one in values]

    errors = all(math.isfinite(m.error) for m in measured)
    found = fit(many, keys, [_start(case, key) for key in keys], errors_known=errors)
    best = {f.free.key: f.free.text(f.value) for f in found.keys}
    first = {f.free.key: f.free.text(f.start) for f in found.keys}
    before, after = known[_text(first)], known[_text(best)]
    return Calibration(case.with_(best), found, measured, before, after, evaluator.runs)


def followed(case: Case, measured: Sequence[Measured]) -> Case:
    """The case, followed to the last measurement; for thermocouples to the mould's exit."""
    copper, exit_ = thermocouples(case), 0.0 if case.mould is None else case.mould.length
    reach = {
        one: exit_ if one.name.partition(".")[0] in copper else one.position for one in measured
    }
    farthest = max(measured, key=lambda one: reach[one])
    last, length = reach[farthest], case.casting.length
    if last <= 0.0:
        raise InputError(
            f"{farthest.where}: all values are at the meniscus, where no parameter has an effect "
            "yet; give some below it"
        )
    if last > length * (1 + ROUNDING):
        needed = "was measured" if last == farthest.position else "of mould take its heat"
        raise InputError(
            f"{farthest.where}: {1e3 * last:g} mm {needed} and the case is followed to "
            f'{1e3 * length:g} mm; give --set casting.length="{1e3 * last:g} mm"'
        )
    return case.with_({"casting.length": f"{last!r} m"}) if last < length else case


def computed(case: Case, folder: Path, measured: Sequence[Measured]) -> list[Quantity]:
    """Return the results of a run of the case at the measurements.

    Raises:
        InputError: The run has no such result there.
        RunFailure: The temperature of the copper cannot be computed.
    """
    table, found = read_columns(folder / HISTORY_NAME), []
    copper, in_copper = CopperTemperatures(case, folder), thermocouples(case)
    for data in measured:
        if (row := data.name.partition(".")[0]) in in_copper:
            found.append(copper.at(in_copper[row], data.position))
            continue
        if is_of_probe(data.name):
            found.append(value_at(folder, data.name, data.position))
            continue
        here = quantities_at(table, data.position, folder)
        if data.name not in here:
            near = units.nearest(data.name, here)
            raise InputError(f"{data.where}: no such result of this case{near}")
        found.append(here[data.name])
    return found


def _start(case: Case, key: Free) -> float:
    """Value of a key in the case, in the unit of its bounds; otherwise their middle."""
    value = units.number_in(value_of(case, key.key), key.unit)
    return 0.5 * (key.low + key.high) if value is None else value


def _text(values: Mapping[str, str]) -> str:
    return ", ".join(f"{key} = {value}" for key, value in values.items())


def write(folder: Path, found: Calibration) -> None:
    """Write the data with the computed values, the fit, and the calibrated case."""
    rows = [["position [m]", "result", "unit", "measured", "error", "before", "after"]]
    for data, before, after in zip(found.measured, found.before, found.after, strict=True):
        unit = before.shown_unit
        off = from_si(data.error, unit_of_difference(unit))
        error = f"{off:.9g}" if math.isfinite(off) else ""
        numbers = [from_si(value, unit) for value in (data.value, before.value, after.value)]
        cells = [f"{number:.9g}" for number in numbers]
        rows.append([f"{data.position:.9g}", data.name, unit, cells[0], error, *cells[1:]])
    write_csv(folder / CSV_NAME, rows, durable=False)
    fit = found.fit
    keys = [
        {
            **asdict(one.free),
            "start": one.start,
            "value": one.value,
            "half_interval_95": one.interval,
            "held_by_bound": one.held,
        }
        for one in fit.keys
    ]
    content = {
        "keys": keys,
        "correlation": fit.correlation,
        "sum_of_squares": [float(r @ r) for r in (fit.start, fit.end)],
        "spread": fit.spread,
        "converged": fit.converged,
        "runs": found.runs,
    }
    write_json(folder / JSON_NAME, content)
    write_text(folder / CASE_NAME, found.case.resolved_toml(), durable=False)
