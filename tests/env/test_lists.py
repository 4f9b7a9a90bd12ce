"""The environment's lists have the same contents, and no file of it names a host."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from fnmatch import fnmatch
from importlib import metadata
from pathlib import Path

import pytest

import castfem

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "tools").glob("*.sh"))
FILES = [
    *SCRIPTS,
    *(ROOT / name for name in ("tools/packages.txt", "tools/docs_packages.txt", "tools/probe.py")),
    *(ROOT / name for name in ("Makefile", "Dockerfile", "apptainer.def", ".ci/run")),
    *(ROOT / name for name in ("environment.yml", "pixi.toml")),
]

# Names in conda-forge that differ from Debian's without "python3-"; None: in another package.
CONDA = {
    "python3-dolfinx-real": "fenics-dolfinx",
    "python3-petsc4py-real": "petsc4py",
    "python3-gmsh": "python-gmsh",
    "openmpi-bin": "openmpi",
    "g++": "cxx-compiler",
    "libopenblas0-serial": "libopenblas",
    "python3-h5py-mpi": "h5py",
    "python3-venv": None,
}
ONLY_CONDA = {"python", "petsc"}  # Debian's petsc4py-real installs both


def debian_names(name: str = "packages.txt") -> list[str]:
    lines = (ROOT / "tools" / name).read_text().splitlines()
    return [name for line in lines if (name := line.split("#")[0].strip())]


def conda_names() -> list[str]:
    text = (ROOT / "environment.yml").read_text().split("dependencies:")[1]
    return re.findall(r"^  - ([\w-]+)", text, re.MULTILINE)


def test_conda_and_debian_agree() -> None:
    translated = {CONDA.get(name, name.removeprefix("python3-")) for name in debian_names()} - {
        None
    }
    assert translated == set(conda_names()) - ONLY_CONDA


def conda_specs() -> dict[str, tuple[str, str]]:
    """Return version and build by name."""
    lines = (ROOT / "environment.yml").read_text().split("dependencies:")[1].splitlines()
    entries = [line.removeprefix("  - ").split(maxsplit=1) for line in lines if "  - " in line]
    found = {}
    for name, *rest in entries:
        version, _, build = rest[0].removeprefix("=").partition("=") if rest else ("*", "", "")
        if rest and not rest[0].startswith("="):
            version, build = rest[0], ""
        found[name] = version, build or "*"
    return found


def test_pixi_and_conda_agree() -> None:
    listed = tomllib.loads((ROOT / "pixi.toml").read_text())["dependencies"]
    whole = {n: v if isinstance(v, dict) else {"version": v} for n, v in listed.items()}
    specs = {n: (v["version"], v.get("build", "*")) for n, v in whole.items()}
    assert specs == conda_specs()
    assert specs["petsc"] == ("*", "real*") and specs["python"] == (">=3.11", "*")


def commands(text: str) -> list[str]:
    """Return the commands of a shell, one by one, without line breaks."""
    joined = re.sub(r"\\\n", " ", text)
    parts = [part for line in joined.splitlines() for part in line.split("&&")]
    return [" ".join(part.split()) for part in parts if part.strip()]


def test_apptainer_has_the_steps_of_the_dockerfile() -> None:
    docker = re.sub(r"^#.*\n", "", (ROOT / "Dockerfile").read_text(), flags=re.MULTILINE)
    text = (ROOT / "apptainer.def").read_text()
    parts = dict(re.findall(r"^%(\w+)\n((?:(?!%).*\n)*)", text, re.MULTILINE))
    assert f"From: {re.findall(r'^FROM (.*)', docker, re.MULTILINE)[0]}" in text
    runs = re.findall(r"^RUN ((?:.*\\\n)*.*\n)", docker, re.MULTILINE)
    assert commands(parts["post"]) == [command for run in runs for command in commands(run)]
    copied = set()
    for line in re.findall(r"^COPY (.*)", docker, re.MULTILINE):
        *names, target = line.split()
        copied |= {(n, target + (n if target.endswith("/") else "")) for n in names}
    assert {tuple(line.split()) for line in parts["files"].splitlines() if line} == copied
    settings = commands(re.findall(r"^ENV ((?:.*\\\n)*.*\n)", docker, re.MULTILINE)[0])[0].split()
    exported = [line.split()[1] for line in parts["environment"].splitlines() if line]
    assert exported and set(exported) <= set(settings)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    folders = set(project["tool"]["setuptools"]["package-dir"].values())
    assert folders | {"pyproject.toml", project["project"]["readme"]} <= {
        name for name, _ in copied
    }


def test_list_contains_the_requirements() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = {re.match(r"[\w-]+", item)[0] for item in wanted}  # type: ignore[index]
    listed = {name.removeprefix("python3-") for name in debian_names()}
    assert names - listed == {"numpy", "ruff"}  # numpy comes with scipy, ruff from PyPI


def test_packages_of_the_manual_are_separate() -> None:
    """Debian's list, the extra, and the imports of Sphinx agree; nothing else installs them."""
    apart = debian_names("docs_packages.txt")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extra = {re.match(r"[\w-]+", item)[0] for item in project["optional-dependencies"]["docs"]}  # type: ignore[index]
    loaded = (ROOT / "docs/conf.py").read_text()
    scripts = [name for name in apart if not name.startswith("python3-")]
    assert {name.removeprefix("python3-") for name in apart} - set(scripts) == extra
    assert scripts and all(name in loaded for name in scripts)
    assert all(name.replace("-", "_") in loaded for name in extra - {"sphinx"})
    assert not set(apart) & set(debian_names())
    printed = subprocess.run(
        [ROOT / "tools/env.sh", "packages", "docs"], capture_output=True, text=True
    )
    assert printed.stdout.split() == apart


