"""Case files as documents: TOML, `extends`, overrides, and the file in which each key was written.

Tables merge deeply: a file adds to and changes what it extends. Arrays (also of tables) replace; a
table in place of an inherited array changes single entries of it by name
(`castfem.model.key_names`). Of two keys that exclude each other the later one wins: a file that
sets `superheat` drops an inherited `temperature`. A table whose kind changes (`shape`) is replaced
as a whole. Inherited keys of other tables that the new kind does not have, and the composition of
another steel, are left out (`castfem.model.inheritance`).
"""

from __future__ import annotations

import copy
import os
import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from castfem.base.csv_files import unreadable
from castfem.base.errors import InputError, shown
from castfem.model import inheritance, key_names
from castfem.model.base import PROPERTY_FILES, is_path
from castfem.model.case import Case
from castfem.model.key_names import no_entry, step_into
from castfem.model.problems import tables
from castfem.model.shipped_cases import find
from castfem.model.tensile import TensileCase

Keys = tuple[str | int, ...]

_EACH = "*"  # any entry of an array
_EXCLUSIVE: tuple[tuple[Keys, str, str], ...] = (
    (("casting",), "superheat", "temperature"),
    (("thermal", "time"), "step", "adaptive"),
    (("machine",), "rolls", "segment"),
    (("cooling", _EACH, "surface", _EACH), "coefficient", "flux"),
    (("cooling", _EACH, "surface", _EACH), "water", "flow"),
)
# Tables that another shape or law replaces as a whole; [mechanics] contains more than its law.
_KINDS = ("shape", "law")
_MANY_SIDED: tuple[Keys, ...] = (("mechanics",),)
# Groups of keys that exclude each other.
_UNDIVIDED: tuple[Keys, ...] = (("mould", "taper"), ("machine", "rolls"), ("caster", "plant"))
# Tables that one word may replace, and the key whose value the word is.
_ONE_WORD: dict[Keys, str] = {
    ("mould", "contact"): "method",
    ("mechanics", "bulging"): "model",
}
SET = "--set"
"""Origin of a key that was changed on the command line."""


@dataclass
class Document:
    """A case as written, before validation."""

    data: dict[str, Any]  #: the merged tables, without `extends`
    label: str  #: name of the requested file
    #: file (or "--set") in which a key, or the table that contains it, was written
    origins: dict[Keys, str] = field(default_factory=dict)
    #: origins of the keys, the latest last
    layers: list[str] = field(default_factory=list)
    #: complete messages about files and overrides that could not be used
    faults: list[str] = field(default_factory=list)
    #: dotted keys that were overridden, and their new values
    changes: list[tuple[str, Any]] = field(default_factory=list)
    #: complete messages about inherited keys that a later setting has removed
    left_out: list[str] = field(default_factory=list)

    def origin(self, path: Keys) -> str:
        """Return the file of a key, or of the table around it if the key is missing."""
        for end in range(len(path), 0, -1):
            if path[:end] in self.origins:
                return self.origins[path[:end]]
        return self.label

    def place(self, paths: Collection[Keys], table: bool = False) -> str:
        """Return the file to correct: the last one that wrote one of some keys, or below it.

        Below a `table`, of which any key may be meant, only files count, not "--set".
        """
        written = {self.origin(path) for path in paths}
        for key, one in self.origins.items():
            if any(key[: len(path)] == path for path in paths) and not (table and one == SET):
                written.add(one)
        return next((one for one in reversed(self.layers) if one in written), min(written))


def read(path: Path) -> Document:
    """Read a case file and all it extends; errors are collected in `faults`."""
    return _read(path, os.fspath(path), ())


def _read(path: Path, label: str, chain: tuple[Path, ...]) -> Document:
    document = Document({}, label)
    data = _load(path, document)
    if data is None:
        return document
    base = data.pop("extends", None)
    _anchor(data, path.parent)
    if base is not None:
        if not isinstance(base, str) or not base:
            document.faults.append(f"{label}: extends: must be the path or the name of a case")
        else:
            _extend(document, path, base, (*chain, path.resolve()))
    inherited = copy.deepcopy(document.data)
    _merge(document, document.data, data, (), label)
    end_layer(document, inherited, {label})
    return document


def _extend(document: Document, path: Path, base: str, chain: tuple[Path, ...]) -> None:
    """Read the file named by `extends` into the document, before the file's own keys."""
    try:
        below = find(base, path)
    except InputError as error:
        what = str(error).removeprefix(f"{base}: ")
        document.faults.append(f'{document.label}: extends ("{base}"): {what}')
        return
    if below.resolve() in chain:
        names = " -> ".join(p.name for p in (*chain, below))
        document.faults.append(
            f'{document.label}: extends ("{base}"): leads back to itself: {names}'
        )
        return
    inherited = _read(below, os.path.normpath(below), chain)
    document.faults += inherited.faults
    document.data, document.origins = inherited.data, inherited.origins
    document.layers = inherited.layers
    document.left_out = inherited.left_out


