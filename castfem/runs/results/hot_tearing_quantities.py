"""Results of the hot tearing criteria, and of the ductility of the grade, if requested.

Each criterion is an index of the whole section, whose largest value is that of the solidification
front as the slice moves down, and one of the surface, which keeps its history.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.result_registry import quantity
from castfem.base.types import Array
from castfem.runs.results.crack_index import SliceStep, crack_index

if TYPE_CHECKING:
    from castfem.runs.results.crack_state import Tearing
    from castfem.runs.results.sample import Sample


def _declare(name: str, unit: str, label: str, needs: tuple[str, ...], says: str) -> None:
    """Declare a criterion, a method of `Tearing`, at front and surface."""

    def values(tearing: Tearing | None) -> Array:
        assert tearing is not None, "the case names criteria"
        found: Callable[[], Array] = getattr(tearing, name)
        return found()

    def front(step: SliceStep) -> Array:
        assert step.tearing is not None
        return np.where(step.tearing.here, values(step.tearing), 0.0)

    def surface(step: SliceStep) -> Array:
        return values(step.tearing)

    def depth(sample: Sample) -> float:
        worst = sample.judged.worst[f"{name}_front"]
        return sample.judged.line.depth(worst.x, worst.y) if worst.value > 0.0 else np.nan

    front.__doc__, surface.__doc__ = f"{says} At the front of solidification.", says
    depth.__doc__ = f"Depth below the surface at which {label} was largest on the way."
    crack_index(
        f"{name}_front", unit, f"{label}, front", needs=needs, on="section", followed=True
    )(front)  # fmt: skip
    crack_index(
        name, unit, label, needs=needs, accumulates=True, followed=True
    )(surface)  # fmt: skip
    own = tuple("throughout" if need == "mechanics" else need for need in needs)
    quantity(
        f"way_{name}_front_depth", "mm", f"depth of the largest {label}", column=False,
        needs=(*own, "quality"),
    )(depth)  # fmt: skip


_declare(
    "won", "percent", "hot tearing by strain", ("mechanics", "won"),
    "Strain across the brittle range over the critical one [Won2000]; from 100 % on it tears.",
)  # fmt: skip
_declare(
    "clyne_davies", "-", "hot tearing by time", ("clyne_davies",),
    "Time in the brittle range over that from solid fraction 0.4 to it [Clyne1981].",
)  # fmt: skip
_declare(
    "rdg", "kPa", "pressure drop of feeding", ("mechanics", "rdg"),
    "Pressure drop that feeds the mushy zone to where it is solid [Rappaz1999].",
)  # fmt: skip


@quantity(
    "rdg_share", "percent", "largest pressure drop of feeding, of that which tears",
    column=False, of_way=True, needs=("throughout", "rdg", "quality"),
)  # fmt: skip
def rdg_share(sample: Sample) -> float:
    """Largest pressure drop at the front over `quality.rdg.cavitation`; a pore forms at 100 %."""
    from castfem.model.quality import Feeding

    quality = sample.simulation.case.quality
    assert quality is not None
    given = quality.rdg or Feeding.model_validate({})
    return sample.judged.worst["rdg_front"].value / given.cavitation


@crack_index(
    "ductility_used", "percent", "share of the ductility used up", needs=("mechanics", "ductility"),
    accumulates=True,
)  # fmt: skip
def ductility_used(step: SliceStep) -> Array:
    """Axial tensile strain of each step over `quality.ductility`, summed up.

    The mechanical strain counts, within the temperatures of the table.
    """
    table = step.settings.ductility
    middle = 0.5 * (step.temperature + step.earlier)
    rate = np.maximum(step.mechanical_rate, 0.0)
    taken = np.maximum(step.mechanical_strain, 0.0) * step.share_within(*table.span)
    return step.value + taken / table.critical_strain(middle, rate)
