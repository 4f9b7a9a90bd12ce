"""`castfem calibrate`: fits keys of a case to measurements."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from castfem.base import result_registry
from castfem.base.errors import InputError
from castfem.base.shown_quantity import from_si, unit_of_difference
from castfem.base.shown_units import scale_of, shown_in
from castfem.base.table import Table, say
from castfem.base.units import nearest
from castfem.cli import many_runs, parallel
from castfem.cli.many_runs import View
from castfem.cli.options import DEFAULT, chosen, sizes_of
from castfem.model import Case, load_case, shipped_cases
from castfem.model.load import faults_of_key
from castfem.post.plots.studies import Compared, calibration_figure
from castfem.post.plots.style import save
from castfem.runs.results.needs import faults_of
from castfem.runs.results.numbers import error_shown, shown, unit_shown
from castfem.studies.calibration.fit import (
    Calibration,
    Free,
    calibrate,
    followed,
    read_free,
    write,
)
from castfem.studies.calibration.measured import (
    Measured,
    is_of_probe,
    missing_column,
    read_measured,
)

FIGURE_NAME = "calibration.png"
_ALIKE = 0.95  # correlation above which the data hardly separate two keys


def calibrate_case(
    name: str,
    data: Path,
    free: Sequence[str],
    folder: Path | None,
    overrides: Sequence[str] = (),
    processes: int | None = None,
    *,
    accuracy: str = DEFAULT,
    quiet: bool = False,
    units: Sequence[str] = (),
) -> int:
    """Fit, print and write; return the exit status (collective)."""

    def prepare(ranks: bool) -> many_runs.Work:
        if processes != 0:
            many_runs.check_processes(processes, ranks)
        path = shipped_cases.find(name)
        sizes = sizes_of(path, overrides, accuracy)
        case, keys = load_case(path, (*overrides, *sizes)), [read_free(one) for one in free]
        if not keys:
            raise InputError("calibrate: name what is to be fitted, --free KEY=LOW..HIGH")
        _check_keys(case, keys)
        measured = read_measured(data)
        _check_results(case, measured)
        alone = shipped_cases.default_folder(name, path)
        target = folder or alone.with_name(f"{alone.name}_calibration")
        evaluator = many_runs.evaluator(followed(case, measured), target, processes)

        def fitted(comm: object) -> int:
            ended = View(0, 0, quiet=True).ended
            with evaluator:
                found = calibrate(case, measured, keys, evaluator, ended)
            _report(found, target, quiet, units)
            return 0

        return fitted

    return many_runs.on_root(prepare)


def _check_keys(case: Case, keys: Sequence[Free]) -> None:
    """Refuse keys given twice, and bounds that make the case invalid, before any run."""
    for number, key in enumerate(keys):
        where = f'--free "{key.key}"'
        if key.key in [other.key for other in keys[:number]]:
            raise InputError(f"{where}: is given twice; leave one out")
        ends = [key.text(value) for value in (key.low, key.high)]
        if problems := faults_of_key(case, key.key, ends, where):
            raise InputError(problems)


_NEAREST = 6  # results proposed in place of an unknown one


def _check_results(case: Case, measured: Sequence[Measured]) -> None:
    """Refuse measurements of results that the case does not have, before any run."""
    first = {one.name: one for one in reversed(measured)}
    at_probes = {name: one for name, one in first.items() if is_of_probe(name)}
    others = {name: one for name, one in first.items() if name not in at_probes}
    faults = dict(zip(others, faults_of(case, list(others)), strict=True))
    faults |= {name: missing_column(case, name) for name in at_probes}
    every = list(result_registry.result_names())
    known = [one for one, fault in zip(every, faults_of(case, every), strict=True) if not fault]
    for name in others:
        if result_registry.find(name) is None:
            some = ", ".join(difflib.get_close_matches(name, known, _NEAREST, 0.0))
            allowed = f"allowed: {some} and other columns of its history.csv"
            faults[name] = f"no such result of this case; {allowed}{nearest(name, known)}"
    problems = [f"{first[name].where}: {fault}" for name, fault in faults.items() if fault]
    if problems:
        raise InputError(problems)


def _report(found: Calibration, target: Path, quiet: bool, units: Sequence[str]) -> None:
    write(target, found)
    with chosen(units), shown_in(found.case.shown_units):
        save(calibration_figure(_panels(found)), target / FIGURE_NAME)
        if not quiet:
            say(parallel.console(), _keys(found), "", *_words(found, target))


def _keys(found: Calibration) -> Table:
    rows = []
    for f in found.fit.keys:
        half = error_shown(f.interval) if math.isfinite(f.interval) else "?"
        fitted = f"{f.value:.5g} \N{PLUS-MINUS SIGN} {half}"
        bounds = f"{f.free.low:g} to {f.free.high:g}"
        rows.append((f.free.key, f"{f.start:.5g}", fitted, bounds, unit_shown(f.free.unit)))
    return Table(("key", "before", "fitted, 95 %", "bounds", "unit"), rows, words=(0, 4))


def _words(found: Calibration, target: Path) -> list[str]:
    """Remarks on a fit, one line each."""
    fit, lines = found.fit, []
    for name in dict.fromkeys(m.name for m in found.measured):
        mine = [i for i, m in enumerate(found.measured) if m.name == name]
        unit = unit_of_difference(found.after[mine[0]].shown_unit)
        scale = scale_of(unit, name)
        off = [
            math.sqrt(np.mean([(run[i].value - found.measured[i].value) ** 2 for i in mine]))
            for run in (found.before, found.after)
        ]
        before, after = (shown(scale(from_si(one, unit)), scale.unit) for one in off)
        lines.append(
            f"{name}: off by {before} before, {after} {unit_shown(scale.unit)} fitted "
            f"(root of the mean square of {len(mine)})"
        )
    for f in fit.keys:
        if f.moved:
            lines.append(
                f"{f.free.key}: the case's value lies outside these bounds; the fit starts, and "
                f'"before" is, at {f.start:.5g} {unit_shown(f.free.unit)}'.rstrip()
            )
        if f.held:
            lines.append(f"{f.free.key}: held by its bound; its interval says little")
        elif not math.isfinite(f.interval):
            lines.append(f"{f.free.key}: the data do not determine its error")
    for i, one in enumerate(fit.keys):
        for j, other in enumerate(fit.keys[:i]):
            if abs(fit.correlation[i, j]) > _ALIKE:
                lines.append(
                    f"{other.free.key} and {one.free.key}: can hardly be distinguished by these "
                    f"data (correlation {fit.correlation[i, j]:.2f}); fit one of them"
                )
    known = all(math.isfinite(m.error) for m in found.measured)
    if known and math.isfinite(fit.spread):
        lines.append(f"scatter over the stated errors: {fit.spread:.2f} (1: they agree)")
    if not fit.converged:
        lines.append("the fit has not converged: give wider bounds, or fewer keys")
    lines.append(f"{found.runs} runs; case, data and figure in {target}")
    return lines


def _panels(found: Calibration) -> list[Compared]:
    panels = []
    for name in dict.fromkeys(m.name for m in found.measured):
        mine = [i for i, m in enumerate(found.measured) if m.name == name]
        some = found.after[mine[0]]
        unit, difference = some.shown_unit, unit_of_difference(some.shown_unit)
        panels.append(
            Compared(
                name, some.label, unit,
                np.array([found.measured[i].position for i in mine]),
                np.array([from_si(found.measured[i].value, unit) for i in mine]),
                np.array([from_si(found.measured[i].error, difference) for i in mine]),
                np.array([found.before[i].shown for i in mine]),
                np.array([found.after[i].shown for i in mine]),
            )
        )  # fmt: skip
    return panels
