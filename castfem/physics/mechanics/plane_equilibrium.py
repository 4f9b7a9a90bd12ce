"""Equilibrium in the free generalized strains, with its derivatives.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from dolfinx import fem

from castfem.base.types import Array, Indices
from castfem.fem import reductions
from castfem.fem.bordered_system import BorderedSystem
from castfem.physics.mechanics.fields import Fields
from castfem.physics.mechanics.generalized_plane_strain import Planes, ScaledPlanes
from castfem.physics.mechanics.interactions import Interactions
from castfem.physics.mechanics.kinematics import Kinematics
from castfem.physics.mechanics.scaling import Scales
from castfem.physics.mechanics.state import MechanicalState

# Restraint of the planes in a step while there is hardly a shell: relative area of the section,
# solid.
DRAG = 1e-3


class PlaneEquations:
    """The equilibrium of axial force and moments (38), for the free generalized strains.

    Before there is a shell almost nothing in the slice balances an axial force, and slivers of
    solid in mostly liquid cells yield by changing volume: the planes would drift by a fixed amount
    per step, however short. Until there is a shell they are restrained by a stiffness relative to
    the start of each step, which delays a shell of a tenth of a millimetre by about a step.

    Args:
        planes: Constraints and loads of the planes.
        fields: Displacement and generalized strains in the forms.
        kinematics: Gives the compiled forms.
        interactions: Interactions with the surface.
        scales: Sizes of the slice.

    Attributes:
        scaled: Free unknowns in the step. begun: Unknowns at its start (free,), m.
        drag: Restraint of the planes, N/m per m. rest: Work of the cells without stress (4,), N/m.
    """

    def __init__(
        self,
        planes: Planes,
        fields: Fields,
        kinematics: Kinematics,
        interactions: Interactions,
        scales: Scales,
    ) -> None:
        self._planes, self._fields, self._kinematics = planes, fields, kinematics
        self._interactions, self._scales = interactions, scales
        self._comm, self.drag = scales.comm, 0.0
        self.rest: Array = np.zeros(4)

    def begin(self, old: MechanicalState, time: float) -> None:
        """Prepare a step from the committed state `old` to `time` (s)."""
        self.scaled = ScaledPlanes.of(self._planes, old.bending, time, self._scales.length)
        self.begun = old.scalars / self.scaled.scaling

    def hold(self, young: float) -> None:
        """Restrain the planes like a section of this Young's modulus, Pa; 0 for no restraint."""
        self.drag = self.drag_by(young)

    def drag_by(self, young: float) -> float:
        """Restraint, N/m per m, of a section with this Young's modulus, Pa."""
        return DRAG * (young * self._scales.area / self._scales.length**2)

    def work_on(self, directions: Array) -> Array:
        """Work of the stress along directions (4, k) of the generalized strains, N/m each."""
        found = self.work_of(self._kinematics.forms.generalized_work, directions)
        return found + self.rest @ directions

    def work_of(self, form: fem.Form, directions: Array) -> Array:
        """Work of the stress in a form along directions (4, k), N/m each (collective)."""
        work = np.zeros(directions.shape[1])
        for i, direction in enumerate(directions.T):
            self._fields.one.value[:] = direction
            work[i] = fem.assemble_scalar(form)
        return reductions.totals(self._comm, work) if len(work) else work

    def balance(self, scalars: Array) -> Array:
        """Residual in the test directions for these scaled scalars (free,), N/m."""
        found = self.work_on(self.scaled.test_directions) - self.scaled.load
        found += self._interactions.work_on(self.scaled.test_directions)
        return np.asarray(found + self.drag * (scalars - self.begun))

    def fill(
        self,
        bordered: BorderedSystem,
        assemble: Callable[[fem.Form, Array], Array],
        prescribed: Indices,
    ) -> None:
        """Add the derivatives by the free unknowns, and those of their equations.

        Args:
            bordered: Receives columns, rows and corner.
            assemble: Assembles a linear form and its additional terms, at this rank's own unknowns.
            prescribed: Unknowns with a prescribed displacement.
        """
        compiled, fields, scaled = self._kinematics.forms, self._fields, self.scaled
        volume, free = self._kinematics.volume, scaled.directions.shape[1]
        corner = np.zeros_like(bordered.corner)
        for i in range(free):
            assert compiled.column is not None and compiled.corner is not None
            direction, test = scaled.directions[:, i], scaled.test_directions[:, i]
            fields.one.value[:] = direction
            bordered.columns[:, i] = assemble(compiled.column, volume.column(direction))
            if scaled.coupled or compiled.row is not None:
                fields.one.value[:] = test
                form = compiled.row or compiled.column
                bordered.rows[:, i] = assemble(form, volume.row(test))
            else:
                bordered.rows[:, i] = bordered.columns[:, i]
            bordered.columns[prescribed, i] = 0.0
            for j in range(free):
                other = scaled.directions[:, j]
                fields.other.value[:] = other
                corner[i, j] = fem.assemble_scalar(compiled.corner) + volume.corner(test, other)
        if free:
            bordered.corner[:] = reductions.totals(self._comm, corner) + self.drag * np.eye(free)
        bordered.updated()
