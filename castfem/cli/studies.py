"""Commands that study a case by runs: sweep, error, optimise, calibrate, sensitivity."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from castfem.cli import completion
from castfem.cli.options import (
    Accuracy,
    At,
    CaseName,
    Overrides,
    Quiet,
    Units,
    sound_units,
)
from castfem.errors import InputError


def sweep(
    case: CaseName,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE,...",
            help="Values of a key; several keys: all combinations.",
            click_type=completion.Assignment(),
        ),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(help="CSV file with a row for each run; its header names keys and units."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder; by default results/<family>/<name>_sweep."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("-j", help="How many runs at once; by default one a core.")
    ] = None,
    resume: Annotated[
        bool, typer.Option(help="Go on from the checkpoints of runs that were not finished.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option(help="Run all anew, and replace runs of other cases.")
    ] = False,
    figures: Annotated[bool, typer.Option(help="Draw the figures of each run.")] = False,
    part: Annotated[
        str,
        typer.Option(metavar="I/N", help="Do a share of the runs, the I-th of N, beside others."),
    ] = "",
    collect: Annotated[
        bool, typer.Option("--collect", help="Run nothing: the table of what has been run.")
    ] = False,
    ranks: Annotated[
        int, typer.Option(metavar="K", help="Under mpirun: run each case on K ranks.")
    ] = 1,
    slurm: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a SLURM script for the parts; run nothing."),
    ] = None,
    at: At = None,
    accuracy: Accuracy = "default",
    units: Units = None,
    quiet: Quiet = False,
) -> None:
    """Run a case with several values, in parallel. What is finished is not run again."""
    from castfem.cli.sweeping import Options, sweep_case
    from castfem.results.places import read_positions

    if resume and overwrite:
        raise InputError("--resume and --overwrite exclude each other")
    if collect and (part or overwrite or slurm is not None):
        raise InputError("--collect runs nothing: leave out --part, --overwrite and --slurm")
    if slurm is not None and overwrite:
        raise InputError("--slurm and --overwrite exclude each other: parts are taken up again")
    status = sweep_case(
        Options(
            name=case,
            folder=output,
            assignments=tuple(set_ or ()),
            table=table,
            processes=jobs,
            resume=resume,
            overwrite=overwrite,
            figures=figures,
            quiet=quiet,
            part=part,
            collect=collect,
            ranks=ranks,
            script=slurm,
            at=tuple(read_positions(at or ())),
            accuracy=accuracy,
            units=sound_units(units),
        )
    )
    if status:
        raise typer.Exit(status)


def error(
    case: CaseName,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder; by default results/<family>/<name>_error."),
    ] = None,
    set_: Overrides = None,
    jobs: Annotated[
        int | None, typer.Option("-j", help="How many runs at once; by default one a core.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option(help="Run all anew, and replace runs of another case.")
    ] = False,
    to: Annotated[
        str, typer.Option(metavar="PERCENT", help="Propose sizes with which errors are 1%, say.")
    ] = "",
    units: Units = None,
    quiet: Quiet = False,
) -> None:
    """Run a case on other meshes, with other steps and windows: the error of each number."""
    from castfem.cli.accuracy import Options, error_of_case

    status = error_of_case(
        Options(
            name=case,
            folder=output,
            overrides=tuple(set_ or ()),
            processes=jobs,
            overwrite=overwrite,
            quiet=quiet,
            to=to,
            units=sound_units(units),
        )
    )
    if status:
        raise typer.Exit(status)


def optimise(
    case: CaseName,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder; by default results/<family>/<name>_optimise."),
    ] = None,
    set_: Overrides = None,
    jobs: Annotated[
        int | None, typer.Option("-j", help="How many runs at once; by default one a core.")
    ] = None,
    ranks: Annotated[
        int, typer.Option(metavar="K", help="Under mpirun: run each case on K ranks.")
    ] = 1,
    figures: Annotated[bool, typer.Option(help="Draw the answer.")] = True,
    units: Units = None,
    quiet: Quiet = False,
) -> None:
    """Find the best values of a case's keys, by its table [optimise]. The same command goes on."""
    from castfem.cli.optimising import Options, optimise_case

    words = sound_units(units)
    status = optimise_case(
        Options(case, output, tuple(set_ or ()), jobs, figures, quiet, words, ranks)
    )
    if status:
        raise typer.Exit(status)


def calibrate(
    case: CaseName,
    to: Annotated[
        Path,
        typer.Option("--to", metavar="DATA.csv", help="What was measured (docs/calibrate.md)."),
    ],
    free: Annotated[
        list[str],
        typer.Option(
            metavar="KEY=LOW..HIGH",
            help='A key to fit, e.g. casting.speed="2..4 m/min"; repeatable.',
            click_type=completion.Assignment(),
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder; by default results/<family>/<name>_calibration."
        ),
    ] = None,
    set_: Overrides = None,
    jobs: Annotated[
        int | None, typer.Option("-j", help="How many runs at once; by default one a core.")
    ] = None,
    units: Units = None,
    quiet: Quiet = False,
) -> None:
    """Fit keys of a case to measured temperatures, shells or heat, within bounds."""
    from castfem.cli.calibrating import calibrate_case

    words = sound_units(units)
    status = calibrate_case(
        case, to, free, output, tuple(set_ or ()), jobs, quiet=quiet, units=words
    )
    if status:
        raise typer.Exit(status)


def sensitivity(
    case: CaseName,
    to: Annotated[
        list[str],
        typer.Option(
            "--to",
            metavar="KEY[=SPREAD],...",
            help="By what: keys of the case, or steel.conductivity and the like; repeatable.",
        ),
    ],
    of: Annotated[
        list[str] | None,
        typer.Option("--of", metavar="RESULT,...", help="Of what; by default heat and shell."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder; by default results/<family>/<name>_sensitivity."
        ),
    ] = None,
    set_: Overrides = None,
    resume: Annotated[bool, typer.Option(help="Go on from the last checkpoint.")] = False,
    figures: Annotated[bool, typer.Option(help="Draw the figure.")] = True,
    units: Units = None,
    quiet: Quiet = False,
) -> None:
    """Run a case once, with the derivatives of its results by some of its keys."""
    from castfem.cli.sensitivity import Options, sensitivity_of_case

    words = sound_units(units)
    overrides = tuple(set_ or ())
    sensitivity_of_case(
        Options(case, tuple(of or ()), tuple(to), output, overrides, resume, figures, quiet, words)
    )
