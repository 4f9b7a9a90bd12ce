"""Planes of a slice that is bent by the machine's curvature (thesis III.1).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.mechanics.generalized_plane_strain import (
    Bending,
    Planes,
    StepTaken,
    TimeHistory,
    zero,
)

if TYPE_CHECKING:
    from castfem.physics.machine.extraction.effort import Effort, Withdrawal


def same_curvature(one: float, other: float) -> bool:
    """Whether two curvatures, 1/m, differ only by rounding."""
    return abs(one - other) <= 1e-9 * max(abs(one), abs(other))


@dataclass(frozen=True)
class ImposedAxis:
    """Position at which the thickness of the slice stays constant in each time interval (42)."""

    #: start of each interval (n,), s; the first position also holds before
    times: tuple[float, ...]
    places: tuple[float, ...]  #: positions y1 (n,), m
    thicknesses: tuple[float, ...]  #: thickness of the slice there (n,)

    @classmethod
    def alternating(
        cls,
        curvature: Callable[[float], float],
        times: Sequence[float],
        bending: float,
        straightening: float,
    ) -> ImposedAxis:
        """Return one position for increasing curvature, another for decreasing.

        While the curvature is constant, the position is kept. At a change of position the slice
        keeps the thickness that it has there; at the first position it is 1.

        Args:
            curvature: Curvature k of the strand's middle over time, 1/m.
            times: Increasing times between which it is monotonic, s.
            bending: y1 while it increases, m.
            straightening: y1 while it decreases, m.
        """
        found = [(times[0], bending, 1.0)]
        for start, end in itertools.pairwise(times):
            before, after = abs(curvature(start)), abs(curvature(end))
            if same_curvature(after, before):
                continue
            place = bending if after > before else straightening
            _, last, thickness = found[-1]
            if place != last:
                k = curvature(start)
                found.append((start, place, thickness * (1.0 - k * place) / (1.0 - k * last)))
        parts = tuple(zip(*found, strict=True))
        return cls(*parts)

    def at(self, time: float) -> tuple[float, float]:
        """The place y1, m, and the thickness of the slice there, at `time` (s)."""
        i = max(bisect_right(self.times, time) - 1, 0)
        return self.places[i], self.thicknesses[i]


@dataclass(frozen=True)
class BentPlanes(Planes):
    """Planes that converge to the centre of curvature of the machine (39)-(44).

    y points from the extrados (outside) at y = -h/2 to the intrados; the machine's radius R is that
    of the extrados. With the curvature k = 1/(R - h/2) of the strand's middle,

        a2 = -a0 k                                                (41)
        a0 = 1/(1 - k y1),  a2 = -k/(1 - k y1)                    (43)-(44)

    the first with a0 free, the second with the neutral axis imposed at y1. The slice is free of
    strain in its first position: a curved mould casts a curved strand.

    The equation of a0: in a curved strand, with t along it and q_t the friction force per metre
    against the casting direction, equilibrium is N' = k M' + q_t and M' = Q, so that

        (N - k M)' = q_t - M k'

    Rolls without friction conserve N - k M where the curvature is constant; where it changes the
    drives below supply the work of bending, -M k' >= 0 in a strand that flows. This follows with
    the "tangential" test direction [1, 0, -k]: N - k M = F - int M dk; along it the centre of
    curvature is fixed. The integral is taken by the trapezoidal rule, implicitly in the step
    itself, with k at mid-step in the test direction. The "axial" test direction, [1, 0, 0], is the
    first equation of (38), N = F.
    """

    #: 1/R over time, 1/m; linear between the rolls (`castfem.physics.machine`)
    curvature: TimeHistory
    half_thickness: float  #: h/2, m
    #: y1, m, where the slice stays 1 thick, or where it keeps its thickness in each time interval;
    #: None for a free axis, found by equilibrium
    neutral_axis: float | ImposedAxis | None = None
    force: TimeHistory = zero  #: external axial force F over time, N
    #: test direction, which determines what F balances: N - k M, "tangential", or N, "axial"
    test_direction: Literal["tangential", "axial"] = "tangential"
    #: whether F contains the work of bending, like a measured force: it is then not subtracted
    #: again
    contains_work: bool = False
    #: axial force of rolls and drives on the whole strand, in addition to F; None without
    effort: Effort | None = None
    position: TimeHistory = zero  #: position of the slice over time, m
    parts: int = 1  #: number of modelled parts in the strand

    @property
    def steady(self) -> bool:
        """See `Planes`: the strand is bent on its way."""
        return False

    @property
    def free(self) -> tuple[str, ...]:
        """See `Planes`."""
        return ("a0",) if self.neutral_axis is None else ()

    def middle(self, time: float) -> float:
        """Curvature k of the strand's middle, 1/m."""
        chi = self.curvature(time)
        slack = 1.0 - chi * self.half_thickness
        if not slack > 0.0:
            raise InputError(
                f"the strand's radius of curvature ({1.0 / chi:g} m) must exceed half its "
                f"thickness ({self.half_thickness:g} m)"
            )
        return chi / slack

    def at(self, time: float) -> tuple[Array, Array, Array]:
        """See `Planes`."""
        k = self.middle(time)
        if self.neutral_axis is None:
            direction = np.array([[1.0], [0.0], [-k], [0.0]])
            return np.array([0.0, 0.0, -k, 0.0]), direction, self._test(k)
        axis = self.neutral_axis
        place, there = axis.at(time) if isinstance(axis, ImposedAxis) else (axis, 1.0)
        thickness = there / (1.0 - k * place)
        none = np.zeros((4, 0))
        return np.array([thickness - 1.0, 0.0, -k * thickness, 0.0]), none, none

    def _test(self, k: float) -> Array:
        """Test direction of a0, (4, 1)."""
        return np.array([[1.0], [0.0], [-k if self.test_direction == "tangential" else 0.0], [0.0]])

    def load(self, time: float) -> Array:
        """See `Planes`."""
        return np.array([self.force(time), 0.0, 0.0, 0.0])

    def withdrawal_force(self, past: Bending, time: float) -> float:
        """See `Planes`."""
        if self.effort is None or past.withdrawal is None:
            return 0.0
        return self.effort.force(past.withdrawal, self.position(time)) / self.parts

    def equilibrium(self, past: Bending, time: float) -> tuple[Array, Array]:
        """See `Planes`."""
        load = self.load(time)
        load[0] += self.withdrawal_force(past, time)
        if self.neutral_axis is not None:
            return np.zeros((4, 0)), load
        k = self.middle(time)
        if self.test_direction == "axial" or self.contains_work:
            return self._test(k), load
        # N - k M = F - W - dk (M_old + M) / 2, with the unknown M on the left: dk / 2 subtracted
        # from k.
        change = k - past.curvature
        taken = past.work + 0.5 * change * past.moment
        return self._test(k - 0.5 * change), load - [taken, 0.0, 0.0, 0.0]

    def initial_bending(self, time: float) -> Bending:
        """See `Planes`."""
        started = None if self.effort is None else self.effort.initial(self.position(time))
        return Bending(curvature=self.middle(time), withdrawal=started)

    def bending_after(self, past: Bending, step: StepTaken) -> Bending:
        """See `Planes`."""
        k, now = self.middle(step.time), step.moment()
        change_of_k = k - past.curvature
        same = same_curvature(k, past.curvature)
        axis = None if same else -float(step.change[0] / step.change[2])
        work = past.work + 0.5 * change_of_k * (past.moment + now)
        withdrawal = self._withdrawn(past, step, now, work)
        return Bending(k, now, work, axis, withdrawal)

    def _withdrawn(
        self, past: Bending, step: StepTaken, moment: float, work: float
    ) -> Withdrawal | None:
        """Forces of rolls and drives after a step."""
        if self.effort is None or past.withdrawal is None:
            return None
        from castfem.physics.machine.extraction.effort import Passing

        passing = Passing(self.parts * moment, self.parts * work, step.temperature, step.added)
        return self.effort.after(past.withdrawal, self.position(step.time), passing)

    def bending_force(self, now: Bending) -> float:
        """See `Planes`."""
        if self.test_direction == "axial" or self.neutral_axis is not None:
            return 0.0
        return now.curvature * now.moment - (0.0 if self.contains_work else now.work)
