"""Plans the runs of a sweep: the product of the values of its keys, or the rows of a table."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from castfem.base.csv_files import Heading, read_csv, with_unit
from castfem.base.errors import InputError
from castfem.model import Case
from castfem.model.key_names import full_key
from castfem.model.load import changed


@dataclass(frozen=True, slots=True)
class NameLengths:
    """Longest names, in characters."""

    folder: int = 100  #: longest name of a folder
    value: int = 24  #: longest text of a value in tables and legends


LENGTHS = NameLengths()
_NAME = "name"  # name of the column that names the runs
_OWN = ("sweep", "compare", "report")  # files beside the runs, with any ending
_LABEL = "sweep"  # origin of a value in messages
_QUOTED = (
    "(put a cell with commas in quotes, and double quotes within it; or separate the cells by "
    "semicolons, also in the header)"
)


@dataclass(frozen=True, slots=True)
class Variant:
    """One run of a sweep."""

    name: str  #: name of its folder, made of the varied values: unchanged when values are added
    given: Mapping[str, str]
    """Values of the varied keys as written by the user; empty for those left out."""
    case: Case
    label: str = ""
    """Name in tables and figures: its row's name, and other varied values; empty if its row has
    none."""


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table of runs: its name, if any, its values by key, and its place."""

    name: str
    values: Mapping[str, str]
    place: str = _LABEL


def plan(base: Case, assignments: Iterable[str], table: Path | None = None) -> tuple[Variant, ...]:
    """Return the runs of a sweep: each row of the table with each combination of the values.

    Args:
        base: The case to vary.
        assignments: `key=value,value,...`; a key with one value is set in all runs.
        table: CSV file; its header names the keys, `key [unit]`, and may have the column `name`.
    """
    problems: list[str] = []
    keys: dict[str, tuple[str, ...]] = {}
    document = base.document()
    for assignment in assignments:
        try:
            key, values = read_assignment(assignment)
            key = full_key(Case, document, key)
            if key in keys:
                raise ValueError(f"{key} is given twice; write all values in one --set")
            keys[key] = values
        except ValueError as error:
            problems.append(f'--set "{assignment}": {error}')
    rows = [Row("", {})]
    if table is not None:
        try:
            rows = read_table(table, document)
        except ValueError as error:
            problems.append(f"{table}: {error}")
        twice = keys.keys() & {key for row in rows for key in row.values}
        problems += [f"{table}: {key} is also given by --set" for key in sorted(twice)]
    if not problems and not keys and table is None:
        problems.append("nothing to sweep; give --set KEY=VALUE,VALUE or --table RUNS.csv")
    if problems:
        raise InputError(problems)
    return _variants(base, rows, keys)


def _variants(
    base: Case, rows: Sequence[Row], keys: Mapping[str, tuple[str, ...]]
) -> tuple[Variant, ...]:
    """Build and validate all cases."""
    several = [key for key, values in keys.items() if len(values) > 1]
    varied = [*_differing(rows), *several] or [*rows[0].values, *keys]
    found: dict[str, Variant] = {}
    problems: list[str] = []
    for row, values in itertools.product(rows, itertools.product(*keys.values())):
        settings = {**row.values, **dict(zip(keys, values, strict=True))}
        given = {key: settings.get(key, "") for key in varied}
        named = {key: given[key] for key in (several if row.name else varied)}
        name = "__".join(part for part in (_safe(row.name), run_name(named)) if part)
        if name in found:
            problems.append(f"two runs would be the same: {name}")
            continue
        try:
            values_of = {key: value_of(value) for key, value in settings.items()}
            case = changed(base, values_of, _LABEL, dict.fromkeys(row.values, row.place))
        except InputError as error:
            problems += error.problems
            continue
        label = ", ".join([row.name, *brief(named)]) if row.name else ""
        found[name] = Variant(name, given, case, label)
    problems += _steel_problems(found.values())
    if problems:
        raise InputError(dict.fromkeys(problems))
    return tuple(found.values())


def _steel_problems(variants: Iterable[Variant]) -> list[str]:
    """Return the faults of the steels, each of which is checked once."""
    from castfem.physics.materials import load_steel

    problems: list[str] = []
    different = {
        json.dumps(v.case.document()["steel"], sort_keys=True): v.case.steel for v in variants
    }
    for steel in different.values():
        try:
            load_steel(
                steel.name,
                composition=steel.composition or None,
                overrides=steel.changes,
                origin=f"{_LABEL}: steel",
            )
        except InputError as error:
            problems += error.problems
    return problems


def _differing(rows: Sequence[Row]) -> list[str]:
    """Return the keys whose values differ between rows of the table."""
    names = dict.fromkeys(key for row in rows for key in row.values)
    return [key for key in names if len({row.values.get(key, "") for row in rows}) > 1]


