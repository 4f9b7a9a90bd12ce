"""Thermoelastic distortion of a tube held in its jacket."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import ufl
from dolfinx import fem, la

from castfem.base.constants import ROUNDING
from castfem.base.types import Array, Indices
from castfem.fem import dof_values, reductions
from castfem.fem.compat import (
    Tabulation,
    assemble_into,
    assemble_owned,
    compile_form,
    create_matrix,
    interpolation_matrix,
)
from castfem.forms import mould_tube
from castfem.meshes.tube import brick_nodes
from castfem.physics.mould.hot.copper import Copper
from castfem.physics.mould.hot.solvers import (
    CoarseLevel,
    LinearSolver,
    Method,
    Solved,
    chosen,
    elastic_options,
)
from castfem.physics.mould.hot.tube import Tube

Support = Literal["free", "hung", "clamped", "between"]
SUPPORTS: dict[str, dict[str, str]] = {
    "free": {},
    "hung": {"top": "z"},
    "clamped": {"top": "xyz"},
    "between": {"top": "z", "bottom": "z"},
}
"""Components that each support fixes on a face, besides the planes of symmetry."""
_BARLOW = 1.0 / np.sqrt(3.0)


@dataclass(frozen=True, slots=True, eq=False)
class Distorted:
    """The displacement of a tube."""

    displacement: fem.Function  #: function, m
    solved: Solved  #: the linear solve
    von_mises: fem.Function  #: von Mises stress at the nodes, including those of the faces, Pa
    largest_stress: float  #: largest stress at the nodes, Pa
    largest_at: tuple[float, float, float]  #: its place (3,), m


class Distortion:
    """Linear thermoelasticity of a tube.

    Args:
        tube: The tube.
        copper: Properties of the copper.
        support: Support of the tube.
        method: Linear solver.
    """

    def __init__(
        self, tube: Tube, copper: Copper, support: Support = "hung", method: Method = "auto"
    ) -> None:
        self.tube, self.copper, self.support = tube, copper, support
        self._method = chosen(method, tube.unknowns)

    def solve(self, temperature: fem.Function) -> Distorted:
        """Return the displacement from the cold tube at a temperature, K (collective).

        Raises:
            RunFailure: The solver does not converge.
        """
        tube, kelvin = self.tube, temperature.x.array
        stiffness, ratio = tube.function(), tube.function()
        strain = tube.function()
        stiffness.x.array[:] = self.copper.youngs_modulus(kelvin)
        ratio.x.array[:] = self.copper.poisson(kelvin)
        strain.x.array[:] = self.copper.thermal_strain(kelvin)
        u, v = ufl.TrialFunction(tube.vectors), ufl.TestFunction(tube.vectors)
        left = compile_form(mould_tube.stiffness(u, v, stiffness, ratio, tube.dx))
        right = compile_form(mould_tube.thermal_load(v, strain, stiffness, ratio, tube.dx))
        conditions, fixed = self._held(tube.vectors)
        matrix = create_matrix(left)
        assemble_into(matrix, left, conditions)
        load = assemble_owned(right, 3 * tube.owned)
        load[fixed] = 0.0
        coarse = self._first_order(stiffness, ratio, fixed) if self._method == "multigrid" else None
        options = elastic_options(self._method)
        solver = LinearSolver(matrix, "mould_elastic_", options, coarse)
        try:
            found, iterations = solver.solve(load)
        finally:
            for thing in (solver, coarse, matrix):
                if thing is not None:
                    thing.destroy()
        moved = fem.Function(tube.vectors)
        moved.x.array[:] = dof_values.with_ghosts(tube.vectors, found)
        stress = self._von_mises(moved, temperature)
        return Distorted(
            moved,
            Solved(self._method, tube.unknowns, iterations),
            stress,
            *self._largest(stress),
        )

    def stress_at(
        self, moved: fem.Function, temperature: fem.Function, points: Array
    ) -> tuple[Array, Array]:
        """Return stress and position at reference points of all owned cells.

        Args:
            moved: Displacement, m.
            temperature: K.
            points: Reference points (n, 3) of a cell.

        Returns:
            Stress (cells, n, 3, 3), Pa, and positions (cells, n, 3), m.
        """
        tube, kelvin = self.tube, temperature.x.array
        parts = [tube.function(), tube.function(), tube.function()]
        parts[0].x.array[:] = self.copper.thermal_strain(kelvin)
        parts[1].x.array[:] = self.copper.youngs_modulus(kelvin)
        parts[2].x.array[:] = self.copper.poisson(kelvin)
        sigma = mould_tube.stress(moved, *parts)
        found = Tabulation(tube.mesh, sigma, points).values()
        places = Tabulation(tube.mesh, ufl.SpatialCoordinate(tube.mesh), points).values()
        return found.reshape(*found.shape[:2], 3, 3), places

    def _von_mises(self, moved: fem.Function, temperature: fem.Function) -> fem.Function:
        """Return the von Mises stress at the nodes, Pa (collective).

        The stress is most accurate at eight points within each cell. It is extrapolated linearly to
        the nodes of the cell, and averaged over all cells of a node.
        """
        tube = self.tube
        barlow = np.array(np.meshgrid(*[[-_BARLOW, _BARLOW]] * 3, indexing="ij")).reshape(3, -1).T
        nodes = 2.0 * brick_nodes(tube.degree) / tube.degree - 1.0
        share = 0.5 * (1.0 + nodes[:, None, :] * barlow[None, :, :] / _BARLOW**2)
        within, _ = self.stress_at(moved, temperature, 0.5 * (1.0 + barlow))
        stress = np.einsum("np,cpij->cnij", share.prod(axis=2), within)
        mean = self._mean_of_cells(stress.reshape(*stress.shape[:2], 9)).reshape(-1, 3, 3)
        deviator = mean - np.trace(mean, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
        found = tube.function()
        found.x.array[: tube.owned] = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
        found.x.scatter_forward()
        return found

    def _mean_of_cells(self, values: Array) -> Array:
        """Average at the owned nodes (owned, m) of values in the owned cells (cells, n, m)."""
        tube = self.tube
        dofs = np.asarray(tube.scalars.dofmap.list)[: len(values)]
        sums = []
        for part in (*np.moveaxis(values, 2, 0), np.ones(values.shape[:2])):
            total = tube.function()
            np.add.at(total.x.array, dofs, part)
            total.x.scatter_reverse(la.InsertMode.add)
            sums.append(total.x.array[: tube.owned].copy())
        return np.stack(sums[:-1], axis=1) / sums[-1][:, None]

    def _largest(self, stress: fem.Function) -> tuple[float, tuple[float, float, float]]:
        """Return the largest von Mises stress, Pa, and its place, m (collective)."""
        tube = self.tube
        values = stress.x.array[: tube.owned]
        top = reductions.largest(tube.comm, values)
        high = values >= top * (1.0 - ROUNDING)  # the same place on any number of ranks
        near = tube.scalars.tabulate_dof_coordinates()[: tube.owned][high]
        own = max((tuple(map(float, place)) for place in near), default=(-np.inf,) * 3)
        x, y, z = max(tube.comm.allgather(own))
        return top, (x, y, z)

    def _held(self, space: fem.FunctionSpace) -> tuple[list[fem.DirichletBC], Indices]:
        """Return the conditions of symmetry and support, and the owned unknowns they fix.

        Args:
            space: Space of the displacement, of any order. (Collective.)
        """
        tube = self.tube
        faces = {"symmetry_y": "y", "symmetry_x": "x", **SUPPORTS[self.support]}
        conditions = []
        for face, components in faces.items():
            for component in components:
                part = space.sub("xyz".index(component))
                dofs = fem.locate_dofs_topological(part, 2, tube.facets(face))
                conditions.append(fem.dirichletbc(np.array(0.0), dofs, part))
        if self.support == "free":
            # Symmetry prevents rotation and lateral motion; one node prevents vertical motion.
            corner = tube.first_node
            block = fem.locate_dofs_geometrical(
                space, lambda x: np.linalg.norm(x.T - corner, axis=1) < ROUNDING
            )
            held = (3 * block + 2).astype(np.int32)
            conditions.append(fem.dirichletbc(np.array(0.0), held, space.sub(2)))
        dofs = np.unique(np.concatenate([one.dof_indices()[0] for one in conditions]))
        return conditions, dofs[dofs < 3 * space.dofmap.index_map.size_local]

    def _first_order(
        self, stiffness: fem.Function, ratio: fem.Function, fixed: Indices
    ) -> CoarseLevel:
        """Return first-order elasticity on the same cells (collective).

        Args:
            stiffness: Young's modulus, Pa.
            ratio: Poisson's ratio.
            fixed: Owned unknowns of the displacement itself that are fixed.
        """
        tube = self.tube
        space = fem.functionspace(tube.mesh, ("Lagrange", 1, (3,)))
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        form = compile_form(mould_tube.stiffness(u, v, stiffness, ratio, tube.dx))
        conditions, held = self._held(space)
        matrix = create_matrix(form)
        assemble_into(matrix, form, conditions)
        interpolation = interpolation_matrix(space, tube.vectors)
        right, left = interpolation.createVecs()
        for vector, zero in ((left, fixed), (right, held)):
            free = np.ones(vector.getLocalSize())
            free[zero] = 0.0
            vector.setArray(free)
        interpolation.diagonalScale(left, right)
        left.destroy()
        right.destroy()
        return CoarseLevel(matrix, interpolation)
