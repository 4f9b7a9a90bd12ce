"""`castfem optimise`: searches for the best values of a case's keys, prints and draws them."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.atomic_files import write_json
from castfem.base.errors import RunFailure
from castfem.base.shown_units import scale_of, shown_in
from castfem.base.table import Table, say
from castfem.cli import many_runs, parallel
from castfem.cli.options import Request, chosen
from castfem.model import load_case, shipped_cases
from castfem.model.checks.shared_heat import fixed_while_varied
from castfem.post.compare.optimum_tables import (
    FRONT_NAME,
    MOULD_NAME,
    mould_table,
    report,
    spread_scale,
    write_front,
    write_mould_table,
)
from castfem.post.report.cautions import cautions_of_all
from castfem.runs.output.summary_file import Summary
from castfem.studies.optimisation.fidelity import THERMAL
from castfem.studies.optimisation.study import Study
from castfem.studies.sweep.record import check_own
from castfem.studies.sweep.work import Job, Outcome

if TYPE_CHECKING:
    from castfem.studies.optimisation.optimum import Optimum

OPTIMUM_NAME = "optimum.json"
_WRITTEN = OPTIMUM_NAME, MOULD_NAME, FRONT_NAME


class RunLines:
    """Prints one line for each run that ends."""

    def __init__(self, quiet: bool) -> None:
        self._quiet, self._count = quiet, 0

    def stage(self, what: str) -> None:
        """Print the purpose of the runs that follow."""
        if not self._quiet:
            print(what, file=sys.stderr, flush=True)

    def ended(self, job: Job, outcome: Outcome) -> None:
        """Print how a run has ended."""
        self._count += 1
        how = f"failed: {outcome.message}" if outcome.failed else "finished"
        if not self._quiet:
            line = f"run {self._count}, {job.name}: {how} in {outcome.seconds:.1f} s"
            print(line, file=sys.stderr, flush=True)


def optimise_case(options: Request) -> int:
    """Search; return the exit status, 2 if no point meets the constraints (collective)."""
    return many_runs.on_root(partial(_prepared, options))


def _done(study: Study, target: Path, options: Request) -> int:
    """Search (on rank 0), write and print the result; return the exit status."""
    assert study.evaluator is not None
    with study.evaluator:
        lines = RunLines(options.quiet)
        optimum = study.solve(lines.ended, stage=lines.stage)
    with chosen(options.units), shown_in(study.problem.case.shown_units):
        return _report(study, optimum, target, options)


def _prepared(options: Request, ranks: bool) -> many_runs.Work:
    """Read the case and check its folder."""
    many_runs.check_processes(options.processes, ranks, options.ranks)
    path = shipped_cases.find(options.name)
    case = load_case(path, options.overrides)
    target = options.target(path, "_optimise")
    check_own(target, _WRITTEN)
    asked = case.optimise
    if asked is not None:
        varied = [*(one.key for one in asked.variable), *(one.key for one in asked.input)]
        for line in fixed_while_varied(case, varied):
            print(f"castfem: {line}", file=sys.stderr)
    evaluator = many_runs.evaluator(case, target, options.processes, options.ranks)
    study = Study(case, evaluator=evaluator, origin=str(path))
    return lambda comm: _done(study, target, options)


def _report(study: Study, optimum: Optimum, target: Path, options: Request) -> int:
    write_json(target / OPTIMUM_NAME, optimum.to_json())
    best = study.case_of(optimum)
    written = [OPTIMUM_NAME]
    moulded = best.mould is not None and optimum.status != "failed"
    if moulded:
        written.append(write_mould_table(target, best).name)
    if optimum.front is not None:
        written.append(write_front(target, optimum.front).name)
    if options.figures and optimum.neighbours:
        written += _drawn(study, optimum, target)
    if not options.quiet:
        out = parallel.console()
        for block in report(optimum):
            say(out, block, "")
        folder = target / optimum.best
        best_run = {"the best run": (folder, Summary.load(folder))} if optimum.best else {}
        for line in cautions_of_all(best_run):
            say(out, line)
        if moulded:
            say(out, _mould(study, optimum), "")
        print(f"{', '.join(written)} in {target}, runs beside")
    if optimum.status != "found":
        what = "no run has come to its end"
        what = {
            "impossible": "the constraints cannot be met",
            "not converged": "the search has not converged; raise optimise.most_runs",
            "independent": "the results do not depend on what is varied",
        }.get(optimum.status, what)
        print(f"castfem: {what}", file=sys.stderr)
        return RunFailure.exit_status
    return 0


def _drawn(study: Study, optimum: Optimum, target: Path) -> list[str]:
    from castfem.post.plots import studies as figures
    from castfem.post.plots.style import save

    drawn = {figures.OPTIMUM_NAME: figures.optimum_figure(optimum)}
    best = study.case_of(optimum)
    if best.mould is not None and optimum.best and optimum.fidelity != THERMAL:
        run = target / optimum.best
        drawn[figures.MOULD_NAME] = figures.mould_figure(*mould_table(best), run)
    if optimum.spread is not None:
        scales = [spread_scale(optimum, i) for i in range(len(optimum.spread.rows))]
        drawn[figures.SPREAD_NAME] = figures.indices_figure(optimum.spread, scales)
    if optimum.front is not None and len(optimum.front.points) > 1:
        drawn[figures.FRONT_NAME] = figures.front_figure(optimum.front)
    for name, figure in drawn.items():
        save(figure, target / name)
    return list(drawn)


def _mould(study: Study, optimum: Optimum) -> Table:
    head, rows = mould_table(study.case_of(optimum), every=0.1)
    scale = scale_of("mm")
    size = ".3f" if scale.unit == "mm" else ".7g"
    cells = [(f"{scale(row[0]):.7g}", *(f"{scale(one):{size}}" for one in row[1:])) for row in rows]
    return Table([name.replace("[mm]", f"[{scale.unit}]") for name in head], cells, words=())