def _load(path: Path, document: Document) -> dict[str, Any] | None:
    """Return the tables of one file; record the reason if it cannot be read."""
    label = document.label
    try:
        text = path.read_text(encoding="utf-8-sig")
        return tomllib.loads(text)
    except OSError as error:
        document.faults.append(f"{label}: {unreadable(path, error)}")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        document.faults.append(f"{label}: line {line}: is not UTF-8 text; save it in that encoding")
    except tomllib.TOMLDecodeError as error:
        document.faults.append(f"{label}: {_syntax(str(error), text)}")
    return None


def _syntax(message: str, text: str) -> str:
    """Return a TOML syntax error as "line 3, column 7: error: the line"."""
    what, _, place = message.partition(" (at ")
    place = place.rstrip(")")
    if not place.startswith("line"):
        return f"line {text.count(chr(10)) + 1}: {what} (the file ends too early)"
    number = int(place.split()[1].rstrip(","))
    lines = text.splitlines()
    line = lines[number - 1].strip() if number <= len(lines) else ""
    if what.startswith("Cannot declare") and (table := _heading(line)):
        first = next((n for n, one in enumerate(lines, 1) if _heading(one) == table), number)
        listed = any(_heading(one) == table and one.strip()[:2] == "[[" for one in lines[:number])
        if line[:2] != "[[" and (listed or _is_listed(table)):
            return f"{place}: {line} is one of several tables; write [[{table}]]"
        before = f"in line {first}" if first < number else "by a key"
        return f"{place}: {line} is there already, {before}; put its keys under one heading"
    # The parser writes the names of a table as a Python tuple.
    what = re.sub(r"\('(.+?)',?\)", lambda names: names[1].replace("', '", "."), what)
    return f"{place}: {what}: {line}"


def _is_listed(table: str) -> bool:
    """Return whether a case may have several tables of this name, such as "cooling.surface"."""
    headings = {one.heading for kind in (Case, TensileCase) for one in tables(kind)}
    return f"[[{table}]]" in headings


def _heading(line: str) -> str:
    """Return the name of the table whose heading a line is ("mould.tube"), else ""."""
    found = re.match(r"\s*\[\[?([^\[\]]+)\]", line)
    return re.sub(r"\s", "", found[1]) if found else ""


def _anchor(data: dict[str, Any], folder: Path) -> None:
    """Make the paths in a file independent of the folder in which castfem is started.

    These are the names of property files (`PROPERTY_FILES`), the rolls of a machine, the database
    of a steel and every `file` of a table.
    """
    for table, key in PROPERTY_FILES:
        inner = data.get(table)
        if isinstance(inner, dict) and isinstance(inner.get(key), str):
            inner[key] = anchored_set(inner[key], folder)
    for table, key in (("machine", "rolls"), ("steel", "database")):
        inner = data.get(table)
        if isinstance(inner, dict) and isinstance(inner.get(key), str):
            inner[key] = os.path.abspath(folder / inner[key])
    _anchor_files(data, folder)


def anchored_set(name: str, folder: Path) -> str:
    """Return the absolute path of a property file; the name of a shipped set is unchanged."""
    return os.path.abspath(folder / name) if is_path(name) else name


def _anchor_files(value: Any, folder: Path) -> None:
    if isinstance(value, dict):
        if isinstance(value.get("file"), str):
            value["file"] = os.path.abspath(folder / value["file"])
        for inner in value.values():
            _anchor_files(inner, folder)
    elif isinstance(value, list):
        for inner in value:
            _anchor_files(inner, folder)


def _merge(
    document: Document, under: dict[str, Any], over: dict[str, Any], path: Keys, label: str
) -> None:
    """Merge the table `over` from the file `label` into `under` at `path`."""
    _exclude(under, over, path)
    changed = any(kind in over and over[kind] != under.get(kind) for kind in _KINDS)
    if changed and path not in _MANY_SIDED:
        under.clear()
        _forget(document, path)
        document.origins[path] = label
    for key, value in over.items():
        here = (*path, key)
        if isinstance(value, dict):
            _write_out(document, under, here)
        if isinstance(value, dict) and key_names.are_named(under.get(key)):
            problem = key_names.change(
                under[key], value, here, lambda *it: _merge(document, it[0], it[1], it[2], label)
            )
            document.faults += [f"{label}: {text}" for text in problem]
            continue
        tables = isinstance(value, dict) and isinstance(under.get(key), dict)
        if tables and here not in _UNDIVIDED:
            _merge(document, under[key], value, here, label)
        else:
            _forget(document, here)
            document.origins[here] = label
            under[key] = value


def _write_out(document: Document, under: dict[str, Any], path: Keys) -> None:
    """Replace a word by the table it stands for, so that keys can be added."""
    word = under.get(str(path[-1]))
    if path in _ONE_WORD and isinstance(word, str):
        under[str(path[-1])] = {_ONE_WORD[path]: word}
        document.origins[(*path, _ONE_WORD[path])] = document.origin(path)


def _exclude(under: dict[str, Any], keys: Collection[str], path: Keys) -> None:
    """Drop from the table `under` at `path` the keys that new keys exclude."""
    for where, one, other in _EXCLUSIVE:
        if _any_entry(path) == where and (one in keys) != (other in keys):
            under.pop(other if one in keys else one, None)


