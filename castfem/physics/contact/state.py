"""The committed state of contact, also in a checkpoint; that of one set of unknowns; a summary."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array, Flags

if TYPE_CHECKING:
    from castfem.physics.contact.facets import Facets


OPEN, STICK, SLIP = 0, 1, 2
CONTACT = "contact."  # before the names of its numbers among those of the whole slice


@dataclass(frozen=True, slots=True)
class ContactState:
    """State at this rank's facet points; nothing ever writes into its arrays."""

    #: on the strand, in the plane along (-n_y, n_x) and along the strand (n, 2), Pa
    friction: Array
    #: axial force of the friction that has acted on the strand so far, N, and its moments with x
    #: and y, N m, (3,)
    withdrawal_resistance: Array
    stress: Array  #: at the points, Mandel (n, 4), Pa; no rows with the penalty, which needs none
    internal: Array  #: what the law remembers there (n, states); likewise
    place: Array  #: where the points are now (n, 2), m
    normal: Array  #: of the wall there (n, 2)
    gap: Array  #: distance to the wall along its normal (n,), m; inf where none is met
    pressure: Array  #: contact pressure (n,), Pa
    #: `OPEN`, `STICK` or `SLIP` (n,); without friction, as liquid, what touches slips
    status: npt.NDArray[np.int8]
    weight: Array  #: length of surface of each point (n,), m

    def numbers(self) -> dict[str, Array]:
        """All but the status, by its name with "contact." before it."""
        names = (one.name for one in fields(self) if one.name != "status")
        return {f"{CONTACT}{name}": getattr(self, name) for name in names}


@dataclass(slots=True)
class ContactEvaluation:
    """Contact at one set of unknowns, by facet point; most names are those of `ContactState`."""

    place: Array
    normal: Array
    gap: Array
    pressure: Array
    friction: Array
    closed: Flags  #: whether points touch
    slides: Flags  #: whether they slide
    stretch: Array  #: length of surface over undeformed length
    coefficients: Array  #: what the forms see (n, columns)
    strain: Array  #: increment (n, 4), of Nitsche's law


@dataclass(frozen=True, slots=True)
class ContactSummary:
    """Contact of the whole section at one moment."""

    pressure: float  #: largest contact pressure at a point, Pa
    #: largest mean over a length of the surface (`castfem.physics.contact.facets`), Pa
    mean_pressure: float
    penetration: float  #: largest, m; 0 if nothing touches
    gap: float  #: largest gap to a wall that is met, m; 0 if none is open
    #: of the wall on the strand, x and y, friction included, N per m of undeformed strand, as those
    #: of the supports
    force: Array
    axial: float  #: friction along the strand, N per m of it as it is, negative as it holds it back
    length: float  #: of surface that touches, m
    share: float  #: of the surface that could
    #: part of the surface that could touch that does and sticks; None without friction
    sticking: float | None
    points: tuple[int, int, int]  #: numbers of points that are open, stick and slip
    highest: Array  #: where the pressure is largest (2,), m
    highest_mean: Array  #: where its mean is (2,), m
    widest: Array  #: where the gap is (2,), m


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
            if not any(self._comm.allgather(values.size)):  # no rank has any
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
