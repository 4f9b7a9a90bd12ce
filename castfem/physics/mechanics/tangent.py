"""Derivative of the forces in the plane by the displacement, for the active cells."""

from __future__ import annotations

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
from dolfinx import fem, la

from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.fem.bordered_system import BorderedSystem
from castfem.fem.compat import assemble_into, create_matrix
from castfem.fem.dof_values import matrix_of_nodes
from castfem.physics.constitutive.base import Response
from castfem.physics.mechanics.fields import Fields
from castfem.physics.mechanics.kinematics import Kinematics
from castfem.physics.mechanics.liquid import FedLiquid
from castfem.physics.mechanics.plane_equilibrium import PlaneEquations
from castfem.physics.mechanics.scaling import Scales
from castfem.physics.mechanics.supports import Constraints


@dataclass(frozen=True, slots=True)
class Rest:
    """Forces of the pressure in the cells without stress, constant throughout a step."""

    forces: Array  #: forces on this rank's nodes, including ghosts, N/m
    work: Array  #: work on each generalized strain (4,), N/m
    sums: Array  #: contribution to the sums of `Scales.stress` (2,)


class ActivePart:
    """The active cells: all, except fed liquid where there is no shell.

    Whole layers of cells are left out, so that the equations rarely change.

    Args:
        kinematics: Kinematics of the section; receives the cells with stress.
        space: Space of the displacement.
        scales: Sizes of the slice.

    Attributes:
        matrix: Receives the derivative of the forces in the plane.
    """

    def __init__(self, kinematics: Kinematics, space: fem.FunctionSpace, scales: Scales) -> None:
        self._kinematics, self._space, self._scales = kinematics, space, scales
        self._whole = self.matrix = create_matrix(kinematics.forms.stiffness)
        self._mark()
        self._layer = -1
        self._nothing: Array = np.zeros_like(fem.Function(space).x.array)

    def _mark(self) -> None:
        if self._kinematics.symmetric:
            self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def follow(self, liquid: FedLiquid, bordered: BorderedSystem) -> bool:
        """Activate the cells down to the innermost with some shell.

        All others are deep liquid: their nodes are fixed in the step, and their pressure is known.
        At large strain their contribution depends on the motion, and all cells are active.

        Returns:
            Whether the cells have changed (collective).
        """
        if not self._kinematics.constant or liquid.layer == self._layer:
            return False
        cells = liquid.cells_to(liquid.layer)
        if self._layer < 0:  # allocates all entries that may ever occur
            assemble_into(self._whole, self._kinematics.forms.stiffness, [])
        self._kinematics.act_on(cells)
        before = self.matrix
        self.matrix, nodes = matrix_of_nodes(self._whole, self._space, liquid.nodes_of(cells))
        self._mark()
        bordered.restrict(self.matrix, nodes)
        if before is not self._whole:
            before.destroy()
        self._layer = liquid.layer
        return True

    def rest(self, planes: PlaneEquations, pressure: Array) -> Rest:
        """Contribution of the pressure of the other cells in a step (collective).

        Args:
            planes: Compute its work on the generalized strains.
            pressure: Pressure at all points of the mean stress, Pa; empty without any.
        """
        if self._kinematics.rest is None:
            return Rest(self._nothing, np.zeros(4), np.zeros(2))
        of_nodes, of_planes = self._kinematics.rest
        forces = np.zeros_like(self._nothing)
        fem.assemble_vector(forces, of_nodes)
        sums = self._scales.beside(self._kinematics.active, pressure)
        return Rest(forces, planes.work_of(of_planes, np.eye(4)), sums)

    def destroy(self) -> None:
        """Free the PETSc objects; safe to call twice."""
        self.matrix.destroy()
        self._whole.destroy()


@dataclass(frozen=True, slots=True)
class Tangent:
    """Stiffness of the active cells, of interactions with their surface and of supports."""

    #: forms, and the additional stiffness against change of volume
    kinematics: Kinematics
    fields: Fields  #: functions in the forms
    constraints: Constraints  #: supports
    work: fem.Function  #: work space

    def _take(self, response: Response) -> None:
        """Set the tangent of the law in the forms, the bulk modulus in the other stiffness."""
        bulk = self.fields.take_tangent(self.kinematics.active, response)
        self.kinematics.volume.take(bulk)

    def fill(self, response: Response, matrix: PETSc.Mat) -> None:
        """Assemble the tangent at the present displacement (collective).

        Args:
            response: Response of the law at the active points.
            matrix: Output, N/m2.
        """
        self._take(response)
        assemble_into(matrix, self.kinematics.forms.stiffness, self.constraints.every)
        self.kinematics.volume.add_to(matrix, self.constraints.free)
        if self.constraints.springs is not None:
            self.constraints.springs.add_to(matrix)

    def lifted(self, response: Response, missing: Array) -> Array:
        """Forces of supports moving to their prescribed positions on the rest (collective).

        Args:
            response: Response of the law at the active points.
            missing: Their remaining motion, m, at `Constraints.fixed`.

        Returns:
            Forces at this rank's own unknowns, N/m (valid until the next call).
        """
        vector, form = self.work.x, self.kinematics.forms.stiffness
        self._take(response)
        vector.array[:] = 0.0
        vector.array[self.constraints.fixed] = missing
        vector.scatter_forward()
        vector.array[:] = self.kinematics.volume.forces(vector.array)
        for condition in self.constraints.conditions:
            at = [self.fields.u.x.array]
            fem.apply_lifting(vector.array, [form], [[condition]], x0=at, alpha=-1.0)
        vector.scatter_reverse(la.InsertMode.add)
        return vector.array[: dof_values.owned_of(self.work.function_space)]
