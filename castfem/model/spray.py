"""The heat law of a spray, its water given per area or as that of the whole zone."""

from __future__ import annotations

from functools import partial
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from castfem.base.quantities import (
    Kind,
    NameOf,
    PositiveNumber,
    WaterFlow,
    WaterTemperature,
)
from castfem.model.heat_law import HeatLaw, Surroundings, kinks_in_time, times
from castfem.model.water import SpecificWater, WaterShare, ZoneFlow, largest, seen_by_slice
from castfem.physics.thermal import flux_laws, mould_flux
from castfem.physics.thermal.sprays import CORRELATIONS, WATER_DENSITY

SprayedArea = Annotated[float, Kind("m^2", "m^2", above=0.0)]


class Spray(HeatLaw):
    """Water spray: convection with the coefficient of a published correlation.

    Its water is given per area, or as that of the whole zone: its flow, per mass of steel, or as a
    share of `[water]`.
    """

    called: ClassVar[str] = "a spray"

    law: Literal["spray"]
    water: WaterFlow | None = Field(None, examples=["5 L/(m^2 s)"])
    """water flow per surface area"""
    flow: ZoneFlow | None = Field(None, examples=["240 L/min"])
    """instead of water, that of the zone on all faces of this law, of the whole strand; in a table
    over the casting speed it follows it, over time goes by the clock of casting.start.time"""
    specific: SpecificWater | None = Field(None, examples=["0.3 L/kg"])
    """instead of water, that of the zone per mass of steel that passes; it follows the casting
    speed"""
    share: WaterShare | None = Field(None, examples=[0.3])
    """instead of water, the zone's share of [water]"""
    area: SprayedArea | None = Field(None, examples=["1.2 m^2"])
    """sprayed area of these faces, with the water of the zone; by default all of them in it"""
    water_temperature: WaterTemperature = Field(examples=["25 degC"])
    """temperature of the water"""
    correlation: Annotated[str, NameOf(CORRELATIONS)]
    """formula of the coefficient"""
    machine_factor: PositiveNumber = Field(1.0, examples=[4])
    """divides the coefficient: fit to the machine, about 4 for nozaki"""

    @property
    def asks_extent(self) -> bool:
        """See `HeatLaw.asks_extent`."""
        return self.water is None

    def build(self, around: Surroundings) -> flux_laws.Convection | flux_laws.Sprayed:
        """See `HeatLaw.build`."""
        water, correlation = self._water(around), CORRELATIONS[self.correlation]
        if not callable(water):
            coefficient = partial(
                correlation.coefficient, water, self.water_temperature, self.machine_factor
            )
            return flux_laws.Convection(coefficient=coefficient, ambient=self.water_temperature)
        most = largest(around.supplied(self)) * self._per_flow(around)
        return flux_laws.Sprayed(
            correlation, water, most, self.water_temperature, self.machine_factor
        )

    def _water(self, around: Surroundings) -> mould_flux.Value:
        """Return the water per area, kg/(m2 s): one number, or over time in s."""
        if self.water is not None:
            return self.water
        return times(self._per_flow(around), around.over_time(around.supplied(self)))

    def milestones(self, around: Surroundings) -> tuple[float, ...]:
        """See `HeatLaw.milestones`; a share of a flow bends where that does."""
        shared = self.share is not None and around.water is not None
        flow = around.water.flow if shared and around.water is not None else self.flow
        return () if flow is None else kinks_in_time(seen_by_slice(flow, around.clock), around)

    def _per_flow(self, around: Surroundings) -> float:
        """Water per area for a flow of the zone, kg/m3 over m2."""
        extent = around.extent
        assert extent is not None, "the law asks for it"
        whole = extent.perimeter * (extent.end - extent.start)
        return WATER_DENSITY / (whole if self.area is None else self.area)
