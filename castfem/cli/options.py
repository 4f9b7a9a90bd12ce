"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from castfem.cli import completion
from castfem.errors import CaseError

CaseName = Annotated[
    str,
    typer.Argument(
        metavar="CASE",
        help="A case file, or the name of a shipped case.",
        click_type=completion.CaseName(),
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key, e.g. casting.length='20 m'.",
        click_type=completion.Assignment(),
    ),
]
Accuracy = Annotated[
    str, typer.Option(help="Cells, steps and windows: coarse, default (the case's) or fine.")
]
At = Annotated[
    list[str] | None,
    typer.Option("--at", metavar="POSITION", help='Results there, such as "800 mm"; repeatable.'),
]
Units = Annotated[
    list[str] | None,
    typer.Option(
        "--units",
        metavar="UNITS",
        help="In plant, si, or NAME=UNIT (temperature=degF, shell=inch); repeatable; by default "
        "as the case says.",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors.")]
Verbose = Annotated[
    int, typer.Option("--verbose", "-v", count=True, help="Say more; tracebacks of faults.")
]


@contextmanager
def chosen(units: Sequence[str] | None) -> Iterator[None]:
    """Show numbers in the units that were asked for with --units, if any were.

    Raises:
        InputError: They cannot be read.
    """
    if not units:
        yield
        return
    from castfem.case.shown_units import read_choice
    from castfem.values.shown_units import shown_in

    with shown_in(read_choice(units)):
        yield


def sound_units(units: list[str] | None) -> tuple[str, ...]:
    """Return what was given with --units, for a command that needs it only when its runs are done.

    Raises:
        InputError: It cannot be read.
    """
    with chosen(units):
        return tuple(units or ())


def above_zero(option: str, text: str, unit: str) -> float:
    """Return what an option gives, in SI.

    Args:
        option: As it is written, such as --every.
        text: Its quantity, with unit.
        unit: What it is measured in, such as s.

    Raises:
        InputError: It is no such quantity, or not above 0.
    """
    from castfem.errors import InputError
    from castfem.values.units import parse

    try:
        value = parse(text, unit)
    except ValueError as error:
        raise InputError(f"{option} {text}: {error}") from None
    if not value > 0.0:
        raise InputError(f"{option} {text}: must be above 0 {unit}")
    return value


@contextmanager
def read_from(path: Path) -> Iterator[None]:
    """Return a block in which what cannot be built of a case is said of its file.

    Raises:
        InputError: What cannot be built.
    """
    try:
        yield
    except CaseError as error:
        raise error.of(path) from error
