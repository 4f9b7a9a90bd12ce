"""The commands of castfem. Heavy modules are imported inside the commands that need them.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from castfem import __version__
from castfem.cli import pictures, studies
from castfem.cli.options import Accuracy, At, CaseName, Overrides, Quiet, Units, Verbose
from castfem.errors import InputError

app = typer.Typer(
    name="castfem",
    help="Continuous casting of steel: one slice of the strand, followed from the meniscus.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"castfem {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    pass


@app.command()
def run(
    case: CaseName,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder; by default results/<family>/<name>."),
    ] = None,
    set_: Overrides = None,
    accuracy: Accuracy = "default",
    resume: Annotated[bool, typer.Option(help="Go on from the last checkpoint.")] = False,
    overwrite: Annotated[
        bool, typer.Option(help="Replace a run of another case in the folder.")
    ] = False,
    profile: Annotated[bool, typer.Option(help="Print where the time went.")] = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
) -> None:
    """Run a case. Under mpirun it runs on all ranks."""
    from castfem.cli.running import Options, run_case

    if resume and overwrite:
        raise InputError("--resume and --overwrite exclude each other")
    run_case(
        Options(
            name=case,
            folder=output,
            overrides=tuple(set_ or ()),
            accuracy=accuracy,
            resume=resume,
            overwrite=overwrite,
            profile=profile,
            verbosity=-1 if quiet else verbose,
        )
    )


app.command()(studies.sweep)
app.command()(studies.error)
app.command()(studies.optimise)
app.command()(studies.calibrate)
app.command()(studies.sensitivity)


@app.command()
def check(case: CaseName, set_: Overrides = None, quiet: Quiet = False) -> None:
    """Check a case, its steel and its mesh without running it."""
    from castfem.case.shipped_cases import find
    from castfem.cli.checking import check_case

    text = check_case(case, find(case), set_ or ())
    if not quiet:
        print(text)


@app.command()
def cases() -> None:
    """List the cases shipped with castfem."""
    from castfem.case import shipped_cases

    shipped = shipped_cases.shipped()
    width = max((len(name) for name in shipped), default=0)
    for name, path in shipped.items():
        print(f"{name:{width}}  {shipped_cases.title_of(path)}")


@app.command()
def init(name: Annotated[str, typer.Argument(help="Name of the new case file.")]) -> None:
    """Write a commented case to start from."""
    from castfem.cli.starter import starter

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


@app.command()
def show(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run.")],
    at: At = None,
    units: Units = None,
) -> None:
    """Print the table of a run and draw its figures; with --at the results at some places."""
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is no' if folder.exists() else 'no such'} folder")
    from castfem.cli import parallel
    from castfem.cli.options import chosen
    from castfem.output.run_record import RUN_NAME
    from castfem.report import error_pages
    from castfem.report.show import show as show_folder
    from castfem.sweep.record import SWEEP_NAME

    if (folder / SWEEP_NAME).is_file() and not (folder / RUN_NAME).is_file():
        raise InputError(f"{folder}: it is a sweep: castfem compare {folder}")
    from castfem.results.places import read_positions

    with chosen(units):
        show_folder(folder, parallel.console(), at=read_positions(at or ()))
    if at:
        return
    for line in error_pages.lines({"": folder}):
        print(line)


@app.command()
def watch(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of a run at work, or of a sweep.")
    ],
    html: Annotated[
        Path | None,
        typer.Option("--html", metavar="FILE", help="Write its report, too, anew until it ends."),
    ] = None,
    every: Annotated[
        str, typer.Option(metavar="TIME", help='Between two looks, such as "5 s".')
    ] = "",
    wait: Annotated[
        bool,
        typer.Option(
            "--wait", help="Wait for runs that have not begun, or are to be taken up again."
        ),
    ] = False,
    units: Units = None,
) -> None:
    """Show how far a run has come, until it ends; with --html as a page that refreshes itself."""
    from castfem.cli.options import chosen
    from castfem.cli.watching import watch_folder

    with chosen(units):
        watch_folder(folder, html, every, wait=wait)


@app.command()
def compare(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Folders of runs, or of a sweep.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder; by default `compare` beside the runs."),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(help="Run the others are measured by; by default idealised, or the first."),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="All quantities, not only those of the headline.")
    ] = False,
    figures: Annotated[bool, typer.Option(help="Draw the figures.")] = True,
    at: At = None,
    units: Units = None,
) -> None:
    """Print runs side by side and draw their histories over one another."""
    from castfem.cli.comparing import compare_runs
    from castfem.cli.options import chosen
    from castfem.results.places import read_positions

    places = read_positions(at or ())
    with chosen(units):
        compare_runs(folders, output, base, everything=everything, figures=figures, at=places)


@app.command()
def report(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Folders of runs, or of a sweep.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File; by default report.html in the run, or beside the runs."
        ),
    ] = None,
    at: At = None,
    units: Units = None,
) -> None:
    """Write a run, or several side by side, as one HTML file that opens offline and prints."""
    from castfem.cli.options import chosen
    from castfem.html_report.page import REPORT_NAME, write
    from castfem.results.places import read_positions

    beside = folders[0] if len(folders) == 1 else folders[0].resolve().parent
    with chosen(units):
        places = read_positions(at or ())
        print(f"report in {write(folders, output or beside / REPORT_NAME, places)}")


app.command()(pictures.mesh)
app.command()(pictures.mould)
app.command()(pictures.section)
app.command()(pictures.machine)


@app.command()
def strand(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File; by default strand.vtu in DIR.")
    ] = None,
    every: Annotated[
        str, typer.Option(help="Length of its cells along the strand, at most.")
    ] = "100 mm",
) -> None:
    """Write the slices of a run, stacked along its caster, for ParaView."""
    from castfem.cli.strand import write

    write(folder, output, every)


app.command()(pictures.material)


@app.command()
def identify(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA.csv",
            help="Tensile curves: temperature [..], strain rate [..], strain [..], stress [..].",
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File of the law; by default DATA.toml.")
    ] = None,
    degree: Annotated[
        int | None,
        typer.Option(help="Smooth over temperature, of this degree; left out: each by itself."),
    ] = None,
    softening: Annotated[
        str, typer.Option(help="p1: positive (0 or more), free, or none (0).")
    ] = "positive",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a law and a picture of these names.")
    ] = False,
) -> None:
    """Fit the modified Norton-Hoff law (163) to tensile curves."""
    from castfem.cli.identifying import identify_law

    identify_law(data, output, degree, softening, overwrite)


@app.command()
def schema(
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print the reference page of case files instead.")
    ] = False,
) -> None:
    """Print the JSON schema of case files, for editors."""
    from castfem.case.json_schema import schema_text
    from castfem.case.reference_page import markdown_page

    sys.stdout.write(markdown_page() if markdown else schema_text())


@app.command()
def completion(
    shell: Annotated[str, typer.Argument(metavar="SHELL", help="bash, zsh or fish.")],
) -> None:
    """Print what lets a shell complete commands, names of cases and keys of --set."""
    from castfem.cli.completion import script

    print(script(shell))
