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
    """Points of liquid that is fed: what stands in for a stiffness there."""

    carries: Flags  #: points in cells that carry stress (points,); the others have none at all
    liquid: Flags  #: points without coherent solid (points,)
    young: float  #: modulus at these in cells that carry stress, Poisson's ratio being 0, Pa

    @classmethod
    def of(cls, carries: Flags, liquid: Flags, solid: float, head: float) -> FedPoints:
        """The points of a step, by what they have to stand.

        Args:
            carries: See `FedPoints`.
            liquid: Likewise.
            solid: Young's modulus at the solidus, Pa.
            head: Largest pressure of the liquid, Pa.
        """
        # In cells that carry stress; where nothing presses, by the modulus of the solid.
        return cls(carries, liquid, max(30.0 * head, 1e-6 * solid))

    def soften(self, rows: slice, table: Array) -> None:
        """Put the moduli into the table of coefficients of some of the points."""
        young = np.where(self.carries[rows], self.young, 0.0)[self.liquid[rows]]
        at = np.flatnonzero(self.liquid[rows])
        table[at, constants.SHEAR], table[at, constants.BULK] = young / 2.0, young / 3.0
        table[at, constants.YOUNG] = self.young
        table[at, constants.CARRY_DEVIATOR] = table[at, constants.CARRY_MEAN] = 0.0
        table[at, constants.FRESH] = 1.0
        # What freezes at the very end of a step is no softer than the liquid it was.
        least = self.young / table[:, constants.YOUNG]
        np.maximum(table[:, constants.SHARE], np.minimum(least, 1.0), out=table[:, constants.SHARE])


class Material:
    """The law at the deviator's points; where the mean stress alone counts, its elasticity.

    Flow leaves the volume unchanged, so a law's mean stress is that of its elastic part, and almost
    a third of the points need no more.

    Args:
        law: Constitutive law.
        count: Quadrature points it is integrated at.
        deviators: Of them, those of the deviator's rule, which come first.

    Attributes:
        response: At these points; written to by each `integrate`.
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
            before: Temperatures of the moduli at its start (points,), K.
            after: At its end.
            thermal: Thermal strain increments (points,).
            dt: Its length, s.
            old: Stress (points, 4), Pa, and state (points, states) at its start.
            fed: Points of liquid that is fed; None where the law knows all.
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
            angle: By which the old stress and state have turned with the material (points,); None
                for nowhere.
        """
        before, after = self._temperatures
        stress_old, internal = self._old
        if angle is not None:
            stress_old, internal = turned(stress_old, angle), self._law.turned(internal, angle)
        for (law, r, out), table in zip(self._parts, self._coefficients, strict=True):
            step = MaterialStep(strain[r], self._thermal[r], before[r], after[r], self._dt)
            law.integrate(step, stress_old[r], internal[r], coefficients=table, out=out)
