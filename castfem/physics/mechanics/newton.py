"""Newton's method for the slice: options, line search, convergence criteria."""

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

# A shell that shrinks away from its wall loses contact point by point, one per iteration.
NEWTON: dict[str, Any] = {"snes_linesearch_type": "basic", "snes_max_it": 100}


def split_options(
    user: Options, symmetric: bool, ranks: int = 1
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of SNES, and those of the linear solver.

    Args:
        user: The user's options, which take precedence; with a preconditioner or factorisation of
            the user none of the default one's are used.
        symmetric: Whether the tangent is symmetric.
        ranks: Number of ranks.
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
    """Limits of the line search."""

    #: negative work, relative to that at the start, above which a step has overshot
    overshoot: float = 0.05
    close: float = 0.05  #: remaining work, relative to that at the start, at which the search ends
    trials: int = 40  #: largest number of trials of one search
    #: relative square of the residual below which a step has not overshot, whatever its work: along
    #: a correction of the size of rounding the work may have any sign
    nearly: float = 1e-2
    #: residual stress, relative to the stress in the section, below which any reduction of the
    #: residual is accepted
    almost: float = 1e-7
    patience: int = 8  #: Newton iterations in which contact may overshoot
    near: float = 1e-3  #: the same, below which contacts are free to open


LIMITS = LineSearchLimits()


@dataclass(frozen=True, slots=True)
class LineSearch:
    """Determines the fraction of Newton's correction to take.

    Where a material flows almost without hardening, the tangent of a step that has just begun to
    flow almost vanishes, and Newton's correction is far too long. The residual forces derive from a
    convex potential (for laws without softening), so that their work along the correction decreases
    monotonically: the step is cut where it would become clearly negative. The norm of the residual,
    which other line searches use, is no guide here, until it is almost small enough: then the sign
    of the work is that of rounding.
    """

    comm: MPI.Comm  #: communicator
    interactions: Interactions  #: interactions with its surface
    #: residual of local unknowns, N/m; evaluates the interactions there
    residual: Callable[[Array], Array]

    def share(self, local: Array, step: Array, iteration: int, imbalance: float) -> float:
        """Return the fraction of the correction to take; below 1 if the full one overshoots far.

        Args:
            local: Unknowns.
            step: Newton's correction, which is subtracted from them.
            iteration: Number of the correction in the solve, from 0.
            imbalance: Residual stress at the unknowns, relative to the stress in the section.

        Returns:
            The fraction (collective).
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
            # Points coming into contact make a kink, not an overshoot: full steps find them.
            return found + self.interactions.kink(base)

        return step_share(first, work)

    def _along(self, local: Array, step: Array) -> tuple[float, float]:
        """Work of the residual along a step, and the square of its norm (collective)."""
        residual = self.residual(local)
        sums = [float(residual @ step), float(residual @ residual)]
        work, square = reductions.totals(self.comm, sums)
        return float(work), float(square)


def step_share(first: float, work: Callable[[float], float]) -> float:
    """Return the fraction of the correction to take, 1 if the full one does not overshoot.

    The last fraction for which `work` is called is the returned one.

    Args:
        first: Work along the correction at the start.
        work: Work after a fraction of the correction; a non-finite value counts as overshoot.
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
    """The residual for one set of unknowns, with its by-products."""

    local: Array  #: the unknowns of this rank
    generalized_strains: Array  #: generalized strains (4,)
    forces: Array  #: nodal forces (owned,), N/m; at supports their reactions
    balance: Array  #: work of the stress minus that of the load in each test direction, N/m
    scale: StressScale  #: scale of the stress


@dataclass(frozen=True, slots=True)
class Criteria:
    """Convergence criteria of a section."""

    comm: MPI.Comm  #: communicator
    scales: Scales  #: scales of the residuals
    constraints: Constraints  #: supports
    tolerance: float  #: allowed residual stress, relative to the stress in the section

    def sizes(
        self, residual_state: ResidualState, residual: Array, load: Array
    ) -> dict[str, float]:
        """Residuals of each kind of unknown, relative to their tolerance (collective).

        "forces": the worst node, as the stress around it that would cause the force, relative to
        the stress in the section. "axial": the worst test direction of the planes, relative to the
        sum of the absolute forces. "supports": deviation from prescribed displacements.

        Args:
            residual_state: The unknowns and their by-products.
            residual: Local residual, N/m; at supports the deviation from the prescribed position,
                m.
            load: Load in the test directions of the planes (free,), N/m.
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
            # Relative to their displacement: allowed deviation of moving supports.
            found["supports"] = over(float(worst[1]), 1e-12 * float(worst[2]))
        if len(load):
            most = float(np.abs(load).max()) * self.scales.length
            total = self.tolerance * (scale.total + most) + scale.rounding * self.scales.area
            left = float(np.abs(residual_state.balance).max()) * self.scales.length
            found["axial"] = over(left, total)
        return found
