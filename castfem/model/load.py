"""Loads a case: file, `extends`, overrides, validation; reports all problems at once."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from castfem.base import units
from castfem.base.errors import InputError
from castfem.model import document, key_names, problems, tensile
from castfem.model.base import LENIENT, PROPERTY_FILES, is_path
from castfem.model.case import Case
from castfem.model.checks import (  # noqa: F401 - each enters its checks here
    caster,
    casting,
    cooling,
    extraction,
    machine,
    mechanics,
    mould,
    mould_fit,
    optimise,
    planes,
    probe,
    ranges,
    secondary,
    section,
    shared_heat,
    unusual,
)
from castfem.model.checks.registry import check, check_test
from castfem.model.problems import Problem
from castfem.model.shipped_cases import find
from castfem.model.tensile import TensileCase
from castfem.physics.materials.phase_table import PhaseTable

_NAMED = (
    (("cooling",), "zone"),
    (("secondary", "circuit"), "circuit"),
    (("secondary", "nozzle"), "nozzle"),
)
AnyCase = Case | TensileCase
"""A strand, or a tensile test."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Result of reading a case."""

    #: the case; if there are problems, faulty values in it are `UNREADABLE`. None if the files
    #: could not be read
    case: AnyCase | None
    problems: tuple[str, ...]  #: one line each
    #: key that selects the steel ("billet.toml: steel"), for messages about it; the material of a
    #: tensile test
    steel: str = "steel"
    #: key of the law of the mechanics ("billet.toml: mechanics.law"), for messages about it
    law: str = "mechanics.law"
    elasticity: str = "mechanics.elasticity"  #: key of its elasticity, for messages about it
    #: probable mistakes in a sound case, and what a later setting removed from it, one line each
    warnings: tuple[str, ...] = ()
    line: Callable[[Problem], str] = str  #: prefixes a later problem with where its key was written
    origin: Callable[[document.Keys], str] = str  #: file (or "--set") in which a key was written

    @property
    def sound(self) -> AnyCase | None:
        """The case, None if it has any fault."""
        return None if self.problems else self.case


def load_case(path: str | Path, overrides: Iterable[str] = ()) -> Case:
    """Read and validate the case file of a strand.

    Args:
        path: The case file.
        overrides: Assignments `dotted.key=value`; a bare key will do if only one table of the case
            has it. The value is TOML, or else taken as text.

    Raises:
        InputError: The case is faulty; the error holds every problem, one line each.
    """
    return _or_raise(read_case(path, overrides))


def load_any(path: str | Path, overrides: Iterable[str] = ()) -> AnyCase:
    """Read and validate a case file of either kind, like `load_case`."""
    reading = read_case(path, overrides)
    if reading.sound is None:
        raise InputError(reading.problems)
    return reading.sound


def read_case(path: str | Path, overrides: Iterable[str] = ()) -> Reading:
    """Read a case file; return its sound part and all problems (see `load_case`)."""
    written = document.read(Path(path))
    if written.faults:
        return Reading(None, tuple(written.faults))
    kind = _kind(written)
    document.override(written, overrides, lambda key: key_names.full_key(kind, written.data, key))
    return _validate(written)


def from_document(data: Mapping[str, Any], label: str = "case") -> Case:
    """Validate the tables of a case made in memory, written as in a case file."""
    sound = _without_none(dict(data))
    return _or_raise(_validate(document.Document(copy.deepcopy(sound), label)))


def _without_none(given: Any) -> Any:
    """Return nested tables without keys that are None, which means left out."""
    if isinstance(given, dict):
        return {key: _without_none(value) for key, value in given.items() if value is not None}
    return [_without_none(value) for value in given] if isinstance(given, list) else given


