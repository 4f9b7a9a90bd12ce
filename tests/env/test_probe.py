"""Which Python is good enough: the version range, and requirements met or not."""

from __future__ import annotations

import importlib.util
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
