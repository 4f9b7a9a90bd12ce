"""Fed liquid: it carries its pressure, but does not resist the motion of the shell.

The liquid of a slice is part of a pool that extends to the meniscus. Where the shell moves away,
liquid flows in; where the shell comes nearer, it flows out. It resists neither, and its mesh must
move only because heat is computed on it. The nodes are therefore of two kinds:

    shell   nodes of cells with a point that is solid enough to carry stress, and of the cells at
            the surface, which represent the shell before there is one;
    deep    all others.

Equilibrium is that of the shell: deep nodes are prescribed, cells without solid have no stress
except the pressure. Then the deep nodes follow, like an elastic body that is moved by the shell
without acting on it: Int eps(u) : eps(v) da = 0 over those cells. The numerical stiffness of the
liquid matters only in the single layer of cells that is freezing.
"""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la

from castfem.base.types import Array, Flags, Indices
from castfem.fem import dof_values, reductions
from castfem.fem.compat import assemble_into, create_matrix
from castfem.fem.dof_values import matrix_of_nodes
from castfem.fem.section import Section
from castfem.forms.mechanics import following
from castfem.physics.mechanics.quadrature import Points


class FedLiquid:
    """Determines the cells that carry stress in a step, and moves the others.

    Args:
        section: The distributed section.
        space: Space of the displacement.
        points: Quadrature points of the slice.
        supports: Constraints on the displacement.

    Attributes:
        carries: Points in cells that carry stress (points,).
        layer: Index of the innermost layer of cells with a shell in a step; 0 at the surface.
        bears: Whether most of the solid is in completely solid cells.
        deep: Degrees of freedom of the deep nodes of this rank (k,).
        held: The condition that prescribes the deep nodes, for DOLFINx' assembly.
    """

    def __init__(
        self,
        section: Section,
        space: fem.FunctionSpace,
        points: Points,
        supports: list[fem.DirichletBC],
    ) -> None:
        self.section, self._space, self._points, self._supports = section, space, points, supports
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        form = section.compile("mechanics.following", following(u, v))
        # A deep node has only deep cells around it: its equations are equal in all steps.
        self._whole = create_matrix(form)
        assemble_into(self._whole, form, [])
        self._moved, self._right = self._whole.createVecs()
        self._equations: _Equations | None = None
        self._marks = fem.Function(space)
        self._surface = self._surface_cells()
        self._nodes = np.asarray(space.dofmap.list)[: section.cells]
        self._layers = self._numbered_layers()
        self.layer = int(self._innermost(np.ones(section.cells, dtype=bool)))
        held = [np.zeros(0, np.int32), *(c.dof_indices()[0] for c in supports)]
        self._supported: Flags = np.zeros(dof_values.owned_of(space), dtype=bool)
        self._supported[(at := np.concatenate(held))[at < len(self._supported)]] = True
        self._follows: Flags = np.zeros(len(self._supported), dtype=bool)
        self._new = True
        self.carries: Flags = np.ones(points.count, dtype=bool)
        self.bears = False
        self.deep: npt.NDArray[np.int64] = np.zeros(0, np.int64)
        self.held = self._condition(np.zeros(0, np.int32))

    def _surface_cells(self) -> Flags:
        """Own cells with a side on the surface of the strand (cells,)."""
        section, topology = self.section, self.section.mesh.topology
        found = np.zeros(section.cells, dtype=bool)
        cells_of = topology.connectivity(1, 2)
        assert cells_of is not None
        for tag in section.matching(section.outer_groups):
            for facet in section.facet_tags.find(tag):
                cell = cells_of.links(facet)[0]
                if cell < section.cells:
                    found[cell] = True
        return found

    def _numbered_layers(self) -> Indices:
        """Layer of each own cell (cells,), from the surface inwards (collective).

        Cells that share a node are neighbours.
        """
        layers, number, comm = np.where(self._surface, 0, -1), 0, self.section.comm
        while reductions.any_of(comm, bool((layers < 0).any())):
            number += 1
            touched = self._of_cells(layers >= 0)[self._nodes] > 0.0
            new = touched.any(axis=1) & (layers < 0)
            layers[new if reductions.any_of(comm, bool(new.any())) else layers < 0] = number
        return layers

    def _innermost(self, cells: Flags) -> float:
        """Index of the innermost layer with one of these cells (cells,) (collective)."""
        return max(reductions.largest(self.section.comm, self._layers[cells].astype(float)), 0.0)

    def cells_to(self, layer: int) -> npt.NDArray[np.int32]:
        """Own cells from the surface to a layer."""
        return np.flatnonzero(self._layers <= layer).astype(np.int32)

    def nodes_of(self, cells: npt.NDArray[np.int32]) -> Flags:
        """Whether each local node belongs to one of these cells, on any rank (collective)."""
        marked = np.zeros(self.section.cells, dtype=bool)
        marked[cells] = True
        return self._of_cells(marked) > 0.0

    def _of_cells(self, marked: Flags) -> Array:
        """Number of these cells, of all ranks, at each local node (collective)."""
        marks, size = self._marks.x, self._space.dofmap.bs
        marks.array[:] = 0.0
        marks.array.reshape(-1, size)[self._nodes[marked]] = 1.0
        marks.scatter_reverse(la.InsertMode.add)
        marks.scatter_forward()
        return np.array(marks.array.reshape(-1, size)[:, 0])

    def _condition(self, nodes: npt.NDArray[np.int32]) -> fem.DirichletBC:
        return fem.dirichletbc(fem.Function(self._space), nodes)

    def begin(self, solid: Flags) -> None:
        """Classify the cells of a step (collective).

        Args:
            solid: Points solid enough to carry stress at its end (points,).
        """
        points, cells = self._points, self.section.cells
        per_cell = len(points.deviator.points), len(points.mean.points)
        deviator, mean = np.split(solid, [points.deviator_points])
        deviator, mean = deviator.reshape(cells, per_cell[0]), mean.reshape(cells, per_cell[1])
        shell = self._surface | deviator.any(axis=1) | mean.any(axis=1)
        whole = deviator.all(axis=1) & mean.all(axis=1)
        area = points.volume[: points.deviator_points].reshape(deviator.shape)
        found = [area[whole].sum(), area[deviator].sum()]
        of_whole, of_all = reductions.totals(self.section.comm, found)
        self.bears = bool(of_whole > 0.5 * of_all)
        self.carries = np.concatenate([np.repeat(shell, number) for number in per_cell])
        self.layer = int(self._innermost(shell))
        self._outermost = reductions.smallest(self.section.comm, self._layers[~shell].astype(float))
        size = self._space.dofmap.bs
        deep = np.flatnonzero(self._of_cells(shell) == 0.0).astype(np.int32)
        self.held = self._condition(deep)
        owned = deep[deep < self._space.dofmap.index_map.size_local].astype(np.int64)
        self.deep = (owned[:, None] * size + np.arange(size)).ravel()

        follows = np.zeros(len(self._supported), dtype=bool)
        follows[self.deep] = True
        follows &= ~self._supported
        self._new |= not np.array_equal(follows, self._follows)
        self._follows = follows

    def follow(self, u: fem.Function) -> None:
        """Let the deep nodes of the displacement `u` follow those of the shell (collective)."""
        if not reductions.any_of(self.section.comm, bool(self._follows.any())):
            return
        for condition in self._supports:
            condition.set(u.x.array)
        owned = slice(0, len(self._follows))
        u.x.array[owned] = self.followed(u.x.array[None, owned])[0]
        u.x.scatter_forward()

    def followed(self, displacements: Array) -> Array:
        """Displacements (n, owned) with deep nodes following the given others (collective).

        Supports are as in the given displacements.
        """
        comm, follows = self.section.comm, self._follows
        if not reductions.any_of(comm, bool(follows.any())):
            return displacements
        if reductions.any_of(comm, self._new):
            self._restrict()
        assert self._equations is not None
        forces = np.zeros_like(displacements)
        for number in range(len(forces)):
            self._moved.setArray(displacements[number])
            self._whole.mult(self._moved, self._right)
            forces[number, follows] = -self._right.getArray(readonly=True)[follows]
        return np.asarray(displacements + self._equations.solved(forces))

    def _restrict(self) -> None:
        """Set up the equations of the nodes that follow; the others are fixed (collective)."""
        if self._equations is None or self._equations.outermost != self._outermost:
            if self._equations is not None:
                self._equations.destroy()
            deep = np.flatnonzero(self._layers >= self._outermost).astype(np.int32)
            nodes = self.nodes_of(deep)
            self._equations = _Equations(self._whole, self._space, nodes, self._outermost)
        self._equations.restrict(self._follows)
        self._new = False

    def destroy(self) -> None:
        """Free the PETSc objects."""
        if self._equations is not None:
            self._equations.destroy()
        for thing in (self._whole, self._right, self._moved):
            thing.destroy()


