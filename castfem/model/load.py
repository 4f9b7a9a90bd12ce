"""Loading a case: file, `extends`, overrides, validation, and all problems in one go."""

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
from castfem.model import (  # noqa: F401 - each enters its checks here
    bending,
    bounds,
    build_mould,
    check_cooling,
    check_secondary,
    document,
    key_names,
    plausibility,
    problems,
    shared_heat,
    shown_units,
    tensile,
)
from castfem.model.base import LENIENT
from castfem.model.case import Case
from castfem.model.checks import check, check_test
from castfem.model.document import PROPERTY_FILES, is_path
from castfem.model.problems import Problem
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
    """What came of reading a case."""

    #: the case; with problems, what is sound of it: what is faulty is `UNREADABLE` in it. None if
    #: not even the files could be read
    case: AnyCase | None
    problems: tuple[str, ...]  #: one line each
    #: where the steel was chosen ("billet.toml: steel"), for its own messages; of a tensile test,
    #: where its material was
    steel: str = "steel"
    #: the same for the law of the mechanics ("billet.toml: mechanics.law")
    law: str = "mechanics.law"
    elasticity: str = "mechanics.elasticity"  #: the same for its elasticity
    #: what a sound case has that was probably not meant, and what a later setting took out of it,
    #: one line each
    warnings: tuple[str, ...] = ()
    line: Callable[[Problem], str] = str  #: puts where it was written before what was found later
    origin: Callable[[document.Keys], str] = str  #: file (or "--set") in which a key was written

    @property
    def sound(self) -> AnyCase | None:
        """The case, None if anything of it is faulty."""
        return None if self.problems else self.case


def load_case(path: str | Path, overrides: Iterable[str] = ()) -> Case:
    """Read and validate the case file of a strand.

    Args:
        path: The case file.
        overrides: Assignments `dotted.key=value`, or of a bare key that only one table of the case
            has; the value is TOML, or else taken as text.

    Raises:
        InputError: Something is wrong; it holds every problem found, one line each.
    """
    return _or_raise(read_case(path, overrides))


def load_any(path: str | Path, overrides: Iterable[str] = ()) -> AnyCase:
    """Read and validate a case file of either kind; as `load_case`."""
    reading = read_case(path, overrides)
    if reading.sound is None:
        raise InputError(reading.problems)
    return reading.sound


def read_case(path: str | Path, overrides: Iterable[str] = ()) -> Reading:
    """Read a case file and return what is sound of it with all its problems (see `load_case`)."""
    written = document.read(Path(path))
    if written.faults:
        return Reading(None, tuple(written.faults))
    kind = _kind(written)
    document.override(written, overrides, lambda key: key_names.full_key(kind, written.data, key))
    return _validate(written)


def from_document(data: Mapping[str, Any], label: str = "case") -> Case:
    """Validate the tables of a case that was made in memory, written as in a case file."""
    sound = _without_none(dict(data))
    return _or_raise(_validate(document.Document(copy.deepcopy(sound), label)))


def _without_none(given: Any) -> Any:
    """Return tables without the keys that are None, which stands for leaving out, at any depth."""
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
        label: Where the changes were written, for messages.
        labels: The same by key, of those that were written elsewhere.
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
    """Return what a case has under a key, as a case file has it; None where it has nothing."""
    data = case.document()
    return key_names.value_at(data, key_names.full_key(Case, data, key))


def _or_raise(reading: Reading) -> Case:
    if reading.problems or reading.case is None:
        raise InputError(reading.problems)
    if isinstance(reading.case, TensileCase):
        raise InputError(f"{reading.case.title}: is a tensile test; a strand is needed here")
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
    odd = plausibility.warnings(case) if isinstance(case, Case) and not lines else ()
    left_out = () if lines else tuple(written.left_out)
    own = written.label, document.SET
    told = (p for p in odd if p.inherited or written.origin(p.path) in own)
    warnings = (*left_out, *(_line(written, problem) for problem in told))
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
    """Take an unknown key out of the data, put None for a missing one."""
    *above, key = problem.path
    table = problems.at(data, tuple(above))
    if isinstance(table, dict) and problem.kind == "extra_forbidden":
        table.pop(key, None)
    elif isinstance(table, dict) and problem.kind == "missing":
        table[key] = None


def _line(written: document.Document, problem: problems.Problem) -> str:
    """Return "file: dotted.key: text"; zones, circuits and nozzles by their names, too."""
    where = problems.dotted(problem.path)
    for array, what in _NAMED:
        entry = problem.path[: len(array) + 1]
        if entry[:-1] == array and len(entry) > len(array):
            name = problems.at(written.data, (*entry, "name"))
            where += f' ({what} "{name}")' if isinstance(name, str) else ""
    parts = [written.place(problem.path), where, problem.text]
    return ": ".join(part for part in parts if part)


def portable(case: AnyCase, beside: str) -> tuple[str, dict[str, bytes]]:
    """Return a case file, and the contents of the property files that belong beside it.

    Returns:
        TOML as of `resolved_toml`, in which files of the user's are named relative to it:
        "properties/steel/mine.toml". Those names, and what is to be written under them.

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
    """The table of phases by the database of a case."""
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
_CHOICE = "; one of "  # how what takes one of some words is refused


def faults_of_key(case: Case, key: str, values: Sequence[Any], where: str) -> list[str]:
    """Return why a key cannot have some values, a line each; a fault of several values once."""
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
        return [f'{where}: {key}: is a text ("{given}"){_FIX}']
    if given is not None or not _has_value(case, key):
        return [line + _FIX if _CHOICE in line else line for line in found]
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
