"""Functions used in the mechanical forms: displacement, stress, pressure and tangent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem.section import Section
from castfem.physics.constitutive.base import Response
from castfem.physics.mechanics.quadrature import ActivePoints, Points

ONE = np.array([1.0, 1.0, 1.0, 0.0])
MEAN = ONE / 3.0
AXIAL = np.array([0.0, 0.0, 1.0, 0.0])  # Mandel


@dataclass(frozen=True, slots=True)
class Fields:
    """Functions and constants used in the mechanical forms."""

    u: fem.Function  #: present displacement, m
    u_old: fem.Function  #: displacement at the start of the step
    generalized_strains: fem.Constant  #: at present (4,), see `castfem.forms.mechanics`
    generalized_strains_old: fem.Constant  #: at the start of the step
    one: fem.Constant  #: a direction of the generalized strains (4,)
    other: fem.Constant  #: a second direction
    deviator: fem.Function  #: stress deviator, Mandel (4,), Pa
    tangent: fem.Function  #: deviatoric tangent (4, 4), Pa
    mean: fem.Function  #: mean stress, linear on each cell, Pa
    #: ferrostatic pressure, linear on each cell, Pa; None without one
    pressure: fem.Function | None

    def clear_stress(self) -> None:
        """Set the stress to zero everywhere."""
        for one in (self.deviator, self.mean, self.tangent):
            one.x.array[:] = 0.0

    def take_stress(self, points: ActivePoints, response: Response) -> tuple[Array, Array]:
        """Split the stress of a response between the two rules.

        Returns:
            Deviators at the points of their rule (deviator_points, 4); mean stress, linear on each
            cell, at the points of its rule.
        """
        every = response.stress @ MEAN
        deviator = response.stress[: points.deviator_points] - np.outer(
            every[: points.deviator_points], ONE
        )
        mean = points.linear(every[points.deviator_points :])
        points.fill(self.deviator, deviator)
        points.fill_mean(self.mean, mean)
        return deviator, mean

    def take_pressure(self, points: Points, pressure: Array) -> None:
        """Set the ferrostatic pressure at the points of the mean stress (n,), Pa."""
        if self.pressure is not None:
            points.mean.fill(self.pressure, points.linear(pressure))

    def take_tangent(self, points: ActivePoints, response: Response) -> Array:
        """Split the tangent in the same way: laws change the volume only elastically.

        At flowing points a small stiffness against change of shape remains: that of perfect
        plasticity is zero along the flow, and rounding makes it negative.

        Returns:
            Bulk modulus at the points of the mean stress, Pa.
        """
        tangent = response.tangent.reshape(-1, 16)
        bulk = tangent @ np.outer(MEAN, MEAN).ravel()
        shape = tangent[: points.deviator_points] - np.outer(
            bulk[: points.deviator_points], np.outer(ONE, ONE)
        )
        flows = np.flatnonzero(response.flows[: points.deviator_points])
        shape[flows] += np.outer(1e-9 * bulk[flows], np.eye(4) - np.outer(ONE, ONE) / 3.0)
        points.fill(self.tangent, shape)
        return np.asarray(bulk[points.deviator_points :])

    @classmethod
    def on(
        cls, section: Section, space: fem.FunctionSpace, points: Points, pressure: bool
    ) -> Fields:
        """Return fields of zeros; a pressure only if requested."""
        vectors = [fem.Constant(section.mesh, np.zeros(4)) for _ in range(4)]
        at, mean = points.deviator, points.mean
        return cls(
            fem.Function(space), fem.Function(space),
            vectors[0], vectors[1], vectors[2], vectors[3],
            at.function(4), at.function(4, 4), mean.function(),
            mean.function() if pressure else None,
        )  # fmt: skip
