"""The columns of history.csv and their values, from the registry of quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.results.registry import columns_of

if TYPE_CHECKING:
    from castfem.results.sample import Sample
    from castfem.simulation.simulation import Simulation


def columns(simulation: Simulation) -> list[tuple[str, str]]:
    """Names and units of the history's columns: those of what the simulation has."""
    return [(d.named(probe), d.unit) for d, probe in columns_of(simulation)]


def row(sample: Sample) -> dict[str, float]:
    """One row of the history in its units (collective)."""
    return {
        d.named(probe): d.in_unit(d.value(sample, probe))
        for d, probe in columns_of(sample.simulation)
    }
