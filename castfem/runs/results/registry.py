"""Selects the quantities of a simulation: the columns of its history, and its results."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import TYPE_CHECKING

from castfem.base.result_registry import Each, QuantityDefinition, declared, in_summary_order
from castfem.runs.results.needs import are_met
from castfem.runs.results.thermal_quantities import depth_of

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.runs.results.sample import Sample


def columns_of(simulation: Simulation) -> Iterator[tuple[QuantityDefinition, str]]:
    """Columns of history.csv: each definition with its probe, "" for the whole slice."""
    return _at_probes(simulation, (d for d in declared() if d.column))


def results_of(simulation: Simulation) -> Iterator[tuple[QuantityDefinition, str]]:
    """Results of summary.json, in the same form."""
    return _at_probes(simulation, in_summary_order())


def _at_probes(
    simulation: Simulation, definitions: Iterable[QuantityDefinition]
) -> Iterator[tuple[QuantityDefinition, str]]:
    """Quantities of the simulation; adjacent definitions for probes are grouped by probe.

    Shells at further solid fractions that the case requests come last.
    """
    probes: dict[Each, tuple[str, ...]] = {
        "": ("",),
        "probe": tuple(simulation.probes.lines),
        "centred_probe": simulation.centred_probes,
    }
    having = [d for d in definitions if are_met(d.needs, simulation)]
    having += [depth_of(round(100.0 * part)) for part in simulation.case.output.shell_at or ()]
    for (each, _), group in groupby(having, key=lambda d: (d.each, d.needs)):
        together = list(group)
        if not each:
            yield from ((d, "") for d in together)
        else:
            yield from ((d, probe) for probe in probes[each] for d in together)


class Columns:
    """The columns of a simulation, which do not change during the run.

    Attributes:
        heading: Name and unit of each column.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Select the columns."""
        self._having = [(d, probe, d.named(probe)) for d, probe in columns_of(simulation)]
        self.heading = [(name, d.unit) for d, _, name in self._having]

    def row(self, sample: Sample) -> dict[str, float]:
        """Return one row of the history in its units (collective)."""
        return {name: d.in_unit(d.value(sample, probe)) for d, probe, name in self._having}
