"""Quadrature points of the slice: rules, functions on them, and the way from nodal values to them.

Two rules: the stress deviator has one, the mean stress a poorer one (against locking).
All arrays over points hold the deviator's points first, then those of the mean stress; within a
rule cell after cell.  Only a rank's own cells count.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from scipy import sparse

from castfem.fem import dof_values
from castfem.fem.dolfinx_compat import CELLS, Tabulation
from castfem.fem.section import Section
from castfem.forms import mechanics as forms
from castfem.mechanics.volume import Linear
from castfem.values.types import Array, Indices


@dataclass(frozen=True, slots=True)
class Integration:
    """Degrees of the two quadrature rules.

    Attributes:
        deviator: For the stress deviator (4: 3 x 3 points, on triangles 6).
        mean: For the mean stress (3: 2 x 2 points, on triangles the 4 of `STRANG_FIX`).
        linear: Whether the mean stress is linear on each cell, or has a value of its own at each
            of its points (to show what that does).
    """

    deviator: int = 4
    mean: int = 3
    linear: bool = True

    @classmethod
    def of(cls, cell: str, order: int) -> Integration:
        """The rules castfem uses on a cell whose geometry is of first or second order."""
        return cls(4, 2) if cell == "triangle" and order == 2 else cls()


# Rule of degree 3 on triangles.  At these points, and no others, the divergence of the bubble is
# that of its projection to linear functions as long as the sides are straight: the rule integrates
# the work of a linear mean stress exactly and constrains no more than that does.  The price is a
# negative weight: moduli must be the same in all four, see `Points.stiffness_temperature`.  Curved
# triangles take the three points of degree 2, which are not exact but do not lock either.
STRANG_FIX = (
    np.array([[1 / 3, 1 / 3], [1 / 5, 1 / 5], [3 / 5, 1 / 5], [1 / 5, 3 / 5]]),
    np.array([-27 / 96, 25 / 96, 25 / 96, 25 / 96]),
)


def displacement_element(cell: str) -> basix.ufl._ElementBase:
    """Second-order displacement: 9-node quadrilaterals; 6-node triangles with an inner bubble."""
    quadratic = basix.ufl.element("Lagrange", cell, 2)
    if cell == "triangle":
        quadratic = basix.ufl.enriched_element([quadratic, basix.ufl.element("Bubble", cell, 3)])
    return basix.ufl.blocked_element(quadratic, shape=(2,))


EVERY = slice(None)


class Rule:
    """One quadrature rule on all cells of this rank.

    Attributes:
        points: Reference points (k, 2). weights: Of them (k,).
        measure: Area measure that uses them, for forms on some of the cells.
        count: Points on this rank's cells. volume: Area that belongs to each (count,), m2.
        position: Where they are on the undeformed mesh (count, 2), m.
    """

    def __init__(self, section: Section, degree: int) -> None:
        mesh = section.mesh
        self._mesh, self._cell = mesh, section.cell
        rule: dict[str, object] = {"quadrature_degree": degree}
        if section.cell == "triangle" and degree == 3:
            self.points, self.weights = STRANG_FIX
            rule["quadrature_rule"] = "custom"
            # As tuples: of arrays the form's signature would see a few digits only.
            rule["quadrature_points"] = tuple(map(tuple, self.points.tolist()))
            rule["quadrature_weights"] = tuple(self.weights.tolist())
        else:
            kind = getattr(basix.CellType, section.cell)
            points, weights = basix.make_quadrature(kind, degree)
            self.points, self.weights = np.asarray(points), np.asarray(weights)
            rule["quadrature_rule"] = "default"
        self.measure = ufl.Measure("dx", domain=mesh, metadata=rule, subdomain_id=CELLS)
        size = Tabulation(mesh, abs(ufl.JacobianDeterminant(mesh)), self.points).values()
        self.volume = (size[..., 0] * self.weights).ravel() if size.size else np.zeros(0)
        self.count = self.volume.size
        places = Tabulation(mesh, ufl.SpatialCoordinate(mesh), self.points).values()
        self.position = places.reshape(self.count, 2)
        self._place = self._layout()

    def _layout(self) -> npt.NDArray[np.int64] | slice:
        """Degree of freedom of each point.

        DOLFINx promises nowhere that they follow one another, nor in which order: both are checked.
        """
        space = self._space(())
        cells = self._mesh.topology.index_map(2).size_local
        dofs = np.asarray(space.dofmap.list)[:cells].ravel().astype(np.int64)
        found = space.tabulate_dof_coordinates()[dofs, :2]
        scale = np.abs(found).max(initial=1e-300)
        if dofs.size != self.count or np.abs(found - self.position).max(initial=0.0) > 1e-9 * scale:
            raise RuntimeError("quadrature functions do not lie at the points of their rule")
        if np.array_equal(dofs, np.arange(self.count)):
            return slice(0, self.count)
        return dofs

    def _space(self, shape: tuple[int, ...]) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element(
            self._cell, value_shape=shape, points=self.points, weights=self.weights
        )
        return fem.functionspace(self._mesh, element)

    def function(self, *shape: int) -> fem.Function:
        """A function with a value of `shape` at each point."""
        return fem.Function(self._space(shape))

    def fill(self, function: fem.Function, values: Array, rows: Indices | slice = EVERY) -> None:
        """Set a function of this rule to `values` (n, ...) at some of its points."""
        if len(values):  # a rank may have no cells
            target = function.x.array.reshape(-1, values[0].size)
            at = rows if isinstance(self._place, slice) else self._place[rows]
            target[at] = values.reshape(len(values), -1)


class Points:
    """The points of both rules and sparse operators to them.

    Args:
        section: The distributed section.
        space: Space of the displacement.
        integration: Degrees of the rules.

    Attributes:
        deviator: Rule of the stress deviator. mean: Rule of the mean stress.
        count: Points of both. deviator_points: Points of the first.
        volume: Area of each point (count,), m2; each rule fills the section by itself, on triangles
            that of the mean stress with a negative part.
        position: (count, 2), m.
        linear: Projection of values at the points of the mean stress on each cell.
        strain: Operator (4 count, local degrees of freedom) from displacement to Mandel strain; at
            the points of the mean stress its trace is linear on each cell.
        dilation: Change of volume at the points of the mean stress per unknown of a cell,
            (cells, points of a cell, unknowns of a cell).
        vertex: Operator (count, local vertices) from vertex values to the points.
    """

    def __init__(
        self, section: Section, space: fem.FunctionSpace, integration: Integration
    ) -> None:
        self.section = section
        self.deviator = Rule(section, integration.deviator)
        self.mean = Rule(section, integration.mean)
        self.deviator_points, self.count = (
            self.deviator.count,
            self.deviator.count + self.mean.count,
        )
        self.volume = np.concatenate([self.deviator.volume, self.mean.volume])
        self.position = np.concatenate([self.deviator.position, self.mean.position])
        count = len(self.mean.points)
        weights = np.reshape(self.mean.volume, (-1, count))
        inside = np.reshape(self.mean.position, (-1, count, 2))
        self.linear = Linear(section, weights, inside, integration.linear)
        self._carry = self._carrying()
        moved = forms.strain(forms.of_displacement(ufl.TrialFunction(space)), section.mesh)
        tables = self._tables(moved, space)
        by_component = tables[1].reshape(len(tables[1]), count, 4, tables[1].shape[2])
        self.dilation = forms.trace(by_component.transpose(2, 0, 1, 3))
        level = self.linear.values @ (self.linear.terms @ self.dilation)
        by_component[:, :, :3] += ((level - self.dilation) / 3.0)[:, :, None]
        self.strain = self._operator([tables[0], by_component.reshape(tables[1].shape)], space)
        hats = self._tables(ufl.TrialFunction(section.vertex_space), section.vertex_space)
        self.vertex = self._operator(hats, section.vertex_space)
        corners = 3 if section.cell == "triangle" else 4
        nodes = np.asarray(space.dofmap.list)[:, :corners]
        at_vertex = np.zeros(self.vertex.shape[1], np.int64)
        at_vertex[np.asarray(section.vertex_space.dofmap.list)[:, :corners]] = nodes
        self._vertex_nodes = at_vertex[: section.owned]
        places = section.vertex_space.tabulate_dof_coordinates()
        self._vertex_heights = np.array(places[: section.owned, 1])

    def _carrying(self) -> Array:
        """From the mean stress at its own points of a cell to the deviator's points, (p, q).

        By what is linear in the coordinates of the reference cell, on quadrilaterals with the mixed
        term: on straight sides that contains all that is linear in x and y, and on curved ones it
        follows the sides, as stress does.
        """
        several = 1
        if len(self.mean.points) > 1:
            several = 4 if self.section.cell == "quadrilateral" else 3
        terms = [
            np.column_stack([np.ones(len(p)), p, p[:, 0] * p[:, 1]])[:, :several]
            for p in (self.deviator.points, self.mean.points)
        ]
        weighted = terms[1] * self.mean.weights[:, None]
        return np.asarray(terms[0] @ np.linalg.solve(terms[1].T @ weighted, weighted.T))

    def _tables(self, expression: object, space: fem.FunctionSpace) -> list[Array]:
        """A linear expression of a space's functions at the points of each rule.

        Returns:
            (cells, points of a cell x components, degrees of freedom of a cell) each.
        """
        cells, dofs = self.section.cells, dof_values.per_cell(space)
        values = (
            Tabulation(self.section.mesh, expression, rule.points).values()
            for rule in (self.deviator, self.mean)
        )
        return [v.reshape(cells, v[:1].size // dofs, dofs) for v in values]

    def _operator(self, tables: list[Array], space: fem.FunctionSpace) -> sparse.csr_matrix:
        """Sparse matrix of `_tables`, rows by point."""
        blocks = [dof_values.operator(space, np.arange(len(t)), t) for t in tables]
        matrix = sparse.vstack(blocks, format="csr")
        matrix.eliminate_zeros()
        matrix.sort_indices()
        return matrix

    def on(self, cells: npt.NDArray[np.int32]) -> ActivePoints:
        """The points of some of this rank's cells, given in their order."""
        linear = self.linear.on(cells.astype(np.int64))
        if len(cells) == self.section.cells:
            return ActivePoints(
                self,
                cells,
                EVERY,
                EVERY,
                EVERY,
                self.deviator_points,
                linear,
                self.strain,
                self.volume,
            )
        each = (len(self.deviator.points), len(self.mean.points))
        deviator, mean = ((cells[:, None] * n + np.arange(n)).ravel().astype(int) for n in each)
        rows = np.concatenate([deviator, self.deviator_points + mean])
        strain = self.strain[(4 * rows[:, None] + np.arange(4)).ravel()]
        return ActivePoints(
            self, cells, rows, deviator, mean, len(deviator), linear, strain, self.volume[rows]
        )

    def level(self, strain: Array) -> Array:
        """Make the change of volume linear on each cell: strains (count, 4) are written to."""
        size = forms.trace(strain[self.deviator_points :].T)
        strain[self.deviator_points :, :3] += ((self.linear(size) - size) / 3.0)[:, None]
        return strain

    def stiffness_temperature(self, temperature: Array) -> Array:
        """Temperatures (count,) that moduli are to be taken at, given those of the points.

        Those of the points; where the rule of the mean stress has a negative weight, one for all
        its points in a cell.
        """
        if self.mean.volume.min(initial=0.0) >= 0.0:
            return temperature
        found = temperature.copy()
        by_cell = found[self.deviator_points :].reshape(-1, len(self.mean.points))
        weights = self.mean.volume.reshape(by_cell.shape)
        mean = (weights * by_cell).sum(axis=1) / weights.sum(axis=1)
        by_cell[:] = mean[:, None]
        return found

    def recovered(self, stress: Array) -> Array:
        """Stress at the deviator's points (n, 4), with the mean stress of its own rule.

        Args:
            stress: At the points of both rules (count, 4).
        """
        own = self.linear(stress[self.deviator_points :, :3].mean(axis=1)).reshape(
            -1, len(self.mean.points)
        )
        found = stress[: self.deviator_points].copy()
        found[:, :3] += ((own @ self._carry.T).ravel() - found[:, :3].mean(axis=1))[:, None]
        return found

    @cached_property
    def _around_vertices(self) -> tuple[sparse.csr_matrix, Array]:
        """Weights of the deviator's points around each local vertex, and their sums."""
        weights = self.vertex[: self.deviator_points].T.multiply(self.deviator.volume).tocsr()
        return weights, np.asarray(weights.sum(axis=1)).ravel()

    def at_vertices(self, values: Array) -> Array:
        """Mean of values at the deviator's points (deviator_points, ...) around each owned vertex.

        Each point counts by its area and its nearness to the vertex (the vertex' hat function).
        """
        weights, whole = self._around_vertices
        flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
        sums = np.column_stack([weights @ flat, whole])
        summed = np.column_stack([self._summed(column) for column in sums.T])
        mean = summed[:, :-1] / summed[:, -1:]
        return np.asarray(mean.reshape(len(mean), *values.shape[1:]))

    def nodal(self, displacement: Array) -> Array:
        """Displacement of the owned vertices (owned, 2), from that of all nodes of this rank."""
        return np.asarray(displacement.reshape(-1, 2)[self._vertex_nodes])

    def moved(self, displacement: Array, generalized_strains: Array) -> Array:
        """How far the owned vertices have moved (owned, 2), m, by the strain `across` too.

        Args:
            displacement: Of all nodes of this rank, m.
            generalized_strains: Generalized strains (4,).
        """
        found = self.nodal(displacement)
        found[:, 1] += generalized_strains[3] * self._vertex_heights
        return found

    def to_vertices(self, density: Array) -> Array:
        """Integral of a density at the deviator's points times each vertex' hat function, (owned,).

        That is how dissipation (J/m3) enters the heat balance of the vertices (J/m).
        """
        return self._summed(
            self.vertex[: self.deviator_points].T @ (density * self.deviator.volume)
        )

    def _summed(self, local: Array) -> Array:
        """Contributions of all ranks to this rank's own vertices."""
        return dof_values.summed(self.section.vertex_space, local)


