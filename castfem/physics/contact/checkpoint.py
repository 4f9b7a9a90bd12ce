"""The state of contact as arrays that do not depend on the number of ranks, and back."""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.physics.contact.facets import Facets
from castfem.physics.contact.state import ContactState

BY_POINT = ("friction", "stress", "internal", "place", "normal", "gap", "pressure", "status",
            "weight")  # fmt: skip


class ContactCheckpoint:
    """Takes a `ContactState` apart for a checkpoint, and puts it together again.

    Arrays are kept facet by facet, ordered by cell of the input mesh and place in the cell.

    Args:
        facets: Whose states these are (collective).
    """

    def __init__(self, facets: Facets) -> None:
        self._comm, self._facets, mesh = facets.section.comm, facets, facets.section.mesh
        original = np.asarray(mesh.topology.original_cell_index)
        own = original[facets.cells] * 4 + facets.local  # no cell has more than four sides
        every = np.sort(np.concatenate(self._comm.allgather(own)))
        self._count, self._where = len(every), np.searchsorted(every, own)

    def arrays(self, state: ContactState) -> dict[str, Array | None]:
        """The arrays of `state`, whole on rank 0, None elsewhere (collective)."""
        found: dict[str, Array | None] = {}
        for name in BY_POINT:
            values = np.asarray(getattr(state, name), float)
            if self._empty(values):
                continue
            shape = (len(self._where), self._facets.per_facet, *values.shape[1:])
            pieces = self._comm.gather((self._where, values.reshape(shape)))
            found[f"contact_{name}"] = None
            if pieces is not None:
                whole = np.zeros((self._count, *shape[1:]))
                for where, piece in pieces:
                    whole[where] = piece
                found[f"contact_{name}"] = whole
        found["contact_pull"] = state.withdrawal_resistance.copy() if self._comm.rank == 0 else None
        return found

    def _empty(self, values: Array) -> bool:
        """Whether no rank has any of these (collective)."""
        return not any(self._comm.allgather(values.size))

    def state(self, arrays: dict[str, Array], like: ContactState) -> ContactState:
        """The state of `arrays`, which every rank has.

        Args:
            arrays: As `arrays` gave them.
            like: A state of the same problem, for what is empty.
        """
        rows = {}
        for name in BY_POINT:
            model = getattr(like, name)
            rows[name] = model
            if f"contact_{name}" in arrays:
                mine = np.asarray(arrays[f"contact_{name}"])[self._where]
                rows[name] = mine.reshape(model.shape).astype(model.dtype)
        return ContactState(withdrawal_resistance=np.array(arrays["contact_pull"], float), **rows)