def changed(
    case: Case,
    changes: Mapping[str, Any],
    label: str = "with_",
    labels: Mapping[str, str] | None = None,
) -> Case:
    """Return the case with some keys changed; see `Case.with_`.

    Args:
        case: The case.
        changes: Dotted or bare key (`castfem.model.key_names`) and new value.
        label: Name of the place where the changes were written, for messages.
        labels: Such names by key, for changes written elsewhere.
    """
    before = case.document()
    written = document.Document(copy.deepcopy(before), "case")
    places = {label}
    for key, value in changes.items():
        if not isinstance(key, str):
            written.faults.append(f"{label}: {key!r}: the name of a key is needed")
            continue
        where = (labels or {}).get(key, label)
        places.add(where)
        try:
            full = key_names.full_key(Case, written.data, key)
        except ValueError as error:
            written.faults.append(f"{where}: {key}: {error}")
            continue
        document.put(written, full, value, where)
    document.end_layer(written, before, places)
    document.entitle(written)
    return _or_raise(_validate(written))


def value_of(case: Case, key: str) -> Any:
    """Return the value of a case at a key, as a case file has it; None if there is none."""
    data = case.document()
    return key_names.value_at(data, key_names.full_key(Case, data, key))


def _or_raise(reading: Reading) -> Case:
    if reading.problems or reading.case is None:
        raise InputError(reading.problems)
    if isinstance(reading.case, TensileCase):
        kind = Problem((), "is a tensile test; the case of a strand is required")
        raise InputError(reading.line(kind))
    return reading.case


def _validate(written: document.Document) -> Reading:
    """Validate a document, check across keys, and collect the problems with their files."""
    kind = _kind(written)
    case, found = _build(kind, written.data)
    checks = check if isinstance(case, Case) else check_test
    found = [*found, *checks.run(case, sound=not found)]
    lines = [*written.faults, *(_line(written, problem) for problem in found)]
    table, name = ("steel", "name") if kind is Case else (tensile.TABLE, "material")
    steel = f"{written.origin((table, name))}: {table}"
    law, elasticity = (
        f"{written.origin(('mechanics', key))}: mechanics.{key}" for key in ("law", "elasticity")
    )
    odd = unusual.warnings(case) if isinstance(case, Case) and not lines else ()
    left_out = () if lines else tuple(written.left_out)
    own = written.label, document.SET
    reported = (p for p in odd if p.inherited or written.origin(p.path) in own)
    warnings = (*left_out, *(_line(written, problem) for problem in reported))
    line = partial(_line, written)
    return Reading(
        case, tuple(dict.fromkeys(lines)), steel, law, elasticity, warnings, line, written.origin
    )


def _kind(written: document.Document) -> type[AnyCase]:
    return TensileCase if tensile.TABLE in written.data else Case


def _build(kind: type[AnyCase], data: dict[str, Any]) -> tuple[AnyCase, list[problems.Problem]]:
    """Return the case, faulty values `UNREADABLE`, and the problems within single keys."""
    try:
        return kind.model_validate(data), []
    except ValidationError as error:
        found = problems.from_validation(error, data, kind)
        sound = copy.deepcopy(data)
        for problem in found:
            _repair(sound, problem)
        return kind.model_validate(sound, context=LENIENT), found


def _repair(data: dict[str, Any], problem: problems.Problem) -> None:
    """Remove an unknown key from the data, or put None for a missing one."""
    *above, key = problem.path
    table = problems.at(data, tuple(above))
    if isinstance(table, dict) and problem.kind == "extra_forbidden":
        table.pop(key, None)
    elif isinstance(table, dict) and problem.kind == "missing":
        table[key] = None


def _line(written: document.Document, problem: problems.Problem) -> str:
    """Return "file: dotted.key: text", with zones, circuits and nozzles by name."""
    where = problems.dotted(problem.path)
    for array, what in _NAMED:
        entry = problem.path[: len(array) + 1]
        if entry[:-1] == array and len(entry) > len(array):
            name = problems.at(written.data, (*entry, "name"))
            where += f' ({what} "{name}")' if isinstance(name, str) else ""
    table = problems.model_at(_kind(written), problem.path, written.data) is not None
    place = written.place(problem.together or (problem.path,), table and not problem.together)
    parts = [place, where, problem.text]
    return ": ".join(part for part in parts if part)