@dataclass(frozen=True, slots=True)
class ActivePoints:
    """The points of those cells in which a step has stress, in the order of all points.

    Attributes:
        points: All points. cells: The cells, of this rank's own.
        rows: Of all points, those of these cells. deviator: The same of the deviator's rule alone.
        mean: Of that of the mean stress. deviator_points: Number of the first.
        linear: Projection of values at the points of the mean stress. strain: Operator from the
            displacement to Mandel strain, see `Points`. volume: Area of each point, see there.
    """

    points: Points
    cells: npt.NDArray[np.int32]
    rows: Indices | slice
    deviator: Indices | slice
    mean: Indices | slice
    deviator_points: int
    linear: Linear
    strain: sparse.csr_matrix
    volume: Array

    @property
    def count(self) -> int:
        """Points of both rules."""
        return int(self.strain.shape[0]) // 4

    def rest(self) -> Indices:
        """Points of the mean stress of all other cells."""
        others = np.ones(self.points.mean.count, dtype=bool)
        others[self.mean] = False
        return np.flatnonzero(others)

    def spread(self, values: Array, elsewhere: Array) -> Array:
        """Values (count, ...) among those of all points, `elsewhere` (all, ...), a new array."""
        found = elsewhere.copy()
        found[self.rows] = values
        return found

    def fill(self, deviator: fem.Function, values: Array) -> None:
        """Set a function at the deviator's points to `values` (deviator_points, ...)."""
        self.points.deviator.fill(deviator, values, self.deviator)

    def fill_mean(self, mean: fem.Function, values: Array) -> None:
        """Set one at the points of the mean stress to `values` (count - deviator_points, ...)."""
        self.points.mean.fill(mean, values, self.mean)


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
