"""A calibration: the case run with the values that a fit asks for, and what is left of it."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base import units
from castfem.base.atomic_files import write_json, write_text
from castfem.base.errors import InputError, RunFailure
from castfem.base.shown_quantity import Quantity, from_si
from castfem.base.tolerances import ROUNDING
from castfem.base.types import Array
from castfem.base.units import nearest
from castfem.model.load import value_of
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.results.places import quantities_at
from castfem.studies.optimisation.calibrate import Fit, Fitted, Free, fit
from castfem.studies.optimisation.evaluator import Evaluator, variant
from castfem.studies.optimisation.measured import Measured, residuals
from castfem.studies.optimisation.probe_data import is_of_probe, value_at

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.studies.optimisation.evaluator import Watcher

CSV_NAME, JSON_NAME, CASE_NAME = "calibration.csv", "calibration.json", "calibrated.toml"


@dataclass(frozen=True, slots=True)
class Calibration:
    """A case fitted to what was measured.

    Attributes:
        case: With the values that fit best, followed as far as the case that was given.
        fit: What was found.
        measured: The data. before: What the case gave of them. after: What it gives now.
        runs: How many were done.
    """

    case: Case
    fit: Fit
    measured: list[Measured]
    before: list[Quantity]
    after: list[Quantity]
    runs: int


def calibrate(
    case: Case,
    measured: list[Measured],
    keys: Sequence[Free],
    evaluator: Evaluator,
    watcher: Watcher | None = None,
) -> Calibration:
    """Fit keys of a case to measured values.

    Args:
        case: The case; its own values are where the fit begins, if they are plain quantities.
        measured: From `castfem.studies.optimisation.measured`.
        keys: To be fitted, with their bounds.
        evaluator: Of `followed(case, measured)`; runs it.
        watcher: Told of the runs.

    Raises:
        InputError: A key or a value cannot be used.
        RunFailure: A run of the fit does not come to its end.
    """
    start = [_start(case, key) for key in keys]
    known: dict[str, list[Quantity]] = {}

    def many(values: Sequence[Mapping[str, str]]) -> list[Array]:
        cases = [variant(evaluator.case, one) for one in values]
        found = evaluator.evaluate(cases, values, watcher)
        for one, run in zip(values, found, strict=True):
            if run.failed or run.folder is None:
                raise RunFailure(f"the run with {_text(one)} failed: {run.message}")
            known[_text(one)] = _computed(run.folder, measured)
        return [residuals(measured, list(known[_text(one)])) for one in values]

    errors = all(math.isfinite(m.error) for m in measured)
    found = fit(many, keys, start, errors_known=errors)
    best = {f.free.key: f.free.text(f.value) for f in found.keys}
    first = {f.free.key: f.free.text(f.start) for f in found.keys}
    return Calibration(
        case.with_(best), found, measured, known[_text(first)], known[_text(best)], evaluator.runs
    )


def followed(case: Case, measured: Sequence[Measured]) -> Case:
    """The case, followed as far as there are data.

    Raises:
        InputError: They lie beyond its end.
    """
    farthest = max(measured, key=lambda one: one.position)
    last = farthest.position
    length = case.casting.length
    if last > length * (1 + ROUNDING):
        raise InputError(
            f"{farthest.where}: {1e3 * last:g} mm was measured and the case is followed to "
            f"{1e3 * length:g} mm; "
            f'give --set casting.length="{1e3 * last:g} mm"'
        )
    return case.with_({"casting.length": f"{last!r} m"}) if last < length else case


def _computed(folder: Path, measured: Sequence[Measured]) -> list[Quantity]:
    """What a run gives where there are data.

    Raises:
        InputError: It has no such result there.
    """
    table = read_history(folder / HISTORY_NAME)
    found = []
    for data in measured:
        if is_of_probe(data.name):
            found.append(value_at(folder, data.name, data.position))
            continue
        here = quantities_at(table, data.position, folder)
        if data.name not in here:
            near = nearest(data.name, here)
            raise InputError(f"{data.where}: no such result of this case{near}")
        found.append(here[data.name])
    return found


def _start(case: Case, key: Free) -> float:
    """The value of a key in the case, in the unit of its bounds; the middle of them without."""
    value = units.number_in(value_of(case, key.key), key.unit)
    return 0.5 * (key.low + key.high) if value is None else value


def _text(values: Mapping[str, str]) -> str:
    return ", ".join(f"{key} = {value}" for key, value in values.items())


def write(folder: Path, found: Calibration) -> None:
    """Write the data with what was computed, the fit, and the calibrated case.

    Raises:
        RunFailure: A file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["position [m]", "result", "unit", "measured", "error", "before", "after"])
    for data, before, after in zip(found.measured, found.before, found.after, strict=True):
        unit = before.shown_unit
        error = "" if not math.isfinite(data.error) else f"{scaled(data.error, unit):.9g}"
        numbers = [from_si(value, unit) for value in (data.value, before.value, after.value)]
        cells = [f"{number:.9g}" for number in numbers]
        writer.writerow([f"{data.position:.9g}", data.name, unit, cells[0], error, *cells[1:]])
    write_text(folder / CSV_NAME, text.getvalue(), durable=False)
    content = {
        "keys": [_stored(f) for f in found.fit.keys],
        "correlation": [[_or_none(c) for c in row] for row in found.fit.correlation],
        "sum_of_squares": [float(r @ r) for r in (found.fit.start, found.fit.end)],
        "spread": _or_none(found.fit.spread),
        "converged": found.fit.converged,
        "runs": found.runs,
    }  # fmt: skip
    write_json(folder / JSON_NAME, content)
    write_text(folder / CASE_NAME, found.case.resolved_toml(), durable=False)


def _stored(found: Fitted) -> dict[str, Any]:
    """What is kept of a key."""
    return {
        **asdict(found.free),
        "start": found.start,
        "value": found.value,
        "half_interval_95": _or_none(found.interval),
        "held_by_bound": found.held,
    }


def scaled(difference: float, unit: str) -> float:
    """A difference in SI in a unit, degC as K."""
    return from_si(difference, "K" if unit == "degC" else unit)


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
