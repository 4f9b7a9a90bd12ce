"""Installation on plain systems: time to the first result, size on disk, difference of results.

Writes a table of docs/environment.md. Each system starts from a copy of the checkout in a folder of
its own, with an empty home and empty caches. The benchmark needs a network, root, 8 GB, half an
hour and a Python of the machine itself, not of a userland (`make SOLVER=wheel env`).

    .castfem/wheel/bin/python -m benchmarks systems
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.report import ROOT, Output
from castfem.runs.output.history import read_history

FIRST = "billet125/taper_1"
CASES = {"billet": FIRST, "slab": "slab1200/slab"}
DIAGNOSTICS = {"step", "newton", "newton_mechanics", "energy_error", "force_error", "penetration"}
"""Columns of a history about the solution process, not about results."""
PYTHONS = ("3.12", "3.13")
VERSIONS = """
import sys, castfem, dolfinx, petsc4py, numpy
print(sys.version.split()[0], dolfinx.__version__, petsc4py.__version__, numpy.__version__)
"""
COLUMNS = {
    "system": "system",
    "commands": "commands",
    "set_up": ("set up [s]", ".0f"),
    "first": ("first result [s]", ".0f"),
    "size": ("on disk [GB]", ".1f"),
    "versions": "Python, DOLFINx, PETSc, NumPy",
    "billet": ("billet, largest difference", ".0e"),
    "slab": ("slab, largest difference", ".0e"),
}
Step = Callable[[str], str]
"""Function that runs a shell command in the checkout on a system and returns its output."""


def plain(folder: Path) -> Step:
    """Return a function that runs commands on this machine with an empty home in `folder`."""
    kept = {name: os.environ[name] for name in ("LANG", "http_proxy") if name in os.environ}
    path = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
    home = folder / "home"
    home.mkdir()
    return lambda line: _shell(
        ["bash", "-c", line], folder / "castfem", kept | {"HOME": str(home), "PATH": path}
    )


def debian_13(folder: Path) -> Step:
    """Return a function that runs commands as root of a new Debian 13 below `folder`."""
    root = folder / "root"
    words = ["--variant=apt", "--include=ca-certificates", "trixie", str(root)]
    subprocess.run(["mmdebstrap", "--quiet", *words], check=True)
    shutil.copy("/etc/resolv.conf", root / "etc")
    inside = ["bwrap", "--bind", str(root), "/", "--proc", "/proc", "--dev", "/dev"]
    inside += ["--bind", str(folder / "castfem"), "/castfem", "--chdir", "/castfem", "--clearenv"]
    for name, value in {"HOME": "/root", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}.items():
        inside += ["--setenv", name, value]
    return lambda line: _shell([*inside, "bash", "-c", line], folder, {"PATH": "/usr/bin:/bin"})


def _shell(words: Sequence[str], folder: Path, environment: Mapping[str, str]) -> str:
    done = subprocess.run(words, cwd=folder, env=environment, text=True, capture_output=True)
    if done.returncode != 0:
        raise RuntimeError(f"{words[-1]}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def measured(system: str, commands: Sequence[str], castfem: str, step: Step, here: Path) -> Any:
    """Set a system up and run the cases on it; return its row without differences."""
    start = perf_counter()
    for line in commands:
        step(line)
    set_up = perf_counter() - start
    for name, case in CASES.items():
        step(f"{castfem}castfem run {case} -q -o {name} --set output.figures=false")
        if name == "billet":
            first = perf_counter() - start
    size = 1e-9 * sum(_size(here / name) for name in ("home", "castfem", "root"))
    python, dolfinx, petsc, numpy = step(f"{castfem}python -c '{VERSIONS}'").split()[-4:]
    return {
        "system": system, "commands": "; ".join(map(named, commands)),
        "set_up": set_up, "first": first, "size": size,
        "versions": ", ".join((python, dolfinx, petsc, numpy)),
    }  # fmt: skip


def named(command: str) -> str:
    """Return a command without the folder of a Python."""
    return re.sub(r"\S*/(\d\.\d+)[.\d]*/bin/python3", r"python\1", command)


def _size(folder: Path) -> int:
    words = subprocess.run(["du", "-sB1", folder], capture_output=True, text=True).stdout.split()
    return int(words[0]) if words else 0


def difference(run: Path, other: Path) -> float:
    """Return the largest difference of two histories, relative to the largest of a column."""
    a, b = read_history(run / "history.csv"), read_history(other / "history.csv")
    worst = 0.0
    for name in set(a.columns) - DIAGNOSTICS:
        mine = np.interp(b["position"], a["position"], a[name].astype(float))
        theirs = b[name].to_numpy(float)
        scale = np.nanmax(np.abs(theirs))
        if scale > 0.0:
            worst = max(worst, float(np.nanmax(np.abs(mine - theirs)) / scale))
    return worst


def systems(pythons: Mapping[str, str]) -> dict[str, tuple[Callable[[Path], Step], list[str], str]]:
    """Return function, commands and folder of the programs of each system."""
    pip = {
        f"venv of Python {version}": (
            plain,
            [f"{python} -m venv cast", 'cast/bin/pip install -q ".[solver]"'],
            "cast/bin/",
        )
        for version, python in pythons.items()
    }
    packages = "$(tools/env.sh packages)"
    return {
        "Debian 12": (plain, ["make SOLVER=debian env"], ".castfem/debian/bin/"),
        "Debian 13": (
            debian_13,
            [
                "apt-get update -q",
                f"apt-get install -qy --no-install-recommends git make {packages}",
                "make SOLVER=system env",
            ],
            ".castfem/system/bin/",
        ),
        **pip,
    }


def main(output: Output, quick: bool) -> None:
    """Install and run all systems, one after the other."""
    pythons = {version: _python(version) for version in PYTHONS}
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        for number, (name, (make, commands, castfem)) in enumerate(
            systems({v: python for v, python in pythons.items() if python}).items()
        ):
            here = Path(temporary, str(number))
            here.mkdir()
            subprocess.run(["git", "clone", "-q", ROOT, here / "castfem"], check=True)
            row = measured(name, commands, castfem, make(here), here)
            for case in CASES:
                shutil.copytree(here / "castfem" / case, Path(temporary, f"{number}-{case}"))
                row[case] = difference(
                    Path(temporary, f"{number}-{case}"), Path(temporary, f"0-{case}")
                )
            rows.append(row)
            print(f"  {row}", flush=True)
            shutil.rmtree(here)
            if quick:
                break
    output.csv("systems", rows)
    show(output)


def _python(version: str) -> str | None:
    """Return a Python of a version: the latest of pyenv, else the one on the path."""
    found = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python3"))
    return str(found[-1]) if found else shutil.which(f"python{version}")


def show(output: Output) -> None:
    """Write the table from the data."""
    rows = [row | {"commands": f"`{row['commands']}`"} for row in output.rows("systems")]
    output.table("systems", rows, COLUMNS)
