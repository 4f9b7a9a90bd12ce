"""`castfem sensitivity`: derivatives of a run's results with respect to keys of its case."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base import log
from castfem.base.errors import InputError
from castfem.base.progress import Progress
from castfem.base.shown_units import label_shown, place_said, said, scale_of, shown_in
from castfem.base.table import Table, say
from castfem.cli import parallel
from castfem.cli.options import Request, chosen, read_from
from castfem.model import Case, shipped_cases
from castfem.model.checks.shared_heat import fixed_while_varied
from castfem.runs.output.folder import RUN_NAME
from castfem.runs.results.numbers import shown, unit_shown, with_error

if TYPE_CHECKING:
    from castfem.studies.sensitivity.result import Row, Sensitivity


@dataclass(frozen=True, slots=True)
class Options(Request):
    """Arguments of the command."""

    of: tuple[str, ...] = ()  #: results
    to: tuple[str, ...] = ()  #: parameters


def sensitivity_of_case(options: Options) -> None:
    """Run, differentiate, print, write and draw (collective)."""
    from castfem.studies.sensitivity.run import sensitivity

    comm = parallel.communicator()
    root = parallel.rank_of(comm) == 0
    log.setup(-1 if options.quiet else 0, parallel.rank_of(comm))
    path = shipped_cases.find(options.name)
    case, target = options.case(path), options.target(path, "_sensitivity")
    if target.exists() and (not target.is_dir() or (target / RUN_NAME).is_file()):
        raise InputError(f"{target}: holds something else; choose another folder with -o")
    progress = Progress(-1 if options.quiet else 0) if root else None
    try:
        with parallel.together(comm), read_from(path):
            found = sensitivity(
                case, options.of, options.to, folder=target, resume=options.resume, comm=comm,
                progress=progress,
            )  # fmt: skip
    finally:
        if progress is not None:
            progress.stop()
        log.close()
    if not root:
        return
    with chosen(options.units), shown_in(case.shown_units):
        _report(found, case, target, options)


def _report(found: Sensitivity, case: Case, target: Path, options: Options) -> None:
    from castfem.post.plots.studies import FIGURE_NAME, draw_tornado
    from castfem.studies.sensitivity.result import CSV_NAME, JSON_NAME

    written = [CSV_NAME, JSON_NAME]
    if options.figures:
        draw_tornado(found, target / FIGURE_NAME)
        written.append(FIGURE_NAME)
    if not options.quiet:
        fixed = fixed_while_varied(case, {parameter.key for parameter in found.parameters})
        out = parallel.console()
        say(out, head_of(found), "", table_of(found), "", *remarks(found), *fixed)
        print(f"{', '.join(written)} in {target}")


def table_of(found: Sensitivity) -> Table:
    """Return the table of the derivatives."""
    rows = []
    for name, quantity in found.quantities.items():
        scale = scale_of(quantity.shown_unit, name)
        value = f"{shown(scale(quantity.shown), scale.unit)} {unit_shown(scale.unit)}"
        rows.append((f"{label_shown(quantity.label)}: {value}", "", ""))
        rows += [_cells(row) for row in found.rows() if row.name == name]
    return Table(("", "derivative", "% by 1 %"), rows, words=(0, 1))


def head_of(found: Sensitivity) -> str:
    """Return the title of the table."""
    return f"{found.title}: {place_said(found.position)} below the meniscus"


def _cells(row: Row) -> tuple[str, str, str]:
    from castfem.studies.sensitivity.result import ShownRow

    one = ShownRow.of(row)
    at = f"{one.at:.6g} {unit_shown(one.at_unit)}".rstrip()
    slope = "-"
    if math.isfinite(one.value):
        slope = f"{_number(one.value, one.error)} {unit_shown(one.unit)}"
    relative = f"{row.elasticity:+.3f}" if math.isfinite(row.elasticity) else ""
    return f"  by {row.parameter.name}, {at}", slope, relative


def _number(value: float, error: float) -> str:
    """A derivative with its error, rounded accordingly."""
    if not math.isfinite(error):
        return f"{value:.4g} (error unknown)"
    if error == 0.0 or value == 0.0:
        return with_error(f"{value:.4g}", error)
    digits = 2 + math.floor(math.log10(abs(value))) - math.floor(math.log10(error))
    return with_error(f"{value:.{min(max(digits, 1), 4)}g}", error)


def _contact_changes(found: Sensitivity, name: str) -> str:
    """Return where contact is about to change with a parameter; "" if nowhere."""
    met = [kink for kink in found.kinks if kink.parameter == name]
    if not met:
        return ""
    x, y = (said(1e3 * part, "mm", ".4g") for part in met[0].place)
    many = f"{met[0].points} points of the surface are"
    points = many if met[0].points > 1 else "a point of the surface is"
    windows = f"{len(met)} windows" if len(met) > 1 else "one window"
    return (
        f"by {name}: {points} about to touch the mould or to "
        f"leave it {place_said(met[0].position)} below the meniscus (x = {x}, y = {y}), "
        f"in {windows} of the run: "
        "results that depend on them have the derivative to one side"
    )


def _in_steps(found: Sensitivity) -> str:
    """Return parameters to which a strained slice responds in small steps; "" if there are none."""
    names = [p.name for p in found.parameters if p.moves_front]
    if not (found.strained and names):
        return ""
    return (
        f"by {', '.join(names)}: the shell grows cell by cell, and stress, strain and gap "
        "change with it in small steps; the difference of two runs a few per cent apart may differ "
        "from the derivative by its error, and even have the other sign (docs/sensitivity.md); "
        "where the error is large, compare two runs"
    )


def _cut(found: Sensitivity) -> str:
    """Return that windows were shortened, which the derivatives keep fixed; "" if none was."""
    if not found.cut:
        return ""
    times = "once" if found.cut == 1 else f"{found.cut} times"
    return (
        f"coupling windows were cut for their error {times} on the way to {found.windows}; "
        "similar runs cut the same windows, but where another one is cut, "
        "results jump within that error, which no derivative shows; with coupling.window_error = "
        '"500 K" none is cut, and a shorter coupling.interval makes them as accurate'
    )


def remarks(found: Sensitivity) -> list[str]:
    """Return remarks on the derivatives, one line each."""
    from castfem.studies.sensitivity.result import ShownRow

    lines = [_contact_changes(found, p.name) for p in found.parameters]
    lines = [line for line in [*lines, _in_steps(found), _cut(found)] if line]
    for row in found.rows():
        one = ShownRow.of(row)
        if one.sides is not None:
            lines.append(
                f"{row.name} by {row.parameter.name}: it has a kink here, "
                f"{one.sides[0]:.4g} below and {one.sides[1]:.4g} {unit_shown(one.unit)} above"
            )
        elif not math.isfinite(row.value):
            why = "the result does not exist here"
            if math.isfinite(row.quantity.value):
                why = "the front has passed too few cells and steps in this zone to tell"
            lines.append(f"{row.name} by {row.parameter.name}: {why}")
    return lines
