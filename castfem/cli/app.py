"""The commands of castfem. Heavy modules are imported inside the commands that need them.

Arguments that a command only passes on to its `Options` are in `given`, by attribute name. Equation
numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import os
import sys
from importlib import resources
from pathlib import Path
from typing import Any

import click

from castfem import __version__
from castfem.base.errors import InputError, RunFailure
from castfem.cli import case_commands, options, study_commands
from castfem.cli.command import Argument, Group, command
from castfem.cli.options import PATH, case_name, file_for, folder, folders, output, overrides, quiet

_TERMINAL, _LINES = 1.0, 10.0  # s between two updates: at a terminal, and elsewhere


@command('run billet125/thermal --set casting.speed="3 m/min" -o slow')
@case_name
@output("Folder; by default results/<family>/<name>.")
@overrides
@options.accuracy
@click.option("--resume/--no-resume", help="Continue from the last checkpoint.")
@click.option("--overwrite/--no-overwrite", help="Replace a run of another case in the folder.")
@click.option("--profile/--no-profile", help="Print the time spent in each part of the run.")
@quiet
@click.option(
    "--verbose", "-v", count=True, show_default=False, help="Print more, with tracebacks of errors."
)
def run(quiet: bool, verbose: int, **given: Any) -> None:
    """Run a case. Under mpirun it runs on all ranks."""
    from castfem.cli.running import Options, run_case

    run_case(options.asked(Options, verbosity=-1 if quiet else verbose, **given))


@command("check my_billet.toml")
@case_name
@overrides
@quiet
def check(case: str, overrides: tuple[str, ...], quiet: bool) -> None:
    """Check a case, its steel and its mesh without running it."""
    from castfem.cli.checking import check_case
    from castfem.model.shipped_cases import find

    text = check_case(case, find(case), overrides)
    if not quiet:
        print(text)


@command("cases")
def cases() -> None:
    """List the cases shipped with castfem."""
    from castfem.base.table import pairs, say
    from castfem.cli import parallel
    from castfem.model import shipped_cases

    shipped = shipped_cases.shipped().items()
    say(parallel.console(), pairs([(name, shipped_cases.title_of(path)) for name, path in shipped]))


def starter(file: str, title: str) -> str:
    """Return the commented case that `castfem init` writes, from its file and title."""
    text = (resources.files(__package__) / "starter.toml").read_text(encoding="utf-8")
    return text.replace("{file}", file).replace("{title}", title)


@command("init my_billet")
@click.argument("name", help="Name of the new case file.", cls=Argument)
def init(name: str) -> None:
    """Write a commented case to start from."""
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if not path.name.removesuffix(".toml").strip():
        raise InputError(f'"{name}": give the new case file a name, such as my_billet.toml')
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(starter(str(path), path.stem.replace("_", " ")))
    except FileExistsError:
        raise InputError(f"{path}: exists already; choose another name") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    print(f"wrote {path}; run it with: castfem run {path}")


@command('show results/billet125/thermal --at "300 mm"')
@folder("Folder of a run.")
@options.at
@options.units
def show(folder: Path, at: tuple[str, ...], units: tuple[str, ...]) -> int:
    """Print the table of a run and draw its figures; with --at the results at some positions."""
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is no' if folder.exists() else 'no such'} folder")
    from castfem.cli import parallel
    from castfem.cli.options import chosen
    from castfem.post.report.show import show as show_folder
    from castfem.runs.output.folder import CASTER_NAME, ERROR_NAME, STRAND_ROWS_NAME
    from castfem.runs.output.run_record import RUN_NAME
    from castfem.runs.results.run_case import error_lines
    from castfem.studies.sweep.record import SWEEP_NAME

    if (folder / ERROR_NAME).is_file() and not (folder / RUN_NAME).is_file():
        from castfem.cli.accuracy import show_errors

        if at:
            raise InputError(
                f"{folder}: --at is of a run; this table has the places of castfem error --at"
            )
        with chosen(units):
            show_errors(folder)
        return 0
    if (folder / CASTER_NAME).is_file():
        from castfem.cli.caster import show_caster

        if at:
            raise InputError(f"{folder}: --at is of a run; {STRAND_ROWS_NAME} has all positions")
        show_caster(folder, units)
        return 0
    if (folder / SWEEP_NAME).is_file() and not (folder / RUN_NAME).is_file():
        raise InputError(f"{folder}: is a sweep; use castfem compare {folder}")
    from castfem.runs.results.labels import read_positions

    with chosen(units):
        sound = show_folder(folder, parallel.console(), at=read_positions(at))
    for line in error_lines({"": folder}) if not at else ():
        print(line)
    return 0 if sound else InputError.exit_status


@command("watch results/billet125/thermal --html at_work.html")
@folder("Folder of a run at work, or of a sweep.")
@click.option(
    "--html",
    metavar="FILE",
    type=PATH,
    help="Write its report as well, and update it until the run ends.",
)
@click.option(
    "--every",
    metavar="TIME",
    default="",
    show_default=False,
    help='Interval between updates, such as "5 s".',
)
@click.option("--wait", is_flag=True, help="Wait for runs that have not begun or will be resumed.")
@options.units
def watch(folder: Path, html: Path | None, every: str, wait: bool, units: tuple[str, ...]) -> int:
    """Show the progress of a run until it ends; with --html also as a page that reloads itself."""
    from castfem.cli import parallel
    from castfem.cli.options import above_zero, chosen
    from castfem.post.watch.show import Page, Viewing
    from castfem.post.watch.show import watch as watch_runs

    console, page = parallel.console(), None
    usual = _TERMINAL if console.is_terminal else _LINES
    interval = above_zero("--every", every, "s") if every else usual
    if html is not None:
        page = Page(folder, html, interval if every else max(interval, _LINES), wait=wait)
    with chosen(units):
        try:
            well = watch_runs(folder, Viewing(console, interval, page, wait))
        except KeyboardInterrupt:
            print("stopped watching; the runs continue")
            return 0
    if page is not None:
        print(f"page in {html}")
    return 0 if well else RunFailure.exit_status


@command("compare results/billet125/thermal slow")
@folders
@output("Folder; by default `compare` beside the runs.")
@click.option("--base", help="Reference run of the comparison; by default idealised, or the first.")
@click.option(
    "everything", "--all", is_flag=True, help="All quantities, not only the headline ones."
)
@click.option("--figures/--no-figures", default=True, help="Draw the figures.")
@options.at
@options.units
def compare(
    folders: tuple[Path, ...],
    output: Path | None,
    base: str | None,
    everything: bool,
    figures: bool,
    at: tuple[str, ...],
    units: tuple[str, ...],
) -> None:
    """Print a comparison of runs and draw their histories together."""
    from castfem.base.shown_units import shown_in
    from castfem.base.table import say
    from castfem.cli import parallel
    from castfem.cli.options import chosen
    from castfem.post.compare import figures as drawing
    from castfem.post.compare import table
    from castfem.post.compare.runs import base_of, read_runs
    from castfem.post.compare.table import remarks
    from castfem.runs.results.labels import read_positions
    from castfem.runs.results.run_case import error_lines, units_of_run

    places, runs = read_positions(at), read_runs(folders)
    measure, target = base_of(runs, base), output or _beside([run.folder for run in runs])
    _make(target, table.CSV_NAME)
    with chosen(units), shown_in(units_of_run(measure.folder)):
        lines = table.lines(runs, measure, everything=everything, at=places)
        out = parallel.console()
        say(out, table.table_of(runs, lines), "", *remarks(runs, measure, lines))
        say(out, *error_lines({run.label: run.folder for run in runs}))
        print(f"table in {table.csv_table(runs, lines).write_csv(target / table.CSV_NAME)}")
        drawn = drawing.draw(target, runs, measure) if figures else []
    if drawn:
        print(f"figures in {target}: {', '.join(path.name for path in drawn)}")


def _beside(folders: list[Path]) -> Path:
    """Return the default folder of a comparison: `compare` in the common folder of the runs."""
    parents = {folder.resolve().parent for folder in folders}
    if len(parents) != 1:
        return Path("results") / "compare"
    return Path(os.path.relpath(parents.pop())) / "compare"


def _make(target: Path, name: str) -> None:
    """Make a folder; refuse one that has files but none of this name."""
    try:
        target.mkdir(parents=True, exist_ok=True)
        if any(target.iterdir()) and not (target / name).is_file():
            raise InputError(f"{target}: holds other files; choose another folder with -o")
    except OSError as error:
        raise InputError(
            f"{target}: cannot be used ({error.strerror}); choose another with -o"
        ) from None


@command("report results/billet125/thermal -o thermal.html")
@folders
@output("File; by default report.html in the run, or beside the runs.")
@options.at
@options.units
def report(
    folders: tuple[Path, ...], output: Path | None, at: tuple[str, ...], units: tuple[str, ...]
) -> None:
    """Write a run, or several side by side, as one HTML file that opens offline and prints."""
    from castfem.cli.options import chosen
    from castfem.post.html.page import REPORT_NAME, write
    from castfem.runs.results.labels import read_positions

    beside = folders[0] if len(folders) == 1 else folders[0].resolve().parent
    with chosen(units):
        places = read_positions(at)
        print(f"report in {write(folders, file_for(output or beside, REPORT_NAME), places)}")


@command("schema > castfem.schema.json")
@click.option("--markdown", is_flag=True, help="Print the reference page of case files instead.")
def schema(markdown: bool) -> None:
    """Print the JSON schema of case files, for editors."""
    from castfem.model.schema import markdown_page, schema_text

    sys.stdout.write(markdown_page() if markdown else schema_text())


@command("completion bash > ~/.castfem.bash")
@click.argument("shell", metavar="SHELL", help="bash, zsh or fish.", cls=Argument)
def completion(shell: str) -> None:
    """Print the script with which a shell completes commands, case names and keys of --set."""
    from castfem.cli.command import script

    print(script(shell, app))


@click.group(
    cls=Group,
    context_settings={
        "help_option_names": ["-h", "--help"],
        "show_default": True,
        "max_content_width": 100,
    },
)
@click.version_option(__version__, message="castfem %(version)s", help="Print the version.")
def app() -> None:
    """Continuous casting of steel: one slice of the strand, followed from the meniscus."""


for one in (
    run, *study_commands.COMMANDS, check, cases, init, show, watch, compare, report,
    *case_commands.COMMANDS, schema, completion,
):  # fmt: skip
    app.add_command(one)