class _Equations:
    """Equations of the cells from the outermost layer with a deep one inwards.

    A direct factorisation, exact, so that ranks and restarts agree; it is kept while the front does
    not move. Conjugate gradients preconditioned by an earlier factorisation would take 20 to 60
    iterations where the front has moved by single cells; a dozen of them cost as much as a new
    factorisation.

    Args:
        whole: Equations of all cells. space: Space of the displacement.
        nodes: Local nodes of those layers. outermost: Index of the first of them.
    """

    def __init__(
        self, whole: PETSc.Mat, space: fem.FunctionSpace, nodes: Flags, outermost: float
    ) -> None:
        self.outermost = outermost
        self._part, self._rows = matrix_of_nodes(whole, space, nodes)
        self._matrix = self._part.duplicate()
        kind = PETSc.Mat.Option
        for option in (kind.SYMMETRIC, kind.SPD, kind.KEEP_NONZERO_PATTERN):
            self._matrix.setOption(option, True)
        self._right, self._moved = self._part.createVecs()
        self._ksp = PETSc.KSP().create(space.mesh.comm)
        self._ksp.setOperators(self._matrix)
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("cholesky")
        has_mumps = PETSc.Sys.hasExternalPackage("mumps")
        self._ksp.getPC().setFactorSolverType("mumps" if has_mumps else "petsc")

    def restrict(self, follows: Flags) -> None:
        """Let these unknowns of this rank follow, and fix all others (collective)."""
        self._part.copy(self._matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        stays = np.flatnonzero(~follows[self._rows]) + self._matrix.getOwnershipRange()[0]
        self._matrix.zeroRowsColumns(stays.astype(PETSc.IntType))

    def solved(self, forces: Array) -> Array:
        """Motion of the unknowns under forces (n, owned), 0 where fixed (collective)."""
        found = np.zeros_like(forces)
        if len(forces) == 1:
            self._right.setArray(forces[0, self._rows])
            self._ksp.solve(self._right, self._moved)
            found[0, self._rows] = self._moved.getArray(readonly=True)
            return found
        size = self._part.getSizes()[0], (None, len(forces))
        right, moved = (PETSc.Mat().createDense(size, comm=self._part.comm) for _ in range(2))
        for one in (right, moved):
            one.setUp()
            one.assemble()
        right.getDenseArray()[:] = forces[:, self._rows].T
        right.assemble()
        self._ksp.matSolve(right, moved)
        found[:, self._rows] = moved.getDenseArray().T
        for one in (right, moved):
            one.destroy()
        return found

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._ksp, self._matrix, self._part, self._right, self._moved):
            thing.destroy()
