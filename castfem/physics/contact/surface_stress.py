"""Stress of the solid at the facets' points, for Nitsche's method.

The constitutive law is evaluated at these additional points, with their own state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from castfem.base.types import Array
from castfem.forms import finite_strain
from castfem.forms.mechanics import SQRT2
from castfem.physics.constitutive.base import Law, MaterialStep, Response, turned
from castfem.physics.contact.facets import Facets
from castfem.physics.contact.interaction import Motion, Solid
from castfem.physics.contact.state import ContactState

Deformations = tuple[finite_strain.Deformation, finite_strain.Deformation]


@dataclass(frozen=True, slots=True)
class SurfaceStrain:
    """Strain of the facets' points from the motion, for any law."""

    gradients: sparse.csr_matrix  #: operator from displacement to its gradient at the points
    thickness: Array  #: strain zz at the points from a0, a1 and a2 (n, 3)
    motion: Motion  #: displacement and generalized strains
    #: function that gives increments and rotation over a step at large strain; None at small
    step: Callable[[], Array] | None

    @classmethod
    def at(
        cls,
        facets: Facets,
        gradients: sparse.csr_matrix,
        motion: Motion,
        step: Deformations | None,
    ) -> SurfaceStrain:
        """Return that of some facets (collective); `step`: deformations at end and start."""
        thickness = np.column_stack([np.ones(facets.count), facets.position])
        found = None if step is None else facets.tabulate(finite_strain.increment(*step))
        return cls(gradients, thickness, motion, found)

    def increments(self, change: Array, generalized_strains: Array) -> Array:
        """Strain at the points (n, 4) for small changes of displacement and generalized strains."""
        g = (self.gradients @ change).reshape(-1, 4)
        return np.column_stack(
            [
                g[:, 0],
                g[:, 3] + generalized_strains[3],
                self.thickness @ generalized_strains[:3],
                (g[:, 1] + g[:, 2]) / SQRT2,
            ]
        )

    def of_step(self) -> tuple[Array, Array | None]:
        """Increments of the step (n, 4), and the rotation angles of the material; None for none."""
        if self.step is not None:
            found = self.step().reshape(-1, 5)
            return np.ascontiguousarray(found[:, :4]), 2.0 * np.arctan(0.5 * found[:, 4])
        motion = self.motion
        change = motion.u.x.array - motion.u_old.x.array
        strains = motion.generalized_strains.value - motion.generalized_strains_old.value
        return self.increments(change, strains), None


class SurfaceStress:
    """The constitutive law at the facets' points, one step at a time.

    Args:
        strained: Strain of the points.
        law: Constitutive law.

    Attributes:
        strained: Strain of the points.
        response: Last response of the law.
        strain: Strain increments of that response (n, 4).
        liquid: Ferrostatic pressure at the points at the end of the step (n,), Pa.
    """

    def __init__(self, strained: SurfaceStrain, law: Law) -> None:
        self.strained, self._law = strained, law
        count = len(strained.thickness)
        self.strain: Array = np.zeros((count, 4))
        self.response = Response.empty(count, len(law.state_names))

    def begin(
        self,
        old: ContactState,
        temperatures: tuple[Array, Array],
        liquid: Array,
        dt: float,
        solid: Solid,
    ) -> None:
        """Prepare a step.

        Args:
            old: Committed state.
            temperatures: Temperatures at the points, at start and end of the step, K.
            liquid: Ferrostatic pressure at the points at its end, Pa.
            dt: Duration, s.
            solid: Gives the thermal strain.
        """
        before, after = temperatures
        strain = solid.thermal_strain
        self._thermal = np.asarray(strain(after)) - np.asarray(strain(before))
        self._old, self._temperatures, self._dt = old, temperatures, dt
        self._coefficients = self._law.coefficients(before, after)
        self.liquid = liquid

    def integrate(self, strain: Array, stress_old: Array, internal: Array) -> Response:
        """Response of the law to increments (n, 4) from an old stress and state."""
        step = MaterialStep(strain, self._thermal, *self._temperatures, self._dt)
        self._law.integrate(
            step, stress_old, internal, coefficients=self._coefficients, out=self.response
        )
        return self.response

    def evaluate(self, normal: Array) -> tuple[Array, Array, Array]:
        """Stress along `normal` (n, 2) and its derivatives.

        Returns:
            n . sigma n (n,), including ferrostatic pressure; its derivatives by the strain (n, 4)
            and by the angle of rotation of the stress (n,).
        """
        self.strain, angle = self.strained.of_step()
        stress_old, internal = self._old.stress, self._old.internal
        if angle is not None:
            stress_old, internal = turned(stress_old, angle), self._law.turned(internal, angle)
        response = self.integrate(self.strain, stress_old, internal)
        x, y = normal.T
        along = np.column_stack([x * x, y * y, np.zeros_like(x), SQRT2 * x * y])
        found = np.einsum("ni,ni->n", along, response.stress) - self.liquid
        by_strain = np.einsum("ni,nij->nj", along, response.tangent)
        xx, yy, _, shear = response.stress.T
        turning = (y * y - x * x) * SQRT2 * shear + 2.0 * x * y * (xx - yy)
        return found, by_strain, turning
