"""Contact pressure as a mean over a length of the surface, which does not hang on the mesh."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.contact.facets import Facets

LENGTH = 5e-3  # m: of the surface over which pressure is averaged
FACETS = 3.0  # and no less than the length of so many facets


class SurfaceMean:
    """Means over a length of the undeformed surface.

    A pressure that is nearly a force at a place, as where the arc of a corner ends in a face, has
    no value at a point that finer cells would come to; its mean has.  Each facet's point stands for
    a piece of the surface around it, of which the part within the length counts.  Where the section
    ends in a plane of symmetry its mirror image would add the same.

    Args:
        facets: The facets' points (collective).
        length: Over which, m; where three facets are longer, over these.
    """

    def __init__(self, facets: Facets, length: float = LENGTH) -> None:
        self._comm, self._own = facets.section.comm, facets.position
        facet = facets.weight.reshape(-1, facets.per_facet).sum(axis=1)
        half = 0.5 * np.maximum(length, FACETS * np.repeat(facet, facets.per_facet))
        self._places = self.gathered(facets.position)
        self._pieces, self._halves = self.gathered(facets.weight), self.gathered(half)
        self._tree = cKDTree(self._places)
        self._around_own = self._around(self._own, half)

    def gathered(self, values: Array) -> Array:
        """Values at this rank's points as those at all points, on every rank (collective)."""
        if self._comm.size == 1:
            return values
        return np.concatenate(self._comm.allgather(values))

    def _around(self, places: Array, half: Array) -> sparse.csr_matrix:
        """Weights of all points in the means over twice `half` (n,), m, around places (n, 2)."""
        near = self._tree.query_ball_point(places, half + 0.5 * self._pieces.max(initial=0.0))
        rows = np.repeat(np.arange(len(places)), [len(numbers) for numbers in near])
        columns = np.concatenate([np.zeros(0, np.int64), *map(np.array, near)]).astype(np.int64)
        distance = np.hypot(*(places[rows] - self._places[columns]).T)
        piece = self._pieces[columns]
        part = np.clip(half[rows] + 0.5 * piece - distance, 0.0, piece)
        sums = np.bincount(rows, part, minlength=len(places))
        shape = (len(places), len(self._places))
        return sparse.csr_matrix((part / sums[rows], (rows, columns)), shape=shape)

    def around(self, places: Array) -> sparse.csr_matrix:
        """Weights (n, all points) of the means around places of the surface (n, 2), m."""
        return self._around(places, self._halves[self._tree.query(places)[1]])

    def highest(self, values: Array, now: Array) -> tuple[float, Array]:
        """The highest mean around a point, and where that is (collective).

        Args:
            values: At this rank's points (n,).
            now: Where they are (n, 2), m.
        """
        means = self._around_own @ self.gathered(values)
        most, *where = reductions.peak(self._comm, means, now)
        return most, np.array(where)
