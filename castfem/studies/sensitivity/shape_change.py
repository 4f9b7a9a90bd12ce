"""Derivatives of the effects of the strained slice on the heat balance of a coupling window.

Besides the gap, which is part of the surface laws, these are the heat of viscoplastic work and the
effect of the motion on conduction, surface and filled volume. Each is a linear form, assembled for
the present slice; its derivative by the displacement is a bilinear form, assembled once for all
parameters. Surface and volume are constant throughout a window; conduction depends on the
temperatures of a stage.
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
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stage import Stage


class ByMotion:
    """Derivative of a linear form by the motion of the slice.

    Args:
        section: The section.
        shape: Deformation of the slice, on which the form depends.
        name: Name of the form.
        form: Tested with functions of the vertices; proportional to the thickness of the slice.
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
        """Derivatives (k, owned) for motions of the owned nodes (k, dofs) and strains (k, 4).

        Args:
            motions: The motions.
            strains: Corresponding generalized strains.
            here: Present values of the form (owned,), if known (collective).
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
        if component == 0 and not value[1:].any():  # the form is proportional to the thickness
            return np.asarray(here / (1.0 + value[0]))
        given, by = value[component], 1e-6  # the shares are almost linear in it
        value[component] = given + by
        change = (assemble_owned(self._form, self._owned) - here) / by
        value[component] = given
        return np.asarray(change)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._matrix, self._in, self._out):
            thing.destroy()


class ShapeChange:
    """Derivatives of the terms of the heat balance that depend on the shape of the slice.

    In a stage, M (H - H_base) + tau (L theta + w q - M s) = 0, these are the conduction L, the
    perimeter shares w, and M, the volume of the steel.

    Args:
        problem: The heat balance of a moving slice.
        surface: Surface of the strand.
        count: Number of parameters.

    Attributes:
        filled: Derivative of the relative volume of the vertices' steel (parameters, owned).
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
        """Set the motion of the slice with the parameters.

        Args:
            motions: Motions of this rank's nodes, including ghosts (parameters, dofs), m.
            strains: Generalized strains (parameters, 4).
            before: `filled` of the previous window.
            solid: Solid vertices (owned,).
        """
        owned = motions[:, : dof_values.owned_of(self._shape.displacement.function_space)]
        self._motions, self._strains = owned, strains
        volume = self._volume(owned, strains, self._shape.enclosed()) / self._shape.area
        self.filled = np.where(solid, before, volume)
        shares = {tag: form(owned, strains) for tag, form in self._shares.items()}
        self._weights = self._surface.spread(shares)

    def of_stage(self, stage: Stage) -> Array:
        """Right-hand side of a stage (parameters, owned), J/m (collective)."""
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
    """Derivatives of the effects of a window on its thermal steps, by each parameter."""

    duration: float  #: duration of the window, s
    #: derivatives of the heat of viscoplastic work (parameters, owned), J/m3; empty without
    heating: Array = field(default_factory=lambda: np.zeros((0, 0)))
    #: derivatives of the shape; None if heat is computed on the undeformed slice
    shape: ShapeChange | None = None

    def of_stage(self, stage: Stage, problem: ThermalProblem) -> Array:
        """Right-hand side of a stage (parameters or 1, owned), J/m (collective)."""
        found: Array = np.zeros((1, len(stage.enthalpy)))
        if self.heating.size:
            found = stage.tau / self.duration * problem.area * self.heating
        if self.shape is not None:
            found = found + self.shape.of_stage(stage)
        return found

    def gained(self, share: float, change: Array, problem: ThermalProblem) -> Array:
        """Derivatives of the heat leaving in a step, other than by its change of enthalpy, J/m.

        Args:
            share: Step length over that of the window.
            change: Change of the enthalpy over the step (owned,), J/m3.
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
