"""The case in the folder of a run: what is shown of it, in which units, and its errors' page."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from castfem.base.errors import CastfemError, InputError
from castfem.base.shown_units import ShownUnits
from castfem.model import Case, load_case, read_case, shipped_cases
from castfem.model.shipped_cases import CASE_NAME

_BILLET = 'docs/billet.md, "Error of the shipped default"'
# Beginnings of the names of shipped cases, and the page on their errors; the first one counts.
_PAGES = (
    ("billet125/thermal", "docs/benchmarks.md"),
    ("billet125/idealised", _BILLET),
    ("billet125/taper_", _BILLET),
)


def case_with(folder: Path, *words: str) -> Case | None:
    """Return the case of a run that has one of some words; None without, or if it is damaged.

    Args:
        folder: Of the run.
        words: Keys; cases without any of them are not read further.
    """
    path = folder / CASE_NAME
    try:
        text = path.read_text(encoding="utf-8")
        if not any(word in text for word in words):
            return None
        return load_case(path)
    except (OSError, CastfemError):
        return None


def error_page(folder: Path) -> str:
    """Return which page of the documentation tabulates the errors of a run's numbers.

    Mesh, windows and all else must be as shipped; otherwise, and for cases whose errors have not
    been measured, it is empty.
    """
    file = folder / CASE_NAME
    case = read_case(file).sound if file.is_file() else None
    if not isinstance(case, Case):
        return ""
    for name, path in shipped_cases.shipped().items():
        page = next((page for start, page in _PAGES if name.startswith(start)), "")
        if page and shipped_cases.title_of(path) == case.title:
            shipped = load_case(path)
            same = (
                case.casting.length == shipped.casting.length
                and case.physics_hash() == shipped.physics_hash()
            )
            return page if same else ""
    return ""


def error_lines(folders: Mapping[str, Path]) -> list[str]:
    """Return a line for each page that tabulates errors of runs in some folders."""
    runs: dict[str, list[str]] = {}
    for name, folder in folders.items():
        runs.setdefault(error_page(folder), []).append(name)
    return [
        "errors of these numbers"
        + ("" if len(names) == len(folders) else f", of {', '.join(names)}")
        + f": {path}"
        for path, names in runs.items()
        if path
    ]


def units_of_run(folder: Path) -> ShownUnits:
    """The choice of the case in the folder of a run; the units of the plant where it makes none.

    Raises:
        InputError: It is not a choice of units.
    """
    path = folder / CASE_NAME
    try:
        text = path.read_text(encoding="utf-8")
        if "units" not in text:
            return ShownUnits()
        output = tomllib.loads(text).get("output", {})
    except (OSError, tomllib.TOMLDecodeError):
        return ShownUnits()
    try:
        return ShownUnits.read(output.get("units", "plant"))
    except ValueError as error:
        raise InputError(f"{path}: output.units: {error}") from None
