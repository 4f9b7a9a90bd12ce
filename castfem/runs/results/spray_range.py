"""Warns where sprayed surfaces are outside the temperatures of their nozzles' tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from castfem.base import log
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.base.units import format
from castfem.fem import reductions
from castfem.physics.thermal.spray_flux import CoefficientTable, SprayWater

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation


class SprayRange:
    """Logs when a sprayed surface first leaves the table of its nozzles, on either side.

    Beyond its ends the table is constant. Committed states are checked, with the cooling of the
    step that led to them.

    Attributes:
        warned: Warnings given, by number of the nozzle and whether it was too hot.
    """

    def __init__(self, simulation: Simulation) -> None:
        table = simulation.case.secondary
        assert table is not None, "of a case with nozzles"
        self._simulation = simulation
        self._before: float | None = None
        self._models = {
            id(model.table): (index, model)
            for index, model in enumerate(table.nozzle)
            if model.table is not None
        }
        self.warned: set[tuple[int, bool]] = set()

    def note(self, time: float, temperature: Array) -> None:
        """Check the temperatures of the owned vertices (owned,), K, at a time, s (collective)."""
        zones, start = self._simulation.zones, self._before
        self._before = time
        if start is None:
            return
        cooling = zones.cooling(zones.index(start))
        for patch, law in cooling.laws:
            if not isinstance(law, SprayWater):
                continue
            for row in law.rows:
                known = row.coefficient
                if isinstance(known, CoefficientTable) and row.flow(time) > 0.0:
                    wet = temperature[patch.dofs][row.water > 0.0]
                    self._compare(known, wet, time)

    def _compare(self, known: CoefficientTable, surface: Array, time: float) -> None:
        """Warn about temperatures (n,), K, outside a table (collective)."""
        comm = self._simulation.section.comm
        index, model = self._models[id(known)]
        ends = known.temperatures[0], known.temperatures[-1]
        hottest = reductions.largest(comm, surface)
        coldest = reductions.smallest(comm, surface)
        for hot, beyond, value in (
            (False, coldest < ends[0], coldest),
            (True, hottest > ends[1], hottest),
        ):
            if not (beyond and np.isfinite(value)) or (index, hot) in self.warned:
                continue
            self.warned.add((index, hot))
            low, high = (format(end, "K", "degC") for end in ends)
            place = self._simulation.machine.position(time)
            log.logger.warning(
                "secondary.nozzle.%d.table: the surface under '%s' has %.4g degC at %.4g m, its "
                "coefficient is known from %s to %s: beyond, the end value is used; add rows to "
                "the table",
                index, model.name, value - ZERO_CELSIUS, place, low, high,
            )  # fmt: skip
