"""Registry of the checks of a case; the check functions are in the modules of their tables.

A check takes the case and one of its tables and yields faults as pairs: the key within that table
("" for the table itself, "/a.b" for a key of the case, "a+b" for keys that exclude each other) and
a text. Values of a faulty case that could not be read are `Unreadable`: a check that uses one ends
there, and the others continue.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from castfem.base.errors import Path
from castfem.model.base import Faults, FaultyError, Unreadable
from castfem.model.problems import Problem

Check = Callable[[Any, Any], Faults]
CheckOfTable = TypeVar("CheckOfTable", bound=Check)

_EACH = "*"
_TRIPPED = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError)


class Checks:
    """Checks of one kind in the order of their definition; used as a decorator to register one.

    Args:
        of_faults: Whether a finding is an error, after which other checks may fail.
    """

    def __init__(self, of_faults: bool) -> None:
        self._of_faults = of_faults
        self._entered: list[tuple[tuple[str, ...], Check]] = []

    def __call__(self, table: str = "") -> Callable[[CheckOfTable], CheckOfTable]:
        """Register a check.

        Args:
            table: Dotted key of the tables to check, "*" for each entry of an array; the check runs
                for those present in the case. "" for the whole case.
        """

        def enter(found: CheckOfTable) -> CheckOfTable:
            self._entered.append((tuple(table.split(".")) if table else (), found))
            return found

        return enter

    def run(self, case: Any, sound: bool = True) -> Iterator[Problem]:
        """Yield the faults that the checks find.

        Args:
            case: The case.
            sound: Whether all values could be read. If not, or if a fault was found, a check may
                fail because of it, and its exception is dropped.
        """
        tripped: list[Exception] = []
        for path, found in self._entered:
            for place, table in _tables(case, path):
                try:
                    for key, text in found(case, table):
                        sound = sound and not self._of_faults
                        yield _problem(_path(place, key), text)
                except FaultyError:
                    pass
                except _TRIPPED as error:
                    tripped.append(error)
        if sound and tripped:
            raise tripped[0]


check = Checks(of_faults=True)
"""Errors, with which the case of a strand cannot be run."""
check_test = Checks(of_faults=True)
"""Errors of a tensile test."""
caution = Checks(of_faults=False)
"""Warnings about values of a sound case that are probably mistakes."""
own_caution = Checks(of_faults=False)
"""Warnings about keys that the case itself sets: the case it extends may need them."""


def _tables(table: Any, path: tuple[str, ...], place: Path = ()) -> Iterator[tuple[Path, Any]]:
    if table is None or isinstance(table, Unreadable):
        return
    if not path:
        yield place, table
    elif path[0] == _EACH:
        for index, entry in enumerate(table):
            yield from _tables(entry, path[1:], (*place, index))
    else:
        yield from _tables(getattr(table, path[0]), path[1:], (*place, path[0]))


def _path(place: Path, key: str) -> Path:
    if key.startswith("/"):
        place, key = (), key[1:]
    return (*place, *(int(part) if part.isdigit() else part for part in key.split(".") if part))


def _problem(path: Path, text: str) -> Problem:
    keys = str(path[-1]).split("+") if path else []
    if len(keys) < 2:
        return Problem(path, text)
    return Problem(path[:-1], text, together=tuple((*path[:-1], key) for key in keys))


def given(table: Any, *keys: str) -> list[str]:
    """Return which of some keys a table has."""
    return [key for key in keys if getattr(table, key) is not None]


def one_of(table: Any, samples: dict[str, str]) -> Faults:
    """Report that none of some keys is given, or more than one."""
    names, found = list(samples), given(table, *samples)
    if not found:
        written = ", ".join(f"{key} = {sample}" for key, sample in samples.items())
        yield "", f"{', '.join(names[:-1])} or {names[-1]} is missing; one of {written}"
    elif len(found) > 1:
        yield "+".join(found), f"{' and '.join(found)} exclude each other; give one of them"


def twice(names: list[str], key: str, same: Callable[[str], str] = str) -> Faults:
    """Report array entries with the name of an earlier one, or with an equal value of `same`."""
    earlier: set[str] = set()
    for index, name in enumerate(names):
        if isinstance(name, Unreadable):
            continue
        if same(name) in earlier:
            yield f"{index}.{key}", f'("{name}") is used twice'
        earlier.add(same(name))
