"""Compiled forms on disk: recovery from unfinished or damaged ones and unwritable folders.

FFCx creates the C file of a form before compiling and another file when it is ready; a process that
finds only the first waits for the second. If the compiling process is dead, the second never
appears. Here every process that compiles holds a lock, which the operating system releases with the
process: a process that has waited in vain and can get the lock exclusively knows that nobody is
working on forms without the second file.

The second file also holds a check sum of the compiled module: a truncated one, for example from a
full disk, is compiled again.
"""

from __future__ import annotations

import atexit
import errno
import fcntl
import os
import shutil
import sysconfig
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache, partial
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import TypeVar

from mpi4py import MPI

from castfem.base.errors import RunFailure
from castfem.base.log import logger
from castfem.fem.rank_zero import on_root

T = TypeVar("T")
WAIT = 10  # s: how long FFCx waits for a form that another process compiles
LOCK = "compiling.lock"
READY = ".c.cached"  # suffix of the file by which FFCx marks a compiled form
TIMED_OUT = "compilation timed out"  # FFCx's message after that
# The operating system's messages about a folder that is not writable.
REFUSED = tuple(
    os.strerror(n)
    for n in (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.ENOTDIR)
)
# DOLFINx's messages on several ranks: 0.9 and 0.10 on all, 0.11 on all but the first.
FAILED = (
    "Failed just-in-time compilation", "Failed JIT compilation", "JIT compilation failed on rank 0",
)  # fmt: skip

_MEND = "set XDG_CACHE_HOME to a writable folder"
_whole = set[Path]()  # marks of forms that this process has compiled, or found undamaged
_looked_through = dict[Path, int]()  # folder -> its last change when all marks in it were checked


def compiled(comm: MPI.Comm, cache: Path, make: Callable[[Path], T]) -> T:
    """Return what `make` compiles, or finds compiled (collective).

    Args:
        comm: Communicator of the ranks that need it; the first one compiles.
        cache: Folder of compiled forms, created if missing. If it is not writable, a temporary
            folder of this process is used.
        make: Calls DOLFINx with the folder.

    Raises:
        RunFailure: There is no writable folder, or no compiler.
        Exception: Whatever `make` raises, except a timeout or a rejected folder.
    """
    folder = _on_all(comm, partial(_ready, cache))
    while True:
        try:
            with _locked(folder, fcntl.LOCK_SH), _readable_settings():
                made = make(folder)
                on_root(comm, partial(_seal, folder))
                return made
        except (OSError, RuntimeError) as error:
            why = _reason(comm, error)
            if why == TIMED_OUT:
                on_root(comm, partial(_clean, folder))
            elif why and folder == cache:
                folder = _on_all(comm, partial(_instead, cache, why))
            else:
                _check_compiler(error)
                raise
        except Exception as error:
            _check_compiler(error)
            raise


@contextmanager
def _readable_settings() -> Iterator[None]:
    """Let FFCx and DOLFINx ignore settings of the user that cannot be read.

    They handle missing files, but not a home folder without permission, such as another user's.
    """
    before = os.environ.get("XDG_CONFIG_HOME")
    folder = Path(before or Path.home() / ".config")
    try:
        for name in ("ffcx/ffcx_options.json", "dolfinx/dolfinx_jit_options.json"):
            with suppress(FileNotFoundError):
                (folder / name).open().close()
    except OSError:
        os.environ["XDG_CONFIG_HOME"] = os.fspath(Path(__file__).parent)  # contains no settings
    try:
        yield
    finally:
        if before is None:
            os.environ.pop("XDG_CONFIG_HOME", None)
        else:
            os.environ["XDG_CONFIG_HOME"] = before


def _check_compiler(error: Exception) -> None:
    """Raise a RunFailure if a form could not be compiled because no compiler was found."""
    command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    compiler, headers = command.split()[0], sysconfig.get_path("include")
    lacking = [f"C compiler ({compiler})"] if shutil.which(compiler) is None else []
    if not Path(headers, "Python.h").is_file():
        lacking.append(f"Python.h in {headers}")
    if lacking:
        raise RunFailure(
            f"there is no {' and no '.join(lacking)}, which DOLFINx compiles its forms with: "
            "`apt install gcc python3-dev`, `conda install -c conda-forge c-compiler`, or set CC "
            "to a compiler"
        ) from error


