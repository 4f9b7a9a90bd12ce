"""Values by cell, in an order that does not depend on the number of ranks."""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.fem.section import Section


class Cellwise:
    """Values by cell on rank 0, numbered as in the input mesh whatever the number of ranks.

    Checkpoints keep stress, state and displacement like this: what belongs to a cell's points and
    nodes, in the order of the reference cell.
    """

    def __init__(self, section: Section) -> None:
        self.comm = section.comm
        owned = section.mesh.topology.index_map(2).size_local
        self.cells = np.asarray(section.mesh.topology.original_cell_index)[:owned]
        self._all = self.comm.gather(self.cells)

    def gather(self, values: Array) -> Array | None:
        """Values (own cells, ...) of all ranks as (cells, ...) on rank 0, None elsewhere."""
        pieces = self.comm.gather(np.ascontiguousarray(values))
        if pieces is None or self._all is None:
            return None
        whole = np.zeros((sum(len(c) for c in self._all), *values.shape[1:]))
        for cells, piece in zip(self._all, pieces, strict=True):
            whole[cells] = piece
        return whole

    def scatter(self, values: Array | None) -> Array:
        """Inverse of `gather`."""
        return np.ascontiguousarray(self.comm.bcast(values)[self.cells])
