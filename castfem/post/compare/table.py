"""The comparison of several runs: results, references, ratios to a base run, and remarks."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.shown_quantity import Quantity, from_si, to_si, unit_of_difference
from castfem.base.shown_units import Scale, difference_of, label_shown, place_said, scale_of
from castfem.base.table import Table
from castfem.post.compare.runs import Run, heat_shared
from castfem.post.report.cautions import cautions_of_all
from castfem.post.report.cracks import crack_places, defects_of
from castfem.post.report.tables import UNCHANGED
from castfem.runs.output.summary_file import SIGNS, Kind, met
from castfem.runs.results.headline import headline, mould_exit, plain_label
from castfem.runs.results.labels import last_quantities
from castfem.runs.results.numbers import is_gap, shown, unit_shown, value_cells
from castfem.runs.results.roll_load import RollLoads

if TYPE_CHECKING:
    import pandas

CSV_NAME = "compare.csv"
RATIOS = ("heat_removed", "heat_removed_slice")  # also shown relative to the base run
SHARE = "% of base"
_ALONG = "size_"  # prefix of quantities that are also shown along the mould
_IDEAL = "idealised"  # label, or part of the title, of a run whose mould has no gap
_SAME = 1e-6  # relative tolerance of equal positions


@dataclass(frozen=True, slots=True)
class Line:
    """A quantity of all runs."""

    label: str  #: its label, with the place
    unit: str  #: unit of the values
    ours: tuple[float, ...]  #: value of each run, NaN if there is none
    theirs: tuple[float, ...]  #: its reference, NaN if there is none
    kinds: tuple[Kind, ...]  #: whether the reference is a value or a bound
    gap: bool = False  #: small gaps are printed in micrometres, with that unit
    #: errors of the values, NaN if unknown; empty if unknown for all runs
    errors: tuple[float, ...] = ()
    name: str = ""  #: name of the quantity
    at: float | None = None  #: position, m below the meniscus; None at the end of the runs
    #: resolutions of the values, None if unknown; empty if unknown for all runs
    resolutions: tuple[float | None, ...] = ()

    @property
    def scale(self) -> Scale:
        """Conversion of its values to the shown unit."""
        return Scale(SHARE) if self.unit == SHARE else scale_of(self.unit, self.name)

    def error(self, run: int) -> float | None:
        """The error of a run's value, None if unknown."""
        known = bool(self.errors) and math.isfinite(self.errors[run])
        return self.errors[run] if known else None

    def resolution(self, run: int) -> float | None:
        """The resolution of a run's value, in the shown unit; None if unknown."""
        known = self.resolutions[run] if self.resolutions else None
        return None if known is None else abs(self.scale.factor) * known

    def verdict(self, run: int) -> bool | None:
        """Whether a run satisfies its bound; None if there is none."""
        return met(self.ours[run], self.theirs[run], self.kinds[run])


def lines(
    runs: Sequence[Run], base: Run, *, everything: bool = False, at: Sequence[float] = ()
) -> list[Line]:
    """Return the headline quantities, those with references, and the ratios to the base run.

    Sizes are also shown along the mould, from the histories.

    Args:
        runs: In the order of the columns.
        base: Reference run of the ratios.
        everything: All quantities instead of the headline ones.
        at: Positions, m: the quantities there instead of those at the end.
    """
    all_of = [run.summary.quantities for run in runs]
    references = [c for run in runs for c in run.summary.references if not c.missing]
    names = list(dict.fromkeys(n for q in all_of for n in q)) if everything else headline(all_of)
    referred = [c.reference.quantity for c in references]
    names += [name for name in dict.fromkeys(referred) if name not in names]
    histories = [run.history() for run in runs]
    way = _way(histories, base, runs)
    found: list[Line] = []
    for name in names:
        those = {c.reference.at for c in references if c.reference.quantity == name}
        inner = [place for place in those if place is not None]
        if name.startswith(_ALONG):
            inner += [p for p in way if not any(math.isclose(p, i, rel_tol=_SAME) for i in inner)]
        places: tuple[float | None, ...] = tuple(at) or (*sorted(inner), None)
        for place in places:
            line = _line(runs, histories, name, place)
            if at and not any(map(math.isfinite, line.ours)):
                continue  # no column in the history
            found.append(line)
            if name in RATIOS:
                judged = tuple(_may_be_judged(run, base) for run in runs)
                found.append(_ratio(line, runs.index(base), judged))
    return found


