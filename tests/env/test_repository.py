"""Declarations of the repository: references, versions, its top level, the architecture page."""

from __future__ import annotations

import ast
import os
import re
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import castfem

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
    """Return the docstring of a module, and all its docstrings and comments."""
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


def test_bare_equation_number_has_a_source() -> None:
    bare = [
        str(path.relative_to(ROOT))
        for path in FILES
        if EQUATION.search(written(path)[1]) and "[Pascon2003]" not in written(path)[0]
    ]
    assert not bare, f"say in the module's docstring whose equations these are: {bare}"


def test_equation_numbers_of_pages_and_cases_have_a_source() -> None:
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


# Version and headings of CHANGELOG.md agree.


HEADING = re.compile(r"^## \[?v?(\d+\.\d+\.\d+)\b", re.MULTILINE)


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def faults(version: str, changes: str) -> list[str]:
    """Return disagreements: the code has the latest released version, which comes first."""
    released, found = HEADING.findall(changes), []
    if released != sorted(released, key=numbers, reverse=True):
        found.append("the latest version does not stand first in CHANGELOG.md")
    if released and released[0] != version:
        found.append(f"CHANGELOG.md is at {released[0]}, the code at {version}")
    return found


def test_code_and_changelog_agree() -> None:
    assert faults(castfem.__version__, (ROOT / "CHANGELOG.md").read_text("utf-8")) == []


# The top level of the project contains only known names


KNOWN = {
    *(".ci", ".gitignore", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "Dockerfile"),
    *("LICENSE", "LICENSE.GPL", "MANIFEST.in", "Makefile", "README.md", "apptainer.def"),
    *("environment.yml", "pixi.toml", "pyproject.toml"),
    *("benchmarks", "cases", "castfem", "docs", "findings", "forms", "meshes", "tests", "tools"),
}
OF_AN_ARCHIVE = {".git", "PKG-INFO", "setup.cfg"}  # added by git or a packager


def present(root: Path) -> list[str]:
    """Return names in a checkout or an unpacked archive, without those in .gitignore."""
    ignored = [*OF_AN_ARCHIVE]
    if (root / ".gitignore").exists():
        ignored += [line.strip("/") for line in (root / ".gitignore").read_text().split()]
    names = [path.name for path in root.iterdir()]
    return [name for name in names if not any(fnmatch(name, one) for one in ignored)]


def test_top_level_contains_only_known_names() -> None:
    assert {*present(ROOT)} - KNOWN == set()


def test_scripts_are_executable() -> None:
    """All that name their interpreter; files that other scripts read do not."""
    files = [*(ROOT / "findings").glob("*.sh"), *(ROOT / "tools").glob("*.sh"), ROOT / ".ci/run"]
    scripts = [file for file in files if file.read_bytes().startswith(b"#!")]
    assert {file.name for file in scripts} >= {"run", "test.sh", "cobyqa_nan.sh"}
    assert [file.name for file in scripts if not os.access(file, os.X_OK)] == []


# docs/architecture.md: the names on it exist.


PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ENGINE = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "castfem").rglob("*.py"))


def named(line: str) -> tuple[list[Path], list[str]]:
    """Return the files in a line of the page, and the identifiers in the same line."""
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


def test_names_of_a_line_exist() -> None:
    """Each file exists, and one of the files in its line has each identifier."""
    lines = [x for x in PAGE.splitlines() if "`" in x]
    assert len(lines) > 20
    for line in lines:
        files, names = named(line)
        texts = [p.read_text(encoding="utf-8") for p in files if p.suffix == ".py"]
        text = "\n".join(texts) or ENGINE
        for name in names:
            if name.startswith("castfem."):
                continue
            assert re.search(rf"\b{name.split('.')[-1].lstrip('@')}\b", text), (name, line)
