"""Quadrature points of the slice for both rules, and operators from nodal values to them.

All arrays over points hold the deviator's points first, then those of the mean stress; within a
rule cell after cell. Only a rank's own cells count.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from scipy import sparse

from castfem.base.types import Array, Indices
from castfem.fem import dof_values
from castfem.fem.compat import Tabulation
from castfem.fem.section import Section
from castfem.forms import mechanics as forms
from castfem.physics.mechanics.mean_stress import Linear
from castfem.physics.mechanics.quadrature_rules import EVERY, Integration, Rule


class Points:
    """The points of both rules and sparse operators to them.

    Args:
        section: The distributed section.
        space: Space of the displacement.
        integration: Degrees of the rules.

    Attributes:
        deviator: Rule of the stress deviator. mean: Rule of the mean stress.
        count: Number of points of both. deviator_points: Number of the first.
        volume: Area of each point (count,), m2; each rule covers the section by itself, that of the
            mean stress on triangles with a negative weight.
        position: Positions (count, 2), m.
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
        self.deviator_points = self.deviator.count
        self.count = self.deviator_points + self.mean.count
        self.volume = np.concatenate([self.deviator.volume, self.mean.volume])
        self.position = np.concatenate([self.deviator.position, self.mean.position])
        count = len(self.mean.points)
        weights = np.reshape(self.mean.volume, (-1, count))
        inside = np.reshape(self.mean.position, (-1, count, 2))
        self.linear = Linear.at(section, weights, inside, integration.linear)
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
        """Operator from the mean stress at its points of a cell to the deviator's points, (p, q).

        It uses functions linear in the reference coordinates, on quadrilaterals also the mixed
        term: with straight sides these contain all functions linear in x and y, and with curved
        ones they follow the sides, like the stress.
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
        """Tabulate a linear expression of a space's functions at the points of each rule.

        Returns:
            (cells, points of a cell x components, degrees of freedom of a cell) each.
        """
        cells, dofs = self.section.cells, dof_values.per_cell(space)
        values = (
            Tabulation(self.section.mesh, expression, rule.points).values()
            for rule in (self.deviator, self.mean)
        )
        return [v.reshape(cells, v[:1].size // dofs, dofs) for v in values]

    @cached_property
    def gradient(self) -> sparse.csr_matrix:
        """Operator (2 deviator_points, local vertices) from vertex values to their gradients."""
        space = self.section.vertex_space
        slopes = Tabulation(
            self.section.mesh, ufl.grad(ufl.TrialFunction(space)), self.deviator.points
        ).values()
        table = slopes.reshape(self.section.cells, -1, dof_values.per_cell(space))
        return dof_values.operator(space, np.arange(len(table)), table)

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
                self, cells, EVERY, EVERY, EVERY, self.deviator_points, linear, self.strain,
                self.volume,
            )  # fmt: skip
        each = (len(self.deviator.points), len(self.mean.points))
        deviator, mean = ((cells[:, None] * n + np.arange(n)).ravel().astype(int) for n in each)
        rows = np.concatenate([deviator, self.deviator_points + mean])
        strain = self.strain[(4 * rows[:, None] + np.arange(4)).ravel()]
        return ActivePoints(
            self, cells, rows, deviator, mean, len(deviator), linear, strain, self.volume[rows]
        )

    def level(self, strain: Array) -> Array:
        """Make the change of volume linear on each cell, in place: strains (count, 4)."""
        size = forms.trace(strain[self.deviator_points :].T)
        strain[self.deviator_points :, :3] += ((self.linear(size) - size) / 3.0)[:, None]
        return strain

    @cached_property
    def whole(self) -> bool:
        """Whether no point of this rank has a negative weight."""
        return float(self.mean.volume.min(initial=0.0)) >= 0.0

    def stiffness_temperature(self, temperature: Array) -> Array:
        """Temperatures (count,) at which moduli are evaluated, from those of the points.

        Temperatures of the points; if the rule of the mean stress has a negative weight, a single
        one for all its points in a cell.
        """
        if self.whole:
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
            stress: Stress at the points of both rules (count, 4).
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

        Each point is weighted with its area and its nearness to the vertex (the vertex' hat
        function).
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
        """Displacement of the owned vertices (owned, 2), m, including the strain `across`.

        Args:
            displacement: Displacement of all nodes of this rank, m.
            generalized_strains: Generalized strains (4,).
        """
        found = self.nodal(displacement)
        found[:, 1] += generalized_strains[3] * self._vertex_heights
        return found

    def to_vertices(self, density: Array) -> Array:
        """Integral of a density at the deviator's points times each vertex' hat function, (owned,).

        In this form dissipation (J/m3) enters the heat balance of the vertices (J/m).
        """
        return self._summed(self._to_vertices @ (density * self.deviator.volume))

    @cached_property
    def _to_vertices(self) -> sparse.csr_matrix:
        """Operator from values at the deviator's points to sums by the vertices' hat functions."""
        return self.vertex[: self.deviator_points].T.tocsr()

    def _summed(self, local: Array) -> Array:
        """Sum the contributions of all ranks at this rank's own vertices."""
        return dof_values.summed(self.section.vertex_space, local)


@dataclass(frozen=True, slots=True)
class ActivePoints:
    """The points of the cells with stress in a step, in the order of all points."""

    points: Points  #: all points
    cells: npt.NDArray[np.int32]  #: the cells, among this rank's own
    rows: Indices | slice  #: indices of their points among all points
    deviator: Indices | slice  #: indices of the deviator's points only
    mean: Indices | slice  #: indices of the points of the mean stress only
    deviator_points: int  #: number of the deviator's points
    linear: Linear  #: projection of values at the points of the mean stress
    strain: sparse.csr_matrix  #: operator from the displacement to Mandel strain, see `Points`
    volume: Array  #: area of each point, see `Points`

    @property
    def count(self) -> int:
        """Number of points of both rules."""
        return int(self.strain.shape[0]) // 4

    def rest(self) -> Indices:
        """Points of the mean stress in all other cells."""
        others = np.ones(self.points.mean.count, dtype=bool)
        others[self.mean] = False
        return np.flatnonzero(others)

    def spread(self, values: Array, elsewhere: Array) -> Array:
        """Extend values (count, ...) to all points with `elsewhere` (all, ...), in a new array."""
        found = elsewhere.copy()
        found[self.rows] = values
        return found

    def fill(self, deviator: fem.Function, values: Array) -> None:
        """Set a function at the deviator's points to `values` (deviator_points, ...)."""
        self.points.deviator.fill(deviator, values, self.deviator)

    def fill_mean(self, mean: fem.Function, values: Array) -> None:
        """Set a function at the points of the mean stress to `values` (mean points, ...)."""
        self.points.mean.fill(mean, values, self.mean)
