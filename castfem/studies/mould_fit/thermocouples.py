"""Temperatures of the thermocouples in the copper of a mould, from the heat of a finished run."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.model.build_mould import nominal_mould
from castfem.physics.mould.hot.model import HotMould
from castfem.runs.results.wall_flux import read_wall_flux
from castfem.studies.mould_fit.coupled import copper_of, given_flux, settings_of, table_of

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.mould import CopperThermocouples
    from castfem.physics.mould.hot.conduction import Heated


class CopperTemperatures:
    """The copper of a case as the heat of its run leaves it; the strand keeps its wall."""

    def __init__(self, case: Case, folder: Path) -> None:
        self._case, self._folder = case, folder

    @cached_property
    def _tube(self) -> tuple[HotMould, Heated]:
        """The tube with its temperature; computed at the first reading."""
        table = table_of(self._case, str(self._folder))
        mould = nominal_mould(table, self._case.section)
        tube = HotMould(MPI.COMM_SELF, mould, copper_of(table), settings_of(table))
        assert table.tube is not None
        if table.tube.heated_by_strand:
            return tube, tube.heat(read_wall_flux(self._folder, table.length))
        return tube, tube.heat(given_flux(table, mould))

    def at(self, one: CopperThermocouples, position: float) -> Quantity:
        """Return the temperature at a thermocouple of a row.

        Args:
            one: The row.
            position: Of the thermocouple below the meniscus, m.
        """
        tube, heated = self._tube
        length = tube.mould.length
        if not 0.0 <= position <= length * (1.0 + ROUNDING):
            raise InputError(
                f"{one.name}.temperature: {1e3 * position:g} mm is not within the mould, "
                f"which ends at {1e3 * length:g} mm"
            )
        around = float(tube.ways[-1])
        if one.way > around * (1.0 + ROUNDING):
            raise InputError(
                f"mould.tube.thermocouple {one.name}: way ({1e3 * one.way:g} mm) is beyond the "
                f"quarter of the wall, {1e3 * around:g} mm; give a smaller one"
            )
        places = np.array([min(position, length)])
        kelvin = tube.temperature_at(heated, places, min(one.way, around), one.depth)
        return Quantity(float(kelvin[0]), "degC", f"temperature of the copper at {one.name}")
