"""Finds case files: by path, or by the name of a case shipped with castfem."""

from __future__ import annotations

import importlib.resources
import tomllib
from pathlib import Path

from castfem.base.errors import InputError
from castfem.base.units import nearest

CASE_NAME = "case.toml"
"""The resolved case in the folder of a run."""


def shipped() -> dict[str, Path]:
    """Return the shipped cases by name ("billet125/idealised"), without the files they extend."""
    root = Path(str(importlib.resources.files("castfem.cases")))
    found = {}
    for path in sorted(root.glob("*/*.toml")):
        if not path.stem.startswith("base"):
            found[path.relative_to(root).with_suffix("").as_posix()] = path
    return found


def find(name: str, beside: Path | None = None) -> Path:
    """Return the file of a case given as a path (with or without .toml) or a shipped name.

    The folder of a run stands for the case in it.

    Args:
        name: Path or name.
        beside: Case file that the path is relative to; None for the current folder.

    Raises:
        InputError: There is no such case; it names the nearest one.
    """
    path = Path(name) if beside is None else beside.parent / name
    for candidate in (path, path.with_name(path.name + ".toml") if path.name else path):
        if candidate.is_file():
            return candidate
    cases = shipped()
    if name in cases:
        return cases[name]
    if (path / CASE_NAME).is_file():
        return path / CASE_NAME
    if path.is_dir():
        raise InputError(f"{name}: is not the folder of a run: it has no {CASE_NAME}")
    if path.is_fifo() or path.parts[:3] == ("/", "dev", "fd"):  # such as <(...) in a shell
        raise InputError(f"{name}: is a pipe, not a file; write the case to a file first")
    others = (p for p in path.parent.glob("*.toml") if p != beside)
    near = nearest(name, [*(Path(name).with_name(p.name).as_posix() for p in others), *cases])
    raise InputError(
        f"{name}: no such case file, and no shipped case of that name (castfem cases lists them)"
        f"{near}"
    )


def title_of(path: Path) -> str:
    """Return the title of a case file, empty if it has none of its own."""
    with path.open("rb") as file:
        return str(tomllib.load(file).get("title", ""))


def default_folder(name: str, path: Path) -> Path:
    """Return the default output folder of a run: results/<family>/<name>.

    The family is the folder of the case file; a file in the current folder has none.
    """
    if name in shipped() and not Path(name).is_file():
        return Path("results") / name
    family = path.resolve().parent
    if family == Path.cwd():
        return Path("results") / path.stem
    return Path("results") / family.name / path.stem
