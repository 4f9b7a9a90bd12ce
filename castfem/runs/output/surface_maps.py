"""What the surface of the strand goes through, unrolled: way round the section x way down.

    surface_maps.h5      of a run that has ended, by whatever cause
    surface_maps.rows    of one that is at work, or was killed

During the run each step adds a row to surface_maps.rows, in one piece like a row of history.csv; in
the end all rows are put into surface_maps.h5, which is written whole. What is followed over the
depth below the surface, criteria of hot tearing, stands in depth_maps.h5 in the same way; there a
line into the section stands for a face, the depth for the way round it, and the brittle range for
the band:

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
    """The vertices of the surface in their order, counterclockwise.

    The line begins where the surface of what is modelled begins: of half a slab at mid-width of the
    extrados, and it goes round the narrow face to mid-width of the intrados.
    """

    nodes: Indices  #: of the section's mesh (n,)
    place: Array  #: x and y (n, 2), m
    way: Array  #: length of surface from the beginning (n,), m
    faces: tuple[str, ...]  #: names of the faces
    face: Indices  #: which of them each vertex lies on (n,); a corner counts to its wide face
    #: distance along the surface from the nearest corner (n,), m; 0 on an arc that is one, inf in a
    #: section without corners
    corner: Array
    closed: bool  #: whether the last vertex stands beside the first

    @classmethod
    def of(cls, mesh: SectionMesh) -> SurfaceLine:
        """The surface of a mesh; lines of symmetry are no part of it."""
        outer = [i for i, name in enumerate(mesh.groups) if name in mesh.outer_groups]
        kept = np.isin(mesh.facet_group, outer)
        facets, group = mesh.facets[kept], mesh.facet_group[kept]
        after = {int(a): (int(b), int(g)) for (a, b), g in zip(facets, group, strict=True)}
        heads = after.keys() - {b for b, _ in after.values()}
        size = float(np.ptp(mesh.points, axis=0).max())
        # The lowest, of these the nearest to the middle; rounding does not choose.
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
        """The line through nodes, between each of which and the next lies a facet of a group."""
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
        """The vertex nearest to a place, m."""
        return int(np.argmin(np.hypot(*(self.place - (x, y)).T)))

    def depth(self, x: float, y: float) -> float:
        """Distance of a place from the surface, m."""
        ends = np.concatenate([self.place, self.place[:1]]) if self.closed else self.place
        start, along = ends[:-1], np.diff(ends, axis=0)
        off = np.array([x, y]) - start
        share = np.clip((off * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        found = float(np.linalg.norm(off - share[:, None] * along, axis=1).min())
        return 0.0 if found <= ROUNDING * float(np.ptp(self.place, axis=0).max()) else found

    def words(self, vertex: int) -> str:
        """Where a vertex lies: "intrados, 20 mm from the corner"."""
        face, off = self.faces[self.face[vertex]], float(self.corner[vertex])
        size = float(np.ptp(self.place, axis=0).max())
        if not np.isfinite(off):
            x, y = 1e3 * self.place[vertex]
            return f"x = {x:.1f}, y = {y:.1f} mm"
        if off <= ROUNDING * size:
            return f"{face}, corner"
        return f"{face}, {1e3 * off:.3g} mm from the corner"

    def stored(self) -> dict[str, Any]:
        """The line as JSON has it."""
        found = asdict(self)
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in found.items()}

    @classmethod
    def restored(cls, stored: Mapping[str, Any]) -> SurfaceLine:
        """The inverse of `stored`."""
        nodes, face = (np.array(stored[k], dtype=np.int64) for k in ("nodes", "face"))
        place, way, corner = (np.array(stored[k], dtype=float) for k in ("place", "way", "corner"))
        faces, closed = tuple(stored["faces"]), bool(stored["closed"])
        return cls(nodes, place, way, faces, face, corner, closed)


def face_name(group: str) -> str:
    """The face of a boundary group: a corner counts to its wide face, which is bent as a whole."""
    if not group.startswith("narrow"):
        for face in ("intrados", "extrados"):
            if face in group.split("_"):
                return face
    return "wide face" if group.startswith("corner") else group.replace("_", " ")


FORMAT = "castfem surface maps"
VERSION = 1
IN_BAND = "in_band"
SURFACE, DEPTHS = (MAPS_NAME, ROWS_NAME), (DEPTHS_NAME, DEPTH_ROWS_NAME)
"""Names of the file of a run that has ended, and of one at work."""
_ANEW = "run again without --resume"


@dataclass(frozen=True, slots=True)
class SurfaceMap:
    """One quantity over the surface."""

    name: str  #: of the map
    unit: str  #: SI
    shown: str  #: unit in which it is shown
    label: str  #: for a reader


@dataclass(frozen=True, slots=True)
class Heading:
    """What holds for all rows."""

    line: SurfaceLine  #: the vertices
    maps: tuple[SurfaceMap, ...]  #: what each row has, in this order
    band: tuple[float, float]  #: temperatures of the low-ductility band, K
    #: columns of the rolls (`castfem.physics.machine.stations.Stations.columns`); None without any
    rolls: Mapping[str, Any] | None = None
    thickness: float | None = None  #: of the section, m; None of one without
    mould_exit: float | None = None  #: m; None without a mould

    @property
    def row(self) -> np.dtype[Any]:
        """Of what a row consists."""
        values = ("<f4", (len(self.maps), len(self.line.nodes)))
        return np.dtype([("time", "<f8"), ("position", "<f8"), ("values", *values)])

    def text(self) -> str:
        """One line that reads back to the same."""
        maps = [[m.name, m.unit, m.shown, m.label] for m in self.maps]
        content = {"format": FORMAT, "version": VERSION, "line": self.line.stored(), "maps": maps}
        facts = {"band": list(self.band), **self.caster()}
        return json.dumps(content | facts) + "\n"

    def caster(self) -> dict[str, Any]:
        """What is known of the caster, as JSON has it."""
        rolls = None if self.rolls is None else dict(self.rolls)
        return {"rolls": rolls, "thickness": self.thickness, "mould_exit": self.mould_exit}

    @classmethod
    def read(cls, text: str) -> Heading:
        """The inverse of `text`."""
        found = json.loads(text)
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise ValueError("not written by castfem")
        line = SurfaceLine.restored(found["line"])
        maps = tuple(SurfaceMap(*one) for one in found["maps"])
        low, high = found["band"]
        caster = (found[key] for key in ("rolls", "thickness", "mould_exit"))
        return cls(line, maps, (low, high), *caster)


class MapWriter(Closing):
    """Adds a row a step; keeps one file open."""

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
        """Goes on with the maps of an earlier run behind so many rows."""
        there, found = _read(folder, names)
        path = folder / names[(folder / names[1]).is_file()]
        if there.text() != heading.text():
            raise InputError(f"{path}: holds other maps than this run writes; {_ANEW}")
        if len(found) < rows:
            raise InputError(
                f"{path}: has {len(found)} rows of {rows} that were written: it has been changed; "
                f"put the file back as it was, or {_ANEW}"
            )
        return cls(folder, heading, found[:rows].tobytes(), names)

    def append(self, time: float, position: float, values: Array) -> None:
        """Adds a row."""
        row = np.zeros(1, self._heading.row)
        row["time"], row["position"], row["values"] = time, position, values
        self._file.append(row.tobytes())

    def sync(self) -> None:
        """Forces the rows to disk."""
        self._file.sync()

    def close(self) -> None:
        """Puts all rows into the file of a run that has ended; nothing is lost without it."""
        if not self._file.is_open:
            return
        self._file.close()
        ended, at_work = (self._folder / name for name in self._names)
        _, rows = _read(self._folder, self._names)
        write_image(ended, lambda file: _fill(file, self._heading, rows))
        with suppress(OSError):
            at_work.unlink()


class SurfaceMaps:
    """The maps of a run, also of one that is at work or was killed.

    Attributes:
        heading: Vertices, names and units, band, rolls.
        time: (rows,), s. position: (rows,), m.
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
        """Of the maps."""
        return tuple(one.name for one in self.heading.maps)

    def __getitem__(self, name: str) -> Array:
        """A map (rows, vertices), in SI; `in_band` is 1 in the low-ductility band, else 0."""
        if name == IN_BAND:
            low, high = self.heading.band
            kelvin = self["temperature"]
            return np.asarray((kelvin > low) & (kelvin < high), float)
        return np.asarray(self._values[:, self.names().index(name)], float)


def _read(folder: Path, names: tuple[str, str]) -> tuple[Heading, np.ndarray[Any, Any]]:
    """Heading and rows, whichever file has them; a row that a kill cut off is left out."""
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
