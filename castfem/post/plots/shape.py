"""The shape of a section: its outline, its deformation, and the magnification of that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from castfem.base.constants import ROUNDING
from castfem.base.types import Array
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.plots.style import STYLE, round_factor
from castfem.runs.output.fields import Fields

Indices = NDArray[np.intp]

# Edges of a cell in VTK order as chains of nodes, anticlockwise.
_EDGES = {
    ("triangle", 1): ((0, 1), (1, 2), (2, 0)),
    ("quadrilateral", 1): ((0, 1), (1, 2), (2, 3), (3, 0)),
    ("triangle", 2): ((0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0)),
    ("quadrilateral", 2): ((0, 4), (4, 1), (1, 5), (5, 2), (2, 6), (6, 3), (3, 7), (7, 0)),
}
_PLANES = {"quarter": (0, 1), "half": (0,)}  # the axis that is 0 on each plane of symmetry


@dataclass(frozen=True, slots=True)
class Outline:
    """The boundary of the modelled part, as straight pieces between nodes."""

    #: (s, 2) nodes of the pieces of the strand's surface, with the steel on their left
    surface: Indices
    #: pieces (c, 2) on each plane of symmetry, by the axis that is 0 on it
    cuts: dict[int, Indices]

    @classmethod
    def of(cls, fields: Fields) -> Outline:
        """Find the pieces that belong to one cell only."""
        chains = np.array(_EDGES[fields.cell, fields.order])
        pieces = fields.cells[:, chains].reshape(-1, 2).astype(np.intp)
        _, first, count = np.unique(
            np.sort(pieces, axis=1), axis=0, return_index=True, return_counts=True
        )
        pieces = pieces[np.sort(first[count == 1])]
        ends = fields.points[pieces]
        near = 1e-9 * float(np.ptp(fields.points[:, :2], axis=0).max())
        free = np.ones(len(pieces), dtype=bool)
        cuts = {}
        for axis in _PLANES.get(str(fields.attributes.get("symmetry")), ()):
            on_plane = (np.abs(ends[:, :, axis]) < near).all(axis=1)
            cuts[axis] = pieces[on_plane]
            free &= ~on_plane
        return cls(pieces[free], cuts)

    @property
    def everything(self) -> Indices:
        """All pieces."""
        return np.vstack([self.surface, *self.cuts.values()])

    def chains(self) -> list[Indices]:
        """The nodes of the surface in order; a closed surface ends where it begins."""
        after = {int(start): int(end) for start, end in self.surface}
        heads = list(after.keys() - set(after.values()))
        found = []
        while after:
            chain = [heads.pop() if heads else next(iter(after))]
            while chain[-1] in after:
                chain.append(after.pop(chain[-1]))
            found.append(np.array(chain, dtype=np.intp))
        return found

    def outward(self, points: Array) -> tuple[Indices, Array]:
        """The nodes of the surface (n,) and unit normals out of the steel (n, 2) there."""
        along = points[self.surface[:, 1], :2] - points[self.surface[:, 0], :2]
        sums = np.zeros((len(points), 2))
        for end in (0, 1):
            np.add.at(sums, self.surface[:, end], np.column_stack([along[:, 1], -along[:, 0]]))
        nodes = np.unique(self.surface)
        normals = sums[nodes]
        return nodes, normals / np.linalg.norm(normals, axis=1)[:, None]


@dataclass(frozen=True, slots=True)
class WallLine:
    """The wall around the modelled part of a section; NaN separates its pieces."""

    start: Array  #: (n, 2) at the meniscus [m]
    moved: Array  #: (n, 2) displacement of these points since then [m]: the taper

    @classmethod
    def of(cls, fields: Fields, index: int) -> WallLine | None:
        """Make it from the run's case; None without a mould at that time or a valid case."""
        from castfem.model import Case, read_case
        from castfem.model.mould_from_case import build_mould

        file, position = fields.folder / CASE_NAME, float(fields.positions[index])
        case = read_case(file).sound if file.is_file() else None
        if not isinstance(case, Case) or case.mould is None:
            return None
        mould = build_mould(case.mould, case.section)
        if position > mould.length * (1.0 + ROUNDING):
            return None
        start, now = (
            np.concatenate([s.points(STYLE.segment) for s in mould.contour(place).segments])
            for place in (0.0, position)
        )
        near = ROUNDING * float(np.abs(start).max())
        for axis in _PLANES.get(str(fields.attributes.get("symmetry")), ()):
            start[start[:, axis] < -near] = np.nan
        return cls(start, now - start)

    def drawn(self, factor: float) -> Array:
        """The wall (n, 2) [m], with the taper magnified."""
        return self.start + factor * self.moved


@dataclass(frozen=True, slots=True)
class Distortion:
    """The deformation of a section, and the wall of its mould."""

    points: Array  #: (n, 2) nodes at the meniscus [m]
    outline: Outline  #: the boundary
    moved: Array  #: (n, 2) displacement of the nodes [m]
    wall: WallLine | None  #: wall of the mould; None if there is none

    @classmethod
    def of(cls, fields: Fields, index: int = -1) -> Distortion:
        """Read it; `index` of the time as for a list."""
        wall = WallLine.of(fields, index)
        return cls(fields.points[:, :2], Outline.of(fields), displacement(fields, index), wall)

    def places(self, factor: float) -> Array:
        """All points (m, 2) [mm] to be drawn, with displacement and taper magnified."""
        found = [self.points, self.points + factor * self.moved]
        if self.wall is not None:
            wall = self.wall.drawn(factor)
            found.append(wall[np.isfinite(wall).all(axis=1)])
        return 1e3 * np.vstack(found)

    def factor(self, share: float = STYLE.moves) -> float:
        """The `magnification` of the displacement of its surface."""
        return magnification(self.moved[np.unique(self.outline.surface)], self.points, share)


def displacement(fields: Fields, index: int = -1) -> Array:
    """Displacement (n, 2) [m] of the nodes, 0 for a run without mechanics."""
    if "displacement" not in fields.names:
        return np.zeros((len(fields.points), 2))
    return fields.values("displacement", index)[:, :2]


def magnification(moved: Array, points: Array, share: float = STYLE.moves) -> float:
    """The largest factor 1, 2, 5, 10 ... that moves nothing by more than a fraction of a side."""
    largest = float(np.linalg.norm(moved, axis=-1).max(initial=0.0))
    room = share * float(np.ptp(points[:, :2], axis=0).min())
    if largest <= 0.0 or not np.isfinite(largest):
        return 1.0
    return round_factor(room / largest)


def von_mises(fields: Fields, index: int = -1) -> Array | None:
    """Von Mises stress (n,) [Pa] at the nodes; None without, or where mechanics have ended."""
    if "von_mises" in fields.names:
        found = fields.values("von_mises", index)
    elif "stress" in fields.names:
        stress = fields.values("stress", index).reshape(-1, 3, 3)
        deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
        found = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
    else:
        return None
    return None if np.isnan(found).any() else np.asarray(found)
