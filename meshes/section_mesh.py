"""The mesh of a cross-section as plain arrays: what every builder returns and the engine takes."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from castfem.meshes import quality as _quality
from castfem.meshes.quality import Quality

# Local number of the node in the middle of each side, sides in the order of `edges_of`.
_MIDDLES = {"quadrilateral": (4, 6, 7, 5), "triangle": (5, 3, 4)}

_ENDS = slice(None, -1), slice(1, None)  # starts and ends of the segments of a polyline
_HAIR = 1e-2  # distance beyond a facet, relative to its length, that still counts as inside
_INNER = ("symmetry_", "side_", "core_end")


@dataclass(frozen=True, slots=True, eq=False)
class SectionMesh:
    """Mesh of a section, or of the half or quarter of it that symmetry leaves to be modelled.

    x runs along the width, y along the thickness, the origin is the centre of the section.
    """

    points: np.ndarray  #: nodes (n, 2), m
    #: nodes of each cell (m, k) in DOLFINx order: triangles as gmsh at first order, quadrilaterals
    #: in tensor order; then the nodes of the sides and of the inside
    cells: np.ndarray
    cell: str  #: "triangle" or "quadrilateral"
    order: int  #: 1 or 2; at second order the nodes of curved sides lie on the true arc
    facets: np.ndarray  #: vertices (f, 2) of the boundary facets, the section on their left
    facet_group: np.ndarray  #: index (f,) into `groups` for each facet
    groups: tuple[str, ...]  #: names of the boundary groups
    #: inward lines from the surface, name -> (start (2,), end (2,)), m
    probes: dict[str, tuple[np.ndarray, np.ndarray]]
    multiplicity: int  #: how many times the modelled part makes up the whole section
    exact_area: float  #: area of the modelled part of the true section, arcs included, m2

    @property
    def outer_groups(self) -> tuple[str, ...]:
        """Groups that are true surface: neither lines of symmetry nor the far ends of a strip."""
        return tuple(name for name in self.groups if not name.startswith(_INNER))

    @property
    def vertices(self) -> np.ndarray:
        """Vertices of the cells, (m, 3) or (m, 4)."""
        return self.cells[:, : _quality.vertex_count(self.cell)]

    def perimeter(self, groups: Collection[str]) -> float:
        """Length of some boundary groups on the whole section, m; of its chords, where it bends."""
        mine = [self.groups[group] in groups for group in self.facet_group]
        ends = self.points[self.facets[mine]]
        return self.multiplicity * float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())

    def quality(self) -> Quality:
        """Counts, sizes, Jacobians, angles, growth and area; see `Quality`."""
        return _quality.measure(self.points, self.cells, self.cell, self.exact_area)

    def outline(self) -> list[tuple[str, np.ndarray]]:
        """Boundary as polylines for drawing.

        Returns:
            For each run of facets in one group its name and its points (k, 2) in order, the
            section on the left; at second order the nodes in the middle of the sides are included.
        """
        _, boundary, sides = _quality.pair_up(self.vertices, self.cell)
        n = _quality.vertex_count(self.cell)
        middle = {}
        if self.order == 2:
            local = np.array(_MIDDLES[self.cell])[boundary % n]
            nodes = self.cells[boundary // n, local]
            middle = {
                tuple(s): int(m) for s, m in zip(sides[boundary].tolist(), nodes, strict=True)
            }
        follows = {int(facet[0]): i for i, facet in enumerate(self.facets)}
        left = set(range(len(self.facets)))
        runs: list[tuple[str, np.ndarray]] = []
        while left:
            loop = _loop(self.facets, follows, self.facet_group, min(left))
            left.difference_update(loop)
            runs += self._runs(loop, middle)
        return runs

    def holds(self, x: float, y: float) -> bool:
        """Whether a point (m) lies in the modelled part, or outside by a hair of a facet."""
        lines = [line for _, line in self.outline()]
        start, end = (np.concatenate([line[cut] for line in lines]) for cut in _ENDS)
        along, off = end - start, np.array([x, y]) - start
        share = np.clip(np.sum(off * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
        away = np.linalg.norm(off - share[:, None] * along, axis=1)
        if np.any(away <= _HAIR * np.linalg.norm(along, axis=1)):
            return True
        crossed = (start[:, 1] > y) != (end[:, 1] > y)
        at = start[crossed, 0] + along[crossed, 0] * off[crossed, 1] / along[crossed, 1]
        return bool(np.count_nonzero(at > x) % 2)

    def _runs(
        self, loop: list[int], middle: dict[tuple[int, int], int]
    ) -> list[tuple[str, np.ndarray]]:
        """Cut one closed loop of facet numbers where the group changes."""
        runs: list[tuple[str, list[int]]] = []
        for i in loop:
            a, b = (int(v) for v in self.facets[i])
            name = self.groups[self.facet_group[i]]
            nodes = [middle[a, b], b] if middle else [b]
            if runs and runs[-1][0] == name:
                runs[-1][1].extend(nodes)
            else:
                runs.append((name, [a, *nodes]))
        return [(name, self.points[nodes]) for name, nodes in runs]


def _loop(facets: np.ndarray, follows: dict[int, int], group: np.ndarray, first: int) -> list[int]:
    """Facet numbers of the closed loop through `first`, started where its group begins."""
    loop, i = [first], follows[int(facets[first, 1])]
    while i != first:
        loop.append(i)
        i = follows[int(facets[i, 1])]
    for shift in range(len(loop)):
        if group[loop[shift]] != group[loop[shift - 1]]:
            return loop[shift:] + loop[:shift]
    return loop
