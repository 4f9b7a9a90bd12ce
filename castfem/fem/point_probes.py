"""Values at single points of the section, whichever ranks hold their cells."""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.locate import locate
from castfem.fem.section import Section


class PointProbes:
    """Interpolates vertex fields at points of the section.

    Args:
        section: The section.
        points: (n, 2), m.

    Raises:
        ValueError: A point lies outside the section.
    """

    def __init__(self, section: Section, points: Array) -> None:
        from scipy import sparse  # slow to import, and most runs have no such points

        self._comm, n = section.comm, len(points)
        along = np.tile([1.0, 0.0], (n, 1))
        rows, columns, weights, _ = locate(section, points, along)
        start = section.vertex_space.dofmap.index_map.local_range[0]
        # A cell of one rank may have vertices of another: each takes its own columns.
        entries = [
            (row, column - start, weight)
            for part in section.comm.allgather(list(zip(rows, columns, weights, strict=True)))
            for row, found, values in part
            for column, weight in zip(found, values, strict=True)
            if 0 <= column - start < section.owned
        ]
        table = np.array(entries, float).reshape(-1, 3)
        places = (table[:, 0].astype(int), table[:, 1].astype(int))
        self._matrix = sparse.csr_matrix((table[:, 2], places), shape=(n, section.owned))

    def at(self, owned: Array) -> Array:
        """Vertex fields (owned, k) at the points (n, k), on every rank (collective)."""
        local = self._matrix @ owned
        return reductions.totals(self._comm, local.ravel()).reshape(local.shape)
