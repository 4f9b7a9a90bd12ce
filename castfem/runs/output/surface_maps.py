"""Maps of the surface of the strand: length round the section by position along the strand.

    surface_maps.h5      of a run that has ended, by whatever cause
    surface_maps.rows    of one that is at work, or was killed

During the run each step appends a row to surface_maps.rows, in one piece like a row of history.csv;
at the end all rows are written to surface_maps.h5. Hot tearing criteria over the depth below the
surface are in depth_maps.h5 in the same format, with a line into the section in place of a face,
the depth in place of the length round the section, and the brittle range in place of the band:

    /                    attributes: format, version, band [K]
    /heading             vertices, maps and rolls as JSON
    /time, /position     (rows,) s, m
    /surface/x, y, way, corner, face    (vertices,), see `SurfaceLine`
    /maps/NAME           (rows, vertices); attributes: unit, label
    /maps/in_band        whether the temperature lies in the low-ductility band
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.atomic_files import AppendedFile, Closing, replacing
from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.types import Array, Indices
from castfem.runs.output.field_files import UNREADABLE, open_hdf5, store, write_image
from castfem.runs.output.folder import DEPTH_ROWS_NAME, DEPTHS_NAME, MAPS_NAME, ROWS_NAME

if TYPE_CHECKING:
    import h5py

    from castfem.meshes import SectionMesh


@dataclass(frozen=True, slots=True)
class SurfaceLine:
    """The vertices of the surface in counterclockwise order.

    The line begins where the modelled surface begins: for half a slab at mid-width of the extrados,
    from where it goes round the narrow face to mid-width of the intrados.
    """

    nodes: Indices  #: nodes of the section's mesh (n,)
    place: Array  #: x and y (n, 2), m
    way: Array  #: length of surface from the start (n,), m
    faces: tuple[str, ...]  #: names of the faces
    face: Indices  #: index of the face of each vertex (n,); a corner belongs to its wide face
    #: distance along the surface from the nearest corner (n,), m; 0 on the arc of a corner, inf in
    #: a section without corners
    corner: Array
    closed: bool  #: whether the last vertex is next to the first

    @classmethod
    def of(cls, mesh: SectionMesh) -> SurfaceLine:
        """The surface of a mesh, without lines of symmetry."""
        outer = [i for i, name in enumerate(mesh.groups) if name in mesh.outer_groups]
        kept = np.isin(mesh.facet_group, outer)
        facets, group = mesh.facets[kept], mesh.facet_group[kept]
        after = {int(a): (int(b), int(g)) for (a, b), g in zip(facets, group, strict=True)}
        heads = after.keys() - {b for b, _ in after.values()}
        size = float(np.ptp(mesh.points, axis=0).max())
        # The lowest vertex, of several the nearest to the middle, independent of rounding.
        ranks = np.round(mesh.points[:, :2] / (ROUNDING * size))
        first = min(heads or after, key=lambda n: (ranks[n, 1], abs(ranks[n, 0])))
        nodes, groups = [first], []
        while nodes[-1] in after:
            node, g = after.pop(nodes[-1])
            groups.append(g)
            if node == first:
                break
            nodes.append(node)
        closed = len(groups) == len(nodes)
        return cls._along(mesh, np.array(nodes), np.array(groups), closed)

    @classmethod
    def _along(
        cls, mesh: SectionMesh, nodes: Indices, groups: Indices, closed: bool
    ) -> SurfaceLine:
        """The line through nodes; neighbours are joined by a facet of one of the groups."""
        names = [face_name(name) for name in mesh.groups]
        place = np.asarray(mesh.points[nodes, :2], float)
        ends = np.concatenate([place, place[:1]]) if closed else place
        lengths = np.linalg.norm(np.diff(ends, axis=0), axis=1)
        way = np.concatenate([[0.0], np.cumsum(lengths)])
        behind = groups if closed else np.append(groups, groups[-1])
        before = np.roll(groups, 1) if closed else np.insert(groups, 0, groups[0])
        own = np.where([names[g].startswith("narrow") for g in behind], before, behind)
        rounded = np.array([name.startswith("corner") for name in mesh.groups])
        at = np.flatnonzero((behind != before) | rounded[behind] | rounded[before])
        corner = np.full(len(nodes), np.inf)
        for i in at:
            off = np.abs(way[: len(nodes)] - way[i])
            corner = np.minimum(corner, np.minimum(off, way[-1] - off) if closed else off)
        faces = tuple(dict.fromkeys(names[g] for g in own))
        face = np.array([faces.index(names[g]) for g in own])
        return cls(nodes, place, way[: len(nodes)], faces, face, corner, closed)

    def at(self, x: float, y: float) -> int:
        """Index of the vertex nearest to a point, m."""
        return int(np.argmin(np.hypot(*(self.place - (x, y)).T)))

    def depth(self, x: float, y: float) -> float:
        """Distance of a point from the surface, m."""
        ends = np.concatenate([self.place, self.place[:1]]) if self.closed else self.place
        start, along = ends[:-1], np.diff(ends, axis=0)
        off = np.array([x, y]) - start
        share = np.clip((off * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        found = float(np.linalg.norm(off - share[:, None] * along, axis=1).min())
        return 0.0 if found <= ROUNDING * float(np.ptp(self.place, axis=0).max()) else found

    def words(self, vertex: int) -> str:
        """Description of the position of a vertex: "intrados, 20 mm from the corner"."""
        face, off = self.faces[self.face[vertex]], float(self.corner[vertex])
        size = float(np.ptp(self.place, axis=0).max())
        if not np.isfinite(off):
            x, y = 1e3 * self.place[vertex]
            return f"x = {x:.1f}, y = {y:.1f} mm"
        if off <= ROUNDING * size:
            return f"{face}, corner"
        return f"{face}, {1e3 * off:.3g} mm from the corner"

    def stored(self) -> dict[str, Any]:
        """The line in JSON types."""
        found = asdict(self)
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in found.items()}

    @classmethod
    def restored(cls, stored: Mapping[str, Any]) -> SurfaceLine:
        """Inverse of `stored`."""
        nodes, face = (np.array(stored[k], dtype=np.int64) for k in ("nodes", "face"))
        place, way, corner = (np.array(stored[k], dtype=float) for k in ("place", "way", "corner"))
        faces, closed = tuple(stored["faces"]), bool(stored["closed"])
        return cls(nodes, place, way, faces, face, corner, closed)


def face_name(group: str) -> str:
    """Face of a boundary group: a corner belongs to its wide face, with which it is bent."""
    if not group.startswith("narrow"):
        for face in ("intrados", "extrados"):
            if face in group.split("_"):
                return face
    return "wide face" if group.startswith("corner") else group.replace("_", " ")


FORMAT = "castfem surface maps"
VERSION = 1
IN_BAND = "in_band"
SURFACE, DEPTHS = (MAPS_NAME, ROWS_NAME), (DEPTHS_NAME, DEPTH_ROWS_NAME)
"""Names of the files of a finished run, and of a running one."""
_ANEW = "run again without --resume"


@dataclass(frozen=True, slots=True)
class SurfaceMap:
    """A quantity mapped over the surface."""

    name: str  #: name of the map
    unit: str  #: SI
    shown: str  #: unit in which it is shown
    label: str  #: label for tables and plots


@dataclass(frozen=True, slots=True)
class Heading:
    """Data that all rows have in common."""

    line: SurfaceLine  #: the vertices
    maps: tuple[SurfaceMap, ...]  #: the maps, in the order of a row
    band: tuple[float, float]  #: temperature range of low ductility, K
    #: columns of the rolls (`castfem.physics.machine.stations.Stations.columns`); None without
    #: rolls
    rolls: Mapping[str, Any] | None = None
    thickness: float | None = None  #: thickness of the section, m; None if it has none
    mould_exit: float | None = None  #: end of the mould, m; None without a mould

    @property
    def row(self) -> np.dtype[Any]:
        """Data type of a row."""
        values = ("<f4", (len(self.maps), len(self.line.nodes)))
        return np.dtype([("time", "<f8"), ("position", "<f8"), ("values", *values)])

    def text(self) -> str:
        """The heading as one line of text, for `read`."""
        maps = [[m.name, m.unit, m.shown, m.label] for m in self.maps]
        content = {"format": FORMAT, "version": VERSION, "line": self.line.stored(), "maps": maps}
        facts = {"band": list(self.band), **self.caster()}
        return json.dumps(content | facts) + "\n"

    def caster(self) -> dict[str, Any]:
        """Data of the caster in JSON types."""
        rolls = None if self.rolls is None else dict(self.rolls)
        return {"rolls": rolls, "thickness": self.thickness, "mould_exit": self.mould_exit}

    @classmethod
    def read(cls, text: str) -> Heading:
        """Inverse of `text`."""
        found = json.loads(text)
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise ValueError("not written by castfem")
        line = SurfaceLine.restored(found["line"])
        maps = tuple(SurfaceMap(*one) for one in found["maps"])
        low, high = found["band"]
        caster = (found[key] for key in ("rolls", "thickness", "mould_exit"))
        return cls(line, maps, (low, high), *caster)


class MapWriter(Closing):
    """Appends one row per step; keeps one file open."""

    def __init__(
        self,
        folder: Path,
        heading: Heading,
        kept: bytes = b"",
        names: tuple[str, str] = SURFACE,
    ) -> None:
        self._folder, self._heading, self._names = folder, heading, names
        path = folder / names[1]
        with replacing(path) as temporary:
            temporary.write_bytes(heading.text().encode() + kept)
        self._file = AppendedFile(path)

    @classmethod
    def resume(
        cls, folder: Path, heading: Heading, rows: int, names: tuple[str, str] = SURFACE
    ) -> MapWriter:
        """Continue the maps of an earlier run after a number of rows."""
        there, found = _read(folder, names)
        path = folder / names[(folder / names[1]).is_file()]
        if there.text() != heading.text():
            raise InputError(f"{path}: has maps that differ from those of this run; {_ANEW}")
        if len(found) < rows:
            raise InputError(
                f"{path}: has {len(found)} rows of {rows} that were written: it has been changed; "
                f"restore the file, or {_ANEW}"
            )
        return cls(folder, heading, found[:rows].tobytes(), names)

    def append(self, time: float, position: float, values: Array) -> None:
        """Append a row."""
        row = np.zeros(1, self._heading.row)
        row["time"], row["position"], row["values"] = time, position, values
        self._file.append(row.tobytes())

    def sync(self) -> None:
        """Flush the rows to disk."""
        self._file.sync()

    def close(self) -> None:
        """Write all rows to the file of a finished run; without it nothing is lost."""
        if not self._file.is_open:
            return
        self._file.close()
        ended, at_work = (self._folder / name for name in self._names)
        _, rows = _read(self._folder, self._names)
        write_image(ended, lambda file: _fill(file, self._heading, rows))
        with suppress(OSError):
            at_work.unlink()


class SurfaceMaps:
    """The maps of a run, also of a running or killed one.

    Attributes:
        heading: Vertices, names and units, band, rolls.
        time: Times of the rows (rows,), s.
        position: Positions of the rows (rows,), m.
    """

    def __init__(self, folder: Path | str, names: tuple[str, str] = SURFACE) -> None:
        self.heading, rows = _read(Path(folder), names)
        self.time, self.position = np.array(rows["time"]), np.array(rows["position"])
        self._values = rows["values"]

    @staticmethod
    def exist(folder: Path, names: tuple[str, str] = SURFACE) -> bool:
        """Whether a run has written maps."""
        return any((folder / name).is_file() for name in names)

    def names(self) -> tuple[str, ...]:
        """Names of the maps."""
        return tuple(one.name for one in self.heading.maps)

    def __getitem__(self, name: str) -> Array:
        """A map (rows, vertices), in SI; `in_band` is 1 in the low-ductility band, else 0."""
        if name == IN_BAND:
            low, high = self.heading.band
            kelvin = self["temperature"]
            return np.asarray((kelvin > low) & (kelvin < high), float)
        return np.asarray(self._values[:, self.names().index(name)], float)


def _read(folder: Path, names: tuple[str, str]) -> tuple[Heading, np.ndarray[Any, Any]]:
    """Heading and rows from whichever file exists; an incomplete last row is dropped."""
    path = folder / names[1]
    try:
        if path.is_file():
            head, _, content = path.read_bytes().partition(b"\n")
            heading = Heading.read(head.decode())
            whole = len(content) // heading.row.itemsize * heading.row.itemsize
            return heading, np.frombuffer(content[:whole], heading.row)
        path = folder / names[0]
        with open_hdf5(path) as file:
            heading = Heading.read(file["heading"][()].decode())
            rows = np.zeros(file["time"].shape, heading.row)
            rows["time"], rows["position"] = file["time"][()], file["position"][()]
            for i, one in enumerate(heading.maps):
                rows["values"][:, i] = file["maps"][one.name][()]
            return heading, rows
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; {_ANEW}") from error
    except UNREADABLE as error:
        raise InputError(f"{path}: cannot be read ({error}); {_ANEW}") from error


def _fill(file: h5py.File, heading: Heading, rows: np.ndarray[Any, Any]) -> None:
    file.attrs["format"], file.attrs["version"] = FORMAT, VERSION
    file["heading"] = heading.text()
    file.attrs["band"] = heading.band
    store(file, "time", np.array(rows["time"])).attrs["unit"] = "s"
    store(file, "position", np.array(rows["position"])).attrs["unit"] = "m"
    line, surface = heading.line, file.create_group("surface")
    for name, values in zip("xy", line.place.T, strict=True):
        store(surface, name, np.array(values)).attrs["unit"] = "m"
    store(surface, "way", line.way).attrs["unit"] = "m"
    store(surface, "corner", line.corner).attrs["unit"] = "m"
    store(surface, "face", line.face).attrs["names"] = list(line.faces)
    maps = file.create_group("maps")
    for i, one in enumerate(heading.maps):
        found = store(maps, one.name, np.ascontiguousarray(rows["values"][:, i]))
        found.attrs["unit"], found.attrs["label"] = one.unit, one.label
        if one.name == "temperature":
            kelvin, (low, high) = rows["values"][:, i].astype(float), heading.band
            inside = (kelvin > low) & (kelvin < high)
            store(maps, IN_BAND, inside.astype(np.uint8)).attrs["unit"] = "-"
