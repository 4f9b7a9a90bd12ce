"""Where contact is about to change its status: there a run has a derivative to each side."""

from __future__ import annotations

from collections.abc import Mapping

from mpi4py import MPI

import numpy as np

from castfem.base.types import Array, Flags
from castfem.fem import reductions
from castfem.physics.contact.state import CONTACT, ContactState
from castfem.studies.sensitivity.parameters import Parameter
from castfem.studies.sensitivity.result import Kink


class Kinks:
    """Collects them along a run.

    Args:
        comm: Ranks of the run.

    Attributes:
        found: One for each window and parameter that has any.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm, self.found = comm, list[Kink]()

    def look(
        self,
        parameter: Parameter,
        position: float,
        state: ContactState,
        closed: Flags,
        slopes: Mapping[str, Array],
    ) -> None:
        """Note the points of a committed state that change within a step (collective).

        Args:
            parameter: Whose difference quotients have that step.
            position: Of the slice below the meniscus, m.
            state: The contact.
            closed: Points that touch (n,).
            slopes: Its derivatives.
        """
        left = np.where(closed, state.pressure, state.gap)
        change = np.abs(np.where(closed, slopes[f"{CONTACT}pressure"], slopes[f"{CONTACT}gap"]))
        near = np.isfinite(left) & (change > 0.0) & (np.abs(left) <= parameter.step * change)
        count = int(reductions.total(self._comm, float(near.sum())))
        if count:
            _, x, y = reductions.peak(self._comm, near.astype(float), state.place)
            self.found.append(Kink(parameter.name, position, count, (x, y)))
