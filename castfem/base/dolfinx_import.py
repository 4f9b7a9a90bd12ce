"""How DOLFINx is imported: after h5py and MPI; where there is none, with a word how to get it.

DOLFINx and petsc4py of PyPI find MPI only where mpi4py has loaded it, and an h5py that is loaded
after them meets their HDF5 instead of its own.
"""

from __future__ import annotations

import sys

_LAST = ("dolfinx", "petsc4py")
_ALL = (*_LAST, "mpi4py", "ufl", "basix")
HOW = (
    'install DOLFINx by `pip install "castfem[solver]"` (Python 3.12 or newer, Linux, x86-64), '
    "`apt install python3-dolfinx-real` (Debian 13) or "
    '`conda install -c conda-forge fenics-dolfinx "petsc=*=real*"`'
)


class _Watch:
    """A finder of modules that finds none: it acts before these are looked for."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """See `importlib.abc.MetaPathFinder`."""
        others = [finder for finder in sys.meta_path if finder is not self]
        if name in _ALL and not any(finder.find_spec(name, None) for finder in others):
            raise ModuleNotFoundError(f"this Python has no {name}: {HOW}", name=name)
        if name in _LAST:
            _load_earlier()


def _load_earlier() -> None:
    try:
        import h5py  # noqa: F401
    except ValueError as error:
        raise ImportError(
            "h5py cannot use the HDF5 that DOLFINx has loaded: import castfem before dolfinx",
            name="h5py",
        ) from error
    import mpi4py.MPI  # noqa: F401


def watch() -> None:
    """Watch from now on, whoever imports it.

    Raises:
        ImportError: DOLFINx was imported before, with an HDF5 that h5py cannot use.
    """
    sys.meta_path.insert(0, _Watch())
    if not sys.modules.keys().isdisjoint(_LAST):
        _load_earlier()