def _any_entry(path: Keys) -> Keys:
    """Return a path with its array indices replaced by "any entry"."""
    return tuple(_EACH if isinstance(step, int) else step for step in path)


def _forget(document: Document, path: Keys) -> None:
    """Drop the recorded origins at and below a path."""
    for known in [k for k in document.origins if k[: len(path)] == path]:
        del document.origins[known]


def end_layer(document: Document, before: Mapping[str, Any], labels: Collection[str]) -> None:
    """Complete a layer (a file, `--set`, a script) once all its keys have been merged.

    Args:
        document: Includes the keys of the layer.
        before: The tables before the layer.
        labels: Origins of the layer's keys.
    """
    document.layers += [one for one in labels if one not in document.layers]

    def inherited(path: Keys) -> bool:
        return document.origin(path) not in labels

    settled = inheritance.settle(before, document.data, inherited)
    if settled:
        places = (("steel", "name"), ("steel", "composition"))
        where = next((document.origin(p) for p in places if not inherited(p)), document.label)
        document.left_out.append(f"{where}: steel.name: {settled}")
    dropped = inheritance.leave_out(before, document.data, inherited)
    if dropped:
        where = document.origin(("section", "shape"))
        listed = [f"{key} ({document.origin(tuple(key.split('.')))})" for key in dropped]
        shape = document.data["section"]["shape"]
        document.left_out.append(
            f'{where}: section.shape: "{shape}" does not have these inherited keys, which '
            f"are left out: {', '.join(listed)}"
        )
    inheritance.mark(before, document.data)


def override(
    document: Document, assignments: Iterable[str], meant: Callable[[str], str] = str
) -> None:
    """Apply `a.b.0.c=value` assignments; values are TOML, or else taken as text.

    Args:
        document: The document to change; faulty assignments are recorded in its `faults`.
        assignments: Assignments as written by the user.
        meant: Returns the dotted key for a name without dots; raises ValueError if there is none.
    """
    before = copy.deepcopy(document.data)
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals or not key.strip():
            document.faults.append(
                f'--set: "{assignment}": write it as key=value, such as casting.speed="3 m/min"'
            )
            continue
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            value = text.strip()
        try:
            full = meant(key.strip())
        except ValueError as error:
            document.faults.append(f"--set: {key.strip()}: {error}")
            continue
        put(document, full, value, SET)
    end_layer(document, before, {SET})
    entitle(document)


_NAMED = 3  # largest number of changes in a title
_WIDE, _LONG = 110, 48  # characters of a title with changes, and of one change
_LESS_NEWS = ("mesh", "thermal", "coupling")  # changes of accuracy only
# Keys, with all below them, that change no result.
_NO_NEWS = ("title", "output", "reference", "verification", "optimise", "caster")


def entitle(document: Document) -> None:
    """Add the changes to the title, which heads tables and pictures, unless it was changed itself.

    The first change is named, others as far as there is room; the rest are counted.
    """
    title, changes = document.data.get("title"), dict(document.changes)
    keys = sorted(changes, key=lambda key: key.partition(".")[0] in _LESS_NEWS)
    listed = {key: changes[key] for key in keys if key.partition(".")[0] not in _NO_NEWS}
    if not isinstance(title, str) or "title" in changes or not listed:
        return
    parts = [p for p in title.split("; ") if p.partition(" = ")[0] not in listed]
    named = [f"{key} = {shown(value).strip(chr(34))}" for key, value in listed.items()]
    named = [one if len(one) <= _LONG else f"{one[: _LONG - 4]} ..." for one in named]
    count = 1
    while count < min(len(named), _NAMED) and len("; ".join([*parts, *named[: count + 1]])) < _WIDE:
        count += 1
    more = [f"and {len(named) - count} more"] if len(named) > count else []
    document.data["title"] = "; ".join([*parts, *named[:count], *more])


def put(document: Document, key: str, value: Any, label: str) -> None:
    """Set one dotted key in the document; record in `faults` if there is no such key."""
    parts = [part.strip() for part in key.split(".")]
    place: Any = document.data
    path: Keys = ()
    for part in parts[:-1]:
        step = step_into(place, part)
        if step is None:
            document.faults.append(f"{label}: {key}: {no_entry(place, path, part)}")
            return
        if isinstance(place, dict):
            _exclude(place, (str(step),), path)
        path = (*path, step)
        if isinstance(place, dict):
            _write_out(document, place, path)
            if step not in place:
                place[step] = {}
                document.origins[path] = label
        place = place[step]
    document.changes.append((key, value))
    last = step_into(place, parts[-1])
    if last is None:
        document.faults.append(f"{label}: {key}: {no_entry(place, path, parts[-1])}")
        return
    if isinstance(place, dict):
        if (*path, last) in PROPERTY_FILES and isinstance(value, str):
            value = anchored_set(value, Path.cwd())
        _merge(document, place, {str(last): copy.deepcopy(value)}, path, label)
    else:
        place[last] = value
        document.origins[(*path, last)] = label
