"""Quadrature points on the facets that may touch a wall, and their values in the forms.

Arrays over points hold this rank's facets one after the other, k points each. Each exterior facet
belongs to one rank. Means along the surface do not depend on the mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from scipy import sparse
from scipy.spatial import cKDTree

from castfem.base.types import Array, Indices
from castfem.fem import dof_values, reductions
from castfem.fem.compat import Tabulation
from castfem.fem.section import Section


@dataclass(frozen=True, slots=True)
class Side:
    """Facets with the same local index in their cells."""

    facets: Indices  #: their indices among the contact facets (m,)
    cells: npt.NDArray[np.int32]  #: their cells (m,)
    points: Array  #: reference points in the cell (k, 2)
    tangent: Array  #: reference vector along the facet
    outward: Array  #: reference normal


class Facets:
    """Contact facets and their points.

    Args:
        section: The distributed section.
        tags: Tags of the boundary groups.
        points: Quadrature points per facet.

    Attributes:
        cells: Cell of each facet (f,). local: Local index of the facet in its cell (f,).
        count: Points on this rank. per_facet: Points per facet, k.
        position: On the undeformed mesh (count, 2), m. normal: Outward normal there (count, 2).
        weight: Length of surface of each point (count,), m.
        height: Size of the cell normal to the facet (count,), m.
        measure: Undeformed surface of the groups, with the same points.
    """

    def __init__(self, section: Section, tags: list[int], points: int) -> None:
        self.section, self.per_facet = section, points
        mesh = section.mesh
        found = [section.facet_tags.find(tag) for tag in tags]
        facets = np.unique(np.concatenate([np.zeros(0, np.int32), *found])).astype(np.int32)
        self.cells, self.local = _places(mesh, facets)
        self.count = len(facets) * points
        self._rule = basix.make_quadrature(basix.CellType.interval, 2 * points - 1)
        self.sides = self._sides(section.cell)
        self.measure = ufl.Measure(
            "ds",
            domain=mesh,
            subdomain_data=section.facet_tags,
            metadata={"quadrature_rule": "default", "quadrature_degree": 2 * points - 1},
        )(tuple(tags))
        self._set_geometry()

    def _sides(self, cell: str) -> list[Side]:
        kind = getattr(basix.CellType, cell)
        corners = np.asarray(basix.geometry(kind), float)
        normals = np.asarray(basix.cell.facet_outward_normals(kind), float)
        sides = []
        for i, (start, end) in enumerate(basix.topology(kind)[1]):
            tangent = corners[end] - corners[start]
            points = corners[start] + np.asarray(self._rule[0]).reshape(-1, 1) * tangent
            mine = np.flatnonzero(self.local == i)
            sides.append(Side(mine, self.cells[mine], points, tangent, normals[i]))
        return sides

    def tabulate(self, expression: Any) -> Callable[[], Array]:
        """Prepare the evaluation of a UFL expression of cells at the points (collective).

        Returns:
            A function that returns (count, components x degrees of freedom).
        """
        everywhere = np.concatenate([side.points for side in self.sides])
        table = Tabulation(self.section.mesh, expression, everywhere, self.cells)
        own = self.local[:, None] * self.per_facet + np.arange(self.per_facet)

        def values() -> Array:
            found = table.values()
            mine = found[np.arange(len(self.cells))[:, None], own]
            return mine.reshape(self.count, found.shape[2])

        return values

    def _set_geometry(self) -> None:
        mesh = self.section.mesh
        self.position = self.tabulate(ufl.SpatialCoordinate(mesh))().reshape(self.count, 2)
        jacobian = self.tabulate(ufl.Jacobian(mesh))().reshape(self.count, 2, 2)
        weights = np.tile(np.asarray(self._rule[1]), len(self.cells))
        along, outward = (np.zeros((self.count, 2)) for _ in range(2))
        for side in self.sides:
            rows = self.rows(side.facets)
            along[rows] = jacobian[rows] @ side.tangent
            inverse = np.linalg.inv(jacobian[rows])
            outward[rows] = np.einsum("nji,j->ni", inverse, side.outward)
        stretch = np.hypot(*along.T)
        self.weight = weights * stretch
        self.normal = outward / np.hypot(*outward.T)[:, None]
        # In square and triangle the reference distance from each side at its foot is one.
        area = np.abs(np.linalg.det(jacobian))
        self.height = area / np.maximum(stretch, 1e-300)

    def rows(self, facets: Indices) -> Indices:
        """Indices of the points of some facets, facet by facet."""
        return (facets[:, None] * self.per_facet + np.arange(self.per_facet)).ravel()

    def operator(self, expression: Any, space: fem.FunctionSpace) -> sparse.csr_matrix:
        """Sparse matrix of an expression linear in functions of a space.

        Rows are the components at the first point, then at the second ...; columns are this rank's
        degrees of freedom.
        """
        values = self.tabulate(expression)()  # even without facets, since compiling is collective
        dofs = dof_values.per_cell(space)
        table = values.reshape(self.count, values.shape[1] // dofs, dofs)
        return dof_values.operator(space, np.repeat(self.cells, self.per_facet), table)


class FacetFields:
    """Values at facet points as a function for forms on `Facets.measure`.

    On each cell it is the polynomial of lowest degree through the values at the points of its
    contact facets; it is not evaluated elsewhere.

    Args:
        facets: The facets.
        width: Number of components.

    Attributes:
        function: The function.
    """

    def __init__(self, facets: Facets, width: int) -> None:
        section, points = facets.section, facets.per_facet
        patterns = _patterns(facets)
        own = max((len(sides) for sides in patterns), default=1)
        most = section.comm.allreduce(own, op=MPI.MAX)
        # Adjacent sides share a value; in a closed ring of sides one more value is fixed.
        degree = points - 2 + min(most, 3)
        element = basix.ufl.element("Lagrange", section.cell, degree, discontinuous=True)
        blocked = basix.ufl.blocked_element(element, shape=(width,))
        self.function = fem.Function(fem.functionspace(section.mesh, blocked))
        self._width, self._points = width, points
        dofs = np.asarray(self.function.function_space.dofmap.list)
        self._parts = []
        for sides, members in patterns.items():
            places = np.concatenate([facets.sides[i].points for i in sides])
            through = np.linalg.pinv(np.asarray(element.tabulate(0, places), float)[0])
            self._parts.append((members, dofs[facets.cells[members[:, 0]]], through))

    def fill(self, values: Array) -> None:
        """Set `values` (count, width)."""
        target = self.function.x.array.reshape(-1, self._width)
        by_facet = values.reshape(-1, self._points, self._width)
        for members, dofs, through in self._parts:
            of_cells = by_facet[members].reshape(len(members), -1, self._width)
            target[dofs] = np.einsum("dk,fkc->fdc", through, of_cells)


def _patterns(facets: Facets) -> dict[tuple[int, ...], Indices]:
    """Sides of a cell that are contact facets -> numbers of the facets (cells, sides)."""
    by_cell: dict[int, list[int]] = {}
    for i in (int(n) for n in np.argsort(facets.local, kind="stable")):
        by_cell.setdefault(int(facets.cells[i]), []).append(i)
    found: dict[tuple[int, ...], list[list[int]]] = {}
    for members in by_cell.values():
        sides = tuple(int(facets.local[i]) for i in members)
        found.setdefault(sides, []).append(members)
    return {sides: np.array(members, np.int64) for sides, members in found.items()}


def _places(
    mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int32], Indices]:
    """Cell of each exterior facet, and index of the facet in that cell."""
    topology = mesh.topology
    topology.create_connectivity(1, 2)
    topology.create_connectivity(2, 1)
    of_facet, of_cell = topology.connectivity(1, 2), topology.connectivity(2, 1)
    assert of_facet is not None and of_cell is not None
    cells = np.array([of_facet.links(f)[0] for f in facets], dtype=np.int32)
    local = [
        int(np.flatnonzero(of_cell.links(c) == f)[0]) for c, f in zip(cells, facets, strict=True)
    ]
    return cells, np.array(local, dtype=np.int64)


LENGTH = 5e-3  # m: length of surface over which pressure is averaged


class SurfaceMean:
    """Averages over a length of the undeformed surface.

    A pressure that is nearly a point force, such as at the end of a corner arc, does not converge
    at a point with finer cells; its average does. Each quadrature point represents a piece of the
    surface around it, of which the part within the length counts. At a plane of symmetry the mirror
    image would contribute equally.

    Args:
        facets: Points of the facets (collective).
    """

    def __init__(self, facets: Facets) -> None:
        self._comm, self._own = facets.section.comm, facets.position
        facet = facets.weight.reshape(-1, facets.per_facet).sum(axis=1)
        half = 0.5 * np.maximum(LENGTH, 3.0 * np.repeat(facet, facets.per_facet))
        self._places = self.gathered(facets.position)
        self._pieces, self._halves = self.gathered(facets.weight), self.gathered(half)
        self._tree = cKDTree(self._places)
        self._around_own = self._around(self._own, half)

    def gathered(self, values: Array) -> Array:
        """Gather values at this rank's points on every rank (collective)."""
        if self._comm.size == 1:
            return values
        return np.concatenate(self._comm.allgather(values))

    def _around(self, places: Array, half: Array) -> sparse.csr_matrix:
        """Weights of all points in the averages over twice `half` (n,), m, around places (n, 2)."""
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
        """Weights (n, all points) of the averages around places of the surface (n, 2), m."""
        return self._around(places, self._halves[self._tree.query(places)[1]])

    def highest(self, values: Array, now: Array) -> tuple[float, Array]:
        """The highest average around a point, and its position (collective).

        Args:
            values: Values at this rank's points (n,).
            now: Present positions of the points (n, 2), m.
        """
        means = self._around_own @ self.gathered(values)
        most, *where = reductions.peak(self._comm, means, now)
        return most, np.array(where)
