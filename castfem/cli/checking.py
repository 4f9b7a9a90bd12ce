"""Checking a case with its steel, all problems at once, and telling what it is."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.case import Case, read_case
from castfem.errors import InputError
from castfem.units import convert

if TYPE_CHECKING:
    from castfem.materials import Steel


def problems_of(
    path: Path, overrides: Iterable[str]
) -> tuple[Case | None, Steel | None, list[str]]:
    """Return a case, its steel and all the problems of both; None for what is not sound."""
    reading = read_case(path, overrides)
    problems = list(reading.problems)
    steel = None
    table = reading.case.steel if reading.case else None
    if table is not None and None not in (table.name, table.composition, table.overrides):
        from castfem.materials import load_steel

        try:
            steel = load_steel(
                table.name,
                Path.cwd(),
                composition=table.composition,
                overrides=table.overrides,
                origin=reading.steel,
            )
        except InputError as error:
            problems += error.problems
    return (None if problems else reading.case), steel, problems


def checked(path: Path, overrides: Iterable[str]) -> tuple[Case, Steel]:
    """Return a sound case and its steel.

    Raises:
        InputError: All problems of the case and of its steel.
    """
    case, steel, problems = problems_of(path, overrides)
    if problems or case is None or steel is None:
        raise InputError(problems)
    return case, steel


def describe(name: str, case: Case, steel: Steel, cells: int) -> str:
    """Return a few lines on a sound case: what is cast, how long, through which zones."""
    casting = case.casting
    solidus = convert(steel.solidus, "K", "degC")
    liquidus = convert(steel.liquidus, "K", "degC")
    lines = [
        f"{name}: sound",
        f"  {case.title}",
        f"  {casting.length:g} m at {casting.speed * 60.0:.4g} m/min, {casting.duration:.4g} s",
        f"  steel {steel.name}: solidus {solidus:.5g} degC, liquidus {liquidus:.5g} degC",
        f"  mesh of {cells} cells",
    ]
    for span in case.zones():
        laws = ", ".join(law.law for _, law in span.laws) or "insulated"
        lines.append(f"  {span.start:7.3f} - {span.end:7.3f} m  {span.name}: {laws}")
    return "\n".join(lines)
