"""Steels by name: sets shipped with castfem, the user's files, and changes for one case."""

from __future__ import annotations

import copy
import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from castfem.base.csv_files import unreadable
from castfem.base.errors import InputError, choices, dotted, shown
from castfem.base.quantities import PERCENT
from castfem.base.units import nearest
from castfem.physics.materials import schema
from castfem.physics.materials.alloying import ELEMENTS, MAX_ALLOYING
from castfem.physics.materials.build import BY_DATABASE, Workshop
from castfem.physics.materials.iron_carbon import MAX_CARBON
from castfem.physics.materials.phase_table import PhaseTable, Request
from castfem.physics.materials.schema import Keys, MaterialFile, Problem
from castfem.physics.materials.steel import Steel

# Other elements that an analysis of a steel may contain.
TRACES = frozenset((
    *("H", "Be", "B", "N", "O", "Mg", "Ca", "Ti", "V", "Co", "Zn", "Ga", "Ge", "As", "Se", "Y"),
    *("Zr", "Nb", "Mo", "Ag", "Sn", "Sb", "Te", "La", "Ce", "Nd", "Hf", "Ta", "W", "Pb", "Bi"),
))  # fmt: skip
FOLDER = Path(__file__).parent / "data"


def available_steels() -> dict[str, str]:
    """Return the names of the sets shipped with castfem, with their descriptions."""
    found = {}
    for path in sorted(FOLDER.glob("*.toml")):
        found[path.stem] = str(tomllib.loads(path.read_text("utf-8")).get("description", ""))
    return found


def load_steel(
    name: str,
    base_dir: str | os.PathLike[str] | None = None,
    composition: Mapping[str, Any] | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    origin: str = "steel",
    where: Callable[[Keys], str] | None = None,
) -> Steel:
    """Load a steel.

    Args:
        name: A set shipped with castfem, or the path of a TOML file (ends in .toml or has a slash),
            relative to `base_dir`.
        base_dir: Folder of the case file; by default the working folder.
        composition: wt% by element symbol, for a set that is computed from it.
        overrides: Keys of the set to change, written as in its file. A value, a table or a formula
            replaces the whole property, other keys are merged into it. A `Request` as "database"
            takes phases and heat from a thermodynamic database.
        origin: Where name, composition and overrides were written ("billet.toml: steel"), for
            messages.
        where: The same for single keys, ("overrides", "density"); None: `origin` for all.

    Raises:
        InputError: The steel is faulty; all problems, one line each.
    """
    path = _locate(name, Path(base_dir or "."), origin)
    label = _label(path)
    changes = dict(overrides or {})
    request = changes.get("database")
    if isinstance(request, Request):
        changes = _by_database(changes)
    else:
        request = None
    data = _merged(_parse(path, label), changes)
    given, problems = schema.read(data)
    amounts, faults = _composition(given, composition, path.stem, request)
    problems += faults
    table = (
        None
        if request is None or problems
        else _table(request, Path(base_dir or "."), amounts, problems)
    )
    stated = {**given.composition, **(composition or {})}
    left_out = tuple(e for e in stated if e in TRACES and request is None)
    shop = Workshop(given, path.stem, amounts, table, left_out, problems)
    steel = shop.steel() if request is None or table is not None else None
    if steel is None:
        asked = composition or {}
        lines = [
            _line(p, label, where or (lambda _: origin), changes, asked) for p in shop.problems
        ]
        raise InputError(dict.fromkeys(lines))
    return steel


def _by_database(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes that take solid fraction and heat from a database, except those of the case."""
    own = changes.keys() & {"enthalpy", "latent_heat"}
    keys = ("solid_fraction",) if own else ("solid_fraction", "enthalpy", "specific_heat")
    wanted = {key: {"formula": BY_DATABASE, "source": ""} for key in keys}
    return wanted | {key: given for key, given in changes.items() if key != "database"}


def _table(
    request: Request, base: Path, composition: Mapping[str, float], problems: list[Problem]
) -> PhaseTable | None:
    """Return the phases from a database, or record why there are none."""
    from castfem.physics.materials.calphad import table_of

    file = os.path.join(base, request.file)
    try:
        if not composition:
            raise ValueError("is asked for a metal without a composition; leave it out")
        return table_of(replace(request, file=file), composition)
    except ValueError as error:
        problems.append(Problem(("database",), f'("{request.file}"): {error}'))
        return None


def given_steel(name: str) -> dict[str, Any]:
    """Return the tables of a shipped steel or a user's file, as written.

    Raises:
        InputError: It cannot be read.
    """
    path = _locate(name, Path("."), "steel")
    return _parse(path, _label(path))


def _locate(name: str, base: Path, origin: str) -> Path:
    """Return the file of a steel."""
    if name.endswith(".toml") or "/" in name or os.sep in name:
        path = base / name
        try:
            path.open().close()
        except OSError as error:
            raise InputError(f'{origin}.name ("{name}"): {unreadable(path, error)}') from None
        return path
    path = FOLDER / f"{name}.toml"
    if name and path.is_file():
        return path
    names = list(available_steels())
    own = (
        f'; a file of your own is written "./{name}.toml"'
        if (base / f"{name}.toml").is_file()
        else ""
    )
    raise InputError(
        f'{origin}.name ("{name}"): no such steel; one of {choices(names)}, '
        f'or the path of a TOML file; for a grade by its analysis "plain_carbon" with a composition'
        f"{own or nearest(name, names)}"
    )


def _label(path: Path) -> str:
    """Return the name of a file in messages: of a shipped set its name, of others the path."""
    if path.parent == FOLDER:
        return f"steel {path.stem}"
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _parse(path: Path, label: str) -> dict[str, Any]:
    """Read a TOML file; CSV files of its tables are relative to it."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{label}: {unreadable(path, error)}") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise InputError(
            f"{label}: line {line}: is not UTF-8 text; save it in that encoding"
        ) from None
    except tomllib.TOMLDecodeError as error:
        what, _, place = str(error).partition(" (at ")
        raise InputError(f"{label}: {place.rstrip(')')}: {what}") from None
    for entry in data.values():
        if isinstance(entry, dict) and isinstance(entry.get("file"), str):
            entry["file"] = os.path.join(path.parent, entry["file"])
    return data


