"""An optimum in words and tables, for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from castfem.base.shown_units import label_shown
from castfem.studies.optimisation.beyond import promising_ends
from castfem.studies.optimisation.chosen_units import (
    difference_in,
    difference_scale,
    heading,
    price_heading,
    price_in,
    scale,
    spread_scale,
    unit_name,
    value_in,
)
from castfem.studies.optimisation.digits import column, ends, result, significant, variable
from castfem.studies.optimisation.front import Front
from castfem.studies.optimisation.numerical import checks_of
from castfem.studies.optimisation.optimum import Kept, Known, Optimum, Spreading, Value

if TYPE_CHECKING:
    from rich.table import Table

_VAGUE = 0.25  # of 5 to 95 %, some three standard deviations: an error of that size hides them
_ROUNDING = 1e-12  # of a result
_SIGMAS = 4.0  # of noise, that a handful of runs may lie apart by it


AFAR = " (which bars better places)"  # a constraint that binds, though not where the optimum is


def told(optimum: Optimum) -> Iterator[Table | str]:
    """Yield what there is to say, in order."""
    if optimum.objective is None:
        yield (
            f"no run has come to its end; the one that came furthest: "
            f"{_values(optimum)}. Look into its run.log ({optimum.best or 'told by others'})"
        )
        return
    yield f"{optimum.sense} {label_shown(optimum.objective.label)}: {_state(optimum)}"
    yield _variables(optimum)
    yield _results(optimum)
    if optimum.away:
        yield _steps(optimum)
    yield from _remarks(optimum)
    if optimum.spread is not None:
        yield from _spread(optimum, optimum.spread)
    if optimum.front is not None:
        yield from _front(optimum.front)


def _spread(optimum: Optimum, spread: Spreading) -> Iterator[Table | str]:
    """What the inputs do, and where it is safe from them."""
    failed = f", {spread.failed} of them failed" if spread.failed else ""
    carried = " with their derivatives" if spread.derivatives else ""
    yield f"spread by the inputs, {spread.runs} runs{carried}{failed}"
    found = _table("by the inputs", "5 to 95 % of the draws", "error of the fit", "met")
    vague = []
    for number, row in enumerate(spread.rows):
        scale = spread_scale(optimum, number)
        unit = f" [{unit_name(scale.unit)}]" if unit_name(scale.unit) else ""
        error = "" if row.error is None else significant(scale(row.error), 2)
        met = "" if row.met is None else f"{100.0 * row.met:.3g} %"
        low, high = row.change
        change = " to ".join(significant(scale(end), 3, "+") for end in row.change)
        found.add_row(f"{row.name}{unit}", change, error, met)
        if row.error is not None and row.error > _VAGUE * (high - low):
            vague.append(row.name)
    yield found
    found = _table("Sobol indices: first order / total", *(row.name for row in spread.rows))
    for number, label in enumerate(spread.labels):
        found.add_row(
            label, *(f"{row.first[number]:.2f} / {row.total[number]:.2f}" for row in spread.rows)
        )
    yield found
    if vague:
        yield (
            f"the fit misses the runs by as much as the inputs make of {', '.join(vague)}: what "
            "stands there is rough, its indices say nothing"
        )
    if not optimum.constraints:
        return
    if optimum.values[0].safe is None:
        yield "no place near the optimum meets all constraints in 95 % of the draws"
    else:
        safe = ", ".join(_value(v, v.safe) for v in optimum.values)
        yield f"best of what meets all constraints in 95 % of the draws: {safe}"


def _front(front: Front) -> Iterator[Table | str]:
    """The points of a front, and what they have cost."""
    both = f"{front.first.name} and {front.second.name}"
    if len(front.points) == 1:
        yield f"{both} are best together: there is no front ({front.runs} further runs)"
        return
    yield f"the front of {both}, {front.runs} further runs"
    heads = (heading(front.first), heading(front.second), price_heading(front))
    found = _table(*front.keys, *heads)
    columns = [
        column([value_in(one, value) for value in values], scale(one).unit)
        for one, values in (
            (front.first, [point.first for point in front.points]),
            (front.second, [point.second for point in front.points]),
        )
    ]
    for point, first, second in zip(front.points, *columns, strict=True):
        found.add_row(
            *(variable(value) for value in point.values),
            first,
            second,
            "" if point.price is None else significant(price_in(front, point.price), 3),
        )
    yield found
    if front.spent:
        yield "a search of the front has had its runs before it was done: raise optimise.most_runs"


def _state(optimum: Optimum) -> str:
    if optimum.status == "found":
        held_by = _ends(v for v in optimum.values if v.at_end in ("lowest", "highest"))
        held = ", ".join(kept.text + ("" if kept.near else AFAR) for kept in optimum.binding)
        held_by += [f"{v.key} where runs fail" for v in optimum.values if v.at_end == "runs fail"]
        by = "; ".join(part for part in (held, *held_by) if part)
        state = f"found; held by {by}" if by else "found; no constraint binds"
        if failed := optimum.runs["failed"]:
            state += f"; {failed} of the {optimum.runs['search']} runs by {optimum.fidelity} failed"
        return f"{state}; another place is as good" if optimum.elsewhere else state
    if optimum.status == "not converged":
        return "not converged: better runs were still met; raise optimise.most_runs"
    if optimum.status == "independent":
        return f"depends on none of {', '.join(optimum.idle)}; any value is as good"
    worst = optimum.worst
    if worst is None:
        return "no run meets all constraints"
    short = difference_in(worst.known, -worst.left)
    missed = f"{significant(short, 3)} {_difference_unit(worst.known)}".rstrip()
    wide = " and ".join(_ends(promising_ends(optimum)))
    wider = f", with {wide}: a wider one may meet them" if wide else ""
    return f"the constraints cannot be met; nearest, {worst.text} is missed by {missed}{wider}"


def _ends(values: Iterable[Value]) -> list[str]:
    return [f"{v.key} at the {v.at_end} of its range" for v in values]


def _values(optimum: Optimum, other: tuple[float, ...] = ()) -> str:
    """The variables at the optimum, or with other values of theirs."""
    pairs = zip(optimum.values, other or [v.value for v in optimum.values], strict=True)
    return ", ".join(_value(v, value) for v, value in pairs)


def _value(value: Value, there: float | None) -> str:
    """A variable with another value of its own."""
    return f"{value.key} = {'?' if there is None else variable(there)} {value.unit}".rstrip()


def _difference_unit(known: Known) -> str:
    return unit_name(difference_scale(known).unit)


def _table(*heads: str) -> Table:
    from rich import box
    from rich.table import Table

    found = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    for i, head in enumerate(heads):
        found.add_column(head, justify="left" if i == 0 else "right", overflow="fold")
    return found


def _variables(optimum: Optimum) -> Table:
    by = [f"constraints by {optimum.checked}"] if optimum.checked and optimum.constraints else []
    found = _table("variable", "best", *by, "cannot be told from", "looked for in")
    for value in optimum.values:
        label = f"{value.key} [{value.unit}]" if value.unit else value.key
        low, high = value.range
        cells = [variable(value.checked)] if by and value.checked is not None else by and [""]
        looked = f"{variable(low)} to {variable(high)}"
        found.add_row(label, variable(value.value), *cells, interval(value), looked)
    return found


def interval(value: Value) -> str:
    """The interval of a variable in words."""
    low, high = ends(value.low, value.high)
    less, more = (" or less" if value.open_low else ""), (" or more" if value.open_high else "")
    return f"{low}{less} to {high}{more}"


def _number(known: Known, value: float) -> str:
    """A difference in the unit of a result; what is rounding alone counts as none."""
    if abs(value) <= _ROUNDING * abs(known.value):
        value = 0.0
    return significant(difference_in(known, value), 2)


def _results(optimum: Optimum) -> Table:
    by = f"left by {optimum.checked}" if optimum.checked else "left by the check"
    found = _table("at the optimum", "value", "noise", "numerical error", "left", by, "")
    objective = optimum.objective
    assert objective is not None
    value = _shown(objective, objective.value, _by_check_apart(optimum))
    found.add_row(heading(objective), value, *_errors(objective), "", "", "objective")
    for kept in optimum.constraints:
        known = kept.known
        left = f"{_number(known, kept.left)} ± {_number(known, kept.error)}"
        checked = _number(known, kept.checked)
        unit = unit_name(scale(known).unit)
        label = f"{kept.text} [{unit}]" if unit else kept.text  # as written, perhaps in another one
        value = _shown(known, known.value, max(abs(kept.left), known.noise))
        found.add_row(label, value, *_errors(known), left, checked, _word(kept))
    return found


def _word(kept: Kept) -> str:
    if not kept.met:
        return "not met"
    if kept.binding:
        return "binds" if kept.near else "bars better places"
    if math.isnan(kept.error):
        return "met, error not known"
    return "" if kept.left >= kept.error else "met, within its error"


def _shown(known: Known, value: float, apart: float) -> str:
    """A value of a result, SI, that differs by so much from what it is compared with."""
    return result(value_in(known, value), scale(known).unit, difference_in(known, apart))


def _by_check_apart(optimum: Optimum) -> float:
    """How far the objective at the optimum by the level of the check is from that of the search."""
    if optimum.by_check is None or optimum.objective is None:
        return 0.0
    return optimum.by_check.objective - optimum.objective.value


def _errors(known: Known) -> tuple[str, str]:
    noise = _number(known, known.noise) if known.measured else "?"
    return noise, _number(known, known.numerical)


def _steps(optimum: Optimum) -> Table:
    objective = optimum.objective
    assert objective is not None
    unit = _difference_unit(objective)
    heads = [f"left of {kept.text}" for kept in optimum.constraints]
    found = _table("a step away", f"{objective.name} [{unit}]", *heads)
    units = {value.key: value.unit for value in optimum.values}
    for step in optimum.away:
        name = f"{step.key} = {variable(step.value)} {units[step.key]}".rstrip()
        if step.message:
            found.add_row(name, "fails", *("" for _ in heads))
            continue
        cells = []
        for kept, left in zip(optimum.constraints, step.left, strict=True):
            missed = "" if left >= -kept.known.noise - 1e-9 * abs(kept.bound) else " (not met)"
            amount = (
                f"{significant(difference_in(kept.known, left), 3)} {_difference_unit(kept.known)}"
            )
            cells.append(f"{amount}{missed}")
        change = significant(difference_in(objective, step.objective), 3, "+")
        found.add_row(name, change, *cells)
    return found


def _by_check(optimum: Optimum) -> Iterator[str]:
    """What the level of the check gives with its own best values."""
    found, objective = optimum.by_check, optimum.objective
    if found is None or objective is None or not optimum.constraints:
        return
    values = ", ".join(_value(v, v.checked) for v in optimum.values)
    left = zip(optimum.constraints, found.left, strict=True)
    kept = "; ".join(
        f"{one.text}: {_number(one.known, value)} {_difference_unit(one.known)} left".rstrip()
        for one, value in left
    )
    value = _shown(objective, found.objective, _by_check_apart(optimum))
    unit = unit_name(scale(objective).unit)
    by = f"{optimum.checked}, {values}"
    yield f"by {by}: {objective.name} {value} {unit}".rstrip() + f"; {kept}"


def _remarks(optimum: Optimum) -> Iterator[str]:
    runs = optimum.runs
    looked_at = runs["looked_at"]
    checked = f"checked by {optimum.checked}" if optimum.checked else "the check of it failed"
    finest = checks_of(optimum.fidelity)[0]
    if optimum.checked not in ("", finest):
        checked += f" (the best run fails by {finest})"
    yield (
        f"{runs['all']} runs: {looked_at} when the search ended (optimise.most_runs), "
        f"{runs['all'] - looked_at} about the optimum, by other levels and for what else was asked"
    )
    yield (
        f"{checked}; {optimum.seconds:.0f} s of runs; best run: {optimum.best or 'told by others'}"
    )
    yield from _by_check(optimum)
    if optimum.idle and optimum.status == "found":
        yield f"no result depends on {' and '.join(optimum.idle)}: any value is as good"
    for why in optimum.unknown:
        yield f"the interval is open, for {why}"
    if optimum.elsewhere:
        some = "; or ".join(_values(optimum, one) for one in optimum.elsewhere[:3])
        yield f"not the only one: as good within scatter, outside of these intervals, is {some}"
    objective = optimum.objective
    assert objective is not None
    for known in {k.name: k for k in (objective, *(c.known for c in optimum.constraints))}.values():
        if known.twin is not None:
            name, value = known.twin
            apart = _number(known, value - known.value)
            yield f"{known.name} lies {apart} {_difference_unit(known)} below {name}, its maximum"
    span = [abs(step.objective) for step in optimum.away if math.isfinite(step.objective)]
    if span and max(span) <= _SIGMAS * objective.noise:
        yield "all about it the objective changes by no more than its noise: it is flat here"
