"""Derivative of the forces in the plane by the displacement."""

from __future__ import annotations

from dataclasses import dataclass

from petsc4py import PETSc

from dolfinx import fem, la

from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.fem.compat import assemble_into
from castfem.physics.constitutive.base import Response
from castfem.physics.mechanics.fields import Fields
from castfem.physics.mechanics.kinematics import Kinematics
from castfem.physics.mechanics.supports import Constraints


@dataclass(frozen=True, slots=True)
class Tangent:
    """Stiffness of the active cells, of what acts on their surface and of what holds them.

    Attributes:
        kinematics: Forms, and the stiffness against change of volume that stands beside them.
        fields: What the forms see. constraints: Supports.
        work: A displacement to compute with; nothing in it is kept.
    """

    kinematics: Kinematics
    fields: Fields
    constraints: Constraints
    work: fem.Function

    def _take(self, response: Response) -> None:
        """Hand the tangent of the law to the forms, the bulk modulus to what stands beside them."""
        bulk = self.fields.take_tangent(self.kinematics.active, response)
        self.kinematics.volume.take(bulk)

    def fill(self, response: Response, matrix: PETSc.Mat) -> None:
        """Assemble it at the displacement the fields hold (collective).

        Args:
            response: Of the law there, at the active points.
            matrix: Gets it, N/m2.
        """
        self._take(response)
        assemble_into(matrix, self.kinematics.forms.stiffness, self.constraints.every)
        self.kinematics.volume.add_to(matrix, self.constraints.free)
        if self.constraints.springs is not None:
            self.constraints.springs.add_to(matrix)

    def lifted(self, response: Response, missing: Array) -> Array:
        """Forces by which supports, on their way to where they belong, move the rest (collective).

        Args:
            response: Of the law, at the active points.
            missing: How far they still have to go, m, at `Constraints.fixed`.

        Returns:
            At this rank's own unknowns, N/m (valid until the next).
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
