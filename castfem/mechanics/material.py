"""The constitutive law at the points of both quadrature rules."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from castfem.laws.base import Law, MaterialStep, Response
from castfem.laws.flow import ThermoElastic
from castfem.mechanics.points import Points

Array = npt.NDArray[np.float64]


class Material:
    """The law at the deviator's points; where the mean stress alone counts, its elasticity.

    Flow leaves the volume unchanged, so a law's mean stress is that of its elastic part, and almost
    a third of the points need no more.

    Args:
        law: Constitutive law.
        points: Quadrature points.

    Attributes:
        response: At all points; written to by each `integrate`.
    """

    def __init__(self, law: Law, points: Points) -> None:
        self.response = Response.empty(points.count, len(law.state_names))
        self.response.state[:] = law.initial_state(points.count)
        rows = (slice(0, points.split), slice(points.split, None))
        laws = (law, ThermoElastic(law.elasticity))
        self._parts = [(m, r, self.response.part(r)) for m, r in zip(laws, rows, strict=True)]

    def begin(self, before: Array, after: Array, thermal: Array, dt: float) -> None:
        """Prepare a step.

        Args:
            before: Temperatures of the moduli at its start (points,), K.
            after: At its end.
            thermal: Thermal strain increments (points,).
            dt: Its length, s.
        """
        self._temperatures, self._thermal, self._dt = (before, after), thermal, dt
        self._coefficients = [m.coefficients(before[r], after[r]) for m, r, _ in self._parts]

    def integrate(self, strain: Array, stress_old: Array, internal: Array) -> None:
        """Fill `response` for strain increments (points, 4) from the old stress and state."""
        before, after = self._temperatures
        for (law, r, out), table in zip(self._parts, self._coefficients, strict=True):
            step = MaterialStep(strain[r], self._thermal[r], before[r], after[r], self._dt)
            law.integrate(step, stress_old[r], internal[r], coefficients=table, out=out)
