"""Results of a case with [quality]: crack indexes, ends of the liquid core, soft reduction.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.result_registry import quantity
from castfem.base.types import Array
from castfem.runs.results.crack_index import SliceStep, crack_index

if TYPE_CHECKING:
    from castfem.runs.results.sample import Sample

POOL = (0.1, 0.3, 0.7, 1.0)
"""Solid fractions on the centre line whose positions are reported."""


@crack_index("I1", "MPa", "I1, axial tension in the band", needs=("mechanics",))
def axial_tension(step: SliceStep) -> Array:
    """Axial tension in the temperature range of low ductility (324)."""
    return np.where(step.in_band, np.maximum(step.axial_stress, 0.0), 0.0)


@crack_index("I2", "1/s", "I2, axial strain rate in the band", needs=("mechanics",))
def axial_strain_rate(step: SliceStep) -> Array:
    """Axial strain rate in the temperature range of low ductility (325)."""
    return np.where(step.in_band, np.maximum(step.strain_rate, 0.0), 0.0)


@crack_index("I2_mechanical", "1/s", "mechanical part of I2", needs=("mechanics",))
def mechanical_strain_rate(step: SliceStep) -> Array:
    """Axial strain rate without thermal expansion, in the temperature range of low ductility."""
    return np.where(step.in_band, np.maximum(step.mechanical_rate, 0.0), 0.0)


@crack_index("I2_pitch", "1/s", "I2, mean over a pitch", needs=("mechanics", "machine"))
def pitch_strain_rate(step: SliceStep) -> Array:
    """Axial strain rate in the range of low ductility, averaged over the last roll pitch.

    The curvature is linear between the rolls, so that I2 itself jumps at the rolls.
    """
    return np.where(step.in_band, np.maximum(step.pitch_rate, 0.0), 0.0)


@crack_index("band_time", "s", "time in the low-ductility band", accumulates=True)
def band_time(step: SliceStep) -> Array:
    """Time that the surface has spent in the temperature range of low ductility."""
    return step.value + step.duration * step.share_within(*step.settings.band)


@crack_index(
    "brittle_strain", "percent", "axial strain in the brittle range", needs=("mechanics",),
    on="section", accumulates=True,
)  # fmt: skip
def brittle_strain(step: SliceStep) -> Array:
    """Mechanical axial tensile strain accumulated in the brittle range.

    Compression in the range is subtracted. It is the effect of bending, straightening and
    misalignment on the solidification front.
    """
    taken = step.mechanical_strain * step.share_within(*step.brittle)
    return np.maximum(step.value + taken, 0.0)


@quantity(
    "critical_share", "percent", "largest strain in the brittle range, of the critical one",
    column=False, needs=("throughout", "quality"),
)  # fmt: skip
def critical_share(sample: Sample) -> float | None:
    """Largest strain in the brittle range over `quality.critical_strain`, if that is given.

    The mushy zone cracks from 100 % on.
    """
    assert sample.simulation.case.quality is not None
    critical = sample.simulation.case.quality.critical_strain
    return None if critical is None else sample.judged.worst["brittle_strain"].value / critical


quantity(
    "centre_solid_fraction", "-", "solid fraction, centre", needs=("quality",),
    says="Solid fraction on the centre line.",
)(lambda sample: sample.judged.solid_fraction)  # fmt: skip


def _declare_pool_end(fraction: float) -> Callable[[Sample], float | None]:
    @quantity(
        f"pool_end_fs{round(100 * fraction)}", "m",
        f"solid fraction {fraction:g} on the centre line", column=False, needs=("quality",),
    )  # fmt: skip
    def pool_end(sample: Sample) -> float | None:
        """Position at which the solid fraction on the centre line reaches 0.1, 0.3, 0.7, 1."""
        return sample.judged.passed.get(fraction)

    return pool_end


for _fraction in POOL:
    _declare_pool_end(_fraction)


def _window(sample: Sample) -> tuple[float, float] | None:
    assert sample.simulation.case.quality is not None
    found = [sample.judged.passed.get(end) for end in sample.simulation.case.quality.soft_reduction]
    return None if found[0] is None or found[1] is None else (found[0], found[1])


def _between_rolls(sample: Sample) -> str:
    window = _window(sample)
    return "" if window is None else sample.judged.caster.between(*window)


@quantity(
    "soft_reduction_length", "m", "window of soft reduction", column=False, place=_between_rolls,
    needs=("quality",),
)  # fmt: skip
def soft_reduction_length(sample: Sample) -> float | None:
    """Length with a centre solid fraction within `quality.soft_reduction`."""
    window = _window(sample)
    return None if window is None else window[1] - window[0]


@quantity(
    "soft_reduction", "mm", "reduction by the rolls in that window", column=False,
    needs=("machine", "quality"),
)  # fmt: skip
def soft_reduction(sample: Sample) -> float | None:
    """Decrease of the roll aperture over that length, interpolated linearly between the rolls."""
    window = _window(sample)
    if window is None:
        return None
    start, end = (sample.judged.caster.aperture(position) for position in window)
    return start - end
