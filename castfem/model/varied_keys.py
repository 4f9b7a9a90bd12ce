"""Keys whose number is varied within a range: by a search, by a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.errors import InputError
from castfem.model.load import changed, value_of

if TYPE_CHECKING:
    from castfem.model.case import Case

_MEND = "; a number is varied: name a key that has one, such as casting.speed"
_ANY_TEXT = "no number"
_CHOICE = "; one of "  # how what takes one of some words is refused


def faults_of_key(case: Case, key: str, values: Sequence[Any], where: str) -> list[str]:
    """Return why a key cannot have some values, a line each; what is wrong with all is told once.

    Args:
        case: The case.
        key: Dotted or bare.
        values: As a case file has them, such as the ends of a range.
        where: Where they were written, which each line begins with.
    """
    found: list[str] = []
    told: set[str] = set()
    for value in values:
        for line in _refused(case, key, value, where):
            plain = line.replace(f'"{value}"', "").replace(f"({value})", "")
            if plain not in told:
                told.add(plain)
                found.append(line)
    given = _text_at(case, key)
    if given is not None and not found and not _refused(case, key, _ANY_TEXT, where):
        return [f'{where}: {key}: is a text ("{given}"){_MEND}']
    if given is not None or not _has_value(case, key):
        return [line + _MEND if _CHOICE in line else line for line in found]
    return found


def _refused(case: Case, key: str, value: Any, where: str) -> list[str]:
    """What is wrong with the case that has a value."""
    try:
        changed(case, {key: value}, where)
    except InputError as error:
        lines = [line.removeprefix("case: ") for line in error.problems]
        return [line if line.startswith(where) else f"{where}: {line}" for line in lines]
    return []


def _text_at(case: Case, key: str) -> str | None:
    """The text that the case has under a key; None of a quantity and of anything else."""
    try:
        given = value_of(case, key)
    except ValueError:
        return None
    if not isinstance(given, str):
        return None
    try:
        units.parse_any(given)
    except ValueError:
        return given
    return None


def _has_value(case: Case, key: str) -> bool:
    try:
        return value_of(case, key) is not None
    except ValueError:
        return True
