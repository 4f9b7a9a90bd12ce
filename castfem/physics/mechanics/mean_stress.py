"""Change of volume and mean stress, linear in x and y on each cell.

With independent values at the four points of a quadrilateral the mean stress has one mode per cell
too many: the fourth, which remains of four values without their linear part, is hardly coupled to
the displacements, and less so on finer meshes (docs/mechanics.md). So change of volume and mean
stress are both projected on 1, x and y on each cell (Boffi, Brezzi and Fortin: Mixed Finite Element
Methods and Applications, 2013, 8.6.3), by least squares in the rule of the mean stress. The
projection is self-adjoint: applied to the strain for the law and to the stress in the work, it
keeps the tangent symmetric if that of the law is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem

from castfem.base.types import Array, Indices
from castfem.fem import dof_values
from castfem.fem.compat import Tabulation
from castfem.fem.section import Section

CENTRES = {"quadrilateral": (1 / 2, 1 / 2), "triangle": (1 / 3, 1 / 3)}


@dataclass(frozen=True, slots=True)
class Linear:
    """Functions linear in x and y on each cell, from values at the points of the mean stress.

    Linear in x and y, not in the reference coordinates: those lose an order on cells that are not
    parallelograms (Arnold, Boffi and Falk, Math. Comp. 71 (2002) 909).
    """

    values: Array  #: basis functions of the projection at the points (cells, q, terms)
    #: operator from values at the points to factors of the basis functions (cells, terms, q)
    terms: Array
    applied: bool  #: whether `__call__` projects, or leaves the values unchanged

    @classmethod
    def at(cls, section: Section, weights: Array, places: Array, applied: bool) -> Linear:
        """Return the projection on a section.

        Args:
            section: The distributed section.
            weights: Area of the points of the mean stress (cells, q), m2.
            places: Their positions (cells, q, 2), m.
            applied: See `Linear`.
        """
        mesh, at_centre = section.mesh, np.array([CENTRES[section.cell]])
        centre, scale = (
            Tabulation(mesh, expression, at_centre).values().reshape(-1, *expression.ufl_shape)
            for expression in (ufl.SpatialCoordinate(mesh), ufl.Jacobian(mesh))
        )
        # In the coordinates of the parallelogram at the cell's centre the numbers are of order one,
        # however thin the cell; the space is the same.
        to_local = np.linalg.inv(scale).transpose(0, 2, 1)
        count = weights.shape[1]
        if not applied:
            each = np.tile(np.eye(count), (len(weights), 1, 1))
            return cls(each, each, False)
        parts = [np.ones((*weights.shape, 1)), (places - centre[:, None]) @ to_local]
        values = np.concatenate(parts if count > 2 else parts[:1], axis=2)
        weighted = (values * weights[:, :, None]).transpose(0, 2, 1)
        terms = np.linalg.solve(weighted @ values, weighted)
        return cls(values, terms, True)

    def on(self, cells: Indices) -> Linear:
        """The projection on some of the cells."""
        if len(cells) == len(self.values):
            return self
        return Linear(self.values[cells], self.terms[cells], self.applied)

    def __call__(self, values: Array) -> Array:
        """Linear part of values at the points of the mean stress (n,), at the same points."""
        if not self.applied:
            return values
        by_cell = values.reshape(*self.values.shape[:2], 1)
        return np.asarray((self.values @ (self.terms @ by_cell)).ravel())


Rates = Callable[[], tuple[Array, Array]]


class VolumeStiffness:
    """Int K dV(u) dV(v) da with changes of volume dV that are linear on each cell, cell by cell.

    These are products of integrals over a cell, which UFL cannot express. The integrands come from
    the forms: the change of volume per unit of each motion, that is of the displacements of the
    cell's nodes and of the four generalized strains.

    Args:
        space: Space of the displacement.
        linear: Projection.
        weights: Area of the points of the mean stress (cells, q), m2.
        rates: Change of volume per unit of each motion, for the law and for the work of the stress
            (per undeformed area), (cells, q, unknowns of a cell + 4) each.
        constant: Whether the rates are constant.
    """

    def __init__(
        self, space: fem.FunctionSpace, linear: Linear, weights: Array, rates: Rates, constant: bool
    ) -> None:
        self._every, self._rates, self._constant = linear, rates, constant
        count = len(weights)
        self._nodes_of = np.ascontiguousarray(np.asarray(space.dofmap.list)[:count], PETSc.IntType)
        self._dofs_of = dof_values.dofs_of(space, np.arange(count))
        self._shape = (*weights.shape, self._dofs_of.shape[1] + 4)
        index_map = space.dofmap.index_map
        self._size = (index_map.size_local + index_map.num_ghosts) * space.dofmap.bs
        self._weighted = (linear.values * weights[:, :, None]).transpose(0, 2, 1)
        self._known: tuple[Array, Array] | None = None
        self._taken = self._inserted = False
        self._matrix: PETSc.Mat | None = None
        self.on(np.arange(count))

    def on(self, cells: Indices) -> None:
        """Act only on some of the cells from now on; the matrix may differ from now on."""
        self._cells = slice(None) if len(cells) == len(self._dofs_of) else cells
        self._linear = self._every.on(cells)
        self._blocks, self._dofs = self._nodes_of[self._cells], self._dofs_of[self._cells]
        if self._known is not None:
            self._change, self._work = (one[self._cells] for one in self._known)
        self._taken = self._inserted = False
        self.destroy()

    def begin(self) -> None:
        """Begin a step, with a new bulk modulus (flow does not change it)."""
        self._taken = False

    def take(self, bulk: Array) -> None:
        """Set the bulk modulus at the points of the mean stress (n,), and evaluate the rates.

        Args:
            bulk: d mean stress / d change of volume, Pa, of the active cells; constant throughout a
                step.
        """
        if self._taken and self._constant:
            return
        if self._known is None or not self._constant:
            # A rank without cells does not tabulate.
            change, work = (rates.reshape(self._shape) for rates in self._rates())
            self._known = self._every.terms @ change, self._weighted @ work
            self._change, self._work = (one[self._cells] for one in self._known)
        self._taken, self._inserted = True, False
        by_point = bulk.reshape(*self._linear.values.shape[:2], 1)
        # Operator from factors of the change of volume to those of the mean stress.
        self._answer = self._linear.terms @ (by_point * self._linear.values)

    @property
    def _nodes(self) -> slice:
        return slice(0, self._dofs.shape[1])

    def add_to(self, matrix: PETSc.Mat, free: Array) -> None:
        """Add to an assembled matrix of the displacements (collective).

        If it is constant throughout a step it is stored in a matrix: adding that takes a tenth of
        the time of inserting it cell by cell.

        Args:
            matrix: The same until the next `on`; its pattern couples all unknowns of a cell.
            free: 0 where a local unknown is prescribed, 1 elsewhere (n,).
        """
        if not self._constant:
            self._insert(matrix, free)
            return
        if self._matrix is None:
            self._matrix = matrix.duplicate()
        if not self._inserted:
            self._matrix.zeroEntries()
            self._insert(self._matrix, free)
            self._inserted = True
        matrix.axpy(1.0, self._matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)

    def _insert(self, matrix: PETSc.Mat, free: Array) -> None:
        nodes, (cells, count) = self._nodes, self._blocks.shape
        open_ = free[self._dofs][:, None, :]
        chunk = 4096  # cells whose stiffness is in memory at once
        for start in range(0, cells, chunk):
            at = slice(start, start + chunk)
            change, work = (m[at, :, nodes] * open_[at] for m in (self._change, self._work))
            found = work.transpose(0, 2, 1) @ (self._answer[at] @ change)
            rows = self._blocks[at]
            matrix.setValuesBlockedLocalRCV(
                rows, rows, found.reshape(len(rows), count, -1), PETSc.InsertMode.ADD
            )
        matrix.assemble()

    def destroy(self) -> None:
        """Free the PETSc objects; safe to call twice."""
        if self._matrix is not None:
            self._matrix.destroy()
            self._matrix = None

    def forces(self, moved: Array) -> Array:
        """Forces on the local unknowns (n,) for their motion `moved` (n,)."""
        return self._nodal(
            self._answer @ (self._change[:, :, self._nodes] @ moved[self._dofs][:, :, None])
        )

    def column(self, change: Array) -> Array:
        """Forces on the local unknowns (n,) for a change of the generalized strains (4,)."""
        return self._nodal(self._answer @ self._along(self._change, change))

    def row(self, virtual: Array) -> Array:
        """Derivative by the local unknowns (n,) of the work on generalized strains `virtual`."""
        factors = self._answer.transpose(0, 2, 1) @ self._along(self._work, virtual)
        nodes = self._change[:, :, self._nodes].transpose(0, 2, 1)
        return self._scattered((nodes @ factors)[:, :, 0])

    def corner(self, virtual: Array, change: Array) -> float:
        """Derivative of the work on generalized strains `virtual` (4,) along `change` (4,)."""
        answer = self._answer @ self._along(self._change, change)
        return float(np.vdot(self._along(self._work, virtual), answer))

    def _along(self, rates: Array, change: Array) -> Array:
        return rates[:, :, self._nodes.stop :] @ change[:, None]

    def _nodal(self, stress: Array) -> Array:
        """Forces from factors of the mean stress (cells, terms, 1)."""
        work = self._work[:, :, self._nodes].transpose(0, 2, 1)
        return self._scattered((work @ stress)[:, :, 0])

    def _scattered(self, of_cells: Array) -> Array:
        return np.bincount(self._dofs.ravel(), of_cells.ravel(), self._size).astype(np.float64)
