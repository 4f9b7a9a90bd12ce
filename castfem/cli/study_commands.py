"""Commands that make several runs: sweep, error, optimise, calibrate, sensitivity, caster.

Arguments that a command only passes on to its `Options` are in `given`
(`castfem.cli.options.asked`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from castfem.base.errors import InputError
from castfem.cli import options
from castfem.cli.command import Assignment, command
from castfem.cli.options import PATH, asked, case_name, jobs, output, overrides, quiet


@command('sweep billet125/thermal --set casting.speed="3 m/min","4 m/min"')
@case_name
@click.option(
    "assignments",
    "--set",
    metavar="KEY=VALUE,...",
    multiple=True,
    type=Assignment(),
    help="Values of a key; several keys give all combinations.",
)
@click.option(
    "--table", type=PATH, help="CSV file with one row per run; its header names keys and units."
)
@output("Folder; by default results/<family>/<name>_sweep.")
@jobs
@click.option("--resume/--no-resume", help="Continue interrupted runs from their checkpoints.")
@click.option(
    "--overwrite/--no-overwrite", help="Repeat all runs, and replace runs of other cases."
)
@click.option("--figures/--no-figures", help="Draw the figures of each run.")
@click.option(
    "--part",
    metavar="I/N",
    default="",
    show_default=False,
    help="Make the I-th of N shares of the runs.",
)
@click.option("--collect", is_flag=True, help="Make no runs: print the table of finished ones.")
@options.ranks
@click.option(
    "script",
    "--slurm",
    metavar="FILE",
    type=PATH,
    help="Write a SLURM script for the parts; make no runs.",
)
@options.at
@options.accuracy
@options.units
@quiet
def sweep(**given: Any) -> int:
    """Run a case with several values, in parallel. Finished runs are not repeated."""
    from castfem.cli.sweeping import Options, sweep_case

    alone = given["part"] or given["overwrite"] or given["script"] is not None
    if given["collect"] and alone:
        raise InputError("--collect runs nothing: leave out --part, --overwrite and --slurm")
    if given["script"] is not None and given["overwrite"]:
        raise InputError("--slurm and --overwrite exclude each other: parts are always resumed")
    return sweep_case(asked(Options, **given))


@command("error billet125/thermal --to 1%")
@case_name
@output("Folder; by default results/<family>/<name>_error.")
@overrides
@jobs
@click.option(
    "--overwrite/--no-overwrite", help="Repeat all runs, and replace runs of another case."
)
@click.option(
    "--to",
    metavar="PERCENT",
    default="",
    show_default=False,
    help="Propose sizes for a given error, such as 1%.",
)
@options.at
@options.accuracy
@options.units
@quiet
def error(**given: Any) -> int:
    """Compute the error of each result, from runs with other meshes, steps and windows."""
    from castfem.cli.accuracy import Options, error_of_case

    return error_of_case(asked(Options, **given))


@command("optimise billet125/optimum_single")
@case_name
@output("Folder; by default results/<family>/<name>_optimise.")
@overrides
@jobs
@options.ranks
@click.option("--figures/--no-figures", default=True, help="Draw the result.")
@options.units
@quiet
def optimise(**given: Any) -> int:
    """Find the best values of a case's keys, by its table [optimise]. A second call continues."""
    from castfem.cli.optimising import optimise_case

    return optimise_case(asked(options.Request, **given))


@command('calibrate CASE --to DATA.csv --free casting.speed="2..4 m/min"')
@case_name
@click.option(
    "--to",
    metavar="DATA.csv",
    type=PATH,
    required=True,
    help="File with the measurements (docs/calibrate.md).",
)
@click.option(
    "--free",
    metavar="KEY=LOW..HIGH",
    multiple=True,
    required=True,
    type=Assignment(),
    help='A key to fit, e.g. casting.speed="2..4 m/min"; repeatable.',
)
@output("Folder; by default results/<family>/<name>_calibration.")
@overrides
@options.accuracy
@jobs
@options.units
@quiet
def calibrate(case: str, to: Path, free: tuple[str, ...], output: Path | None, **given: Any) -> int:
    """Fit keys of a case to measured temperatures, shells or heat, within bounds."""
    from castfem.cli.calibrating import calibrate_case

    options.sound_units(given["units"])
    return calibrate_case(case, to, free, output, processes=given.pop("jobs"), **given)


@command("sensitivity billet125/thermal --to casting.speed,casting.superheat")
@case_name
@click.option(
    "--to",
    metavar="KEY[=SPREAD],...",
    multiple=True,
    required=True,
    help="Parameter: a key of the case, or steel.conductivity and others; repeatable.",
)
@click.option(
    "--of",
    metavar="RESULT,...",
    multiple=True,
    help="Result to differentiate; by default heat and shell; repeatable.",
)
@output("Folder; by default results/<family>/<name>_sensitivity.")
@overrides
@options.accuracy
@click.option("--resume/--no-resume", help="Continue from the last checkpoint.")
@click.option("--figures/--no-figures", default=True, help="Draw the figure.")
@options.units
@quiet
def sensitivity(**given: Any) -> None:
    """Run a case once and compute the derivatives of its results with respect to its keys."""
    from castfem.cli.sensitivity import Options, sensitivity_of_case

    sensitivity_of_case(asked(Options, **given))


@command("caster slab1200/ladle_change --accuracy coarse")
@case_name
@output("Folder; by default results/<family>/<name>_caster.")
@click.option(
    "--follow",
    metavar="PLANT.csv",
    type=PATH,
    help="Follow a growing plant record, row by row, instead of caster.plant.",
)
@overrides
@options.accuracy
@click.option("--resume/--no-resume", help="Continue from the last checkpoint.")
@click.option("--overwrite/--no-overwrite", help="Replace a run of another case in the folder.")
@click.option("--figures/--no-figures", default=True, help="Draw the figure.")
@options.units
@quiet
def caster(**given: Any) -> None:
    """Follow a whole strand through changes of speed, superheat and water, by [caster]."""
    from castfem.cli.caster import CasterRequest, caster_of_case

    caster_of_case(asked(CasterRequest, **given))


COMMANDS = sweep, error, optimise, calibrate, sensitivity, caster
