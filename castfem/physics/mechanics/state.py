"""The committed mechanical state, and the result of a step.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from castfem.base.types import Array
from castfem.physics.contact.interaction import InteractionState
from castfem.physics.contact.state import ContactState
from castfem.physics.mechanics.planes import STRAIGHT, Bending


@dataclass(frozen=True, slots=True)
class MechanicalState:
    """The committed state; nothing ever writes into its arrays.

    Attributes:
        time: Since the meniscus, s.
        displacement: Of this rank's nodes, ghosts included, x and y by turns, m.
        generalized_strains: [a0 - 1, a1, a2, across] (4,).
        scalars: Free degrees of freedom of the planes (free,).
        rate: d displacement / dt of the owned nodes over the last step, m/s.
        scalar_rate: d scalars / dt.
        unsteadiness: Relative change of the rates over the last step; inf before the first.
        temperature: At the owned vertices, K.
        stress: At the points, Mandel (points, 4), Pa; the mean stress counts at the points of its
            own rule alone, the deviator at those of the other.
        internal: What the law remembers (points, states).
        pressure: Ferrostatic pressure at the points of the mean stress, Pa; empty without one.
        interactions: State of each of the slice's interactions.
        bending: By the machine's curvature; all zero in a strand that goes straight down.
    """

    time: float
    displacement: Array
    generalized_strains: Array
    scalars: Array
    rate: Array
    scalar_rate: Array
    unsteadiness: float
    temperature: Array
    stress: Array
    internal: Array
    pressure: Array
    interactions: tuple[InteractionState, ...] = ()
    bending: Bending = STRAIGHT

    @property
    def contact(self) -> ContactState | None:
        """Contact with a wall; None without one."""
        return next((one for one in self.interactions if isinstance(one, ContactState)), None)

    @property
    def withdrawal_resistance(self) -> Array:
        """Axial force of all friction on the strand so far, N, and its moments, N m, (3,)."""
        return sum((one.withdrawal_resistance for one in self.interactions), np.zeros(3))


@dataclass(frozen=True, slots=True)
class Balance:
    """Forces of the slice and what is left unbalanced.

    Attributes:
        axial: Int sigma_zz da (N), and its moments with x and y (N m), (3,): the left of (38).
        axial_error: Largest imbalance along a test direction of the planes, what holds them before
            there is a shell (`plane_equations`) counted in, over the sum of the absolute forces.
        forces_error: Largest imbalance of a free node, over the force of the mean stress there.
        support: Sum of the forces of all supports, x and y, N/m.
    """

    axial: Array
    axial_error: float
    forces_error: float
    support: Array


@dataclass(frozen=True, slots=True)
class MechanicalResult:
    """One attempted step, or several that were taken one after another.

    Attributes:
        converged: Whether the solver succeeded and what it found can be kept; if not, `state` is
            the old one.
        state: The new state. newton: Newton iterations. reason: The solver's word.
        balance: Forces of the new state; None if not converged.
        dissipation: Viscoplastic work over the step at the deviator's points, J/m3.
        flowing: Share of the section's area that flows.
        refused: Whether there was equilibrium, in a state that cannot be kept.
        unborne: Whether a load meets no shell that could bear it: no shorter step would.
    """

    converged: bool
    state: MechanicalState
    newton: int
    reason: str
    balance: Balance | None
    dissipation: Array
    flowing: float
    refused: bool = False
    unborne: bool = False

    def before(self, after: MechanicalResult) -> MechanicalResult:
        """Both, `after` being the later: its state, and the work of both."""
        return replace(
            after,
            newton=self.newton + after.newton,
            dissipation=self.dissipation + after.dissipation,
        )