def _merged(data: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Apply overrides; a property with a new value loses the source of the old one.

    Keys that the override makes meaningless are removed: the solidus and liquidus of the set for a
    solid fraction with its own, latent heat for an enthalpy and vice versa, and the specific heat
    for a table of enthalpies.
    """
    merged = copy.deepcopy(data)
    fraction = changes.get("solid_fraction")
    dropped = {"latent_heat": "enthalpy", "enthalpy": "latent_heat"}
    gone = [old for new, old in dropped.items() if new in changes]
    if isinstance(fraction, Mapping) and fraction.get("formula") != "linear":
        gone += ["solidus", "liquidus"]
    enthalpy = changes.get("enthalpy")
    if isinstance(enthalpy, Mapping) and enthalpy.keys() & {"temperature", "file"}:
        gone.append("specific_heat")
    for key in gone:
        merged.pop(key, None)
    for key, given in changes.items():
        change = copy.deepcopy(given) if isinstance(given, Mapping) else {"value": given}
        old = merged.get(key)
        if key not in schema.KINDS:
            merged[key] = given
        elif not isinstance(old, dict) or any(form in change for form in schema.FORMS):
            merged[key] = {"source": "set in the case", **change}
        else:
            parameters = {**old.get("parameters", {}), **change.get("parameters", {})}
            merged[key] = {**old, **change, **({"parameters": parameters} if parameters else {})}
    return merged


def _composition(
    given: MaterialFile, asked: Mapping[str, Any] | None, name: str, request: Request | None
) -> tuple[dict[str, float], list[Problem]]:
    """Return the composition in wt%, the case's before the file's, and its faults."""
    problems, amounts = [], {}
    if asked and not given.from_composition and request is None:
        sets = ", ".join(s for s in available_steels() if "plain_carbon" in s)
        text = f"{name} is not computed from a composition; leave it out, take {sets}, or write "
        text += "the composition into the file of your own steel: its laws then go by it"
        own = given.composition.items()
        sound = {e: value for e, w in own if (value := _percent(w)) is not None}
        return sound, [Problem(("composition",), text)]
    for element, written in {**given.composition, **(asked or {})}.items():
        most = MAX_CARBON if element == "C" else MAX_ALLOYING
        if request is not None:
            most = 50.0  # iron is the rest; the limits of the database are reported separately
        if element not in ELEMENTS and element not in TRACES:
            text = f"no data for this element; known: {choices(ELEMENTS)}"
            text += nearest(element, ELEMENTS)
        elif (value := _percent(written)) is None:
            text = f"({shown(written)}) must be weight percent: a plain number, or with a sign, "
            text += '"0.42 %"'
        elif not 0.0 <= value <= most:
            text = f"({value:g}) is out of range; 0 to {most:g} weight percent"
        else:
            if element in ELEMENTS or request is not None:
                amounts[element] = value
            continue
        problems.append(Problem(("composition", element), text))
    for element in given.from_composition:
        if element not in {**given.composition, **(asked or {})}:
            text = f"is needed by {name}, in weight percent, such as {element} = 0.2"
            problems.append(Problem(("composition", element), text))
    return amounts, problems


def _percent(written: Any) -> float | None:
    """Return weight percent as written in a file, None if it is none."""
    try:
        return PERCENT.read(written)
    except ValueError:
        return None


def _line(
    problem: Problem,
    label: str,
    where: Callable[[Keys], str],
    changes: Mapping[str, Any],
    asked: Mapping[str, Any],
) -> str:
    """Return "where: key: text": where the user wrote it, in the case or in the material file."""
    path: Keys = problem.path
    if path[0] == "database":
        return f"{where(path)}.{dotted(path)} {problem.text}"
    if path[0] in changes:
        return f"{where(('overrides', *path))}.overrides.{dotted(path)}: {problem.text}"
    if path[0] == "composition" and (asked or "is needed" in problem.text):
        return f"{where(path)}.{dotted(path)}: {problem.text}"
    return f"{label}: {dotted(path)}: {problem.text}"