def _way(
    histories: Sequence[pandas.DataFrame | None], base: Run, runs: Sequence[Run]
) -> tuple[float, ...]:
    """Positions [m] within the base run's mould, and its exit if a run goes beyond it.

    Positions above the start of the base run are left out.
    """
    table = histories[runs.index(base)]
    if table is None:
        return ()
    end, _ = mould_exit(np.asarray(table["position"]), base.summary)
    ends = [float(t["position"].iloc[-1]) for t in histories if t is not None]
    beyond = any(last > end * (1 + _SAME) for last in ends)
    start = float(table["position"].iloc[0]) * (1 - _SAME)
    return tuple(s * end for s in (1 / 3, 2 / 3) if s * end >= start) + ((end,) if beyond else ())


def _line(
    runs: Sequence[Run], histories: Sequence[pandas.DataFrame | None], name: str, at: float | None
) -> Line:
    """One quantity, at the end of the runs or along the strand."""
    quantity = next(r.summary.quantities[name] for r in runs if name in r.summary.quantities)
    ours, theirs, errors, resolutions = [], [], [], []
    kinds: list[Kind] = []
    for run, history in zip(runs, histories, strict=True):
        mine = run.summary.quantities.get(name)
        error = None if mine is None else mine.shown_error
        if at is not None:
            stated = run.summary.errors_near(at).get(name)
            unit = unit_of_difference(quantity.shown_unit)
            error = None if stated is None else from_si(stated, unit)
        errors.append(math.nan if error is None else error)
        there = mine if at is None else _on_the_way(history, name, at)
        value = math.nan if there is None else there.value
        resolutions.append(None if there is None or error is not None else there.shown_resolution)
        expected = math.nan
        kind: Kind = "value"
        for comparison in run.summary.references:
            reference = comparison.reference
            if reference.quantity == name and reference.at == at and not comparison.missing:
                value = comparison.ours
                if not reference.changed:
                    expected, kind = reference.value, reference.kind
        ours.append(from_si(value, quantity.shown_unit))
        theirs.append(from_si(expected, quantity.shown_unit))
        kinds.append(kind)
    label = plain_label(quantity) + ("" if at is None else f", at {1e3 * at:.6g} mm")
    known = tuple(errors) if any(map(math.isfinite, errors)) else ()
    return Line(
        label,
        quantity.shown_unit,
        tuple(ours),
        tuple(theirs),
        tuple(kinds),
        is_gap(name),
        known,
        name,
        at,
        tuple(resolutions) if any(resolutions) else (),
    )


def _on_the_way(history: pandas.DataFrame | None, name: str, at: float) -> Quantity | None:
    """A column of a history at a position [m]; None if the run has not reached it."""
    if history is None or name not in history:
        return None
    wanted = (name, *(column for column in history if str(column).startswith("solidus_cell_")))
    row = {
        str(one): float(np.interp(at, history["position"], history[one], np.nan, np.nan))
        for one in wanted
    }
    return last_quantities(row, history.attrs["units"]).get(name)


def _may_be_judged(run: Run, base: Run) -> bool:
    """Whether a bound on a ratio to an idealised mould with equal casting holds for this run."""
    ideal = base.label == _IDEAL or _IDEAL in base.summary.title.lower()
    one, other = run.speed_and_length(), base.speed_and_length()
    return ideal and (one == other or bool(one and other and np.allclose(one, other, rtol=1e-4)))


def _ratio(line: Line, base: int, judged: Sequence[bool]) -> Line:
    """A line as percentage of the base run's; bounds only for the runs to which they apply."""

    def share(values: Sequence[float]) -> tuple[float, ...]:
        whole = values[base]
        return tuple(100.0 * v / whole if whole else math.nan for v in values)

    theirs = share(line.theirs)
    common = len({value for value in theirs if math.isfinite(value)}) < 2  # one for all
    if common or line.kinds[base] != "value":
        theirs = (math.nan,) * len(theirs)
    theirs = tuple(
        value if may or kind == "value" else math.nan
        for value, may, kind in zip(theirs, judged, line.kinds, strict=True)
    )
    return Line(line.label, SHARE, share(line.ours), theirs, line.kinds, at=line.at)


