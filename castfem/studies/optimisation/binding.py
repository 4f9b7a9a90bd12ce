"""Which constraints keep an objective from being better: by quadratics, and by runs that were seen.

Quadratics tell of what lies round the optimum alone. Where the objective is jagged they follow one
of its dents: it may rise to either side, and yet a run that misses nothing but one constraint may
be far better. Then that constraint keeps the objective from being better, whatever the dent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.studies.optimisation.vicinity import Quadratic, better_without

_SIGMAS = 3.0  # two runs differ by that much of their scatter in one case of thirty


@dataclass(frozen=True, slots=True)
class Binding:
    """Which constraints bind.

    Attributes:
        held: Whether the objective would be better without each.
        near: Likewise, and whether its bound is where the optimum is, within its error.
    """

    held: tuple[bool, ...]
    near: tuple[bool, ...]

    @classmethod
    def of(
        cls, model: Quadratic, scatter: Array, here: Array, seen: Array, error: Array
    ) -> Binding:
        """Return what binds at an optimum.

        Args:
            model: Of the runs near it.
            scatter: Of cost and margins (1 + m,), SI: noise.
            here: Cost and margins of the best run (1 + m,).
            seen: Those of all runs of that level (r, 1 + m), NaN where they have failed; none where
                no run meets all.
            error: Numerical error of the margins (m,), SI.
        """
        local = np.array(better_without(model, scatter), dtype=bool)
        blurred = scatter + model.misfit
        within = here[1:] <= blurred[1:] + error
        kept = _kept_from(here, seen[~np.isnan(seen).any(axis=1)], scatter, blurred, within)
        return cls(_flags(local | kept), _flags(local | (kept & within)))


def _flags(found: npt.NDArray[np.bool_]) -> tuple[bool, ...]:
    return tuple(bool(flag) for flag in found)


def _kept_from(
    here: Array, seen: Array, scatter: Array, blurred: Array, within: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Which constraints (m,) are all that runs miss whose objective is better.

    Where better runs miss several at once, and none of these alone keeps from others, those bind
    whose bounds are within their errors, or else all of them.
    """
    found = np.zeros(len(within), dtype=bool)
    better = seen[seen[:, 0] < here[0] - _SIGMAS * blurred[0]]
    missed = better[:, 1:] < -scatter[1:]
    for which in sorted(missed, key=np.count_nonzero):
        if np.any(which) and not np.any(which & found):
            found |= which & within if np.any(which & within) else which
    return found