def _on_all(comm: MPI.Comm, work: Callable[[], Path]) -> Path:
    """Result of the first rank, on all ranks (collective)."""
    found: Path = comm.bcast(on_root(comm, work), root=0)
    return found


def _reason(comm: MPI.Comm, error: Exception) -> str:
    """The first rank's message, if it can be resolved; then all ranks fail (collective).

    On several ranks DOLFINx raises another error that contains the first rank's message.
    """
    if comm.size > 1 and not str(error).startswith(FAILED):
        return ""
    said = f"{TIMED_OUT} {error}" if isinstance(error, TimeoutError) else str(error)
    if comm.size == 1 and not isinstance(error, OSError):
        said = ""
    found: str = comm.bcast(next((one for one in (TIMED_OUT, *REFUSED) if one in said), ""), root=0)
    return found


@contextmanager
def _locked(cache: Path, kind: int) -> Iterator[None]:
    """Hold the lock of the folder, shared or exclusively.

    If locking is impossible (permission or file system), continue without it.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            file = stack.enter_context(open(cache / LOCK, "ab"))
            fcntl.flock(file, kind)
        yield


def _ready(cache: Path) -> Path:
    """The folder of a cache or its replacement, with damaged forms removed."""
    try:
        cache.mkdir(parents=True, exist_ok=True)
        changed = cache.stat().st_mtime_ns
        if _looked_through.get(cache) != changed:
            if not all(_is_whole(ready) for ready in cache.glob(f"*{READY}")):
                _clean(cache)
            _looked_through[cache] = changed
    except OSError as error:
        return _instead(cache, error.strerror or str(error))
    return cache


def _instead(cache: Path, why: str) -> Path:
    """A folder of this process alone, in place of a cache that is not writable."""
    try:
        folder = _temporary(why) / cache.name
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise RunFailure(
            f"{cache}: cannot be written ({why}), and there is no temporary folder "
            f"({error.strerror or error}); {_MEND}"
        ) from error
    return folder


@lru_cache(maxsize=1)
def _temporary(why: str) -> Path:
    """A folder deleted with this process; logs the reason once."""
    folder = Path(tempfile.mkdtemp(prefix="castfem-forms-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    logger.warning(
        "the cache of compiled forms cannot be written (%s): each run compiles them again; %s",
        why,
        _MEND,
    )
    return folder


def _clean(cache: Path) -> None:
    """Remove unfinished and damaged forms; waits until no other process compiles."""
    with _locked(cache, fcntl.LOCK_EX):
        for source in cache.glob("*.c"):
            ready = source.with_suffix(READY)
            if not ready.exists() or not _is_whole(ready):
                logger.debug("%s was never finished or is damaged, and is removed", source)
                for path in (ready, *_modules(ready), source):
                    path.unlink(missing_ok=True)


def _modules(ready: Path) -> list[Path]:
    """Compiled files marked by this file."""
    name = ready.name.removesuffix(READY)
    paths = (ready.with_name(f"{name}{ending}") for ending in EXTENSION_SUFFIXES)
    return [path for path in paths if path.exists()]


def _seal(cache: Path) -> None:
    """Write a check sum into the marks of newly compiled forms.

    Loading a truncated module is not noticed: it ends the process by a signal.
    """
    with suppress(OSError):
        if _looked_through.get(cache) == cache.stat().st_mtime_ns:
            return  # nothing has been compiled since
    for ready in cache.glob(f"*{READY}"):
        if ready not in _whole and (found := _sum(ready)):
            with suppress(OSError):  # then it is compiled again
                ready.write_text(found)
            _whole.add(ready)


def _is_whole(ready: Path) -> bool:
    """Whether a compiled form is unchanged since it was sealed; checked once."""
    if ready not in _whole:
        with suppress(OSError):
            if ready.read_text(errors="replace") == _sum(ready):
                _whole.add(ready)
    return ready in _whole


def _sum(ready: Path) -> str:
    """Check sums of the compiled files; empty if there are none."""
    return " ".join(f"{zlib.crc32(path.read_bytes()):08x}" for path in _modules(ready))
