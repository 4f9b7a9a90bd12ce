"""What `python -m build` makes, installed where no checkout is, and used from an empty folder."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHIPPED = {"castfem": "castfem", "forms": "castfem/forms", "meshes": "castfem/meshes"}
SHIPPED["cases"] = "castfem/cases"


def called(*words: str | Path, cwd: Path | None = None) -> str:
    """Run a program without anything of this Python's environment; what it prints."""
    own = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    environment = {name: value for name, value in os.environ.items() if name not in own}
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the sdist, and of the wheel that was built from it."""
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
    """The program of a new virtual environment; DOLFINx comes from where this Python has it."""
    home = tmp_path_factory.mktemp("venv")
    venv.create(home, system_site_packages=True, with_pip=False)
    beside = Path(sys.prefix) / "lib" / f"python3.{sys.version_info.minor}" / "site-packages"
    parent = beside / "parent.pth"  # where DOLFINx lies in a venv itself
    if parent.is_file():
        shutil.copy(parent, home / parent.relative_to(sys.prefix))
    python = home / "bin" / "python"
    called(python, "-m", "pip", "install", "-q", "--no-deps", "--no-index", wheel)
    return home / "bin" / "castfem"


def sources() -> set[str]:
    """Names in the wheel of all that lies in the folders that are shipped."""
    return {
        f"{inside}/{path.relative_to(ROOT / folder).as_posix()}"
        for folder, inside in SHIPPED.items()
        for path in (ROOT / folder).rglob("*.*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_wheel_holds_what_is_shipped_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        licences = [name for name in archive.namelist() if "licenses/LICENSE" in name]
    assert names == sources()
    assert "castfem/py.typed" in names and len(licences) == 2


def test_sdist_holds_what_the_wheel_is_built_from(built: Path) -> None:
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
        told = Parser().parsestr(archive.read(name).decode())
    tree = ast.parse((ROOT / "castfem" / "__init__.py").read_text())
    (version,) = (
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__version__"
    )
    assert told["Version"] == version == wheel.name.split("-")[1]
    assert {"numpy", "pydantic"} <= {re.split(r"\W", r)[0] for r in told.get_all("Requires-Dist")}


def test_it_runs_from_an_empty_folder(program: Path, tmp_path: Path) -> None:
    """A case, its table, figures and page, the steel: all from the wheel, none from here."""
    where = called(
        program.with_name("python"), "-c", "import castfem; print(castfem.__file__)", cwd=tmp_path
    )
    assert Path(where.strip()).is_relative_to(program.parents[1])
    case = ("billet125/thermal", "--set", "casting.length=60 mm", "--set", "mesh.surface_size=4 mm")
    said = called(program, "run", *case, cwd=tmp_path)
    folder = tmp_path / "results" / "billet125" / "thermal"
    assert "results in results/billet125/thermal" in said and (folder / "summary.json").is_file()
    assert len(list((folder / "figures").iterdir())) > 3
    called(program, "report", folder, cwd=tmp_path)
    assert (folder / "report.html").stat().st_size > 10_000
    for words in (("cases",), ("material", "carbon_042"), ("init", "mine"), ("check", "mine.toml")):
        assert called(program, *words, cwd=tmp_path)
    assert "slab1200/slab" in called(program, "cases", cwd=tmp_path)
    machine = called(program, "machine", "slab1200/thermal", cwd=tmp_path)
    assert "rolls" in machine  # of a CSV file beside its case
