"""Which Python is good enough: the version range, and requirements met or not."""

from __future__ import annotations

import importlib.util
import os
import shlex
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def probe() -> ModuleType:
    spec = importlib.util.spec_from_file_location("probe", ROOT / "tools/probe.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("version", "good"),
    [
        ("0.8.0", False),
        ("0.9.0", True),
        ("0.11.0.post0", True),
        ("0.12.0.dev0", False),
        ("0.90", False),
        ("2019.2.0.dev0", False),
        ("unknown", False),
    ],
)
def test_range_of_dolfinx(probe: ModuleType, version: str, good: bool) -> None:
    assert probe.in_range(version) is good


@pytest.mark.parametrize(
    ("requirement", "installed", "met"),
    [
        ("numpy", "1.26.4", True),
        ("numpy>=1.26", "1.9.0", False),
        ("numpy>=1.26.0", "1.26", True),
        ("numpy>=1.26", "2", True),
        ("numpy==1.26", "1.26.0", True),
        ("numpy==1.26", "1.26.1", False),
        ("no-such-package>=1", None, False),
    ],
)
def test_requirement(
    probe: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    requirement: str,
    installed: str | None,
    met: bool,
) -> None:
    if installed is not None:
        monkeypatch.setattr("importlib.metadata.version", lambda name: installed)
    assert probe.is_met(requirement) is met


def test_requirements_are_the_projects(probe: ModuleType) -> None:
    names = probe.requirements()
    assert any(name.startswith("pydantic") for name in names)
    assert any(name.startswith("gmsh") for name in names)
    assert not any(name.startswith("ruff") for name in names)


def test_this_python_passes_or_says_why() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "tools/probe.py"], capture_output=True, text=True, check=False
    )
    if done.returncode == 0:
        answers = dict(shlex.split(line)[0].split("=", 1) for line in done.stdout.splitlines())
        assert set(answers) == {"python", "dolfinx", "parent", "missing"}
        assert Path(answers["python"]).exists()
    else:
        assert len(done.stdout.splitlines()) == 1


def test_a_venv_with_wheels_is_possible_or_it_says_why() -> None:
    line = [sys.executable, ROOT / "tools/probe.py", "wheel"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        answers = dict(shlex.split(line)[0].split("=", 1) for line in done.stdout.splitlines())
        assert answers["python"] == sys.executable
        assert answers["wheels"].startswith("dolfinx-solver-real>=")
    else:
        assert len(done.stdout.splitlines()) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("version_info", (3, 11, 7)), "Python 3.11 is older than 3.12"),
        (("platform", "darwin"), "no wheels for darwin"),
        (("path", None), "no C compiler"),
    ],
)
def test_what_stands_against_wheels(
    probe: ModuleType, monkeypatch: pytest.MonkeyPatch, change: tuple[str, object], said: str
) -> None:
    name, value = change
    if value is None:
        monkeypatch.setenv("CC", "/nowhere/cc")
    else:
        monkeypatch.setattr(probe.sys, name, value)
    assert said in (probe.reason_against_wheel() or "")


# Where DOLFINx comes from: which Python `tools/env.sh` takes, and what it says of others.


# What Pythons answer that are asked for a DOLFINx, and for a venv with one from PyPI.
WITHOUT = 'echo "no DOLFINx (No module named dolfinx)"; exit 1'
OLD = 'echo "Python 3.11 is older than 3.12"; exit 1'
LATER = 'echo "python=$0"; echo "wheels=solver"'
WITH = 'echo "python=$0"; echo "dolfinx=0.11.0"; echo "parent="; echo "missing="'
PYENV = "home/.pyenv/versions/3.13.0/bin/python3"
OTHERS = {f"bin/python3{minor}": (WITHOUT, OLD) for minor in ("", ".12", ".13", ".14")}
HIDDEN = "raise ModuleNotFoundError(\"No module named 'dolfinx'\")"


def choice(folder: Path, pythons: dict[str, tuple[str, str]], **given: str) -> tuple[str, str]:
    """What is printed and said where the path has these Pythons, and others of no use."""
    home = folder / "home"
    for place, (system, wheel) in (OTHERS | pythons).items():
        file = folder / place
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'#!/bin/sh\nif [ "$2" = wheel ]; then\n{wheel}\nelse\n{system}\nfi\n')
        file.chmod(0o755)
    own = ("PYTHON", "SOLVER", "DEBIAN", "PYENV_ROOT")
    environment = {name: value for name, value in os.environ.items() if name not in own}
    (folder / "dolfinx.py").write_text(HIDDEN)  # of /usr/bin/python3
    environment["PYTHONPATH"] = str(folder)
    environment |= {"PATH": f"{folder}/bin:/usr/bin:/bin", "HOME": str(home), **given}
    done = subprocess.run(
        [ROOT / "tools/env.sh", "choice"], env=environment, capture_output=True, text=True
    )
    return done.stdout.replace(str(folder), "").strip(), done.stderr


@pytest.mark.parametrize(
    ("pythons", "given", "chosen"),
    [
        ({"bin/python3": (WITH, LATER)}, {}, "system /bin/python3"),
        ({"bin/python3": (WITHOUT, LATER)}, {}, "wheel /bin/python3"),
        ({}, {}, "debian /usr/bin/python3"),
        ({"bin/python3": (WITH, LATER)}, {"SOLVER": "wheel"}, "wheel /bin/python3"),
        ({PYENV: (WITHOUT, LATER)}, {"SOLVER": "wheel"}, f"wheel /{PYENV}"),
    ],
)
def test_the_first_that_there_is(
    pythons: dict[str, tuple[str, str]], given: dict[str, str], chosen: str, tmp_path: Path
) -> None:
    found, said = choice(tmp_path, pythons, **given)
    assert (found, said) == (chosen, "")


def test_what_python_names_comes_first(tmp_path: Path) -> None:
    pythons = {"bin/python3": (WITH, LATER), "mine": (WITHOUT, LATER), "other": (WITH, LATER)}
    assert choice(tmp_path, pythons, PYTHON=str(tmp_path / "other"))[0] == "system /other"
    found, said = choice(tmp_path, pythons, PYTHON=str(tmp_path / "mine"), SOLVER="wheel")
    assert (found, said) == ("wheel /mine", "")


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"SOLVER": "conda"}, "SOLVER=conda is unknown: choose system, wheel or debian"),
        ({"SOLVER": "wheel", "DEBIAN": "sid"}, "DEBIAN=sid and SOLVER=wheel exclude each other"),
        ({"SOLVER": "wheel"}, "SOLVER=wheel: there is no Python for it; "),
        ({"SOLVER": "system"}, "python3 is passed over: no DOLFINx (No module"),
    ],
)
def test_what_there_is_not_is_told_in_a_line(
    given: dict[str, str], why: str, tmp_path: Path
) -> None:
    found, said = choice(tmp_path, {}, **given)
    assert found == "" and why in said and len(said.splitlines()) == 1
