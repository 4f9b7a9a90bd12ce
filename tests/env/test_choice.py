"""Where DOLFINx comes from: which Python `tools/env.sh` takes, and what it says of others."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
