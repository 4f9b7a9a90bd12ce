"""run.json: status, versions, ranks and times of a run."""

from __future__ import annotations

import json
import platform
import shlex
import signal
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from importlib import metadata
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

import castfem
from castfem.base.atomic_files import write_json
from castfem.base.errors import InputError, dotted
from castfem.base.process import STOPS
from castfem.runs.output.summary_file import renamed

RUN_NAME = "run.json"
_FORMAT = "castfem run"
_STOPPED = STOPS[signal.SIGINT]


@dataclass(frozen=True, slots=True)
class RunRecord:
    """The content of run.json."""

    #: "running", "finished", "failed", or "interrupted" by the user or a batch system. A killed run
    #: stays "running".
    status: str = "running"
    reason: str = ""  #: reason of a failure or interruption, one line
    started: str = ""  #: when the run began, UTC
    ended: str = ""  #: when it ended, empty until then
    resumed: int = 0  #: number of resumes
    ranks: int = 1  #: number of MPI processes
    #: versions of castfem and the packages it uses, by name
    versions: Mapping[str, str] = field(default_factory=dict)
    #: seconds by stage, including those before a resume
    wall_time: Mapping[str, float] = field(default_factory=dict)
    #: names of the compiled forms of this run (compiled or from the cache)
    compiled_forms: tuple[str, ...] = ()
    memory_mb: float | None = None  #: largest resident memory of all ranks together, MB
    #: last good state: time [s], position [m], step
    reached: Mapping[str, int | float] = field(default_factory=dict)
    commands: tuple[str, ...] = ()  #: command lines: of the start and of each resume
    #: SHA-256 of case.toml and of the copies of property files, by name
    files: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def load(cls, folder: Path | str) -> RunRecord:
        """Read run.json."""
        path = Path(folder) / RUN_NAME
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError as error:
            raise InputError(f"{folder}: holds no run of castfem (no {RUN_NAME})") from error
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read ({error})") from error
        if not isinstance(content, dict) or content.get("format") != _FORMAT:
            raise InputError(f"{path}: not written by castfem")
        known = {entry.name for entry in fields(cls)}
        record = {key: value for key, value in content.items() if key in known}
        for key in ("wall_time", "reached"):  # non-finite values are null in the file
            if isinstance(record.get(key), dict):
                record[key] = renamed({k: v for k, v in record[key].items() if v is not None})
        try:
            found = _reader().validate_python(record)
        except ValidationError as error:
            first = error.errors()[0]
            where = dotted(first["loc"])
            raise InputError(
                f"{path}: {where}: {first['msg'].lower()}, the file has been changed; correct "
                "it, or choose another folder"
            ) from error
        if found.status == "failed" and found.reason == _STOPPED:  # as castfem 0.1 wrote it
            return replace(found, status="interrupted")
        return found

    def write(self, folder: Path) -> None:
        """Write run.json."""
        write_json(folder / RUN_NAME, {"format": _FORMAT, **asdict(self)})


@cache
def _reader() -> TypeAdapter[RunRecord]:
    """Validator of a record; making it takes longer than reading hundreds of records."""
    return TypeAdapter(RunRecord)


def versions() -> dict[str, str]:
    """Versions of castfem and the packages loaded in this process; imports nothing."""
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
    """Command line of this process, with only the name of the program."""
    program, *words = sys.argv or [""]
    return shlex.join([Path(program).name, *words])
