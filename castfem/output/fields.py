"""Reading fields.h5 back, for figures and for users' own scripts."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.errors import InputError
from castfem.output.xdmf import FORMAT, HDF5_NAME, open_hdf5

if TYPE_CHECKING:
    import h5py


class Fields:
    """The fields of a run, read from its folder one array at a time.

    Attributes:
        points: (n, 3) nodes [m].
        cells: (m, k) nodes of the cells, in VTK order.
        cell: "triangle" or "quadrilateral".
        order: 1 or 2, of the geometry.
        times: (t,) [s].
        positions: (t,) below the meniscus [m].
        attributes: What the run told: solidus, liquidus [K], symmetry ...
    """

    def __init__(self, folder: Path | str) -> None:
        """Opens fields.h5; also while a run is writing it.

        Raises:
            InputError: There is none, or it cannot be read.
        """
        path = Path(folder) / HDF5_NAME
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        try:
            self._file = open_hdf5(path, "r")
            self._read_head()
        except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: cannot be read ({error}); repeat the run") from error

    def _read_head(self) -> None:
        """Everything but the values."""
        self.attributes: dict[str, Any] = {
            key: value.item() if isinstance(value, np.generic) else value
            for key, value in self._file.attrs.items()
        }
        if self.attributes.pop("format", None) != FORMAT:
            raise ValueError("not written by castfem")
        self.attributes.pop("version")
        self.cell = str(self.attributes.pop("cell"))
        self.order = int(self.attributes.pop("order"))
        self.points: NDArray[np.float64] = self._file["mesh/points"][()]
        self.cells: NDArray[np.int32] = self._file["mesh/cells"][()]
        group = self._file["steps"]
        self._steps: list[h5py.Group] = [
            group[name] for name in sorted(group) if "time" in group[name].attrs
        ]
        self.times = np.array([float(step.attrs["time"]) for step in self._steps])
        self.positions = np.array([float(step.attrs["position"]) for step in self._steps])

    @property
    def names(self) -> tuple[str, ...]:
        """Of the fields; empty when no time has been written."""
        return tuple(self._steps[0]) if self._steps else ()

    def centre(self, name: str) -> str:
        """Where a field lives: "point" or "cell"."""
        return str(self._steps[0][name].attrs["centre"])

    def values(self, name: str, index: int = -1) -> NDArray[np.float64]:
        """A field at one time: (rows,), (rows, 3) or (rows, 9); `index` as in a list.

        Raises:
            InputError: No such field.
        """
        if name not in self.names:
            raise InputError(f"{self._file.filename}: no field {name}; there are {self.names}")
        return np.asarray(self._steps[index][name][()], dtype=np.float64)

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def __enter__(self) -> Fields:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
