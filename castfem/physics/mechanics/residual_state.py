"""The residual of the mechanical problem at one set of unknowns."""

from __future__ import annotations

from dataclasses import dataclass

from castfem.base.types import Array
from castfem.physics.mechanics.scaling import StressScale


@dataclass(slots=True)
class ResidualState:
    """The residual at one set of unknowns, and what was found with it.

    Attributes:
        local: The unknowns of this rank. generalized_strains: Generalized strains (4,).
        forces: Nodal forces (owned,), N/m; at supports what they carry.
        balance: Work of the stress less that of the load along each test direction, N/m.
        scale: How large the stress is.
    """

    local: Array
    generalized_strains: Array
    forces: Array
    balance: Array
    scale: StressScale