def test_dockerfile_and_userland_read_the_list() -> None:
    assert "tools/packages.txt" in (ROOT / "Dockerfile").read_text()
    printed = subprocess.run([ROOT / "tools/env.sh", "packages"], capture_output=True, text=True)
    assert printed.stdout.split() == debian_names()


def test_ruff_is_pinned() -> None:
    assert re.search(r'"ruff==\d+\.\d+\.\d+"', (ROOT / "pyproject.toml").read_text())


def test_no_host_is_named() -> None:
    for path in FILES:
        assert not re.search(r"://|\b[\w-]+\.(org|com|net|io)\b", path.read_text()), path


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_script_parses(path: Path) -> None:
    assert subprocess.run(["bash", "-n", path]).returncode == 0


def test_ci_runs_the_test_command_of_the_readme() -> None:
    assert (ROOT / ".ci/run").read_text().rstrip().endswith("exec make test")
    assert (ROOT / ".ci/run").stat().st_mode & 0o111


# Imports are declared and declarations imported, and types are shipped.


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
CODE = ("castfem", "forms", "meshes")
# From the source of DOLFINx, not from a wheel, with the package of tools/packages.txt.
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
}  # imported on request of a case; the extra that installs it
COMES_WITH = {"PIL": "matplotlib", "pydantic_core": "pydantic", "llvmlite": "numba"}


def imports(tree: ast.Module) -> Iterator[str]:
    """Yield top-level names of all imports of a module, wherever they are."""
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


def test_imports_and_declarations_agree() -> None:
    assert set(COMES_WITH.values()) <= declared()
    assert third_party() - set(COMES_WITH) == declared() | set(DISTRIBUTION) | set(EXTRA)
    for name, extra in EXTRA.items():
        assert any(
            item.startswith(name) for item in PROJECT["project"]["optional-dependencies"][extra]
        )


def test_packages_of_the_distribution_are_listed() -> None:
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
    data |= set((ROOT / "cases").glob("*/*.py"))  # scripts that make the tables of a case
    assert data <= shipped
    assert ROOT / "castfem" / "py.typed" in shipped
    packages = {p.parent.relative_to(ROOT).as_posix() for p in (ROOT / "castfem").rglob("*.py")}
    assert {p.replace("/", ".") for p in packages} <= set(setup["packages"])


def test_version_is_written_once() -> None:
    """In the code; packages read it there, and the citation has the same."""
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "castfem.__version__"}
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited is not None and cited[1] == castfem.__version__
    assert metadata.version("castfem") == castfem.__version__


def test_no_folder_of_code_is_excluded_by_git_or_lint() -> None:
    """Ruff's own list, like many a .gitignore, excludes each folder called build."""
    lines = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    patterns = [line.strip("/") for line in lines if not line.startswith("/")]
    patterns += PROJECT["tool"]["ruff"]["exclude"]
    files = [file for folder in CODE for file in (ROOT / folder).rglob("*.py")]
    parts = {part for file in files for part in file.relative_to(ROOT).parts}
    assert "build" in parts
    assert not [part for part in parts for pattern in patterns if fnmatch(part, pattern)]
