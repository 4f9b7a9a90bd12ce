"""References whose case was changed after they were written: numbers of the unchanged case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from castfem.base import units

# Tables and keys that change no result, or only how well it is computed.
_NO_PHYSICS = (
    ("title",),
    ("output",),
    ("reference",),
    ("verification",),
    ("optimise",),
    ("mesh",),
    ("thermal",),
    ("coupling",),
    ("section", "symmetry"),
    ("mould", "contact"),
    ("mechanics", "solver"),
    ("tensile", "steps"),
)
_LENGTH = ("casting", "length")  # counts where a number holds "at the end"
_ROUNDING = 1e-12


def mark(before: Mapping[str, Any], after: dict[str, Any]) -> None:
    """Note in the references of a document which keys were changed since they were written.

    Args:
        before: The tables as they were, with their references.
        after: The changed tables; references that are new in them are left as they are.
    """
    known = before.get("reference")
    entries = after.get("reference")
    if not isinstance(known, list) or not isinstance(entries, list):
        return
    keys = [path for path in _changed(before, after, ()) if not _is_numerical(path)]
    for entry in entries:
        if not isinstance(entry, dict) or entry not in known:
            continue
        those = [".".join(path) for path in keys if path != _LENGTH or "at" not in entry]
        if those:
            entry["changed"] = list(dict.fromkeys([*entry.get("changed", ()), *those]))


def _is_numerical(path: tuple[str, ...]) -> bool:
    return any(path[: len(start)] == start for start in _NO_PHYSICS)


def _changed(one: Any, other: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Paths of the values that differ; entries of arrays by their name, or by their index."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for key in dict.fromkeys([*one, *other]):
            yield from _changed(one.get(key), other.get(key), (*path, str(key)))
    elif _is_array(one) and _is_array(other) and len(one) == len(other):
        for index, (left, right) in enumerate(zip(one, other, strict=True)):
            name = right.get("name", index) if isinstance(right, Mapping) else index
            yield from _changed(left, right, (*path, str(name)))
    elif not _same(one, other):
        yield path


def _is_array(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _same(one: Any, other: Any) -> bool:
    """Whether two values are one, in whatever units they are written."""
    if one == other or not (isinstance(one, str) and isinstance(other, str)):
        return bool(one == other)
    try:
        (left, unit), (right, its) = units.parse_any(one), units.parse_any(other)
    except ValueError:
        return False
    return unit == its and abs(left - right) <= _ROUNDING * abs(right)
