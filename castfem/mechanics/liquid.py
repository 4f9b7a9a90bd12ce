"""Liquid that is fed from above: it carries its pressure, and nothing of what the shell does.

A slice's liquid is part of a pool that reaches up to the meniscus.  Where the shell moves away more
of it flows in, where the shell comes nearer it flows out: it resists neither, and its mesh has to
go somewhere only because the heat that crosses it does.  So the nodes fall into two kinds,

    shell   of cells with a point that is solid enough to carry stress, and of the cells at the
            surface, which stand for the shell before there is one;
    deep    all others.

Equilibrium is that of the shell: deep nodes are prescribed, cells without solid have no stress
but the pressure.  Then the deep nodes follow, as an elastic body that is pulled along by the shell
and pulls at nothing itself: Int eps(u) : eps(v) da = 0 over those cells.  Whatever stiffness the
liquid is given numerically counts in no more than the one layer of cells that freezes.
"""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la

from castfem.fem import dof_values
from castfem.fem.dolfinx_compat import assemble_into, create_matrix
from castfem.fem.section import Section
from castfem.forms.mechanics import following
from castfem.mechanics.quadrature import Points

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class FedLiquid:
    """Which cells carry stress in a step, and where the others go.

    Args:
        section: The distributed section.
        space: Of the displacement.
        points: Quadrature points of the slice.
        supports: Conditions on the displacement.

    Attributes:
        carries: Points in cells that carry stress (points,).
        deep: Degrees of freedom of deep nodes that this rank owns (k,).
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
        self._freely = fem.Function(fem.functionspace(section.mesh, ("DG", 0)))
        # Of each own cell; nobody promises that they are numbered alike.
        self._cell = np.asarray(self._freely.function_space.dofmap.list)[: section.cells].ravel()
        self._form = section.compile("mechanics.following", following(u, v, self._freely))
        self._matrix = create_matrix(self._form)
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._right, self._found = self._matrix.createVecs()
        self._ksp = self._make_solver()
        self._load = fem.Function(space)
        self._surface = self._surface_cells()
        self._nodes = np.asarray(space.dofmap.list)[: section.cells]
        self._shell_nodes: npt.NDArray[np.int32] = np.zeros(0, np.int32)
        self.carries: Flags = np.ones(points.count, dtype=bool)
        self.deep: npt.NDArray[np.int64] = np.zeros(0, np.int64)
        self.held = self._condition(np.zeros(0, np.int32))

    def _make_solver(self) -> PETSc.KSP:
        """A factorisation: exact, so that ranks and restarts agree."""
        ksp = PETSc.KSP().create(self.section.comm)
        ksp.setOperators(self._matrix)
        ksp.setType("preonly")
        ksp.getPC().setType("cholesky")
        has_mumps = PETSc.Sys.hasExternalPackage("mumps")
        ksp.getPC().setFactorSolverType("mumps" if has_mumps else "petsc")
        return ksp

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

    def _condition(self, nodes: npt.NDArray[np.int32]) -> fem.DirichletBC:
        return fem.dirichletbc(fem.Function(self._space), nodes)

    def begin(self, solid: Flags) -> None:
        """Sort the cells of a step (collective).

        Args:
            solid: Points that are solid enough to carry stress at its end (points,).
        """
        split = self._points.split
        shell = self._surface.copy()
        for part in (solid[:split], solid[split:]):
            if part.size:
                shell |= part.reshape(self.section.cells, -1).any(axis=1)
        each = [np.repeat(shell, n // max(1, len(shell))) for n in (split, len(solid) - split)]
        self.carries = np.concatenate(each) if len(shell) else np.zeros(0, dtype=bool)
        self._freely.x.array[self._cell] = np.where(shell, 0.0, 1.0)
        self._freely.x.scatter_forward()
        marks = self._load.x
        marks.array[:] = 0.0
        size = self._space.dofmap.bs
        marks.array.reshape(-1, size)[self._nodes[shell]] = 1.0
        marks.scatter_reverse(la.InsertMode.add)
        marks.scatter_forward()
        of_shell = marks.array.reshape(-1, size)[:, 0] > 0.0
        deep = np.flatnonzero(~of_shell).astype(np.int32)
        self.held = self._condition(deep)
        self._shell_nodes = np.flatnonzero(of_shell).astype(np.int32)
        owned = deep[deep < self._space.dofmap.index_map.size_local].astype(np.int64)
        self.deep = (owned[:, None] * size + np.arange(size)).ravel()

    def follow(self, u: fem.Function) -> None:
        """Let the deep nodes of the displacement `u` follow those of the shell (collective)."""
        if self.section.comm.allreduce(len(self.deep)) == 0:
            return
        moved = fem.dirichletbc(u, self._shell_nodes)
        conditions = [moved, *self._supports]
        assemble_into(self._matrix, self._form, conditions)
        load = self._load.x
        load.array[:] = 0.0
        fem.apply_lifting(load.array, [self._form], [conditions])
        load.scatter_reverse(la.InsertMode.add)
        owned = dof_values.owned_of(self._space)
        for condition in (*self._supports, moved):
            condition.set(load.array)
        self._right.setArray(load.array[:owned])
        self._ksp.setUp()
        self._ksp.solve(self._right, self._found)
        u.x.array[self.deep] = self._found.getArray(readonly=True)[self.deep]
        u.x.scatter_forward()

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._ksp, self._matrix, self._right, self._found):
            thing.destroy()
