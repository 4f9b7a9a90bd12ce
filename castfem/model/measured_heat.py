"""Heat laws scaled to a total that a plant has measured, and how it goes with the casting speed."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

from pydantic import Field

from castfem.base.errors import InputError
from castfem.base.quantities import Kind, KindOr
from castfem.base.table_notation import Curve
from castfem.base.tables import Table
from castfem.model.heat_law import HeatLaw, Surroundings, kinks_in_time, times
from castfem.physics.machine import Machine
from castfem.physics.machine.travel import Steady
from castfem.physics.thermal import mould_flux

ANY_SPEED = "any speed"
TOTALS = ("power", "water", "water_rise")
"""Keys of a measured total."""

HeatFlow = Annotated[
    float | Table, Curve(Kind("W", "kW", above=0.0, label="heat flow", sample="1450 kW"), "speed")
]
VolumeFlow = Annotated[
    float | Table,
    Curve(Kind("m^3/s", "L/min", above=0.0, label="water", sample="1800 L/min"), "speed"),
]
Rise = Annotated[
    float | Table,
    Curve(Kind("K", "K", difference=True, above=0.0, sample="7 K"), "speed"),
]
MeasuredAt = Annotated[float | str, KindOr(Kind("m/s", "m/min", above=0.0), ANY_SPEED)]


class ScaledLaw(HeatLaw):
    """A law whose heat may be scaled to a measured total."""

    power: HeatFlow | None = None
    """heat that the mould takes from the faces of this law in all, on the whole strand and over the
    whole zone; the flux is scaled to it"""
    water: VolumeFlow | None = None
    """cooling water that takes this heat, instead of power"""
    water_rise: Rise | None = Field(None, examples=["7 K"])
    """rise of its temperature, with water"""
    measured_at: MeasuredAt | None = Field(None, examples=["2.8 m/min"])
    """casting speed at which this heat, or a flux over position, was measured: at another speed the
    flux is the same after the same time in the mould, so that the total changes; "any speed": the
    total is the same at every speed, as it is (with a warning where speeds are compared) when this
    is left out"""

    @property
    def asks_extent(self) -> bool:
        """See `HeatLaw.asks_extent`."""
        return self.scales

    @property
    def scales(self) -> bool:
        """Whether its flux is scaled to a total."""
        return self.power is not None or None not in (self.water, self.water_rise)

    @property
    def over_speed(self) -> bool:
        """Whether its total is a table over the casting speed."""
        return any(isinstance(it, Table) for it in (self.power, self.water, self.water_rise))

    @property
    def by_dwell_time(self) -> bool:
        """Whether what was measured at one speed holds at another by the time in the mould."""
        return self.measured_at not in (None, ANY_SPEED)

    def total(self, speed: float) -> float | None:
        """The heat it is scaled to at a casting speed (m/s), W; None if it is not scaled."""
        if not self.scales:
            return None
        if self.power is not None:
            return _at(self.power, speed)
        assert self.water is not None and self.water_rise is not None, "it is scaled"
        return mould_flux.WATER * _at(self.water, speed) * _at(self.water_rise, speed)

    def scaled(self, given: str | float | Table, around: Surroundings) -> mould_flux.Value:
        """Return a flux over time, scaled to the measured total if there is one.

        A total over the casting speed is taken at the mean speed in the zone. One that was measured
        at some speed, with this flux, makes a flux over the time since the meniscus at that speed;
        it holds at others.
        """
        measured = self._as_measured(around)
        value, extent = measured.over_time(given), around.extent
        if extent is None or not self.scales:
            return value
        machine = measured.machine
        total = self.total(machine.speed_between(extent.start, extent.end))
        assert total is not None, "it is scaled"
        between = machine.time_at(extent.start), machine.time_at(extent.end)
        kinks = (*kinks_in_time(given, measured), *machine.kinks)
        heat = extent.perimeter * mould_flux.heat_to_mould(value, machine.speed, between, kinks)
        if not heat > 0.0:
            raise InputError(
                f"{self.tag}: the flux takes {1e-3 * heat:.4g} kW in all and cannot be scaled to a "
                "measured total; a curve that is above 0 is needed"
            )
        return times(total / heat, value)

    def kinks(self, given: str | float | Table, around: Surroundings) -> tuple[float, ...]:
        """Return the instants at which a flux of the law changes its slope in time, s."""
        return kinks_in_time(given, self._as_measured(around))

    def milestones(self, around: Surroundings) -> tuple[float, ...]:
        """See `HeatLaw.milestones`; totals do not change while a slice is in the mould."""
        given = (
            getattr(self, key)
            for key in type(self).model_fields
            if key not in (*TOTALS, "measured_at")
        )
        measured = self._as_measured(around)
        found: list[float] = []
        for value in given:
            found += kinks_in_time(value, measured if value is self.curve else around)
        return tuple(found)

    curve_key: ClassVar[str] = "value"
    """The key of the flux that is scaled."""

    @property
    def curve(self) -> str | float | Table | None:
        """The flux that is scaled; None where the law has none."""
        found: str | float | Table | None = getattr(self, self.curve_key)
        return found

    def _as_measured(self, around: Surroundings) -> Surroundings:
        """Return the surroundings at the speed at which the heat was measured."""
        if not self.by_dwell_time:
            return around
        assert isinstance(self.measured_at, float), "it is a speed"
        return replace(around, machine=Machine(Steady(self.measured_at)))


def _at(given: float | Table, speed: float) -> float:
    return float(given(speed)) if isinstance(given, Table) else given
