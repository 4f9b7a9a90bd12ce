"""The surface of a section unrolled: its vertices one behind the other, and what each is called."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.types import Array, Indices

if TYPE_CHECKING:
    from castfem.meshes import SectionMesh


@dataclass(frozen=True, slots=True)
class SurfaceLine:
    """The vertices of the surface in their order, counterclockwise.

    The line begins where the surface of what is modelled begins: of half a slab at mid-width of the
    extrados, and it goes round the narrow face to mid-width of the intrados.

    Attributes:
        nodes: Of the section's mesh (n,).
        place: x and y (n, 2), m.
        way: Length of surface from the beginning (n,), m.
        faces: Names of the faces.
        face: Which of them each vertex lies on (n,); a corner counts to its wide face.
        corner: Distance along the surface from the nearest corner (n,), m; 0 on an arc that is one,
            inf in a section without corners.
        closed: Whether the last vertex stands beside the first.
    """

    nodes: Indices
    place: Array
    way: Array
    faces: tuple[str, ...]
    face: Indices
    corner: Array
    closed: bool

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
