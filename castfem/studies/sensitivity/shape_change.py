"""What the strained slice does to the heat balance of a coupling window, differentiated.

Beside the gap, which the laws of the surface see, that is the heat of viscoplastic work and what
the motion of the slice does to conduction, surface and filled volume.
Each is a linear form, assembled for the slice as it is; its derivative by the displacement is a
bilinear form, assembled once for all parameters.  Surface and volume are the same throughout a
window, conduction is that of the temperatures of a stage.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import ufl
from dolfinx import fem

from castfem.base.types import Array, Flags
from castfem.fem import dof_values
from castfem.fem.compat import assemble_into, assemble_owned, create_matrix
from castfem.fem.section import Section
from castfem.forms.heat import conduction_moved, slice_measure
from castfem.physics.thermal.boundary import Patch, Surface
from castfem.physics.thermal.deformed_section import Shape
from castfem.physics.thermal.problem import Stage, ThermalProblem


class ByMotion:
    """Derivative of a linear form by the motion of the slice.

    Args:
        section: The section.
        shape: The slice, on which the form hangs.
        name: Of the form.
        form: Tested with functions of the vertices; it goes with the thickness of the slice.
    """

    def __init__(self, section: Section, shape: Shape, name: str, form: ufl.Form) -> None:
        trial = ufl.TrialFunction(shape.displacement.function_space)
        change = ufl.derivative(form, shape.displacement, trial)
        self._shape, self._owned = shape, section.owned
        self._form = section.compile(name, form)
        self._change = section.compile(f"{name}.by_motion", change)
        self._matrix = create_matrix(self._change)
        self._in, self._out = self._matrix.createVecs()

    def __call__(self, motions: Array, strains: Array, here: Array | None = None) -> Array:
        """Its derivatives (k, owned) by motions of the owned nodes (k, dofs) and strains (k, 4).

        Args:
            motions: The motions.
            strains: That go with them.
            here: The form as it is (owned,), if that is known (collective).
        """
        assemble_into(self._matrix, self._change, [])
        found: Array = np.zeros((len(motions), self._owned))
        for number in range(len(motions)):
            self._in.setArray(motions[number])
            self._matrix.mult(self._in, self._out)
            found[number] = self._out.getArray(readonly=True)
        moving = np.flatnonzero(strains.any(axis=0))
        if not len(moving):
            return found
        if here is None:
            here = assemble_owned(self._form, self._owned)
        for component in moving:
            found += np.outer(strains[:, component], self._by_strain(component, here))
        return found

    def _by_strain(self, component: int, here: Array) -> Array:
        """Derivative of the form by a generalized strain (owned,) (collective)."""
        value = self._shape.generalized_strains.value
        if component == 0 and not value[1:].any():  # the form goes with the thickness
            return np.asarray(here / (1.0 + value[0]))
        given, by = value[component], 1e-6  # shares are all but linear in it
        value[component] = given + by
        change = (assemble_owned(self._form, self._owned) - here) / by
        value[component] = given
        return np.asarray(change)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._matrix, self._in, self._out):
            thing.destroy()


class ShapeChange:
    """Derivatives of the terms of the heat balance that the shape of the slice enters.

    In a stage, M (H - H_base) + tau (L theta + w q - M s) = 0, these are L, the conduction, w, the
    shares of the surface, and M, the volume that its steel fills.

    Args:
        problem: The heat balance of a slice that moves.
        surface: Of the strand.
        count: How many parameters there are.

    Attributes:
        filled: Derivative of the volume that the vertices' steel fills, over the undeformed one
            (parameters, owned).
    """

    def __init__(self, problem: ThermalProblem, surface: Surface, count: int) -> None:
        section, shape = problem.section, problem.shape
        assert shape is not None
        self._problem, self._surface, self._shape = problem, surface, shape
        space = section.vertex_space
        self._theta, v = fem.Function(space), ufl.TestFunction(space)
        conducted = conduction_moved(
            self._theta, v, slice_measure(section.mesh), shape.gradient, shape.thickness
        )
        self._conducted = ByMotion(section, shape, "heat.conducted.moved", conducted)
        self._volume = ByMotion(section, shape, "heat.volume.moved", shape.volume)
        self._shares = {
            tag: ByMotion(section, shape, name, form)
            for tag, (name, form) in surface.forms().items()
        }
        self.filled: Array = np.zeros((count, section.owned))
        self._motions: Array = np.zeros((count, 0))
        self._strains: Array = np.zeros((count, 4))
        self._weights: list[tuple[Patch, Array]] = []

    def follow(self, motions: Array, strains: Array, before: Array, solid: Flags) -> None:
        """Take up how the slice, through which heat flows now, moves with the parameters.

        Args:
            motions: Of this rank's nodes, ghosts included (parameters, dofs), m.
            strains: Generalized strains (parameters, 4).
            before: `filled` of the window before.
            solid: Vertices that are (owned,).
        """
        owned = motions[:, : dof_values.owned_of(self._shape.displacement.function_space)]
        self._motions, self._strains = owned, strains
        volume = self._volume(owned, strains, self._shape.enclosed()) / self._shape.area
        self.filled = np.where(solid, before, volume)
        shares = {tag: form(owned, strains) for tag, form in self._shares.items()}
        self._weights = self._surface.spread(shares)

    def of_stage(self, stage: Stage) -> Array:
        """What stands on the right of a stage (parameters, owned), J/m (collective)."""
        space = self._theta.function_space
        self._theta.x.array[:] = dof_values.with_ghosts(space, stage.point.conduction)
        here = self._problem.conducted(stage.point.conduction)
        flow = self._conducted(self._motions, self._strains, here)
        slopes = {id(patch): weights for patch, weights in self._weights}
        for patch, law in self._problem.cooling.laws:
            flux = law.flux(stage.point.temperature[patch.dofs], stage.time)[0]
            flow[:, patch.dofs] += slopes[id(patch)] * flux
        return -stage.tau * (self._problem.area * self.filled * stage.rate + flow)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for form in (self._conducted, self._volume, *self._shares.values()):
            form.destroy()


@dataclass(slots=True)
class Feedback:
    """Derivatives of what a window hands to its thermal steps, by each parameter."""

    duration: float  #: of the window, s
    #: of the heat of viscoplastic work (parameters, owned), J/m3; empty without
    heating: Array = field(default_factory=lambda: np.zeros((0, 0)))
    shape: ShapeChange | None = None  #: of the shape; None where heat does not follow it

    def of_stage(self, stage: Stage, problem: ThermalProblem) -> Array:
        """What stands on the right of a stage (parameters or 1, owned), J/m (collective)."""
        found: Array = np.zeros((1, len(stage.enthalpy)))
        if self.heating.size:
            found = stage.tau / self.duration * problem.area * self.heating
        if self.shape is not None:
            found = found + self.shape.of_stage(stage)
        return found

    def gained(self, share: float, change: Array, problem: ThermalProblem) -> Array:
        """Derivatives of what leaves in a step beside that by its change of enthalpy, J/m.

        Args:
            share: Of the window that the step is.
            change: Of the enthalpy over the step (owned,), J/m3.
            problem: The heat balance.

        Returns:
            (parameters,) or one for all.
        """
        found: Array = np.zeros(1)
        if self.heating.size:
            found = share * (self.heating @ problem.area)
        if self.shape is not None:
            found = found - self.shape.filled @ (problem.area * change)
        return found
