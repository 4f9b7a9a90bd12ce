"""Newton's method for the slice: options, line search, and when equilibrium is good enough."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.factorisation import default_options, pivoting_options
from castfem.fem.snes import Options
from castfem.physics.mechanics.interactions import Interactions
from castfem.physics.mechanics.scaling import Scales, StressScale, over
from castfem.physics.mechanics.supports import Constraints

# A shell that shrinks off its wall lets go of it point by point, an iteration each.
NEWTON: dict[str, Any] = {"snes_linesearch_type": "basic", "snes_max_it": 100}


def split_options(
    user: Options, symmetric: bool, ranks: int = 1
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of SNES, and those of the linear solver.

    Args:
        user: The user's, which win; with a preconditioner or a factorisation of his own nothing of
            the default one is left.
        symmetric: Whether the tangent is.
        ranks: How many share it.
    """
    factor: dict[str, Any] = {}
    if "pc_type" not in user:
        of_mumps = any(key.startswith("mat_mumps_") for key in user)
        choose = pivoting_options if of_mumps else default_options
        factor = choose(symmetric, ranks)
        if "pc_factor_mat_solver_type" in user:
            factor = {"pc_type": "cholesky" if symmetric else "lu"}
    chosen = {**NEWTON, "ksp_type": "preonly", **factor, **user}
    nonlinear = {k: v for k, v in chosen.items() if not k.startswith(("ksp_", "pc_", "mat_"))}
    return nonlinear, {k: v for k, v in chosen.items() if k not in nonlinear}


@dataclass(frozen=True, slots=True)
class LineSearchLimits:
    """When a correction is cut, and when a search ends."""

    overshoot: float = 0.05  #: of the work at the start: less is Newton's own business
    close: float = 0.05  #: what is left of the work at the start when the search ends
    trials: int = 40  #: of one search
    #: of the square of the imbalance: what leaves less of it has not overshot, whatever its work:
    #: along a correction that is no longer than rounding that may have any sign
    nearly: float = 1e-2
    #: times what may be out of balance: from there on what makes it smaller is taken
    almost: float = 10.0
    patience: int = 8  #: Newton iterations in which contact may overshoot
    near: float = 1e4  #: times the tolerance: how near the solution contacts become free to open


LIMITS = LineSearchLimits()


@dataclass(frozen=True, slots=True)
class LineSearch:
    """How much of Newton's correction a slice is to take.

    Where a material flows almost without hardening, the tangent of a step that has just begun to
    flow is next to nothing and Newton's correction is far too long.  The forces out of balance
    derive from a convex potential (for laws that do not soften), so their work along the correction
    falls steadily: the step is cut where it would turn clearly negative.  The size of the residual,
    which other line searches go by, says nothing here, until it is almost as small as it has to be:
    then the sign of its work is that of rounding.
    """

    comm: MPI.Comm  #: ranks
    interactions: Interactions  #: what acts on its surface
    #: of local unknowns, N/m; leaves the interactions evaluated there
    residual: Callable[[Array], Array]

    def share(self, local: Array, step: Array, iteration: int, imbalance: float) -> float:
        """Part of the correction to take: less than 1 where all of it would overshoot by far.

        Args:
            local: Unknowns.
            step: Newton's correction, which is subtracted from them.
            iteration: Number of the correction in the solve, from 0.
            imbalance: Imbalance at the unknowns, relative to the tolerance.

        Returns:
            The part (collective).
        """
        first, before = self._along(local, step)
        base = self.interactions.evaluated()
        enough = before if imbalance < LIMITS.almost else LIMITS.nearly * before

        def work(share: float) -> float:
            found, left = self._along(local - share * step, step)
            if share == 1.0 and left < enough:
                return 0.0
            if share < 1.0 or iteration >= LIMITS.patience:
                return found
            # Points that come into contact make a kink, no overshoot: full steps find them.
            return found + self.interactions.kink(base)

        return step_share(first, work)

    def _along(self, local: Array, step: Array) -> tuple[float, float]:
        """Work of what is out of balance along a step, and the square of its size (collective)."""
        residual = self.residual(local)
        sums = [float(residual @ step), float(residual @ residual)]
        work, square = reductions.totals(self.comm, sums)
        return float(work), float(square)


def step_share(first: float, work: Callable[[float], float]) -> float:
    """Part of the correction to take, 1 wherever the full one does not overshoot.

    The last share that `work` is asked for is the one that is returned.

    Args:
        first: Work along the correction at the start.
        work: The same after a share of the correction; not finite where it cannot be told, which
            counts as an overshoot.
    """

    def work_after(share: float) -> float:
        found = work(share)
        return found if math.isfinite(found) else -first

    full = work_after(1.0)
    if not first > 0.0 or full >= -LIMITS.overshoot * first:
        return 1.0
    low, high, share = 0.0, 1.0, 1.0
    at_low, at_high, found = first, full, full
    for _ in range(LIMITS.trials):
        crossing = (at_low * high - at_high * low) / (at_low - at_high)
        share = max(crossing, 0.1 * high) if low == 0.0 else crossing
        found = work_after(share)
        if abs(found) <= LIMITS.close * first:
            break
        if found > 0.0:
            low, at_low, at_high = share, found, 0.5 * at_high
        else:
            high, at_high, at_low = share, found, 0.5 * at_low
    return share


@dataclass(slots=True)
class ResidualState:
    """The residual at one set of unknowns, and what was found with it."""

    local: Array  #: the unknowns of this rank
    generalized_strains: Array  #: generalized strains (4,)
    forces: Array  #: nodal forces (owned,), N/m; at supports what they carry
    balance: Array  #: work of the stress less that of the load along each test direction, N/m
    scale: StressScale  #: how large the stress is


@dataclass(frozen=True, slots=True)
class Criteria:
    """What may be out of balance in a section."""

    comm: MPI.Comm  #: its ranks
    scales: Scales  #: sizes
    constraints: Constraints  #: supports
    tolerance: float  #: out-of-balance stress left, relative to the stress there is

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
        scale, fixed = residual_state.scale, self.constraints.fixed
        force_per_stress = self.scales.force_per_stress
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
            # Of their displacement: how far supports that move may be from their goal.
            found["supports"] = over(float(worst[1]), 1e-12 * float(worst[2]))
        if len(load):
            most = float(np.abs(load).max()) * self.scales.length
            total = self.tolerance * (scale.total + most) + scale.rounding * self.scales.area
            left = float(np.abs(residual_state.balance).max()) * self.scales.length
            found["axial"] = over(left, total)
        return found
