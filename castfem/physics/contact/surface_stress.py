"""Stress of the solid at the facets' points, which Nitsche's method asks for.

The constitutive law has a further rule of points there, with a state of its own.
"""

from __future__ import annotations

import copy

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


class SurfaceStress:
    """The constitutive law at the facets' points, one step at a time.

    Args:
        facets: The points.
        law: Constitutive law.
        gradients: Operator from displacement to its gradient at the points.
        motion: Displacement and generalized strains.
        step: Deformation at the end and at the start of a step at large strain; None at small.

    Attributes:
        response: What the law answered last. strain: Increments it was asked about (n, 4).
        liquid: Ferrostatic pressure at the points at the end of the step (n,), Pa.
    """

    def __init__(
        self,
        facets: Facets,
        law: Law,
        gradients: sparse.csr_matrix,
        motion: Motion,
        step: Deformations | None,
    ) -> None:
        self._law, self._gradients, self._motion = law, gradients, motion
        self._step = None
        if step is not None:
            self._step = facets.tabulate(finite_strain.increment(*step))
        self._thickness = np.column_stack([np.ones(facets.count), facets.position])
        self.strain: Array = np.zeros((facets.count, 4))
        self.response = Response.empty(facets.count, len(law.state_names))

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
            temperatures: At the points, at start and end of the step, K.
            liquid: Ferrostatic pressure at the points at its end, Pa.
            dt: Its length, s.
            solid: Has the thermal strain.
        """
        before, after = temperatures
        strain = solid.thermal_strain
        self._thermal = np.asarray(strain(after)) - np.asarray(strain(before))
        self._old, self._temperatures, self._dt = old, temperatures, dt
        self._coefficients = self._law.coefficients(before, after)
        self.liquid = liquid

    def of_law(self, law: Law) -> SurfaceStress:
        """The same for another law, with a response of its own."""
        other = copy.copy(self)
        other._law = law
        other.response = Response.empty(len(self.strain), len(law.state_names))
        return other

    def _increments(self) -> tuple[Array, Array, Array]:
        """Strain increments (n, 4), and the old stress and state turned with the material."""
        old = self._old
        if self._step is not None:
            found = self._step().reshape(-1, 5)
            angle = 2.0 * np.arctan(0.5 * found[:, 4])
            strain = np.ascontiguousarray(found[:, :4])
            return strain, turned(old.stress, angle), self._law.turned(old.internal, angle)
        motion = self._motion
        strain = self.increments(
            motion.u.x.array - motion.u_old.x.array,
            motion.generalized_strains.value - motion.generalized_strains_old.value,
        )
        return strain, old.stress, old.internal

    def increments(self, change: Array, generalized_strains: Array) -> Array:
        """Strain at the points (n, 4) of small changes of displacement and generalized strains."""
        g = (self._gradients @ change).reshape(-1, 4)
        return np.column_stack(
            [
                g[:, 0],
                g[:, 3] + generalized_strains[3],
                self._thickness @ generalized_strains[:3],
                (g[:, 1] + g[:, 2]) / SQRT2,
            ]
        )

    def integrate(self, strain: Array, stress_old: Array, internal: Array) -> Response:
        """What the law answers to increments (n, 4) from an old stress and state."""
        step = MaterialStep(strain, self._thermal, *self._temperatures, self._dt)
        self._law.integrate(
            step, stress_old, internal, coefficients=self._coefficients, out=self.response
        )
        return self.response

    def evaluate(self, normal: Array) -> tuple[Array, Array, Array]:
        """Stress along `normal` (n, 2) and its derivatives.

        Returns:
            n . sigma n (n,), ferrostatic pressure included; its derivative by the strain (n, 4) and
            by the angle at which the stress turns (n,).
        """
        self.strain, stress_old, internal = self._increments()
        response = self.integrate(self.strain, stress_old, internal)
        x, y = normal.T
        along = np.column_stack([x * x, y * y, np.zeros_like(x), SQRT2 * x * y])
        found = np.einsum("ni,ni->n", along, response.stress) - self.liquid
        by_strain = np.einsum("ni,nij->nj", along, response.tangent)
        xx, yy, _, shear = response.stress.T
        turning = (y * y - x * x) * SQRT2 * shear + 2.0 * x * y * (xx - yy)
        return found, by_strain, turning
