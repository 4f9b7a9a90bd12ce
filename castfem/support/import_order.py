"""The order in which compiled libraries are loaded: h5py, then MPI, then DOLFINx and petsc4py.

Those of PyPI find MPI only where mpi4py has loaded it, and an h5py that is loaded after them meets
their HDF5 instead of its own.
"""

from __future__ import annotations

import sys

_LAST = ("dolfinx", "petsc4py")


class _Earlier:
    """A finder of modules that finds none: it loads what comes before what is asked for."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """See `importlib.abc.MetaPathFinder`."""
        if name in _LAST:
            _load()


def _load() -> None:
    try:
        import h5py  # noqa: F401
    except ValueError as error:
        raise ImportError(
            "h5py cannot use the HDF5 that DOLFINx has loaded: import castfem before dolfinx"
        ) from error
    import mpi4py.MPI  # noqa: F401


def keep() -> None:
    """Take care of the order from now on, whoever imports them.

    Raises:
        ImportError: DOLFINx was loaded before, with an HDF5 that h5py cannot use.
    """
    sys.meta_path.insert(0, _Earlier())
    if not sys.modules.keys().isdisjoint(_LAST):
        _load()
