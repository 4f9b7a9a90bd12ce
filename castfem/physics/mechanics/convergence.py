"""When equilibrium is good enough: each kind of unknown has a criterion of its own."""

from __future__ import annotations

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.mechanics.residual_state import ResidualState
from castfem.physics.mechanics.scaling import Scales, over
from castfem.physics.mechanics.supports import Constraints

ARRIVED = 1e-12  # of their displacement: how far supports that move may be from their goal


@dataclass(frozen=True, slots=True)
class Criteria:
    """What may be out of balance in a section.

    Attributes:
        comm: Its ranks. scales: Sizes. constraints: Supports.
        tolerance: Out-of-balance stress left, relative to the stress there is.
    """

    comm: MPI.Comm
    scales: Scales
    constraints: Constraints
    tolerance: float

    def sizes(
        self, residual_state: ResidualState, residual: Array, load: Array
    ) -> dict[str, float]:
        """What is out of balance, over what may be, for each kind of unknown (collective).

        "forces": the worst node, as the stress around it that would make such a force, against the
        stress in the section.  "axial": the worst test direction of the planes against the sum of
        the absolute forces.  "supports": distance from where supports are to be.

        Args:
            residual_state: The unknowns and what is known there.
            residual: Local, N/m; at supports the distance from where they are to be, m.
            load: Along the test directions of the planes (free,), N/m.
        """
        scale, fixed, force_per_stress = (
            residual_state.scale,
            self.constraints.fixed,
            self.scales.force_per_stress,
        )
        nodal = np.abs(residual[: len(force_per_stress)]) / force_per_stress
        missing = nodal[fixed] * force_per_stress[fixed]
        nodal[self.constraints.prescribed] = 0.0
        largest = np.abs(residual_state.local[fixed]).max(initial=0.0)
        worst = reductions.largest_of(
            self.comm, [nodal.max(initial=0.0), missing.max(initial=0.0), largest]
        )
        allowed = self.tolerance * scale.typical + scale.rounding
        found = {"forces": over(float(worst[0]), allowed)}
        if self.constraints.moving:
            found["supports"] = over(float(worst[1]), ARRIVED * float(worst[2]))
        if len(load):
            most = float(np.abs(load).max()) * self.scales.length
            total = self.tolerance * (scale.total + most) + scale.rounding * self.scales.area
            left = float(np.abs(residual_state.balance).max()) * self.scales.length
            found["axial"] = over(left, total)
        return found
