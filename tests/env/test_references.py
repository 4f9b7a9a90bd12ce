"""Every key of a source stands in the bibliography, and equation numbers say of what."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
KEY = re.compile(r"\[([A-Z][A-Za-z]+(?:\d{4})?)\](?!\()")
EQUATION = re.compile(r"(?<![\w.\]`])\((?:[1-9]\d|[1-3]\d\d)\)")
PACKAGES = ("castfem", "forms", "meshes")
FILES = sorted(p for d in (*PACKAGES, "benchmarks", "tests") for p in (ROOT / d).rglob("*.py"))
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
CASES = sorted((ROOT / "cases").rglob("*.toml"))


def known() -> set[str]:
    page = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")
    return set(re.findall(r"^\| \[(\w+)\] \|", page, re.MULTILINE))


@cache
def written(path: Path) -> tuple[str, str]:
    """Docstring of a module, and all its docstrings and comments."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = [ast.get_docstring(n) or "" for n in ast.walk(tree) if isinstance(n, kinds)]
    return docs[0], "\n".join([*docs, *re.findall(r"(?<!\S)#.*", text)])


def test_every_key_is_in_the_bibliography() -> None:
    keys = known()
    assert len(keys) > 20
    texts = [written(path)[1] for path in FILES]
    texts += [path.read_text(encoding="utf-8") for path in (*PAGES, *CASES)]
    used = {key for text in texts for key in KEY.findall(text) if re.search(r"\d{4}$", key)}
    assert used and used <= keys, used - keys


def test_a_bare_equation_number_says_of_what() -> None:
    bare = [
        str(path.relative_to(ROOT))
        for path in FILES
        if EQUATION.search(written(path)[1]) and "[Pascon2003]" not in written(path)[0]
    ]
    assert not bare, f"say in the module's docstring whose equations these are: {bare}"


def test_a_page_or_case_with_equation_numbers_says_of_what() -> None:
    texts = {p: p.read_text(encoding="utf-8") for p in PAGES}
    for path in CASES:
        lines = path.read_text(encoding="utf-8").splitlines()
        texts[path] = "\n".join(x for x in lines if x.startswith(("#", "title", "source")))
    bare = [
        str(path.relative_to(ROOT))
        for path, text in texts.items()
        if EQUATION.search(text) and "[Pascon2003]" not in text
    ]
    assert not bare, f"name the work whose equations these are by its key: {bare}"
