"""Checks of a choice of units against the quantities that there are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from castfem.case.result_names import AT_PROBES, COLUMNS, all_names, unit_of
from castfem.errors import InputError
from castfem.values import units
from castfem.values.shown_units import KINDS, SYSTEMS, ShownUnits, check, coherent


def faults(choice: ShownUnits) -> Iterator[tuple[str, str]]:
    """Yield the names that are no quantity, or have a unit that measures something else."""
    for name in choice.names:
        usual = AT_PROBES.get(name) or COLUMNS.get(name) or unit_of(name)
        if usual is None:
            known = (*KINDS, "system", *AT_PROBES, *COLUMNS, *all_names())
            near = units.nearest(name, known) or f"; what is measured is {', '.join(KINDS)}"
            yield name, f"is neither what is measured nor a quantity of a run{near}"
            continue
        if coherent(usual) == "1":
            yield name, "is a plain number or a percentage, which has no other unit"
            continue
        try:
            check(name, coherent(usual), choice.own[name])
        except ValueError as error:
            yield name, str(error).removeprefix(f"{name}: ")


def read_choice(given: Sequence[str]) -> ShownUnits:
    """Return what was asked for on the command line: "si", "plant", or NAME=UNIT.

    Raises:
        InputError: It cannot be read, or a unit measures something else.
    """
    table: dict[str, str] = {}
    for text in given:
        name, is_one, unit = text.partition("=")
        if not is_one and text not in SYSTEMS:
            raise InputError(f"--units {text}: plant, si, or NAME=UNIT such as temperature=degF")
        table |= {name.strip(): unit.strip()} if is_one else {"system": text}
    try:
        choice = ShownUnits.read(table)
    except ValueError as error:
        raise InputError(f"--units {error}") from None
    problems = [f"--units {name}: {text}" for name, text in faults(choice)]
    if problems:
        raise InputError(problems)
    return choice
