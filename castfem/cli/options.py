"""Options shared by several commands."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from castfem.base.errors import CaseError, InputError
from castfem.cli.command import Argument, Assignment, CaseName

if TYPE_CHECKING:
    from castfem.model import Case

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
"""Adds an argument or option to the function of a command."""
_LONGEST = 255  # bytes of a file name, in every common file system
DEFAULT = "default"
"""Accuracy with the case's own sizes."""


@dataclass(frozen=True, slots=True)
class Request:
    """Common arguments of commands that run cases."""

    name: str  #: case file, folder of a run, or name of a shipped case
    folder: Path | None  #: output folder; None for the default
    overrides: tuple[str, ...] = ()  #: assignments of --set
    processes: int | None = None  #: number of simultaneous runs; None for one per core
    ranks: int = 1  #: ranks of each run, under mpirun
    resume: bool = False  #: continue from checkpoints
    overwrite: bool = False  #: repeat runs, also over runs of other cases
    figures: bool = True  #: draw the figures
    quiet: bool = False  #: print only errors
    accuracy: str = DEFAULT  #: accuracy of cells, steps and windows; "default" for that of the case
    at: tuple[float, ...] = ()  #: positions, m, at which results are wanted
    units: tuple[str, ...] = ()  #: values of --units

    def target(self, path: Path, ending: str) -> Path:
        """Return the output folder: by default that of a run of the case, with a suffix."""
        from castfem.model import shipped_cases

        alone = shipped_cases.default_folder(self.name, path)
        return self.folder or alone.with_name(f"{alone.name}{ending}")

    def sizes(self, path: Path) -> list[str]:
        """Return the assignments of the requested accuracy."""
        return sizes_of(path, self.overrides, self.accuracy)

    def case(self, path: Path) -> Case:
        """Return the case with the requested keys and accuracy."""
        from castfem.model import load_case

        return load_case(path, (*self.overrides, *self.sizes(path)))

    def check_reached(self, length: float) -> None:
        """Refuse positions beyond the followed length, m."""
        from castfem.base.constants import ROUNDING
        from castfem.base.shown_units import place_said

        beyond = [place_said(one) for one in self.at if not 0.0 <= one <= length * (1.0 + ROUNDING)]
        if beyond:
            raise InputError(
                f"--at {', '.join(beyond)}: the run goes from the meniscus to "
                f"{place_said(length)}; give a place within, or a longer casting.length"
            )


def sizes_of(path: Path, overrides: Sequence[str], accuracy: str) -> list[str]:
    """Return the assignments of an accuracy for a case: its sizes, and a title that says so."""
    if accuracy == DEFAULT:
        return []
    from castfem.model import load_case
    from castfem.studies.accuracy.sizes import assignments, titled

    case = load_case(path, overrides)
    return [*assignments(case, accuracy), f"title={json.dumps(titled(case, accuracy))}"]


Asked = TypeVar("Asked", bound=Request)
_ATTRIBUTES = {"case": "name", "output": "folder", "jobs": "processes"}


def asked(
    kind: type[Asked], at: Sequence[str] = (), units: tuple[str, ...] = (), **given: Any
) -> Asked:
    """Return the request from a command line; positions and units are checked before any run."""
    if given.get("resume") and given.get("overwrite"):
        raise InputError("--resume and --overwrite exclude each other")
    places: tuple[float, ...] = ()
    if at:
        from castfem.runs.results.labels import read_positions

        places = tuple(read_positions(at))
    found = {_ATTRIBUTES.get(name, name): value for name, value in given.items()}
    return kind(at=places, units=sound_units(units), **found)


class _Path(click.Path):
    """A path; one that no file or folder can have is refused at once."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """See `click.Path`."""
        if not str(value).strip():
            self.fail("the name is empty; give a file or folder", param, ctx)
        if any(len(part.encode(errors="replace")) > _LONGEST for part in Path(value).parts):
            self.fail(
                f"a part of the name is longer than {_LONGEST} bytes; give a shorter one",
                param,
                ctx,
            )
        return super().convert(value, param, ctx)


PATH = _Path(path_type=Path)

case_name: Decorator = click.argument(
    "case",
    metavar="CASE",
    type=CaseName(),
    help="Case file, or name of a shipped case.",
    cls=Argument,
)
folders: Decorator = click.argument(
    "folders",
    metavar="DIR...",
    nargs=-1,
    required=True,
    type=PATH,
    help="Folders of runs, or of a sweep.",
    cls=Argument,
)
overrides: Decorator = click.option(
    "overrides",
    "--set",
    metavar="KEY=VALUE",
    multiple=True,
    type=Assignment(),
    help="Change a key, e.g. casting.length='20 m'.",
)
accuracy: Decorator = click.option(
    "--accuracy",
    default="default",
    help="Accuracy of cells, steps and windows: coarse, default (that of the case) or fine.",
)
at: Decorator = click.option(
    "--at",
    metavar="POSITION",
    multiple=True,
    help='Results at this position, such as "800 mm"; repeatable.',
)
units: Decorator = click.option(
    "--units",
    metavar="UNITS",
    multiple=True,
    help="Units: plant, si, or NAME=UNIT (temperature=degF, shell=inch); repeatable; by default "
    "those of the case.",
)
jobs: Decorator = click.option(
    "-j", "jobs", type=int, help="Number of simultaneous runs; by default one per core."
)
ranks: Decorator = click.option(
    "--ranks", metavar="K", default=1, help="Under mpirun: run each case on K ranks."
)
quiet: Decorator = click.option("--quiet", "-q", is_flag=True, help="Print only errors.")


def folder(about: str) -> Decorator:
    """Return the argument `folder`, with its line of help."""
    return click.argument("folder", metavar="DIR", type=PATH, help=about, cls=Argument)


def output(about: str) -> Decorator:
    """Return the option --output, with its line of help."""
    return click.option("--output", "-o", type=PATH, help=about)


def file_for(output: Path | None, name: str) -> Path:
    """Return the path of a file: as given by -o, or its usual name in an existing folder."""
    if output is None:
        return Path(name)
    return output / name if output.is_dir() else output


@contextmanager
def chosen(units: Sequence[str]) -> Iterator[None]:
    """Show numbers in the units of --units, if any are given."""
    if not units:
        yield
        return
    from castfem.base.shown_units import shown_in
    from castfem.model.shown_units import read_choice

    with shown_in(read_choice(units)):
        yield


def sound_units(units: tuple[str, ...]) -> tuple[str, ...]:
    """Return the values of --units, checked before the runs begin."""
    with chosen(units):
        return units


def above_zero(option: str, text: str, unit: str) -> float:
    """Return the value of an option in SI."""
    from castfem.base.units import parse

    try:
        value = parse(text, unit)
    except ValueError as error:
        raise InputError(f"{option} {text}: {error}") from None
    if not value > 0.0:
        raise InputError(f"{option} {text}: must be above 0 {unit}")
    return value


@contextmanager
def read_from(path: Path) -> Iterator[None]:
    """Add the name of the file to errors raised while a case is built from it."""
    try:
        yield
    except CaseError as error:
        raise error.of(path) from error


def case_and_target(
    case: str,
    output: Path | None,
    overrides: Sequence[str],
    ending: str,
    accuracy: str = DEFAULT,
) -> tuple[Case, Path]:
    """Return a case and the path of its picture: by default its name with an ending."""
    from castfem.model import load_case
    from castfem.model.shipped_cases import find

    path = find(case)
    given = (*overrides, *sizes_of(path, overrides, accuracy))
    return load_case(path, given), file_for(output, f"{path.stem}_{ending}.png")
