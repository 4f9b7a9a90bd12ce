"""Errors with their exit status, and formatting of keys and values in messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any


class CastfemError(Exception):
    """Base of all errors that castfem raises on purpose, with their exit status."""

    exit_status = 2


class InputError(CastfemError):
    """The input of the user is invalid.

    Attributes:
        problems: One line for each problem, with the file, the key and the fix.
    """

    exit_status = 1

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class CaseError(InputError):
    """A case cannot be built; its problems begin with the key and name no file."""

    def of(self, path: object) -> InputError:
        """Return the same error with the file of the case."""
        return InputError(f"{path}: {problem}" for problem in self.problems)


class FolderInUse(InputError):
    """Another run is active in the folder."""


class RunFailure(CastfemError):
    """A run could not continue; the last good state is on disk."""

    exit_status = 2


class CannotWrite(RunFailure):
    """A file cannot be written (full disk, no permission); the run itself is valid."""


Path = tuple[str | int, ...]


def dotted(path: Path) -> str:
    """Return the path as users write it: cooling.0.surface.1.law."""
    return ".".join(str(part) for part in path)


def shown(value: object) -> str:
    """Return a value as in a TOML file, shortened."""
    text = written(value)
    return text if len(text) <= 60 else text[:56] + " ..."


def written(value: object) -> str:
    """Return a value as in a TOML file."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{k} = {written(v)}" for k, v in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(written(v) for v in value) + "]"
    return str(value)


def said_in_a_line(error: BaseException) -> str:
    """Return the message of an error in one line, with its type if it was not meant for users."""
    lines = str(error).splitlines() or [""]
    said = lines[0] if isinstance(error, CastfemError) else f"{type(error).__name__}: {lines[0]}"
    return said.removesuffix(": ")


def choices(names: Iterable[object]) -> str:
    """Return names as a list in a sentence."""
    return ", ".join(str(name) for name in names)


def grouped(count: float) -> str:
    """Return a count with separated thousands, 10 000 000; very large ones as a power of ten."""
    return f"{count:,.0f}".replace(",", " ") if count < 1e13 else f"{count:.0e}"


def differences(
    there: Mapping[str, Any], here: Mapping[str, Any], leave_out: Iterable[str] = ()
) -> str:
    """Return the keys in which two case documents differ, with both values; "" if there are none.

    Args:
        there: One document, nested tables and arrays of plain values.
        here: The other document.
        leave_out: Dotted keys to ignore, with all below them.
    """
    found = list(_differences(there, here, "", tuple(leave_out)))
    more = [f"and {len(found) - 5} more"] if len(found) > 5 else []
    return "; ".join([*found[:5], *more])


def _differences(there: Any, here: Any, key: str, leave_out: tuple[str, ...]) -> Iterator[str]:
    if key in leave_out:
        return
    if there == here:
        return
    one, other = _parts(there), _parts(here)
    if one is not None and other is not None:
        for name in dict.fromkeys([*one, *other]):
            below = f"{key}.{name}" if key else str(name)
            yield from _differences(one.get(name), other.get(name), below, leave_out)
    else:
        yield f"{key}: {_brief(there)} there, {_brief(here)} here"


def _parts(value: Any) -> Mapping[Any, Any] | None:
    """Entries of a table or array by key; None for a plain value."""
    if isinstance(value, Mapping):
        return value
    if isinstance(value, list | tuple):
        return dict(enumerate(value))
    return {} if value is None else None


def _brief(value: Any) -> str:
    if value is None:
        return "nothing"
    text = str(value)
    return text if len(text) <= 40 else text[:36] + " ..."
