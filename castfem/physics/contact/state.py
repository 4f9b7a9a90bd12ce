"""Contact states: the committed one, its checkpoint, one evaluation, and a summary."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array, Flags

if TYPE_CHECKING:
    from castfem.physics.contact.facets import Facets


OPEN, STICK, SLIP = 0, 1, 2
CONTACT = "contact."  # prefix of its arrays among those of the whole slice


@dataclass(frozen=True, slots=True)
class ContactState:
    """State at this rank's facet points; its arrays are never modified."""

    #: friction on the strand, in the plane along (-n_y, n_x) and along the strand (n, 2), Pa
    friction: Array
    #: accumulated axial force of friction on the strand, N, and its moments with x and y, N m, (3,)
    withdrawal_resistance: Array
    #: stress at the points, Mandel (n, 4), Pa; no rows with the penalty, which needs none
    stress: Array
    internal: Array  #: state variables of the law there (n, states); no rows with the penalty
    place: Array  #: present positions of the points (n, 2), m
    normal: Array  #: normal of the wall there (n, 2)
    gap: Array  #: distance to the wall along its normal (n,), m; inf without a wall
    pressure: Array  #: contact pressure (n,), Pa
    #: `OPEN`, `STICK` or `SLIP` (n,); touching points without friction, such as liquid ones, slip
    status: npt.NDArray[np.int8]
    weight: Array  #: length of surface of each point (n,), m

    def numbers(self) -> dict[str, Array]:
        """All arrays except the status, by name with the prefix "contact."."""
        names = (one.name for one in fields(self) if one.name != "status")
        return {f"{CONTACT}{name}": getattr(self, name) for name in names}


@dataclass(slots=True)
class ContactEvaluation:
    """Contact for one set of unknowns, by facet point; most names are those of `ContactState`."""

    place: Array
    normal: Array
    gap: Array
    pressure: Array
    friction: Array
    closed: Flags  #: whether points touch
    slides: Flags  #: whether they slide
    stretch: Array  #: length of surface relative to the undeformed length
    coefficients: Array  #: coefficients of the forms (n, columns)
    strain: Array  #: strain increment (n, 4), for Nitsche's method


@dataclass(frozen=True, slots=True)
class ContactSummary:
    """Contact of the whole section at one time."""

    pressure: float  #: largest contact pressure at a point, Pa
    #: largest average over a length of the surface (`castfem.physics.contact.facets`), Pa
    mean_pressure: float
    penetration: float  #: largest penetration, m; 0 without contact
    gap: float  #: largest gap to a wall, m; 0 if none is open
    #: force of the wall on the strand, x and y, including friction, N per m of undeformed strand,
    #: like those of the supports
    force: Array
    #: friction along the strand, N per m of deformed strand, negative if it holds the strand back
    axial: float
    length: float  #: length of surface in contact, m
    share: float  #: fraction of the possible contact surface in contact
    #: fraction of the possible contact surface that sticks; None without friction
    sticking: float | None
    points: tuple[int, int, int]  #: numbers of open, sticking and sliding points
    highest: Array  #: place of the largest pressure (2,), m
    highest_mean: Array  #: place of the largest average pressure (2,), m
    widest: Array  #: place of the largest gap (2,), m


BY_POINT = ("friction", "stress", "internal", "place", "normal", "gap", "pressure", "status",
            "weight")  # fmt: skip


class ContactCheckpoint:
    """Converts a `ContactState` for a checkpoint, and back.

    Arrays are stored facet by facet, ordered by cell of the input mesh and local index of the
    facet.

    Args:
        facets: Facets of the states (collective).
    """

    def __init__(self, facets: Facets) -> None:
        self._comm, self._facets, mesh = facets.section.comm, facets, facets.section.mesh
        original = np.asarray(mesh.topology.original_cell_index)
        own = original[facets.cells] * 4 + facets.local  # no cell has more than four sides
        every = np.sort(np.concatenate(self._comm.allgather(own)))
        self._count, self._where = len(every), np.searchsorted(every, own)

    def arrays(self, state: ContactState) -> dict[str, Array | None]:
        """Arrays of `state`, complete on rank 0, None elsewhere (collective)."""
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
        """Restore the state from `arrays`, which are on every rank.

        Args:
            arrays: Result of `arrays`.
            like: A state of the same problem, for empty arrays.
        """
        rows = {}
        for name in BY_POINT:
            model = getattr(like, name)
            rows[name] = model
            if f"contact_{name}" in arrays:
                mine = np.asarray(arrays[f"contact_{name}"])[self._where]
                rows[name] = mine.reshape(model.shape).astype(model.dtype)
        return ContactState(withdrawal_resistance=np.array(arrays["contact_pull"], float), **rows)
