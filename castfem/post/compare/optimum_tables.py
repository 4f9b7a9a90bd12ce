"""An optimum as text and tables, for the terminal and files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.atomic_files import write_csv
from castfem.base.constants import EXACT, ROUNDING, same_instant
from castfem.base.shown_units import Scale, label_shown, scale_of
from castfem.base.table import Table
from castfem.model.mould_from_case import build_mould
from castfem.post.compare.digits import column, ends, result, significant, variable
from castfem.studies.optimisation.fidelity import checks_of
from castfem.studies.optimisation.optimum import (
    ConstraintStatus,
    Front,
    Optimum,
    ResultWithError,
    Spread,
    Value,
    unit_name,
)  # fmt: skip

if TYPE_CHECKING:
    from castfem.model import Case


_FAR = " (which bars better places)"  # a constraint that binds, but not at the optimum


def report(optimum: Optimum) -> Iterator[Table | str]:
    """Yield texts and tables, in order."""
    objective = optimum.objective
    if objective is None:
        yield (
            f"no run has finished; the one that came furthest: "
            f"{_values(optimum)}. See its run.log ({optimum.best or 'of a run made elsewhere'})"
        )
        return
    yield f"{optimum.sense} {label_shown(objective.label)}: {_state(optimum)}"
    yield _variables(optimum)
    yield _results(optimum, objective)
    if optimum.neighbours:
        yield _steps(optimum, objective)
    yield from _remarks(optimum, objective)
    if optimum.spread is not None:
        yield from _spread(optimum, optimum.spread)
    if optimum.front is not None:
        yield from _front(optimum.front)


def _state(optimum: Optimum) -> str:
    if optimum.status == "found":
        texts = (one.text + ("" if one.near else _FAR) for one in optimum.binding)
        held = [v for v in optimum.values if v.at_end in ("lowest", "highest")]
        by = [", ".join(texts), *_ends(held)]
        by += [f"{v.key} where runs fail" for v in optimum.values if v.at_end == "runs fail"]
        by = [part for part in by if part]
        state = f"found; held by {'; '.join(by)}" if by else "found; no constraint binds"
        if failed := optimum.runs["failed"]:
            state += f"; {failed} of the {optimum.runs['search']} runs by {optimum.fidelity} failed"
        return f"{state}; another point is as good" if optimum.other_optima else state
    if optimum.status == "not converged":
        return "not converged: better runs were still met; raise optimise.most_runs"
    if optimum.status == "independent":
        return f"depends on none of {', '.join(optimum.without_effect)}; any value is as good"
    worst = optimum.worst
    if worst is None:
        return "no run meets all constraints"
    missed = significant(worst.result.chosen_difference(-worst.left), 3)
    missed = f"{missed} {worst.result.difference_unit}".rstrip()
    ends_at = " and ".join(_ends(promising_ends(optimum)))
    wider = f", with {ends_at}: a wider one may meet them" if ends_at else ""
    return f"the constraints cannot be met; nearest, {worst.text} is missed by {missed}{wider}"


def promising_ends(optimum: Optimum) -> tuple[Value, ...]:
    """The variables at an end of their range beyond which violated constraints may be met.

    Towards such an end the violation of a constraint decreases by more than noise, and none
    increases; and each violated constraint decreases towards one of them.
    """
    missed = [(number, one) for number, one in enumerate(optimum.constraints) if not one.met]
    falls = {
        value.key: [_falls(optimum, value, number, one) for number, one in missed]
        for value in optimum.values
        if value.at_end in ("lowest", "highest")
    }
    found = {key: signs for key, signs in falls.items() if any(signs) and min(signs) >= 0}
    if not all(any(signs[i] > 0 for signs in found.values()) for i in range(len(missed))):
        return ()
    return tuple(value for value in optimum.values if value.key in found)


def _falls(optimum: Optimum, value: Value, number: int, one: ConstraintStatus) -> int:
    """1 if the violation decreases from the next run inwards, -1 if it increases, else 0."""
    steps = [a for a in optimum.neighbours if a.key == value.key and math.isfinite(a.objective)]
    if not steps:
        return 0
    inward = min(steps, key=lambda step: abs(step.value - value.value))
    gained = one.left - inward.left[number]
    noise = 3.0 * one.result.noise + ROUNDING * abs(one.bound)  # one in thirty by chance
    return 0 if abs(gained) <= noise else int(math.copysign(1, gained))


def _ends(values: Iterable[Value]) -> list[str]:
    return [f"{v.key} at the {v.at_end} of its range" for v in values]


def _values(optimum: Optimum, other: Iterable[float | None] | None = None) -> str:
    values = [v.value for v in optimum.values] if other is None else other
    return ", ".join(
        f"{v.key} = {'?' if value is None else variable(value)} {v.unit}".rstrip()
        for v, value in zip(optimum.values, values, strict=True)
    )


def _variables(optimum: Optimum) -> Table:
    by = [f"constraints by {optimum.checked}"] if optimum.checked and optimum.constraints else []
    rows = []
    for value in optimum.values:
        label = f"{value.key} [{value.unit}]" if value.unit else value.key
        checked = ["" if value.checked is None else variable(value.checked) for _ in by]
        searched = " to ".join(variable(end) for end in value.range)
        rows.append((label, variable(value.value), *checked, interval(value), searched))
    return Table(("variable", "best", *by, "cannot be distinguished from", "looked for in"), rows)


def interval(value: Value) -> str:
    """The interval of a variable as text."""
    low, high = ends(value.low, value.high)
    less, more = (" or less" if value.open_low else ""), (" or more" if value.open_high else "")
    return f"{low}{less} to {high}{more}"


def _difference(known: ResultWithError, value: float) -> str:
    """A difference in the unit of a result; rounding counts as zero."""
    if abs(value) <= EXACT * abs(known.value):
        value = 0.0
    return significant(known.chosen_difference(value), 2)


def _errors(known: ResultWithError) -> tuple[str, str]:
    noise = _difference(known, known.noise) if known.measured else "?"
    return noise, _difference(known, known.numerical)


def _shown(known: ResultWithError, value: float, apart: float) -> str:
    """A value of a result, SI, that differs by so much from the value it is compared with."""
    return result(known.chosen(value), known.scale.unit, known.chosen_difference(apart))


def _check_apart(optimum: Optimum, objective: ResultWithError) -> float:
    """Difference between the objective of the check, at its own optimum, and that of the search."""
    return 0.0 if optimum.by_check is None else optimum.by_check.objective - objective.value


def _results(optimum: Optimum, objective: ResultWithError) -> Table:
    by = f"left by {optimum.checked}" if optimum.checked else "left by the check"
    value = _shown(objective, objective.value, _check_apart(optimum, objective))
    rows = [(objective.heading(), value, *_errors(objective), "", "", "objective")]
    for one in optimum.constraints:
        known = one.result
        left = f"{_difference(known, one.left)} ± {_difference(known, one.error)}"
        unit = unit_name(known.scale.unit)
        label = f"{one.text} [{unit}]" if unit else one.text  # as written, perhaps in another unit
        value = _shown(known, known.value, max(abs(one.left), known.noise))
        checked = _difference(known, one.checked)
        rows.append((label, value, *_errors(known), left, checked, _word(one)))
    return Table(("at the optimum", "value", "noise", "numerical error", "left", by, ""), rows)


def _word(one: ConstraintStatus) -> str:
    if not one.met:
        return "not met"
    if one.binding:
        return "binds" if one.near else "bars better places"
    if math.isnan(one.error):
        return "met, error not known"
    return "" if one.left >= one.error else "met, within its error"


def _steps(optimum: Optimum, objective: ResultWithError) -> Table:
    heads = [f"left of {one.text}" for one in optimum.constraints]
    head = f"{objective.name} [{objective.difference_unit}]"
    rows: list[Sequence[str]] = []
    units = {value.key: value.unit for value in optimum.values}
    for step in optimum.neighbours:
        name = f"{step.key} = {variable(step.value)} {units[step.key]}".rstrip()
        if step.message:
            rows.append((name, "fails", *("" for _ in heads)))
            continue
        cells = [significant(objective.chosen_difference(step.objective), 3, "+")]
        for one, left in zip(optimum.constraints, step.left, strict=True):
            amount = significant(one.result.chosen_difference(left), 3)
            missed = "" if left >= -one.result.noise - 1e-9 * abs(one.bound) else " (not met)"
            cells.append(f"{amount} {one.result.difference_unit}{missed}")
        rows.append((name, *cells))
    return Table(("a step away", head, *heads), rows)


def _remarks(optimum: Optimum, objective: ResultWithError) -> Iterator[str]:
    runs = optimum.runs
    further = runs["all"] - runs["looked_at"]
    ended = (
        "the check of it failed" if optimum.status == "found" else "not checked by another level"
    )
    checked = f"checked by {optimum.checked}" if optimum.checked else ended
    finest = checks_of(optimum.fidelity)[0]
    if optimum.checked not in ("", finest):
        checked += f" (the best run fails by {finest})"
    yield (
        f"{runs['all']} runs: {runs['looked_at']} of the search (limit: optimise.most_runs), "
        f"{further} about the optimum, at other levels of accuracy and for further questions"
    )
    best = optimum.best or "made elsewhere"
    yield f"{checked}; {optimum.seconds:.0f} s of runs; best run: {best}"
    if optimum.by_check is not None and optimum.constraints:
        yield _by_check(optimum, objective)
    if optimum.without_effect and optimum.status == "found":
        yield f"no result depends on {' and '.join(optimum.without_effect)}: any value is as good"
    for why in optimum.unverified:
        yield f"the interval is open, for {why}"
    if optimum.other_optima:
        some = "; or ".join(_values(optimum, one) for one in optimum.other_optima[:3])
        yield f"not the only one: as good within scatter, outside of these intervals, is {some}"
    every = (objective, *(one.result for one in optimum.constraints))
    for known in {one.name: one for one in every if one.twin is not None}.values():
        name, value = known.twin or ("", 0.0)
        apart = f"{_difference(known, value - known.value)} {known.difference_unit}"
        yield f"{known.name} lies {apart} below {name}, its maximum"
    span = [abs(step.objective) for step in optimum.neighbours if math.isfinite(step.objective)]
    if span and max(span) <= 4.0 * objective.noise:
        yield "all around it the objective changes by no more than its noise: it is flat here"


def _by_check(optimum: Optimum, objective: ResultWithError) -> str:
    assert optimum.by_check is not None
    left = "; ".join(
        f"{one.text}: {_difference(one.result, value)} {one.result.difference_unit} left"
        for one, value in zip(optimum.constraints, optimum.by_check.left, strict=True)
    )
    value = _shown(objective, optimum.by_check.objective, _check_apart(optimum, objective))
    unit = unit_name(objective.scale.unit)
    by = f"{optimum.checked}, {_values(optimum, [v.checked for v in optimum.values])}"
    return f"by {by}: {objective.name} {value} {unit}".rstrip() + f"; {left}"


def spread_scale(optimum: Optimum, number: int) -> Scale:
    """Conversion of a row of a spread to the chosen unit; a variable keeps its unit."""
    assert optimum.spread is not None
    row = optimum.spread.rows[number]
    if row.error is None or optimum.objective is None:
        return Scale(row.unit)
    results = (optimum.objective, *(one.result for one in optimum.constraints))
    return scale_of(row.unit, results[number].name)


def _spread(optimum: Optimum, spread: Spread) -> Iterator[Table | str]:
    """Effects of the inputs, and the point where all constraints are met in most draws."""
    failed = f", {spread.failed} of them failed" if spread.failed else ""
    derivatives = " with their derivatives" if spread.derivatives else ""
    yield f"spread by the inputs, {spread.runs} runs{derivatives}{failed}"
    rows = []
    for number, row in enumerate(spread.rows):
        scale = spread_scale(optimum, number)
        unit = f" [{unit_name(scale.unit)}]" if unit_name(scale.unit) else ""
        error = "" if row.error is None else significant(scale(row.error), 2)
        met = "" if row.met is None else f"{100.0 * row.met:.3g} %"
        change = " to ".join(significant(scale(end), 3, "+") for end in row.change)
        rows.append((f"{row.name}{unit}", change, error, met))
    yield Table(("by the inputs", "5 to 95 % of the draws", "error of the fit", "met"), rows)
    heads = ("Sobol indices: first order / total", *(row.name for row in spread.rows))
    indices = [
        (label, *(f"{row.first[i]:.2f} / {row.total[i]:.2f}" for row in spread.rows))
        for i, label in enumerate(spread.labels)
    ]
    yield Table(heads, indices)
    widths = {row.name: row.change[1] - row.change[0] for row in spread.rows}
    vague = [one.name for one in spread.rows if (one.error or 0.0) > 0.25 * widths[one.name]]
    if vague:
        yield (
            f"the error of the fit is as large as the spread of {', '.join(vague)}: these are "
            "rough, and their indices say nothing"
        )
    if not optimum.constraints:
        return
    if optimum.values[0].safe is None:
        yield "no place near the optimum meets all constraints in 95 % of the draws"
    else:
        safe = _values(optimum, [v.safe for v in optimum.values])
        yield f"best of what meets all constraints in 95 % of the draws: {safe}"


def _front(front: Front) -> Iterator[Table | str]:
    both = f"{front.first.name} and {front.second.name}"
    if len(front.points) == 1:
        yield f"{both} are best together: there is no front ({front.runs} further runs)"
        return
    yield f"the front of {both}, {front.runs} further runs"
    heads = front.first.heading(), front.second.heading(), front.price_heading()
    rows = []
    firsts, seconds = (
        column([one.chosen(value) for value in values], one.scale.unit)
        for one, values in (
            (front.first, [point.first for point in front.points]),
            (front.second, [point.second for point in front.points]),
        )
    )
    for point, first, second in zip(front.points, firsts, seconds, strict=True):
        price = front.price(point, chosen=True)
        shown = "" if price is None else significant(price, 3)
        rows.append((*(variable(value) for value in point.values), first, second, shown))
    yield Table((*front.keys, *heads), rows, words=())
    if front.exhausted:
        yield "a search of the front ran out of runs: raise optimise.most_runs"


MOULD_NAME, FRONT_NAME = "mould.csv", "front.csv"


def mould_table(case: Case, every: float = 0.05) -> tuple[list[str], list[list[float]]]:
    """Return headings and rows of a mould: distance from the meniscus and inner sizes, mm.

    The sizes are those of the working mould, and also those of the cold mould if it is given cold.

    Args:
        case: A case with [mould].
        every: Distance between two rows, m; further rows are at changes of a taper.
    """
    assert case.mould is not None
    mould = build_mould(case.mould, case.section)
    length = mould.length
    places = {float(z) for z in np.arange(0.0, length, every)}
    for knot in (*case.mould_knots(), length):
        places = {z for z in places if not same_instant(z, knot, length)} | {knot}
    names = list(mould.dimensions(0.0))
    ends = [mould.dimensions(z) for z in (0.0, 0.5 * length, length)]
    if "height" in names and all(abs(one["width"] - one["height"]) < 1e-12 for one in ends):
        names.remove("height")
    cold = [f"cold {name}" for name in names] if mould.expansion is not None else []
    rows = []
    for place in sorted(places):
        sizes = mould.dimensions(place)
        row = [place, *(sizes[name] for name in names)]
        if cold:
            made = mould.dimensions(place, as_made=True)
            row += [made[name] for name in names]
        rows.append([1e3 * value for value in row])
    return [f"{name} [mm]" for name in ("distance", *names, *cold)], rows


def write_mould_table(folder: Path, case: Case) -> Path:
    """Write the table as CSV and return its path."""
    head, rows = mould_table(case)
    path = folder / MOULD_NAME
    write_csv(path, [head, *([f"{value:.4f}" for value in row] for row in rows)])
    return path


def write_front(folder: Path, front: Front) -> Path:
    """Write the points as CSV, one row each; return its path."""
    head = [one.heading(chosen=False) for one in (front.first, front.second)]
    rows = [[*front.keys, *head, front.price_heading(chosen=False), "run"]]
    for point in front.points:
        price = front.price(point)
        results = front.first.shown(point.first), front.second.shown(point.second)
        numbers = (f"{value:.9g}" for value in (*point.values, *results))
        rows.append([*numbers, "" if price is None else f"{price:.6g}", point.run])
    path = folder / FRONT_NAME
    write_csv(path, rows)
    return path
