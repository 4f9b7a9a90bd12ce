"""Fields over time in fields.xdmf + fields.h5, for ParaView, VisIt and meshio.

The XDMF holds one temporal collection and in it one grid a time, each with all its fields, so that
colouring, Warp By Vector and Plot Over Line work without merging anything. Numbers are in the HDF5:

    /                    attributes: format, version, cell, order and what the caller tells
    /mesh/points         (n, 3) m
    /mesh/cells          (m, k) in VTK node order
    /steps/000000/NAME   (n,), (n, 3) or (n, 9) values; attributes of the group: time, position

Values are single precision unless asked for: it resolves 1e-4 K at casting temperature and 10 Pa in
100 MPa, halves the file, and a run is restarted from checkpoint.h5, never from here. Points, times
and positions are double.

Each write puts the numbers on disk before the XDMF names them, and the XDMF is replaced in one
step. The HDF5 is never locked: ParaView may open it during the run.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from castfem.errors import InputError, RunFailure
from castfem.output.files import GrowingFile, saving
from castfem.output.layout import components, vtk_cells

if TYPE_CHECKING:
    import h5py

XDMF_NAME = "fields.xdmf"
HDF5_NAME = "fields.h5"
FORMAT = "castfem fields"
VERSION = 1

_TOPOLOGY = {
    ("triangle", 1): "Triangle",
    ("quadrilateral", 1): "Quadrilateral",
    ("triangle", 2): "Triangle_6",
    ("quadrilateral", 2): "Quadrilateral_9",
}
_HEAD = (
    '<?xml version="1.0"?>\n<Xdmf Version="3.0">\n<Domain>\n'
    '<Grid Name="strand" GridType="Collection" CollectionType="Temporal">\n'
)
_FOOT = "</Grid>\n</Domain>\n</Xdmf>\n"
_KINDS = {1: "Scalar", 3: "Vector", 9: "Tensor"}
_CENTRES = {"point": "Node", "cell": "Cell"}
_COMPRESS_FROM = 65536  # bytes; below, the chunk index and the filter cost more than they save
_OVERHEAD = 4096  # bytes of HDF5's own an array costs at most


class FieldWriter:
    """Appends the fields of one time after another to fields.xdmf and fields.h5.

    Attributes:
        times: Written so far [s].
    """

    times: list[float]
    _path: Path
    _file: h5py.File
    _layout: dict[str, tuple[str, int]]
    _xdmf: GrowingFile
    _rows: dict[str, int]
    _dtype: np.dtype[Any]
    _mesh: str

    def __init__(
        self,
        folder: Path | str,
        points: ArrayLike,
        cells: ArrayLike,
        cell: str,
        order: int,
        *,
        dtype: DTypeLike = np.float32,
        attributes: Mapping[str, float | str] | None = None,
    ) -> None:
        """Begins both files anew.

        Args:
            folder: Where they go; it exists.
            points: (n, 2) or (n, 3) coordinates of the nodes [m].
            cells: (m, k) nodes of the cells in DOLFINx order.
            cell: "triangle" or "quadrilateral".
            order: 1 or 2, of the geometry.
            dtype: float32 or float64, of the values.
            attributes: What a reader of the fields alone should know: solidus, liquidus [K],
                symmetry ("quarter", "half", "whole").

        Raises:
            RunFailure: They cannot be written.
            ValueError: The mesh is no mesh.
        """
        corners = np.asarray(points, dtype=np.float64)
        if corners.ndim != 2 or corners.shape[1] not in (2, 3):
            raise ValueError(f"points are {corners.shape}, not (n, 2) or (n, 3)")
        table = vtk_cells(cells, cell, order)
        if table.size and not 0 <= table.min() <= table.max() < len(corners):
            raise ValueError("cells name nodes that are not there")
        if corners.shape[1] == 2:
            corners = np.column_stack([corners, np.zeros(len(corners))])
        with saving(Path(folder) / HDF5_NAME):
            self._bind(Path(folder), open_hdf5(Path(folder) / HDF5_NAME, "w"))
        with self._saving():
            self._reserve(corners.nbytes + table.nbytes, 2)
            facts = {"format": FORMAT, "version": VERSION, "cell": cell, "order": order}
            for key, value in {**(attributes or {}), **facts}.items():
                self._file.attrs[key] = value
            _store(self._file, "mesh/points", corners)
            _store(self._file, "mesh/cells", table)
            self._file.create_group("steps").attrs["dtype"] = np.dtype(dtype).name
            self._read_mesh_facts()
            self._file.flush()
        self._xdmf.publish()

    @classmethod
    def resume(cls, folder: Path | str, time: float) -> FieldWriter:
        """Opens the files of an earlier run and drops what was written after `time` [s].

        Raises:
            InputError: There are none, or they cannot be read.
            RunFailure: They cannot be written.
        """
        path = Path(folder) / HDF5_NAME
        mend = "run again without --resume"
        if not path.is_file():
            raise InputError(f"{path}: no such file; {mend}")
        try:
            writer = cls.__new__(cls)
            writer._bind(Path(folder), open_hdf5(path, "r+"))
            if writer._file.attrs.get("format") != FORMAT:
                raise InputError(f"{path}: not written by castfem; {mend}")
            later = writer._recover(time)
        except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: cannot be read ({error}); {mend}") from error
        writer._xdmf.publish()  # before the numbers go, so that the XDMF never names what is gone
        with writer._saving():
            for name in later:
                del writer._file["steps"][name]
            writer._file.flush()
        return writer

    def write(
        self,
        time: float,
        position: float,
        point_fields: Mapping[str, ArrayLike] | None = None,
        cell_fields: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        """Appends one time; when it returns, both files are complete on disk.

        Args:
            time: Since the meniscus [s], later than the last.
            position: Below the meniscus [m].
            point_fields: Name to values at the nodes, shapes as in `components`.
            cell_fields: Name to values in the cells. Both name the same fields at every time.

        Raises:
            RunFailure: They cannot be written; the times before are still there.
            ValueError: Another set of fields than before, a wrong shape, or not a later time.
        """
        if self.times and not time > self.times[-1]:
            raise ValueError(f"time {time} s is not after {self.times[-1]} s")
        fields = self._prepare("point", point_fields or {})
        cell_values = self._prepare("cell", cell_fields or {})
        if fields.keys() & cell_values.keys():
            raise ValueError(f"point and cell fields share {fields.keys() & cell_values.keys()}")
        fields |= cell_values
        layout = {name: (centre, _width(values)) for name, (centre, values) in fields.items()}
        if self.times and layout != self._layout:
            raise ValueError(f"fields {layout} differ from those before, {self._layout}")
        name = f"{len(self.times):06d}"
        with self._saving():
            self._reserve(sum(values.nbytes for _, values in fields.values()), len(fields))
            step = self._file["steps"].create_group(name)
            for field, (centre, values) in fields.items():
                _store(step, field, values).attrs["centre"] = centre
            # the time comes last: a step that has none was cut off while it was written
            step.attrs["position"] = float(position)
            step.attrs["time"] = float(time)
            self._file.flush()
        self._layout = layout
        self._append(name, float(time), float(position))
        self._xdmf.publish()

    def close(self) -> None:
        """Closes the files; nothing is lost without it."""
        self._xdmf.close()
        with self._saving():
            self._file.close()

    def __enter__(self) -> FieldWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _bind(self, folder: Path, file: h5py.File) -> None:
        """Sets up an object without any time."""
        self.times = []
        self._path = folder
        self._file = file
        self._layout = {}
        self._xdmf = GrowingFile(folder / XDMF_NAME, _HEAD, _FOOT)

    @contextmanager
    def _saving(self) -> Iterator[None]:
        """As `saving`; after a failure the file is given up, or HDF5 would fail again at exit."""
        try:
            with saving(self._path / HDF5_NAME):
                yield
        except RunFailure:
            with suppress(OSError, RuntimeError):
                self._file.close()
            raise

    def _reserve(self, size: int, arrays: int) -> None:
        """Makes sure that the disk has room for some bytes in some arrays.

        HDF5 does not survive a write that fails: the file could not be read again, nor the process
        end in order.
        """
        needed = self._file.id.get_filesize() + size + _OVERHEAD * (arrays + 4)
        handle = os.open(self._path / HDF5_NAME, os.O_WRONLY)
        try:
            if os.fstat(handle).st_size < needed:
                os.posix_fallocate(handle, 0, needed)
        finally:
            os.close(handle)

    def _read_mesh_facts(self) -> None:
        """What is constant in every grid: its mesh as XDMF, the rows and type of its fields."""
        nodes = self._file["mesh/points"].shape[0]
        count, width = self._file["mesh/cells"].shape
        topology = _TOPOLOGY[self._file.attrs["cell"], int(self._file.attrs["order"])]
        self._rows = {"point": nodes, "cell": count}
        self._dtype = np.dtype(self._file["steps"].attrs["dtype"])
        self._mesh = (
            f'<Topology TopologyType="{topology}" NumberOfElements="{count}">'
            f"{_item('/mesh/cells', (count, width), np.dtype(np.int32))}</Topology>\n"
            f'<Geometry GeometryType="XYZ">'
            f"{_item('/mesh/points', (nodes, 3), np.dtype(np.float64))}</Geometry>\n"
        )

    def _recover(self, time: float) -> list[str]:
        """Takes up the complete steps up to `time` and returns the names of all others."""
        self._read_mesh_facts()
        dropped = []
        for name in sorted(self._file["steps"]):
            step = self._file["steps"][name]
            if not same_or_before(step.attrs.get("time", np.inf), time):
                dropped.append(name)
                continue
            self._layout = {
                field: (str(values.attrs["centre"]), _width(values))
                for field, values in step.items()
            }
            self._append(name, float(step.attrs["time"]), float(step.attrs["position"]))
        return dropped

    def _prepare(
        self, centre: str, fields: Mapping[str, ArrayLike]
    ) -> dict[str, tuple[str, NDArray[Any]]]:
        """The fields of one centre in the shape and type they are written in."""
        prepared = {}
        for name, values in fields.items():
            if not name or set(name) & set("/:.\\"):
                raise ValueError(f"a field cannot be named {name!r}")
            array = components(values, self._rows[centre], name)
            prepared[name] = (centre, np.ascontiguousarray(array, dtype=self._dtype))
        return prepared

    def _append(self, name: str, time: float, position: float) -> None:
        """Adds one grid to the text of the XDMF."""
        grid = [
            f'<Grid Name="strand" GridType="Uniform"><Time Value="{time!r}"/>'
            f'<Information Name="position" Value="{position!r}"/>\n{self._mesh}'
        ]
        for field, (centre, width) in sorted(self._layout.items()):
            rows = self._rows[centre]
            shape = (rows,) if width == 1 else (rows, width)
            grid.append(
                f'<Attribute Name={quoteattr(field)} AttributeType="{_KINDS[width]}" '
                f'Center="{_CENTRES[centre]}">'
                f"{_item(f'/steps/{name}/{field}', shape, self._dtype)}</Attribute>\n"
            )
        grid.append("</Grid>\n")
        self._xdmf.extend("".join(grid))
        self.times.append(time)


def same_or_before(time: float, limit: float) -> bool:
    """Whether a time [s] is not after another, give or take the digits a text file keeps."""
    return bool(time <= limit + 1e-9 * max(1.0, abs(limit)))


def open_hdf5(path: Path, mode: str) -> h5py.File:
    """Opens without a lock, so that a viewer may read while the run writes.

    The format is HDF5 1.8's: its metadata have check sums, and less of them changes in place while
    a step is added than in the format before, which is what a kill in that instant could damage.
    The formats after it mark a file as open, and a killed run would have to be cleared by hand.
    """
    import h5py

    return h5py.File(path, mode, locking=False, libver=("v108", "v108"))


def _store(group: h5py.Group, name: str, values: NDArray[Any]) -> h5py.Dataset:
    """Stores one array, lightly compressed when it is large."""
    if values.nbytes < _COMPRESS_FROM:
        return group.create_dataset(name, data=values)
    return group.create_dataset(
        name,
        data=values,
        chunks=_chunks(values),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
    )


def _chunks(values: NDArray[Any]) -> tuple[int, ...]:
    """Chunks of about a megabyte, whole rows."""
    row = values.nbytes // len(values)
    return (max(1, min(len(values), 1_000_000 // row)), *values.shape[1:])


def _width(values: NDArray[Any] | h5py.Dataset) -> int:
    """Number of components of a stored field."""
    return int(values.shape[1]) if len(values.shape) == 2 else 1


def _item(path: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> str:
    """The XDMF of one array in the HDF5."""
    number = "Int" if dtype.kind == "i" else "Float"
    return (
        f'<DataItem Dimensions="{" ".join(map(str, shape))}" NumberType="{number}" '
        f'Precision="{dtype.itemsize}" Format="HDF">{HDF5_NAME}:{path}</DataItem>'
    )
