"""docs/architecture.md: what it names is there, and what it says a change costs is counted."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ENGINE = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "castfem").rglob("*.py"))
# Which functions and classes of its test a recipe consists of, and lines that enter it elsewhere:
# a decorator that is called there, the entry of a mesher.
TOYS = {
    "history column, summary row": (("mean",), 0),
    "surface (flux) law": (("RatedFlux", "Rated"), 0),
    "crack index": (("swing",), 0),
    "spray correlation": (("linear",), 1),
    "constitutive law": (("Softened",), 0),
    "section shape": (("square", "Square"), 1),
    "support of the surface": (("belt_work", "Belt", "StickingBelt"), 0),
}


def rows() -> list[list[str]]:
    """Cells of all rows of its tables."""
    lines = [line for line in PAGE.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def named(line: str) -> tuple[list[Path], list[str]]:
    """Files in a line of the page, and the identifiers beside them."""
    files: list[Path] = []
    names: list[str] = []
    for word in re.findall(r"`([^`]+)`", line):
        if re.fullmatch(r"[\w/.*-]+", word) and ("/" in word or word.endswith(".py")):
            found = [p for base in ("castfem", ".") for p in (ROOT / base).glob(word)]
            found = found or list((ROOT / "castfem").rglob(word))
            assert found, f"{word}: there is no such file"
            files += found
        elif re.fullmatch(r"@?[A-Za-z_][\w.]*", word):
            names.append(word)
    return files, names


@pytest.mark.parametrize("line", [x for x in PAGE.splitlines() if "`" in x])
def test_what_a_line_names_is_there(line: str) -> None:
    """Each file exists, and one of those in its line has each identifier."""
    files, names = named(line)
    text = "\n".join(p.read_text(encoding="utf-8") for p in files if p.suffix == ".py") or ENGINE
    for name in names:
        if name.startswith("castfem."):
            continue
        assert re.search(rf"\b{name.split('.')[-1].lstrip('@')}\b", text), name


@pytest.mark.parametrize("recipe", TOYS)
def test_lines_of_a_toy_are_counted(recipe: str) -> None:
    """Without blank lines, decorators included."""
    (row,) = (r for r in rows() if r[0] == recipe)
    (file,) = named(row[-1])[0]
    tree = ast.parse(file.read_text(encoding="utf-8"))
    kinds = (ast.FunctionDef, ast.ClassDef)
    text = file.read_text(encoding="utf-8").splitlines()
    names, count = TOYS[recipe]
    for node in ast.walk(tree):
        if isinstance(node, kinds) and node.name in names:
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            count += sum(bool(x.strip()) for x in text[first - 1 : node.end_lineno])
    assert count == int(row[3]), recipe
