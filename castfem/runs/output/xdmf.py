"""Writes fields over time to fields.xdmf, for ParaView, VisIt and meshio; values are in HDF5 files.

The XDMF has one temporal collection with one grid per time that contains all fields, so that
colouring, Warp By Vector and Plot Over Line work without merging; an Information element of each
grid names the units of its fields. `castfem.runs.output.field_files` explains where the values are,
and why a kill cannot damage them.

Values are in single precision by default: this resolves 1e-4 K at casting temperature and 10 Pa in
100 MPa, and halves the files; runs are restarted from checkpoint.h5, not from here. Points, times
and positions are in double precision.

Each write stores the values before the XDMF names them, and the XDMF is replaced atomically: it may
be opened at any moment, during the run and after a kill.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from castfem.base import log
from castfem.base.atomic_files import Closing, GrowingFile, saving
from castfem.base.constants import same_or_before
from castfem.base.errors import InputError, RunFailure
from castfem.runs.output import field_files
from castfem.runs.output.field_files import HDF5_NAME, UNREADABLE, Step, open_hdf5
from castfem.runs.output.layout import UNITS, components, vtk_cells

if TYPE_CHECKING:
    import h5py

XDMF_NAME = "fields.xdmf"

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
_ANEW = "run again without --resume"


class FieldWriter(Closing):
    """Appends the fields at successive times to fields.xdmf; keeps no file open.

    Attributes:
        times: Times written so far [s].
    """

    _folder: Path
    _steps: list[Step]
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
        """Start new files.

        Args:
            folder: Existing output folder.
            points: (n, 2) or (n, 3) coordinates of the nodes [m].
            cells: (m, k) nodes of the cells in DOLFINx order.
            cell: "triangle" or "quadrilateral".
            order: Geometric order of the cells, 1 or 2.
            dtype: Type of the values, float32 or float64.
            attributes: Facts for readers of the fields: solidus, liquidus [K], symmetry ("quarter",
                "half", "whole").

        Raises:
            RunFailure: The files cannot be written.
            ValueError: The mesh is invalid.
        """
        corners = np.asarray(points, dtype=np.float64)
        if corners.ndim != 2 or corners.shape[1] not in (2, 3):
            raise ValueError(f"points are {corners.shape}, not (n, 2) or (n, 3)")
        table = vtk_cells(cells, cell, order)
        if table.size and not 0 <= table.min() <= table.max() < len(corners):
            raise ValueError("cells name nodes that do not exist")
        if corners.shape[1] == 2:
            corners = np.column_stack([corners, np.zeros(len(corners))])
        self._folder = Path(folder)
        facts = {**(attributes or {}), "cell": cell, "order": order}
        self._layout = {}
        self._name_all([])
        field_files.begin(self._folder, corners, table, facts, dtype)
        with open_hdf5(self._folder / HDF5_NAME) as file:
            self._read_mesh_facts(file)

    @classmethod
    def resume(
        cls, folder: Path | str, time: float, names: Iterable[str] | None = None
    ) -> FieldWriter:
        """Continue the files of an earlier run; drop what was written after `time` [s]."""
        path = Path(folder) / HDF5_NAME
        if not path.is_file():
            raise InputError(
                f"{path}: no such file, the run wrote no fields; set output.fields=[], or {_ANEW}"
            )
        writer = cls.__new__(cls)
        writer._folder, writer._layout = Path(folder), {}
        try:
            with open_hdf5(path) as file:
                everything = field_files.written(writer._folder, file)
                writer._read_mesh_facts(file)
            kept = [step for step in everything if same_or_before(step.time, time)]
            if kept:
                with open_hdf5(writer._folder / kept[-1].file) as file:
                    writer._read_layout(file[kept[-1].group])
        except UNREADABLE as error:
            raise InputError(f"{path}: cannot be read ({error}); {_ANEW}") from error
        if names is not None and kept and set(names) != writer._layout.keys():
            there = ", ".join(sorted(writer._layout))
            raise InputError(f"{path}: holds {there}; set output.fields to these, or {_ANEW}")
        writer._drop(everything, kept)
        return writer

    @property
    def times(self) -> list[float]:
        """Times written so far [s]."""
        return [step.time for step in self._steps]

    def write(
        self,
        time: float,
        position: float,
        point_fields: Mapping[str, ArrayLike] | None = None,
        cell_fields: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        """Append one time; on return it is complete on disk.

        Args:
            time: Time since the meniscus [s], later than the last.
            position: Position below the meniscus [m].
            point_fields: Values at the nodes by name, shapes as in `components`.
            cell_fields: Values in the cells by name. The names must be the same at every time.

        Raises:
            RunFailure: The files cannot be written; the previous times are still there.
            ValueError: The set of fields differs, a shape is wrong, or the time is not later.
        """
        last = self._steps[-1] if self._steps else None
        if last is not None and not time > last.time:
            raise ValueError(f"time {time} s is not after {last.time} s")
        fields = self._prepare("point", point_fields or {})
        cell_values = self._prepare("cell", cell_fields or {})
        if fields.keys() & cell_values.keys():
            raise ValueError(f"point and cell fields share {fields.keys() & cell_values.keys()}")
        fields |= cell_values
        layout = {name: (centre, _width(values)) for name, (centre, values) in fields.items()}
        if last is not None and layout != self._layout:
            raise ValueError(f"fields {layout} differ from those before, {self._layout}")
        number = 0 if last is None else last.number + 1
        step = field_files.add(self._folder, number, float(time), float(position), fields)
        self._layout = layout
        self._append(step)
        self._xdmf.publish()

    def close(self) -> None:
        """Gather all times in fields.h5; nothing is lost if this is omitted or fails."""
        try:
            if any(step.single for step in self._steps):
                self._gather()
        except (RunFailure, *UNREADABLE) as error:
            log.logger.warning("the fields stay in single files: %s", error)
        self._xdmf.close()

    def _drop(self, everything: list[Step], kept: list[Step]) -> None:
        """Keep some times and remove the others from disk."""
        self._name_all(kept)  # before the values are removed: it never names missing ones
        field_files.remove_singles(self._folder, keep=kept)
        if any(not step.single for step in set(everything) - set(kept)):
            self._gather()

    def _gather(self) -> None:
        gathered = field_files.gather(self._folder, self._steps)
        self._xdmf.close()
        self._name_all(gathered)
        field_files.remove_singles(self._folder)

    def _name_all(self, steps: list[Step]) -> None:
        """Rewrite the XDMF file for these times; remove it if there are none."""
        path = self._folder / XDMF_NAME
        self._xdmf = GrowingFile(path, _HEAD, _FOOT)
        self._steps = []
        for step in steps:
            self._append(step)
        if steps:
            self._xdmf.publish(durable=True)
        else:
            with saving(path):
                path.unlink(missing_ok=True)

    def _read_mesh_facts(self, file: h5py.File) -> None:
        """Read what is the same in all grids: the mesh as XDMF, rows and type of fields."""
        nodes = file["mesh/points"].shape[0]
        count, width = file["mesh/cells"].shape
        topology = _TOPOLOGY[file.attrs["cell"], int(file.attrs["order"])]
        self._rows = {"point": nodes, "cell": count}
        self._dtype = np.dtype(file["steps"].attrs["dtype"])
        cells = _item(HDF5_NAME, "/mesh/cells", (count, width), np.dtype(np.int32))
        points = _item(HDF5_NAME, "/mesh/points", (nodes, 3), np.dtype(np.float64))
        self._mesh = (
            f'<Topology TopologyType="{topology}" NumberOfElements="{count}">{cells}</Topology>\n'
            f'<Geometry GeometryType="XYZ">{points}</Geometry>\n'
        )

    def _read_layout(self, group: h5py.Group) -> None:
        self._layout = {
            field: (str(values.attrs["centre"]), _width(values)) for field, values in group.items()
        }

    def _prepare(
        self, centre: str, fields: Mapping[str, ArrayLike]
    ) -> dict[str, tuple[str, NDArray[Any]]]:
        """Convert the fields of one centre to the written shape and type."""
        prepared = {}
        for name, values in fields.items():
            if not name or set(name) & set("/:.\\"):
                raise ValueError(f"a field cannot be named {name!r}")
            array = components(values, self._rows[centre], name)
            prepared[name] = (centre, np.ascontiguousarray(array, dtype=self._dtype))
        return prepared

    def _append(self, step: Step) -> None:
        units = {"time": "s", "position": "m", "coordinates": "m"}
        units |= {name: UNITS[name] for name in sorted(self._layout) if name in UNITS}
        listed = ", ".join(f"{name} [{unit}]" for name, unit in units.items())
        grid = [
            f'<Grid Name="strand" GridType="Uniform"><Time Value="{step.time!r}"/>'
            f'<Information Name="position" Value="{step.position!r}"/>\n'
            f'<Information Name="units" Value="{listed}"/>\n'
            f"{self._mesh}"
        ]
        for field, (centre, width) in sorted(self._layout.items()):
            rows = self._rows[centre]
            shape = (rows,) if width == 1 else (rows, width)
            values = _item(step.file, f"/{step.group}/{field}", shape, self._dtype)
            grid.append(
                f'<Attribute Name="{escape(field)}" AttributeType="{_KINDS[width]}" '
                f'Center="{_CENTRES[centre]}">{values}</Attribute>\n'
            )
        grid.append("</Grid>\n")
        self._xdmf.extend("".join(grid))
        self._steps.append(step)


def _width(values: NDArray[Any] | h5py.Dataset) -> int:
    return int(values.shape[1]) if len(values.shape) == 2 else 1


def _item(file: str, path: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> str:
    """XDMF element of an array in an HDF5 file."""
    number = "Int" if dtype.kind == "i" else "Float"
    return (
        f'<DataItem Dimensions="{" ".join(map(str, shape))}" NumberType="{number}" '
        f'Precision="{dtype.itemsize}" Format="HDF">{file}:{path}</DataItem>'
    )
