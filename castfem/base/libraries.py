"""Import order of libraries: DOLFINx after h5py and MPI, without numba; matplotlib, no display.

DOLFINx and petsc4py from PyPI find MPI only if mpi4py has loaded it, and an h5py loaded after them
uses their HDF5 instead of its own. PETSc replaces Python's signal handlers, so that a closed pipe
aborts the process instead of raising `BrokenPipeError`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.machinery import ModuleSpec
from importlib.util import LazyLoader
from pathlib import Path
from types import ModuleType
from typing import Any

_LAST = ("dolfinx", "petsc4py")
_AT_FIRST_USE = "dolfinx.utils"  # imports numba (0.4 s, 55 MB); only for scripts of users
_ALL = (*_LAST, "mpi4py", "ufl", "basix")
_COMPILER = "numba"  # looked up only where nothing is compiled yet
HOW = (
    'install DOLFINx by `pip install "castfem[solver]"` (Python 3.12 or newer, Linux, x86-64), '
    "`apt install python3-dolfinx-real` (Debian 13) or "
    '`conda install -c conda-forge fenics-dolfinx "petsc=*=real*"`'
)


class _Watch:
    """An import hook that acts before these libraries are looked up."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`."""
        if name not in (_AT_FIRST_USE, _COMPILER, *_ALL):
            return None
        others = [finder for finder in sys.meta_path if finder is not self]
        if name == _AT_FIRST_USE:
            specs = (finder.find_spec(name, path, target) for finder in others)
            spec = next((spec for spec in specs if spec is not None), None)
            if spec is not None and spec.loader is not None:
                spec.loader = LazyLoader(spec.loader)
            return spec
        if not any(finder.find_spec(name, None) for finder in others):
            how = "`pip install numba` (it compiles the laws)" if name == _COMPILER else HOW
            raise ModuleNotFoundError(f"this Python has no {name}: {how}", name=name)
        if name in _LAST:
            _load_earlier()
        return None


def _load_earlier() -> None:
    options = os.environ.get("PETSC_OPTIONS", "")
    if "no_signal_handler" not in options:
        os.environ["PETSC_OPTIONS"] = f"{options} -no_signal_handler".strip()
    try:
        import h5py  # noqa: F401
    except ValueError as error:
        raise ImportError(
            "h5py cannot use the HDF5 that DOLFINx has loaded: import castfem before dolfinx",
            name="h5py",
        ) from error
    import mpi4py.MPI  # noqa: F401


def watch() -> None:
    """Install the import hook.

    Raises:
        ImportError: DOLFINx was imported before, with an HDF5 that h5py cannot use.
    """
    sys.meta_path.insert(0, _Watch())
    # pydantic 2.10 checks what it has made of the declaration of each model, 50 ms in a run.
    os.environ.setdefault("PYDANTIC_SKIP_VALIDATING_CORE_SCHEMAS", "1")
    if not sys.modules.keys().isdisjoint(_LAST):
        _load_earlier()
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGPIPE) is signal.SIG_IGN:
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # PETSc may have set its own by now


_DISPLAY = "MPLBACKEND"


def own_matplotlib() -> ModuleType:
    """Import matplotlib even if the environment names a display that this Python does not have.

    Jupyter passes its own to every program it starts. Figures of castfem need none.
    """
    display = None if "matplotlib" in sys.modules else os.environ.pop(_DISPLAY, None)
    try:
        import matplotlib
    finally:
        if display is not None:
            os.environ[_DISPLAY] = display
    if display is not None:
        with suppress(ValueError):  # for the user's own figures, if it exists
            matplotlib.rcParams["backend"] = display
    return matplotlib


@contextmanager
def own_style(settings: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Use matplotlib's defaults and these settings inside the block, without a matplotlibrc."""
    matplotlib = own_matplotlib()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(settings or {})
        yield


def cache_folder() -> Path:
    """The user's cache folder of castfem."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("castfem", appauthor=False))