def table_of(runs: Sequence[Run], table: Sequence[Line]) -> Table:
    """The table for display: one row per quantity, one column per run.

    References have their own column if they are equal for all runs, otherwise they follow the
    values in brackets; those of an unchanged case are left out.
    """
    changed = any(c.reference.changed for run in runs for c in run.summary.references)
    alone = not changed and have_common_references(table)
    heads = ["quantity", "unit", *(["reference"] if alone else [])]
    for number, run in enumerate(runs):
        given = not alone and any(math.isfinite(line.theirs[number]) for line in table)
        heads.append("\n".join(textwrap.wrap(run.label, 13)) + "\n(reference)" * given)
    rows = []
    for line in table:
        cells = [_cell(line, number, bare=alone) for number in range(len(runs))]
        if alone:
            having = [i for i, value in enumerate(line.theirs) if math.isfinite(value)]
            cells.insert(0, _reference(line, having[0]) if having else "")
        label = "\n".join(textwrap.wrap(label_shown(line.label), 26))
        rows.append((label, unit_shown(line.scale.unit), *cells))
    return Table(heads, rows, words=(0, 1), repeated=3 if alone else 2)


def have_common_references(table: Sequence[Line]) -> bool:
    """Return whether there are references, equal for all runs."""
    different = [
        {pair for pair in zip(line.theirs, line.kinds, strict=True) if math.isfinite(pair[0])}
        for line in table
    ]
    return any(different) and all(len(values) < 2 for values in different)


def _cell(line: Line, run: int, *, bare: bool) -> str:
    """The value of a run, with or without its reference in brackets."""
    value, scale = line.ours[run], line.scale
    if scale.unit == SHARE:
        ours = _text(value, scale)
    else:
        error, resolution = line.error(run), line.resolution(run)
        ours, unit = value_cells(value, scale, error, resolution, line.gap)
        if unit != unit_shown(scale.unit):
            ours += f" {unit}"  # a small gap
    if bare or not math.isfinite(line.theirs[run]):
        return ours
    return f"{ours} ({_reference(line, run)})"


def cells(line: Line) -> list[tuple[str, str]]:
    """Return the value of each run as text, and its reference, "" for none."""
    return [
        (_cell(line, i, bare=True), _reference(line, i) if math.isfinite(line.theirs[i]) else "")
        for i in range(len(line.ours))
    ]


def _reference(line: Line, run: int) -> str:
    """The reference of a run; a bound with its sign."""
    return SIGNS[line.kinds[run]] + _text(line.theirs[run], line.scale)


def _text(value: float, scale: Scale) -> str:
    if scale.unit == SHARE and math.isfinite(value):
        return f"{value:.1f}"
    return shown(scale(value), scale.unit)


def csv_table(runs: Sequence[Run], table: Sequence[Line]) -> Table:
    """The table in documented units: one row per quantity, one column per run.

    A run with errors has a column for them, one with references a column for these. If some
    references are bounds one more column has `at_least` or `at_most`.
    """
    columns = [["quantity", *(k.label for k in table)], ["unit", *(k.unit for k in table)]]
    for i, run in enumerate(runs):
        columns.append([run.label, *(_number(line.ours[i]) for line in table)])
        if any(line.error(i) is not None for line in table):
            errors = (line.errors[i] if line.errors else math.nan for line in table)
            columns.append([f"{run.label}: error", *map(_number, errors)])
        if any(math.isfinite(line.theirs[i]) for line in table):
            columns.append([f"{run.label}: reference", *(_number(k.theirs[i]) for k in table)])
        if any(line.kinds[i] != "value" for line in table):
            kinds = (k.kinds[i] if math.isfinite(k.theirs[i]) else "value" for k in table)
            columns.append([f"{run.label}: bound", *("" if k == "value" else k for k in kinds)])
    heads, *rows = zip(*columns, strict=True)
    return Table(heads, rows)


def _number(value: float) -> str:
    return f"{value:.12g}" if math.isfinite(value) else ""


