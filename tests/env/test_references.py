"""Every key of a source stands in the bibliography, and equation numbers say of what."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
KEY = re.compile(r"\[([A-Z][A-Za-z]+(?:\d{4})?)\](?!\()")
EQUATION = re.compile(r"(?<![\w.\]`])\((?:[1-9]\d|[1-3]\d\d)\)")
FILES = sorted(p for d in ("castfem", "forms", "meshes") for p in (ROOT / d).rglob("*.py"))


def known() -> set[str]:
    page = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")
    return set(re.findall(r"^\| \[(\w+)\] \|", page, re.MULTILINE))


@cache
def told(path: Path) -> tuple[str, str]:
    """Docstring of a module, and all its docstrings and comments."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = [ast.get_docstring(n) or "" for n in ast.walk(tree) if isinstance(n, kinds)]
    return docs[0], "\n".join([*docs, *re.findall(r"#.*", text)])


def test_every_key_is_in_the_bibliography() -> None:
    keys = known()
    assert len(keys) > 20
    used = {
        key for path in FILES for key in KEY.findall(told(path)[1]) if re.search(r"\d{4}$", key)
    }
    assert used and used <= keys


def test_a_bare_equation_number_says_of_what() -> None:
    bare = [
        str(path.relative_to(ROOT))
        for path in FILES
        if EQUATION.search(told(path)[1]) and "[Pascon2003]" not in told(path)[0]
    ]
    assert not bare, f"say in the module's docstring whose equations these are: {bare}"
