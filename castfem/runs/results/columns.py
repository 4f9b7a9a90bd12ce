"""The columns of history.csv and their values, from the registry of quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.runs.results.registry import columns_of

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.runs.results.sample import Sample


class Columns:
    """The columns of a simulation, found once: which there are does not change as it goes on.

    Attributes:
        heading: Name and unit of each.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Find them."""
        self._having = [(d, probe, d.named(probe)) for d, probe in columns_of(simulation)]
        self.heading = [(name, d.unit) for d, _, name in self._having]

    def row(self, sample: Sample) -> dict[str, float]:
        """One row of the history in its units (collective)."""
        return {name: d.in_unit(d.value(sample, probe)) for d, probe, name in self._having}
