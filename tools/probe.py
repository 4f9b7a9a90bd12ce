"""Judges whether the Python that runs this file can carry castfem, for tools/env.sh.

Prints shell assignments (python, dolfinx, parent, missing) and leaves with status 0 if it can;
prints one line saying why not and leaves with status 1 if it cannot. With the word "wheel": whether
a venv of this Python could, with DOLFINx from PyPI; prints python and wheels. Reads no network and
writes no file. Python 3.7 can still read it, as the first one on the PATH may be old.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
import sysconfig
from contextlib import suppress
from typing import Any

LOWEST = (0, 9)
BEYOND = (0, 12)
# Beside pyproject.toml's own list: this comes from the distribution where it has it.
FROM_DISTRIBUTION = ("gmsh>=4.11",)


def release(version: str) -> tuple[int, ...]:
    """The leading numbers of a version: '0.10.0.post1' gives (0, 10, 0)."""
    found = re.match(r"\d+(?:\.\d+)*", version.strip())
    return tuple(int(part) for part in found.group().split(".")) if found else ()


def in_range(version: str) -> bool:
    """Whether castfem runs on this version of DOLFINx."""
    return LOWEST <= release(version)[:2] < BEYOND


def project() -> dict[str, Any]:
    """What pyproject.toml says of the project."""
    import tomllib

    folder = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    with open(os.path.join(folder, "pyproject.toml"), "rb") as file:
        found: dict[str, Any] = tomllib.load(file)["project"]
    return found


def requirements() -> list[str]:
    """The requirements at run time and of tests, except ruff, which is a program."""
    wanted = [*project()["dependencies"], *project()["optional-dependencies"]["test"]]
    return [item for item in wanted if not item.startswith("ruff")] + list(FROM_DISTRIBUTION)


def is_met(requirement: str) -> bool:
    """Whether 'name', 'name>=1.2' or 'name==1.2' is met by what is installed."""
    from importlib import metadata
    from importlib.util import find_spec

    found = re.match(r"([\w.-]+?)\s*(?:(>=|==)\s*([\w.]+))?$", requirement)
    assert found is not None, requirement
    name, relation, bound = found.groups()
    try:
        version = release(metadata.version(name))
    except metadata.PackageNotFoundError:  # Debian's gmsh, for one, has no such record
        return find_spec(name.replace("-", "_")) is not None
    if relation is None:
        return True
    width = max(len(version), len(release(bound)))
    ours, theirs = (v + (0,) * (width - len(v)) for v in (version, release(bound)))
    return ours == theirs if relation == "==" else ours >= theirs


def reason_against() -> str | None:
    """Why castfem cannot run here, or None. Imports what has to work together."""
    if sys.version_info < (3, 11):  # noqa: UP036
        return f"Python {sys.version_info[0]}.{sys.version_info[1]} is older than 3.11"
    try:
        for earlier in ("h5py", "mpi4py.MPI"):  # see castfem/base/libraries.py
            with suppress(ModuleNotFoundError):
                __import__(earlier)
        import dolfinx
    except Exception as problem:
        return f"no DOLFINx ({problem})"
    if not in_range(dolfinx.__version__):
        return f"DOLFINx {dolfinx.__version__} is not 0.9 ... 0.11"
    try:
        from petsc4py import PETSc

        import dolfinx.fem.petsc
    except Exception as problem:
        return f"DOLFINx {dolfinx.__version__} without PETSc ({problem})"
    if PETSc.ScalarType(0).dtype.kind != "f":
        return "PETSc is built for complex numbers"
    for name in ("gmsh", "h5py"):  # compiled: present but broken is worse than absent
        try:
            __import__(name)
        except ModuleNotFoundError:
            continue
        except Exception as problem:
            return f"{name} does not load ({problem})"
    return None


def reason_against_wheel() -> str | None:
    """Why a venv of this Python cannot have the wheels of the extra "solver", or None."""
    if sys.version_info < (3, 12):
        return f"Python {sys.version_info[0]}.{sys.version_info[1]} is older than 3.12"
    if sys.platform != "linux" or os.uname().machine != "x86_64":
        return f"there are no wheels for {sys.platform} on {os.uname().machine}"
    try:
        import ensurepip
        import venv  # noqa: F401

        ensurepip.version()
    except Exception as problem:
        return f"it cannot make a venv ({problem})"
    compiler = (os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc").split()[0]
    if shutil.which(compiler) is None:
        return f"no C compiler ({compiler})"
    if not os.path.isfile(os.path.join(sysconfig.get_path("include"), "Python.h")):
        return f"no Python.h in {sysconfig.get_path('include')}"
    return None


def main() -> int:
    """Print the verdict."""
    of_wheel = sys.argv[1:] == ["wheel"]
    reason = reason_against_wheel() if of_wheel else reason_against()
    if reason:
        print(" ".join(reason.split()))
        return 1
    if of_wheel:
        print(f"python={shlex.quote(sys.executable)}")
        print(f"wheels={shlex.quote(' '.join(project()['optional-dependencies']['solver']))}")
        return 0
    import dolfinx

    missing = [item for item in requirements() if not is_met(item)]
    # A venv made by a venv's Python sees only the base: name the folders of the one between.
    between = sys.prefix != sys.base_prefix
    parent = [path for path in sys.path if between and path.endswith("-packages")]
    for key, value in (
        ("python", sys.executable),
        ("dolfinx", dolfinx.__version__),
        ("parent", ":".join(parent)),
        ("missing", " ".join(missing)),
    ):
        print(f"{key}={shlex.quote(value)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