def read_assignment(assignment: str) -> tuple[str, tuple[str, ...]]:
    """Return key and values of `key=value,value`.

    Commas within quotes or brackets do not separate: `fields=["temperature"],[]` has two values.

    Raises:
        ValueError: It has another form, or a value is missing or occurs twice.
    """
    key, equals, text = assignment.partition("=")
    if not equals or not key.strip():
        raise ValueError('write it as key=value,value, such as casting.speed="3 m/min","4 m/min"')
    values = split_values(text)
    if not all(values):
        raise ValueError("a value is missing")
    if len(set(values)) < len(values):
        raise ValueError("a value is given twice")
    return key.strip(), values


def split_values(text: str) -> tuple[str, ...]:
    """Return the parts between commas outside of quotes and brackets."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        else:
            depth += (letter in "[{(") - (letter in "]})")
            if letter == "," and depth == 0:
                parts.append("")
                continue
        parts[-1] += letter
    return tuple(part.strip() for part in parts)


def value_of(text: str) -> Any:
    """Return a value as in a case file: TOML, or else a text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()


def read_table(path: Path, document: Mapping[str, Any]) -> list[Row]:
    """Return the rows of a CSV file with a header of keys, `casting.speed [m/min],name`.

    A number takes the unit of its column; an empty cell keeps the value of the case.

    Raises:
        ValueError: It cannot be read, or its header or a row is invalid.
    """
    file = read_csv(path)
    if not file.rows:
        raise ValueError("needs a header, such as 'casting.speed [m/min]', and a row for each run")
    columns = [(_key(heading, document), heading.unit) for heading in file.headings]
    keys = [key for key, _ in columns]
    if twice := next((key for key in keys if keys.count(key) > 1), ""):
        raise ValueError(f"line {file.line}: two columns are of {twice}; leave one out")
    rows: list[Row] = []
    for number, row in enumerate(file.rows, start=1):
        cells = row.cells
        if len(cells) != len(columns):
            problem = f"run {number} has {len(cells)} cells, the header {len(columns)}"
            raise ValueError(f"{problem} {_QUOTED}" if file.separator == "," else problem)
        values = {
            key: with_unit(cell, unit)
            for (key, unit), cell in zip(columns, cells, strict=True)
            if cell
        }
        name = values.pop(_NAME, "")
        if name:
            _check_name(name, row.line, rows)
        place = f"{path}: run {number} ({name})" if name else f"{path}: run {number}"
        rows.append(Row(name, values, place))
    return rows


def _check_name(name: str, line: int, rows: Iterable[Row]) -> None:
    """Refuse a row name that is not a valid folder name, or that another row has."""
    if any(other.name == name for other in rows):
        raise ValueError(f"line {line}: two rows are named {shortened(name)}")
    if not _safe(name):
        raise ValueError(
            f'line {line}: the name "{shortened(name)}" cannot name a folder; give it letters '
            "(A to Z) or digits"
        )
    if name.partition(".")[0] in _OWN:
        raise ValueError(
            f'line {line}: the name "{shortened(name)}" is reserved for files of the sweep; choose '
            f"another than {', '.join(_OWN)}"
        )
    if len(name) > LENGTHS.folder:
        raise ValueError(
            f'line {line}: the name "{shortened(name)}" has {len(name)} characters; it names a '
            f"folder, give at most {LENGTHS.folder}"
        )


def _key(heading: Heading, document: Mapping[str, Any]) -> str:
    """Return the full key of a column."""
    key = heading.name
    if not key:
        raise ValueError("a column has no name")
    try:
        return key if key == _NAME else full_key(Case, document, key)
    except ValueError as error:
        raise ValueError(f"column {key}: {error}") from None


def brief(given: Mapping[str, str]) -> list[str]:
    """Return values with the last part of their keys, shortened: `taper 1 %/m`."""
    return [f"{key.rpartition('.')[2]} {shortened(value)}" for key, value in given.items() if value]


def shortened(value: str) -> str:
    """Return a value without quotes, shortened if too long for a table."""
    text = value.strip("\"'")
    return text if len(text) <= LENGTHS.value else f"{text[: LENGTHS.value - 4]} ..."


def run_name(given: Mapping[str, str]) -> str:
    """Return a name for a folder: `taper_1_percent_m__speed_3.6_m_min`."""
    leaves = [key.rpartition(".")[2] for key in given]
    parts = [
        f"{leaf if leaves.count(leaf) == 1 else _safe(key)}_{_safe(value) or 'default'}"
        for leaf, (key, value) in zip(leaves, given.items(), strict=True)
    ]
    name = "__".join(parts)
    if len(name) <= LENGTHS.folder:
        return name
    return f"{name[: LENGTHS.folder - 9]}_{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def _safe(text: str) -> str:
    """Return a text reduced to characters valid in every file system and shell."""
    return re.sub(r"[^\w.+-]+", "_", text.replace("%", " percent "), flags=re.ASCII).strip("_.")
