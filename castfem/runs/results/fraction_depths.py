"""Depth of chosen solid fractions below the surface (`output.shell_at`), a quantity for each."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from castfem.base.result_registry import AT_FRACTION, QuantityDefinition, quantity_family

if TYPE_CHECKING:
    from castfem.physics.materials import Steel
    from castfem.runs.results.sample import Sample

_HALVINGS = 60  # of the mushy zone, to find the temperature of a solid fraction


@lru_cache(maxsize=128)
def depth_of(percent: int) -> QuantityDefinition:
    """Return the quantity that is the shell as far as so much of it is solid, at each probe."""
    levels: dict[int, tuple[Steel, float]] = {}  # the last steel's

    def depth(sample: Sample, probe: str) -> float:
        """Depth below the surface, along the probe's line, to which at least so much is solid."""
        steel = sample.simulation.steel
        if id(steel) not in levels:
            levels.clear()
            levels[id(steel)] = steel, temperature_at(steel, percent / 100)
        return sample.profiles[probe].isotherm_depth(levels[id(steel)][1])

    return QuantityDefinition(
        f"fs{percent}", unit="mm", label=f"shell to fs = {percent / 100:g}, {{}}", each="probe",
        axis="depth below the surface", compute=depth,
    )  # fmt: skip


quantity_family(AT_FRACTION, depth_of)


def temperature_at(steel: Steel, fraction: float) -> float:
    """Temperature at which so much is solid, K: the highest one, at 1 the solidus."""
    if fraction >= 1.0:
        return steel.solidus
    low, high = steel.solidus, steel.liquidus
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if float(steel.solid_fraction(middle)) >= fraction:
            low = middle
        else:
            high = middle
    return low
