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
    """The committed state; nothing ever writes into its arrays."""

    time: float  #: since the meniscus, s
    displacement: Array  #: of this rank's nodes, ghosts included, x and y by turns, m
    generalized_strains: Array  #: [a0 - 1, a1, a2, across] (4,)
    scalars: Array  #: free degrees of freedom of the planes (free,)
    rate: Array  #: d displacement / dt of the owned nodes over the last step, m/s
    scalar_rate: Array  #: d scalars / dt
    unsteadiness: float  #: relative change of the rates over the last step; inf before the first
    temperature: Array  #: at the owned vertices, K
    #: at the points, Mandel (points, 4), Pa; the mean stress counts at the points of its own rule
    #: alone, the deviator at those of the other
    stress: Array
    internal: Array  #: what the law remembers (points, states)
    pressure: Array  #: ferrostatic pressure at the points of the mean stress, Pa; empty without one
    interactions: tuple[InteractionState, ...] = ()  #: state of each of the slice's interactions
    #: by the machine's curvature; all zero in a strand that goes straight down
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
    """Forces of the slice and what is left unbalanced."""

    axial: Array  #: int sigma_zz da (N), and its moments with x and y (N m), (3,): the left of (38)
    #: largest imbalance along a test direction of the planes, what holds them before there is a
    #: shell (`plane_equations`) counted in, over the sum of the absolute forces
    axial_error: float
    #: largest imbalance of a free node, over the force of the mean stress there
    forces_error: float
    support: Array  #: sum of the forces of all supports, x and y, N/m


@dataclass(frozen=True, slots=True)
class MechanicalResult:
    """One attempted step, or several that were taken one after another."""

    #: whether the solver succeeded and what it found can be kept; if not, `state` is the old one
    converged: bool
    state: MechanicalState  #: the new state
    newton: int  #: Newton iterations
    reason: str  #: the solver's word
    balance: Balance | None  #: forces of the new state; None if not converged
    dissipation: Array  #: viscoplastic work over the step at the deviator's points, J/m3
    flowing: float  #: share of the section's area that flows
    refused: bool = False  #: whether there was equilibrium, in a state that cannot be kept
    #: whether a load meets no shell that could bear it: no shorter step would
    unborne: bool = False

    def before(self, after: MechanicalResult) -> MechanicalResult:
        """Both, `after` being the later: its state, and the work of both."""
        return replace(
            after,
            newton=self.newton + after.newton,
            dissipation=self.dissipation + after.dissipation,
        )
