"""The array of tables [[cooling]]: zones in casting order with their heat laws.

`castfem.model.heat_law` has their common base.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field

from castfem.base.errors import InputError
from castfem.base.quantities import (
    Conductivity,
    Distance,
    InverseLength,
    Kind,
    Length,
    NameOf,
    OrWord,
    PositiveNumber,
    Temperature,
    WaterFlow,
    WaterTemperature,
)
from castfem.base.table_notation import Curve
from castfem.base.tables import Table, Tabled
from castfem.model.base import TableModel, written
from castfem.model.heat_law import (
    GAP,
    HeatLaw,
    ScaledLaw,
    Surroundings,
    kinks_in_time,
    no_emissivity,
    times,
)
from castfem.model.water import SpecificWater, WaterShare, ZoneFlow, largest, seen_by_slice
from castfem.physics.thermal import flux_laws, mould_flux
from castfem.physics.thermal.mould_flux import MOULD_FLUXES
from castfem.physics.thermal.spray_correlations import CORRELATIONS, WATER_DENSITY

__all__ = [
    "Contact",
    "Convection",
    "Flux",
    "HeatLaw",
    "PrescribedTemperature",
    "Radiation",
    "Spray",
    "Zone",
]

FORMULA = "the name of a formula, "
GivenFlux = Annotated[
    str | Tabled,
    OrWord(Curve(Kind("W/m^2", "MW/m^2"), "time", ("position",)), MOULD_FLUXES, FORMULA),
]
ContactCoefficient = Annotated[
    Tabled, Curve(Kind("W/(m^2 K)", "W/(m^2 K)", least=0.0), "position", ("time", "temperature"))
]
ContactFlux = Annotated[
    str | Tabled,
    OrWord(
        Curve(Kind("W/m^2", "MW/m^2", least=0.0), "position", ("time", "temperature")),
        MOULD_FLUXES,
        FORMULA,
    ),
]

MOULD = "mould"
WallTemperature = Annotated[str | Tabled, OrWord(Curve(Kind("K", "degC"), "time"), (MOULD,))]


class Contact(ScaledLaw):
    """Contact with a wall, through a gap where one opens (thesis, eq. 301)."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["coefficient"]}, {"required": ["flux"]}]}
    )

    called: ClassVar[str] = "contact with a gap of its own"
    curve_key: ClassVar[str] = "flux"

    law: Literal["contact"]
    coefficient: ContactCoefficient | None = Field(None, examples=["1600 W/(m^2 K)"])
    """heat transfer coefficient without a gap; a table over temperature uses that of the surface"""
    flux: ContactFlux | None = Field(None, examples=["2 MW/m^2"])
    """heat flux at full contact, instead of coefficient, as measured where there is no gap; a gap
    lowers it"""
    wall: WallTemperature | None = Field(None, examples=["160 degC"])
    """temperature of the wall; "mould" (the default) takes mould.wall_temperature"""
    gap: Distance | None = Field(
        None,
        description=GAP + "; by default the one that opens in the mould, none without [mould]",
        examples=["0.2 mm"],
    )
    gap_conductivity: Conductivity | None = Field(None, examples=["0.15 W/(m K)"])
    """conductivity of the medium in the gap; required where a gap can open"""

    def build(self, around: Surroundings) -> flux_laws.Contact:
        """See `HeatLaw.build`."""
        wall = around.wall if self.wall in (None, MOULD) else self.wall
        assert wall is not None and not isinstance(wall, str), "the case has been checked"
        return flux_laws.Contact(
            coefficient=self._good(around),
            wall=wall,
            # Without a gap the conductivity is not used.
            gap_conductivity=1.0 if self.gap_conductivity is None else self.gap_conductivity,
            gap=self.gap or 0.0,
            follows=self.gap is None,
        )

    def _good(self, around: Surroundings) -> float | mould_flux.Curve:
        if self.flux is not None:
            table = over_temperature(self.flux)
            if table is not None:
                return mould_flux.FluxCurve(over_temperature=table)
            return mould_flux.FluxCurve(self.scaled(self.flux, around))
        assert self.coefficient is not None, "the case has been checked"
        table = over_temperature(self.coefficient)
        if table is not None:
            return mould_flux.CoefficientCurve(over_temperature=table)
        value = self.with_factor(around.over_time(self.coefficient), around)
        return mould_flux.CoefficientCurve(value) if callable(value) else value


class Flux(ScaledLaw):
    """A given heat flux; positive when heat leaves the strand."""

    called: ClassVar[str] = "a given flux"

    law: Literal["flux"]
    value: GivenFlux
    """heat flux; a table over time counts from the meniscus"""

    def build(self, around: Surroundings) -> flux_laws.PrescribedFlux:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedFlux(self.scaled(self.value, around))


def over_temperature(given: object) -> Table | None:
    """Return a value of a law if it is a table over the surface temperature, else None."""
    return given if isinstance(given, Table) and given.over == "temperature" else None


SprayedArea = Annotated[float, Kind("m^2", "m^2", above=0.0)]