def in_si(runs: Sequence[Run], found: Sequence[Line]) -> pandas.DataFrame:
    """Return the lines of a comparison in SI, one row each."""
    import pandas

    rows: list[dict[str, Any]] = []
    for line in found:
        # A ratio is below the result it belongs to, and has no name of its own.
        name = f"{rows[-1]['name']}_share" if line.unit == SHARE else line.name
        shown = "%" if line.unit == SHARE else line.unit
        row: dict[str, Any] = {"name": name, "at": math.nan if line.at is None else line.at}
        row |= {"label": line.label, "unit": Quantity(0.0, shown, "").unit}
        for i, run in enumerate(runs):
            row[run.label] = to_si(line.ours[i], shown)
            row[f"{run.label}: error"] = to_si(line.error(i), unit_of_difference(shown))
            row[f"{run.label}: reference"] = to_si(line.theirs[i], shown)
            bound = line.kinds[i] != "value" and math.isfinite(line.theirs[i])
            row[f"{run.label}: bound"] = line.kinds[i] if bound else None
        rows.append(row)
    table = pandas.DataFrame(rows).set_index("name")
    extra = [f"{run.label}: {what}" for run in runs for what in ("error", "reference", "bound")]
    return table.drop(columns=[column for column in extra if table[column].isna().all()])


_SEPARATOR = "; "  # separator of the parts of a note
_HERE = "castfem compare"  # part that refers the reader of a single run to this table


def remarks(runs: Sequence[Run], base: Run, table: Sequence[Line]) -> list[str]:
    """Return remarks for the reader of the table.

    These are the base, sources and notes of the references, satisfied bounds, different ends.
    """
    found = [f"base: {base.label}", *heat_shared(runs)]
    found += cautions_of_all({run.label: (run.folder, run.summary) for run in runs})
    who = dict.fromkeys(c.reference.source for run in runs for c in run.summary.references)
    if who:
        found.append(f"references: {'; '.join(who)}")
    for run in runs:
        keys = dict.fromkeys(k for c in run.summary.references for k in c.reference.changed)
        if keys:
            found.append(f"references of {run.label} are {UNCHANGED}: {', '.join(keys)} differs")
    found += _bounds(runs, table)
    notes: dict[str, dict[str, None]] = {}
    for run in runs:
        for comparison in run.summary.references:
            reference = comparison.reference
            quantity = run.summary.quantities.get(reference.quantity)
            label = reference.quantity if quantity is None else plain_label(quantity)
            note = _SEPARATOR.join(
                part for part in reference.note.split(_SEPARATOR) if _HERE not in part
            )
            if note:
                notes.setdefault(f"{label}: {note}", {})[run.label] = None
    found += [f"note ({', '.join(who)}) {text}" for text, who in notes.items()]
    ends = {
        place_said(run.summary.quantities["position"].value, beyond=math.inf)
        for run in runs
        if "position" in run.summary.quantities
    }
    for run in runs:
        loads = None if run is base else RollLoads.of(run.folder)
        if loads is not None and (of_base := RollLoads.of(base.folder)) is not None:
            found += [f"from {base.label} to {run.label}: {one}" for one in loads.changes(of_base)]
        defects, places = defects_of(run.folder), crack_places(run.folder, run.summary)
        found += [f"defects of {run.label}: {defects}"] if defects else []
        worst = [] if places is None else [*places.worst] or [places.nowhere]
        found += [f"worst of {run.label}: {one}" for one in worst if one]
    if len(ends) > 1:
        found.append(f"the runs end at different positions: {', '.join(sorted(ends))}")
    return found


def _bounds(runs: Sequence[Run], table: Sequence[Line]) -> list[str]:
    """Which runs satisfy their bounds, and by how much others violate theirs."""
    found = {}
    for heading, verdict in (("bounds met", True), ("bounds missed", False)):
        parts = []
        for line in table:
            those = [i for i in range(len(runs)) if line.verdict(i) is verdict]
            names = [runs[i].label + ("" if verdict else _miss(line, i)) for i in those]
            unit = f", {SHARE}" if line.unit == SHARE else ""
            parts += [f"{line.label}{unit} ({', '.join(names)})"] if names else []
        found[heading] = "; ".join(parts)
    return [f"{heading}: {text}" for heading, text in found.items() if text]


def _miss(line: Line, run: int) -> str:
    """The violation of a bound, after a blank."""
    by = abs(line.ours[run] - line.theirs[run])
    if line.unit == SHARE:
        return f" by {by:.1f} points"
    unit = difference_of(line.scale.unit)
    return f" by {shown(line.scale.factor * by, unit)} {unit_shown(unit)}"