def portable(case: AnyCase, beside: str) -> tuple[str, dict[str, bytes]]:
    """Return a case file and the contents of the property files that it needs beside it.

    Returns:
        TOML like `resolved_toml`, in which the user's files are named relative to it
        ("properties/steel/mine.toml"), and the contents to write under these names.

    Raises:
        InputError: A file cannot be read.
    """
    import tomli_w

    tables, files = case.document(), {}
    for table, key in PROPERTY_FILES:
        name = tables.get(table, {}).get(key)
        if not isinstance(name, str) or not is_path(name):
            continue
        source = Path(name)
        kind = table if key == "name" else key
        try:
            content = source.read_bytes()
        except OSError as error:
            raise InputError(f"{table}.{key}: {name}: cannot be read ({error.strerror})") from error
        tables[table][key] = place = f"{beside}/{kind}/{source.name}"
        files[place] = content
    if isinstance(case, Case) and case.steel.database is not None:
        tables["steel"]["database"] = place = f"{beside}/steel/{PHASES_NAME}"
        files[place] = _phases(case).to_text().encode()
    return tomli_w.dumps(tables), files


PHASES_NAME = "phases.csv"


def _phases(case: Case) -> PhaseTable:
    """Compute the table of phases from the database of a case."""
    from castfem.physics.materials import load_steel

    given = case.steel
    table = load_steel(
        given.name, composition=given.composition or None, overrides=given.changes,
        origin=f"{case.title}: steel",
    ).diagram  # fmt: skip
    assert isinstance(table, PhaseTable)
    return table


_FIX = "; a number is varied: name a key that has one, such as casting.speed"
_ANY_TEXT = "no number"
_CHOICE = "; one of "  # part of every message that refuses a word


def faults_of_key(case: Case, key: str, values: Sequence[Any], where: str) -> list[str]:
    """Return why a key cannot take some values, one line each; equal faults once."""
    found: list[str] = []
    reported: set[str] = set()
    for value in values:
        for line in _refused(case, key, value, where):
            plain = line.replace(f'"{value}"', "").replace(f"({value})", "")
            if plain not in reported:
                reported.add(plain)
                found.append(line)
    given = _text_at(case, key)
    if given is not None and not found and not _refused(case, key, _ANY_TEXT, where):
        return [f'{where}: {key}: is a text ("{given}"){_FIX}']
    if given is not None or not _has_value(case, key):
        return [line + _FIX if _CHOICE in line else line for line in found]
    return found


def _refused(case: Case, key: str, value: Any, where: str) -> list[str]:
    """Errors of the case with this value."""
    try:
        changed(case, {key: value}, where)
    except InputError as error:
        lines = [line.removeprefix("case: ") for line in error.problems]
        return [line if line.startswith(where) else f"{where}: {line}" for line in lines]
    return []


def _text_at(case: Case, key: str) -> str | None:
    """Text value of the case at a key; None for a quantity and anything else."""
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


def load(name: str | Path) -> Case:
    """Return a checked case from a file, or one shipped with castfem.

    Args:
        name: Path of a case file, with or without .toml, or the name of a shipped case
            ("billet125/thermal").

    Raises:
        InputError: There is no such case, or it is faulty; all faults, one line each.
    """
    return load_case(find(str(name)))


def as_case(given: Case | str | Path, caller: str) -> Case:
    """Return a case unchanged, or load the one that is named.

    Raises:
        InputError: It is neither, there is no such case, or the case is faulty.
    """
    found = load(given) if isinstance(given, str | Path) else given
    if not isinstance(found, Case):
        raise InputError(
            f"{caller}: a case is needed, its path or the name of a shipped one, not {found!r}"
        )
    return found


Case.changed = staticmethod(changed)
