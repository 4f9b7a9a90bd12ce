"""Summary of the contact of a slice."""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.contact.state import OPEN, SLIP, STICK, ContactState, ContactSummary
from castfem.physics.contact.wall_contact import WallContact


def summary(
    contact: WallContact, state: ContactState, generalized_strains: Array
) -> ContactSummary:
    """Contact of the whole section (collective).

    Args:
        contact: Contact of the slice.
        state: State of the contact.
        generalized_strains: Generalized strains (4,), which give the slice's thickness.
    """
    comm, touches = contact.section.comm, state.status != OPEN
    weight, force = state.weight, -state.pressure[:, None] * state.normal
    along = np.column_stack([-state.normal[:, 1], state.normal[:, 0]])
    force = force + state.friction[:, :1] * along
    area = weight * contact.thickness(state, generalized_strains)
    counts = [float((state.status == s).sum()) for s in (OPEN, STICK, SLIP)]
    sums = reductions.totals(
        comm,
        [
            *(area @ force),
            weight @ state.friction[:, 1],
            weight @ touches,
            weight @ ~touches,
            *counts,
            weight @ (state.status == STICK),
        ],
    )
    # Sum of touching and open parts: with complete contact the fraction is exactly 1.
    length = float(sums[3])
    whole = length + float(sums[4])
    met = np.where(np.isfinite(state.gap), state.gap, -np.inf)
    pressure, *highest = reductions.peak(comm, state.pressure, state.place)
    mean, mean_at = contact.mean.highest(state.pressure, state.place)
    gap, *widest = reductions.peak(comm, met, state.place)
    deepest = reductions.largest(comm, -state.gap[touches])
    return ContactSummary(
        pressure=max(pressure, 0.0),
        mean_pressure=max(mean, 0.0),
        penetration=max(deepest, 0.0),
        gap=max(gap, 0.0),
        force=sums[:2],
        axial=float(sums[2]),
        length=length,
        share=length / whole,
        sticking=None if contact.contact.friction is None else float(sums[8]) / whole,
        points=(int(sums[5]), int(sums[6]), int(sums[7])),
        highest=np.array(highest),
        highest_mean=mean_at,
        widest=np.array(widest),
    )
