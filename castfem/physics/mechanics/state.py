"""The committed mechanical state, and the result of a step.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from castfem.base.types import Array
from castfem.physics.contact.interaction import InteractionState
from castfem.physics.contact.state import ContactState
from castfem.physics.mechanics.generalized_plane_strain import STRAIGHT, Bending


@dataclass(frozen=True, slots=True)
class MechanicalState:
    """The committed state; its arrays are never modified."""

    time: float  #: time since the meniscus, s
    #: displacement of this rank's nodes, including ghosts, x and y alternating, m
    displacement: Array
    generalized_strains: Array  #: [a0 - 1, a1, a2, across] (4,)
    scalars: Array  #: free scalars of the planes (free,)
    rate: Array  #: d displacement / dt of the owned nodes over the last step, m/s
    scalar_rate: Array  #: d scalars / dt
    unsteadiness: float  #: relative change of the rates over the last step; inf before the first
    temperature: Array  #: temperature of the owned vertices, K
    #: stress at the points, Mandel (points, 4), Pa; only the mean stress is used at the points of
    #: its rule, only the deviator at the others
    stress: Array
    internal: Array  #: state variables of the law (points, states)
    pressure: Array  #: ferrostatic pressure at the points of the mean stress, Pa; empty without one
    interactions: tuple[InteractionState, ...] = ()  #: state of each of the slice's interactions
    #: bending by the curvature of the machine; all zero for a straight strand
    bending: Bending = STRAIGHT

    @property
    def contact(self) -> ContactState | None:
        """Contact with a wall; None without one."""
        return next((one for one in self.interactions if isinstance(one, ContactState)), None)

    @property
    def withdrawal_resistance(self) -> Array:
        """Accumulated axial force of friction on the strand, N, and its moments, N m, (3,)."""
        return sum((one.withdrawal_resistance for one in self.interactions), np.zeros(3))


@dataclass(frozen=True, slots=True)
class Balance:
    """Forces of the slice, and residuals."""

    #: int sigma_zz da (N), and its moments with x and y (N m), (3,): left-hand side of (38)
    axial: Array
    #: largest residual in a test direction of the planes, including the restraint before there is a
    #: shell (`plane_equilibrium`), over the sum of the absolute forces
    axial_error: float
    #: largest residual of a free node, relative to the force of the mean stress there
    forces_error: float
    support: Array  #: sum of the reactions of all supports, x and y, N/m


@dataclass(frozen=True, slots=True)
class MechanicalResult:
    """Result of one attempted step, or of several successive ones."""

    #: whether the solver succeeded and the result is accepted; if not, `state` is the old one
    converged: bool
    state: MechanicalState  #: the new state
    newton: int  #: Newton iterations
    reason: str  #: reason given by the solver
    balance: Balance | None  #: forces of the new state; None if not converged
    dissipation: Array  #: viscoplastic work over the step at the deviator's points, J/m3
    flowing: float  #: fraction of the section's area that is yielding
    refused: bool = False  #: whether equilibrium was found, but in an invalid state
    #: whether a load meets no shell that could carry it, so that a shorter step would not help
    unborne: bool = False

    def before(self, after: MechanicalResult) -> MechanicalResult:
        """The sum of two results, `after` being the later: its state, and the work of both."""
        return replace(
            after,
            newton=self.newton + after.newton,
            dissipation=self.dissipation + after.dissipation,
        )
