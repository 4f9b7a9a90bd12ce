"""Heat laws of a mould: contact with its wall, or a flux, scaled to totals measured there."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field

from castfem.case.heat_law import GAP, HeatLaw, Surroundings, kinks_in_time, times
from castfem.errors import InputError
from castfem.thermal import flux_laws, mould_flux
from castfem.thermal.mould_flux import MOULD_FLUXES
from castfem.values.curves import CurveOrName, CurveOverEither
from castfem.values.quantities import Conductivity, Distance, Kind, PositiveDifference
from castfem.values.table_notation import CurveOr
from castfem.values.tables import Table

GivenFlux = Annotated[
    str | float | Table,
    CurveOrName(Kind("W/m^2", "MW/m^2"), "time", ("position",), MOULD_FLUXES),
]
ContactCoefficient = Annotated[
    float | Table,
    CurveOverEither(Kind("W/(m^2 K)", "W/(m^2 K)", least=0.0), "position", ("time", "temperature")),
]
ContactFlux = Annotated[
    str | float | Table,
    CurveOrName(
        Kind("W/m^2", "MW/m^2", least=0.0), "position", ("time", "temperature"), MOULD_FLUXES
    ),
]
HeatFlow = Annotated[float, Kind("W", "kW", above=0.0, label="heat flow", sample="1450 kW")]
VolumeFlow = Annotated[float, Kind("m^3/s", "L/min", above=0.0, label="water", sample="1800 L/min")]

MOULD = "mould"
WallTemperature = Annotated[str | float | Table, CurveOr(Kind("K", "degC"), "time", MOULD)]


class ScaledLaw(HeatLaw):
    """A law whose heat may be scaled to a measured total."""

    power: HeatFlow | None = Field(
        None,
        description="heat that the mould takes from the faces of this law in all, on the whole "
        "strand and over the whole zone; the flux is scaled to it",
    )
    water: VolumeFlow | None = Field(
        None, description="cooling water that takes this heat, instead of power"
    )
    water_rise: PositiveDifference | None = Field(
        None, description="rise of its temperature, with water", examples=["7 K"]
    )

    @property
    def asks_extent(self) -> bool:
        """See `HeatLaw.asks_extent`."""
        return self.total is not None

    @property
    def total(self) -> float | None:
        """The heat it is scaled to, W; None if it is not scaled."""
        if self.water is not None and self.water_rise is not None:
            return mould_flux.WATER * self.water * self.water_rise
        return self.power

    def scaled(self, given: str | float | Table, around: Surroundings) -> mould_flux.Value:
        """Return a flux over time, scaled to the measured total if there is one."""
        value, total, extent = around.over_time(given), self.total, around.extent
        if total is None or extent is None:
            return value
        machine = around.machine
        between = machine.time_at(extent.start), machine.time_at(extent.end)
        kinks = (*kinks_in_time(given, around), *machine.kinks)
        heat = extent.perimeter * mould_flux.heat_to_mould(value, machine.speed, between, kinks)
        if not heat > 0.0:
            raise InputError(
                f"{self.tag}: the flux takes {1e-3 * heat:.4g} kW in all and cannot be scaled to a "
                "measured total; a curve that is above 0 is needed"
            )
        return times(total / heat, value)


class Contact(ScaledLaw):
    """Contact with a wall, through a gap where there is one (thesis, eq. 301)."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["coefficient"]}, {"required": ["flux"]}]}
    )

    called: ClassVar[str] = "contact with a gap of its own"

    law: Literal["contact"]
    coefficient: ContactCoefficient | None = Field(
        None,
        description="coefficient without a gap; a table over temperature is over that of the "
        "surface",
        examples=["1600 W/(m^2 K)"],
    )
    flux: ContactFlux | None = Field(
        None,
        description="heat flux of good contact, instead of coefficient: what is measured where "
        "there is no gap; a gap lowers it",
        examples=["2 MW/m^2"],
    )
    wall: WallTemperature | None = Field(
        None,
        description='temperature of the wall; "mould", as by default: mould.wall_temperature',
        examples=["160 degC"],
    )
    gap: Distance | None = Field(
        None,
        description=GAP + "; by default the one that opens in the mould, none without [mould]",
        examples=["0.2 mm"],
    )
    gap_conductivity: Conductivity | None = Field(
        None,
        description="conductivity of what fills the gap; needed where there can be one",
        examples=["0.15 W/(m K)"],
    )

    def build(self, around: Surroundings) -> flux_laws.Contact:
        """See `HeatLaw.build`."""
        wall = around.wall if self.wall in (None, MOULD) else self.wall
        assert wall is not None and not isinstance(wall, str), "the case has been checked"
        return flux_laws.Contact(
            coefficient=self._good(around),
            wall=wall,
            # Without a gap its conductivity is of no account.
            gap_conductivity=1.0 if self.gap_conductivity is None else self.gap_conductivity,
            gap=self.gap or 0.0,
            follows=self.gap is None,
        )

    def _good(self, around: Surroundings) -> float | mould_flux.Curve:
        """Return the coefficient without a gap."""
        if self.flux is not None:
            table = _over_temperature(self.flux)
            if table is not None:
                return mould_flux.FluxCurve(over_temperature=table)
            return mould_flux.FluxCurve(self.scaled(self.flux, around))
        assert self.coefficient is not None, "the case has been checked"
        if not isinstance(self.coefficient, Table):
            return self.coefficient
        table = _over_temperature(self.coefficient)
        if table is not None:
            return mould_flux.CoefficientCurve(over_temperature=table)
        return mould_flux.CoefficientCurve(around.over_time(self.coefficient))


class Flux(ScaledLaw):
    """A given heat flux; positive when heat leaves the strand."""

    called: ClassVar[str] = "a given flux"

    law: Literal["flux"]
    value: GivenFlux = Field(description="heat flux; over the time since the meniscus")

    def build(self, around: Surroundings) -> flux_laws.PrescribedFlux:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedFlux(self.scaled(self.value, around))


def _over_temperature(given: object) -> Table | None:
    return given if isinstance(given, Table) and given.over == "temperature" else None
