"""What is imported is declared, what is declared is imported, and types reach those who import."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from fnmatch import fnmatch
from importlib import metadata
from pathlib import Path

import castfem

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
CODE = ("castfem", "forms", "meshes")
# From where DOLFINx comes from, not from a wheel, with the package of tools/packages.txt.
DISTRIBUTION = {
    "dolfinx": "python3-dolfinx-real",
    "ufl": "python3-dolfinx-real",
    "basix": "python3-dolfinx-real",
    "petsc4py": "python3-petsc4py-real",
    "mpi4py": "python3-petsc4py-real",
    "gmsh": "python3-gmsh",
}

EXTRA = {
    "optuna": "optimise",
    "pycalphad": "calphad",
}  # imported where a case asks for it; the extra that brings it
COMES_WITH = {"PIL": "matplotlib", "pydantic_core": "pydantic"}  # which stand on them


def imports(tree: ast.Module) -> Iterator[str]:
    """Top-level names of all that a module imports, wherever in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]


def third_party() -> set[str]:
    files = [file for folder in CODE for file in (ROOT / folder).rglob("*.py")]
    found = {name for file in files for name in imports(ast.parse(file.read_text("utf-8")))}
    return found - set(sys.stdlib_module_names) - {"castfem", *CODE}


def declared() -> set[str]:
    names = [re.match(r"[\w-]+", item) for item in PROJECT["project"]["dependencies"]]
    return {name[0].replace("-", "_").lower() for name in names if name}


def test_every_import_is_declared_and_every_declared_one_is_imported() -> None:
    assert set(COMES_WITH.values()) <= declared()
    assert third_party() - set(COMES_WITH) == declared() | set(DISTRIBUTION) | set(EXTRA)
    for name, extra in EXTRA.items():
        assert any(
            item.startswith(name) for item in PROJECT["project"]["optional-dependencies"][extra]
        )


def test_the_distributions_packages_are_listed() -> None:
    listed = re.findall(r"^[\w+-]+", (ROOT / "tools/packages.txt").read_text(), re.MULTILINE)
    assert set(DISTRIBUTION.values()) <= set(listed)


def test_types_and_data_are_shipped() -> None:
    setup = PROJECT["tool"]["setuptools"]
    places = {name: ROOT / path for name, path in setup["package-dir"].items()}
    shipped = set[Path]()
    for package, patterns in setup["package-data"].items():
        top, _, below = package.partition(".")
        folder = places.get(package) or places[top].joinpath(*below.split("."))
        shipped |= {file for pattern in patterns for file in folder.glob(pattern)}
    own = [f for folder in (*CODE, "cases") for f in (ROOT / folder).rglob("*.*") if f.is_file()]
    data = {file for file in own if file.suffix != ".py" and "__pycache__" not in file.parts}
    data |= set((ROOT / "cases").glob("*/*.py"))  # what makes the tables of a case
    assert data <= shipped
    assert ROOT / "castfem" / "py.typed" in shipped
    packages = {p.parent.relative_to(ROOT).as_posix() for p in (ROOT / "castfem").rglob("*.py")}
    assert {p.replace("/", ".") for p in packages} <= set(setup["packages"])


def test_version_is_written_once() -> None:
    """In the code; packages take it from there, and who cites names the same."""
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "castfem.__version__"}
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited is not None and cited[1] == castfem.__version__
    assert metadata.version("castfem") == castfem.__version__


def test_files_of_tests_are_told_apart() -> None:
    """Of two of one name pytest would refuse the second, unless their folder is a package."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    loose = [file.name for file in files if not (file.parent / "__init__.py").is_file()]
    assert sorted({name for name in loose if loose.count(name) > 1}) == []


def test_no_folder_of_code_is_left_out_by_git_or_lint() -> None:
    """Ruff's own list, as many a .gitignore, leaves out each folder called build."""
    lines = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    patterns = [line.strip("/") for line in lines if not line.startswith("/")]
    patterns += PROJECT["tool"]["ruff"]["exclude"]
    files = [file for folder in CODE for file in (ROOT / folder).rglob("*.py")]
    parts = {part for file in files for part in file.relative_to(ROOT).parts}
    assert "build" in parts
    assert not [part for part in parts for pattern in patterns if fnmatch(part, pattern)]
