"""By what a run was made: versions of the programs, and the command line."""

from __future__ import annotations

import platform
import shlex
import sys
from contextlib import suppress
from importlib import metadata
from pathlib import Path

import castfem


def versions() -> dict[str, str]:
    """Versions of castfem and of what this process has loaded; imports nothing."""
    found = {"castfem": castfem.__version__, "python": platform.python_version()}
    for name in ("dolfinx", "ufl", "basix", "numpy", "h5py"):
        module = sys.modules.get(name)
        if module is None:
            continue
        version = getattr(module, "__version__", None)
        if version is None:
            with suppress(metadata.PackageNotFoundError):
                version = metadata.version(f"fenics-{name}")
        if version:
            found[name] = str(version)
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None:
        found["mpi"] = mpi.Get_library_version().partition(",")[0].strip()
    petsc = sys.modules.get("petsc4py.PETSc")
    if petsc is not None:
        found["petsc"] = ".".join(str(number) for number in petsc.Sys.getVersion())
    return found


def command() -> str:
    """The command line of this process; of the program its name alone."""
    program, *words = sys.argv or [""]
    return shlex.join([Path(program).name, *words])
