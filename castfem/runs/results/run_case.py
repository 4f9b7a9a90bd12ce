"""Reads the case in the folder of a run: keys, units, and the page on its errors."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from castfem.base.errors import CastfemError, InputError
from castfem.base.shown_units import ShownUnits
from castfem.model import Case, load_case, read_case, shipped_cases
from castfem.model.shipped_cases import CASE_NAME

_BILLET = 'docs/billet.md, "Error of the shipped default"'
# Prefixes of shipped cases, and the page on their errors; the first match counts.
_PAGES = (
    ("billet125/thermal", "docs/benchmarks.md"),
    ("billet125/idealised", _BILLET),
    ("billet125/taper_", _BILLET),
)


def case_with(folder: Path, *words: str) -> Case | None:
    """Return the case of a run that contains one of some words; None if not, or damaged.

    Args:
        folder: Folder of the run.
        words: Keys; a case without any of them is not parsed.
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
    """Return the page of the documentation with the errors of a run's numbers.

    Mesh, windows and everything else must be as shipped; otherwise, and for cases whose errors have
    not been measured, it is "".
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
    """Return a line for each page on the errors of the runs in some folders."""
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
    """Return the units of the case in the folder of a run; those of the plant if it chooses none.

    Raises:
        InputError: The choice of units is not valid.
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
