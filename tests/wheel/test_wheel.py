"""The result of `python -m build`, installed as users do, with the newest releases, and used.

The Python of this environment replaces that of a user, if it is 3.12 or newer.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHIPPED = {"castfem": "castfem", "forms": "castfem/forms", "meshes": "castfem/meshes"}
SHIPPED["cases"] = "castfem/cases"
SHORT_SLAB = ("--set", "casting.length=0.9 m")


def called(*words: str | Path, cwd: Path | None = None) -> str:
    """Run a program without the environment of this Python; return its output."""
    own = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    environment = {name: value for name, value in os.environ.items() if name not in own}
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the sdist, and of the wheel built from it."""
    home = tmp_path_factory.mktemp("build")
    for folder in SHIPPED:
        left_out = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, home / "source" / folder, ignore=left_out)
    for file in {*ROOT.glob("*.*"), *ROOT.glob("LICENSE*")}:
        if file.is_file():
            shutil.copy(file, home / "source")
    called(sys.executable, "-m", "build", "--no-isolation", "-o", home / "dist", home / "source")
    return home / "dist"


@pytest.fixture(scope="session")
def wheel(built: Path) -> Path:
    (found,) = built.glob("castfem-*-py3-none-any.whl")
    return found


@pytest.fixture(scope="session")
def program(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program in a new virtual environment with the extra "solver"."""
    if sys.version_info < (3, 12):
        pytest.skip("there are no wheels of DOLFINx for Python 3.11")
    home = tmp_path_factory.mktemp("venv")
    begun = time.monotonic()
    venv.create(home, with_pip=True)
    python = home / "bin" / "python"
    called(python, "-m", "pip", "install", "-q", f"{wheel}[solver]")
    took = time.monotonic() - begun
    size = sum(path.lstat().st_size for path in home.rglob("*"))
    print(f"\ninstalled in {took:.0f} s, {1e-9 * size:.2f} GB:")
    print(called(python, "-m", "pip", "list", "--format=freeze").replace("\n", " "))
    return home / "bin" / "castfem"


def sources() -> set[str]:
    """Return the names in the wheel of all files in the shipped folders."""
    return {
        f"{inside}/{path.relative_to(ROOT / folder).as_posix()}"
        for folder, inside in SHIPPED.items()
        for path in (ROOT / folder).rglob("*.*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_wheel_contains_exactly_the_shipped_files(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        licences = [name for name in archive.namelist() if "licenses/LICENSE" in name]
    assert names == sources()
    assert "castfem/py.typed" in names and len(licences) == 2


def test_sdist_contains_the_sources_of_the_wheel(built: Path) -> None:
    (path,) = built.glob("castfem-*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    inside = {name.removeprefix("castfem/") for name in sources()}
    of_cases = {name for name in inside if name.startswith(("cases/", "forms/", "meshes/"))}
    assert of_cases <= names and len(of_cases) > 50
    assert {"pyproject.toml", "README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE"} <= names


def test_version_is_that_of_the_code(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = Parser().parsestr(archive.read(name).decode())
    tree = ast.parse((ROOT / "castfem" / "__init__.py").read_text())
    (version,) = (
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__version__"
    )
    assert metadata["Version"] == version == wheel.name.split("-")[1]
    assert {"numpy", "pydantic"} <= {
        re.split(r"\W", r)[0] for r in metadata.get_all("Requires-Dist")
    }


def test_program_runs_from_an_empty_folder(program: Path, tmp_path: Path) -> None:
    """The billet, a slab, tables, figures and a page: all from the wheel, none from this folder."""
    python = program.with_name("python")
    where = called(python, "-c", "import castfem; print(castfem.__file__)", cwd=tmp_path)
    assert Path(where.strip()).is_relative_to(program.parents[1])
    begun = time.monotonic()
    printed = called(program, "run", "billet125/taper_1", "--accuracy", "coarse", cwd=tmp_path)
    print(f"the first billet, coarse, in {time.monotonic() - begun:.0f} s")
    folder = tmp_path / "results" / "billet125" / "taper_1"
    assert "results in results/billet125/taper_1" in printed and (folder / "summary.json").is_file()
    assert len(list((folder / "figures").iterdir())) > 3
    called(program, "run", "slab1200/slab", *SHORT_SLAB, "-o", "slab", cwd=tmp_path)
    called(program, "report", "slab", folder, "-o", "both.html", cwd=tmp_path)
    assert (tmp_path / "both.html").stat().st_size > 10_000
    for words in (("cases",), ("material", "carbon_042"), ("init", "mine"), ("check", "mine.toml")):
        assert called(program, *words, cwd=tmp_path)
    assert "rolls" in called(program, "machine", "slab1200/thermal", cwd=tmp_path)


def test_two_ranks_agree(program: Path, tmp_path: Path) -> None:
    case = ("run", "billet125/taper_1", "--accuracy", "coarse", "--set", "casting.length=30 mm")
    launcher = (program.with_name("mpiexec"), "-n", "2")
    found = []
    for begin, name in (((), "one"), (launcher, "two")):
        called(*begin, program, *case, "-o", name, cwd=tmp_path)
        summary = json.loads((tmp_path / name / "summary.json").read_text(encoding="utf-8"))
        found.append(summary["quantities"])
    one, two = found
    assert one.keys() == two.keys() and len(one) > 10
    for name, quantity in one.items():
        assert two[name]["value"] == pytest.approx(quantity["value"], rel=1e-7, abs=1e-9), name
