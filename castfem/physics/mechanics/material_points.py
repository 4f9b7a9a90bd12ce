"""The constitutive law at the points of both quadrature rules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array, Flags
from castfem.physics.constitutive.base import Law, MaterialStep, Response, turned
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.constitutive.kernel import constants


@dataclass(frozen=True, slots=True)
class FedPoints:
    """Points of fed liquid: the stiffness used there."""

    carries: Flags  #: points in cells that carry stress (points,); others have no stiffness
    liquid: Flags  #: points without coherent solid (points,)
    young: float  #: modulus of liquid points in cells that carry stress, with Poisson's ratio 0, Pa

    @classmethod
    def of(cls, carries: Flags, liquid: Flags, solid: float, head: float) -> FedPoints:
        """Return the points of a step, with a modulus according to the pressure.

        Args:
            carries: See `FedPoints`.
            liquid: See `FedPoints`.
            solid: Young's modulus at the solidus, Pa.
            head: Largest pressure of the liquid, Pa.
        """
        # In cells that carry stress; without pressure, from the modulus of the solid.
        return cls(carries, liquid, max(30.0 * head, 1e-6 * solid))

    def soften(self, rows: slice, table: Array) -> None:
        """Write the moduli into the table of coefficients of some points."""
        young = np.where(self.carries[rows], self.young, 0.0)[self.liquid[rows]]
        at = np.flatnonzero(self.liquid[rows])
        table[at, constants.SHEAR], table[at, constants.BULK] = young / 2.0, young / 3.0
        table[at, constants.YOUNG] = self.young
        table[at, constants.CARRY_DEVIATOR] = table[at, constants.CARRY_MEAN] = 0.0
        table[at, constants.FRESH] = 1.0
        # Points that freeze at the very end of a step are no softer than the liquid was.
        least = self.young / table[:, constants.YOUNG]
        np.maximum(table[:, constants.SHARE], np.minimum(least, 1.0), out=table[:, constants.SHARE])


class Material:
    """The law at the deviator's points; where only the mean stress counts, its elasticity.

    Flow leaves the volume unchanged, so that a law's mean stress is that of its elastic part;
    almost a third of the points need no more.

    Args:
        law: Constitutive law.
        count: Number of its quadrature points.
        deviators: Number of points of the deviator's rule, which come first.

    Attributes:
        response: Response at these points; written by each `integrate`.
    """

    def __init__(self, law: Law, count: int, deviators: int) -> None:
        self._law = law
        self.response = Response.empty(count, len(law.state_names))
        self.response.state[:] = law.initial_state(count)
        rows = (slice(0, deviators), slice(deviators, None))
        laws = (law, ThermoElastic(law.elasticity))
        self._parts = [(m, r, self.response.part(r)) for m, r in zip(laws, rows, strict=True)]

    def begin(
        self,
        before: Array,
        after: Array,
        thermal: Array,
        dt: float,
        old: tuple[Array, Array],
        fed: FedPoints | None = None,
    ) -> None:
        """Prepare a step.

        Args:
            before: Temperatures at its start (points,), K, for the moduli.
            after: Temperatures at its end.
            thermal: Thermal strain increments (points,).
            dt: Duration, s.
            old: Stress (points, 4), Pa, and state (points, states) at its start.
            fed: Points of fed liquid; None if the law covers all points.
        """
        self._temperatures, self._thermal, self._dt = (before, after), thermal, dt
        self._old = old
        self._coefficients = [m.coefficients(before[r], after[r]) for m, r, _ in self._parts]
        if fed is not None:
            for (_, r, _), table in zip(self._parts, self._coefficients, strict=True):
                fed.soften(r, table)

    def integrate(self, strain: Array, angle: Array | None = None) -> None:
        """Fill `response` for strain increments (points, 4).

        Args:
            strain: The increments.
            angle: Rotation of the old stress and state with the material (points,); None for none.
        """
        before, after = self._temperatures
        stress_old, internal = self._old
        if angle is not None:
            stress_old, internal = turned(stress_old, angle), self._law.turned(internal, angle)
        for (law, r, out), table in zip(self._parts, self._coefficients, strict=True):
            step = MaterialStep(strain[r], self._thermal[r], before[r], after[r], self._dt)
            law.integrate(step, stress_old[r], internal[r], coefficients=table, out=out)
