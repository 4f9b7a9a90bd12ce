"""Reads the fields of a run, for figures and for users' scripts."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.atomic_files import Closing
from castfem.base.errors import InputError
from castfem.runs.output.field_files import HDF5_NAME, UNREADABLE, Step, open_hdf5, written

if TYPE_CHECKING:
    import h5py


class Fields(Closing):
    """The fields of a run, read from its folder one array at a time.

    Attributes:
        points: (n, 3) nodes [m].
        cells: (m, k) nodes of the cells, in VTK order.
        cell: "triangle" or "quadrilateral".
        order: Geometric order of the cells, 1 or 2.
        folder: Folder of the run.
        times: Times (t,) [s].
        positions: Positions below the meniscus (t,) [m].
        attributes: Facts about the run: solidus, liquidus [K], symmetry ...
    """

    def __init__(self, folder: Path | str) -> None:
        """Open the fields of a folder, also while a run is writing them."""
        self.folder = Path(folder)
        self._path = self.folder / HDF5_NAME
        if not self._path.is_file():
            raise InputError(f"{self._path}: no such file")
        self._file: h5py.File | None = None
        self._open()

    def _open(self) -> None:
        """Open the present fields.h5 and read everything but the values."""
        for left in (2, 1, 0):  # a run that ends meanwhile gathers them in one file
            try:
                self.close()
                before = self._path.stat()
                self._file = open_hdf5(self._path)
                self._steps: list[Step] = written(self.folder, self._file)
                if self._path.stat().st_ino == before.st_ino or not left:
                    return self._read_head(self._file)
            except FileNotFoundError as error:  # a time that has been gathered meanwhile
                if not left:
                    raise self._unreadable(error) from error
            except UNREADABLE as error:
                raise self._unreadable(error) from error
        return None

    def _unreadable(self, error: BaseException) -> InputError:
        return InputError(f"{self._path}: cannot be read ({error}); repeat the run")

    def _read_head(self, file: h5py.File) -> None:
        self.attributes: dict[str, Any] = {
            key: value.item() if isinstance(value, np.generic) else value
            for key, value in file.attrs.items()
        }
        for key in ("format", "version"):
            self.attributes.pop(key)
        self.cell = str(self.attributes.pop("cell"))
        self.order = int(self.attributes.pop("order"))
        self.points: NDArray[np.float64] = file["mesh/points"][()]
        self.cells: NDArray[np.int32] = file["mesh/cells"][()]
        self.times = np.array([step.time for step in self._steps])
        self.positions = np.array([step.position for step in self._steps])
        self._centres: dict[str, str] = {}
        if self._steps:
            with self._holding(self._steps[0]) as source:
                group = source[self._steps[0].group]
                self._centres = {name: str(v.attrs["centre"]) for name, v in group.items()}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fields; empty when no time has been written."""
        return tuple(self._centres)

    def centre(self, name: str) -> str:
        """Location of the values of a field: "point" or "cell"."""
        return self._centres[name]

    def values(self, name: str, index: int = -1) -> NDArray[np.float64]:
        """A field at one time: (rows,), (rows, 3) or (rows, 9); `index` as for a list."""
        if name not in self.names:
            raise InputError(f"{self._path}: no field {name}; there are {self.names}")
        place = range(len(self._steps))[index]
        try:
            return self._read(self._steps[place], name)
        except FileNotFoundError:  # the run has ended meanwhile
            self._open()
            return self._read(self._steps[place], name)

    def _read(self, step: Step, name: str) -> NDArray[np.float64]:
        with self._holding(step) as source:
            return np.asarray(source[step.group][name][()], dtype=np.float64)

    def _holding(self, step: Step) -> AbstractContextManager[h5py.File]:
        """The file that holds a time; fields.h5 stays open."""
        if step.single:
            opened: AbstractContextManager[h5py.File] = open_hdf5(self.folder / step.file)
            return opened
        return nullcontext(self._file)

    def close(self) -> None:
        """Close the file; may be called twice."""
        if self._file is not None:
            self._file.close()
        self._file = None