class Spray(HeatLaw):
    """Water spray: convection with the coefficient of a published correlation.

    Its water is given per surface area, or for the whole zone: as a flow, per mass of steel, or as
    a share of `[water]`.
    """

    called: ClassVar[str] = "a spray"

    law: Literal["spray"]
    water: WaterFlow | None = Field(None, examples=["5 L/(m^2 s)"])
    """water flow per surface area"""
    flow: ZoneFlow | None = Field(None, examples=["240 L/min"])
    """flow of the zone on all faces of this law, on the whole strand, instead of water; a number,
    or a table over the casting speed or over time by the clock of casting.start.time"""
    specific: SpecificWater | None = Field(None, examples=["0.3 L/kg"])
    """water of the zone per mass of passing steel, instead of water; its flow follows the casting
    speed"""
    share: WaterShare | None = Field(None, examples=[0.3])
    """the zone's share of [water], instead of water"""
    area: SprayedArea | None = Field(None, examples=["1.2 m^2"])
    """sprayed area of these faces, for the water of the zone; by default their whole area in it"""
    water_temperature: WaterTemperature = Field(examples=["25 degC"])
    """temperature of the water"""
    correlation: Annotated[str, NameOf(CORRELATIONS)]
    """correlation for the heat transfer coefficient"""
    machine_factor: PositiveNumber = Field(1.0, examples=[4])
    """divides the coefficient, to fit it to the machine; about 4 for nozaki"""

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
        """Return the water per area, kg/(m2 s): a number, or a function of time in s."""
        if self.water is not None:
            return self.water
        return times(self._per_flow(around), around.over_time(around.supplied(self)))

    def milestones(self, around: Surroundings) -> tuple[float, ...]:
        """See `HeatLaw.milestones`; a share of a flow changes slope where the flow does."""
        shared = self.share is not None and around.water is not None
        flow = around.water.flow if shared and around.water is not None else self.flow
        return () if flow is None else kinks_in_time(seen_by_slice(flow, around.clock), around)

    def _per_flow(self, around: Surroundings) -> float:
        """Water per area for a unit flow of the zone, kg/m3 over m2."""
        extent = around.extent
        assert extent is not None, "the law asks for it"
        whole = extent.perimeter * (extent.end - extent.start)
        return WATER_DENSITY / (whole if self.area is None else self.area)


CoefficientOfTemperature = Annotated[
    Tabled, Curve(Kind("W/(m^2 K)", "W/(m^2 K)", least=0.0), "temperature")
]
EmissivityOfTemperature = Annotated[
    Tabled, Curve(Kind("1", least=0.0, most=1.0, label="emissivity", sample="0.8"), "temperature")
]


class Convection(HeatLaw):
    """Convection to the ambient (eq. 30); beside contact, only across its gap."""

    crosses_gap: ClassVar[bool] = True

    law: Literal["convection"]
    coefficient: CoefficientOfTemperature
    """heat transfer coefficient"""
    ambient: Temperature = Field(examples=["25 degC"])
    """ambient temperature"""

    def build(self, around: Surroundings) -> flux_laws.Convection:
        """See `HeatLaw.build`."""
        return flux_laws.Convection(coefficient=self.coefficient, ambient=self.ambient)


class Radiation(HeatLaw):
    """Radiation to the ambient (eq. 32, 33); beside contact, only across its gap."""

    crosses_gap: ClassVar[bool] = True

    law: Literal["radiation"]
    emissivity: EmissivityOfTemperature | None = None
    """emissivity of the strand; by default that of the steel"""
    ambient: Temperature = Field(examples=["25 degC"])
    """temperature of the surroundings or the wall"""
    wall_emissivity: EmissivityOfTemperature = 1.0
    """emissivity of the wall"""
    refractive_index: PositiveNumber = Field(1.0, examples=[1.5])
    """refractive index of the medium in the gap"""
    absorption: InverseLength = written("0 1/m")
    """absorption coefficient of the medium in the gap"""
    gap: Distance | None = Field(
        None,
        description=GAP + "; by default that of a contact law on the same boundary group, none "
        "without one",
        examples=["0.2 mm"],
    )

    def build(self, around: Surroundings) -> flux_laws.Radiation:
        """See `HeatLaw.build`."""
        steel = around.steel
        if lack := no_emissivity(self.emissivity, steel):
            raise InputError(f"radiation: {lack}")
        return flux_laws.Radiation(
            emissivity=steel.emissivity if self.emissivity is None else self.emissivity,
            ambient=self.ambient,
            wall_emissivity=self.wall_emissivity,
            refractive_index=self.refractive_index,
            absorption=self.absorption,
            gap=self.gap,
        )


class PrescribedTemperature(HeatLaw):
    """A given surface temperature."""

    called: ClassVar[str] = "a given temperature"

    law: Literal["temperature"]
    value: Temperature = Field(examples=["1000 degC"])
    """surface temperature"""

    def build(self, around: Surroundings) -> flux_laws.PrescribedTemperature:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedTemperature(self.value)


class Zone(TableModel):
    """A cooling zone with its heat laws; the fluxes on a boundary group add up (eq. 36).

    Beside contact, radiation and convection act across its gap: at touching points there is only
    contact (eq. 35).
    """

    name: str = Field(min_length=1)
    """name of the zone, unique in the case"""
    to: Length | None = Field(None, examples=["600 mm"])
    """end of the zone, from the meniscus; left out: it extends to the end of the strand"""
    surface: tuple[HeatLaw, ...] = ()
    """heat laws; none: insulated"""
