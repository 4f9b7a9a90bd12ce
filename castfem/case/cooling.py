"""The array of tables [[cooling]]: zones in casting order and the heat laws that hold in them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from castfem.case.base import TableModel, written
from castfem.case.variants import Variants
from castfem.errors import InputError
from castfem.machine.along import over_time
from castfem.thermal import flux_laws, mould_flux
from castfem.thermal.mould_flux import MOULD_FLUXES
from castfem.thermal.sprays import CORRELATIONS, WATER_DENSITY
from castfem.values.curves import CurveOrName, CurveOverEither
from castfem.values.quantities import (
    Conductivity,
    Distance,
    InverseLength,
    Kind,
    Length,
    NameOf,
    PositiveDifference,
    PositiveNumber,
    Temperature,
    WaterFlow,
    WaterTemperature,
)
from castfem.values.table_notation import Curve, CurveOr
from castfem.values.tables import Table

if TYPE_CHECKING:
    from castfem.machine import Machine
    from castfem.materials import Steel

CoefficientOfTemperature = Annotated[
    float | Table, Curve(Kind("W/(m^2 K)", "W/(m^2 K)", least=0.0), over="temperature")
]
EmissivityOfTemperature = Annotated[
    float | Table,
    Curve(
        Kind("1", least=0.0, most=1.0, label="emissivity", sample="0.8"),
        over="temperature",
    ),
]
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
ZoneFlow = Annotated[
    float | Table,
    CurveOverEither(
        Kind("m^3/s", "L/min", least=0.0, label="water flow", sample="240 L/min"),
        "speed",
        ("time",),
    ),
]
SprayedArea = Annotated[float, Kind("m^2", "m^2", above=0.0)]
HeatFlow = Annotated[float, Kind("W", "kW", above=0.0, label="heat flow", sample="1450 kW")]
VolumeFlow = Annotated[float, Kind("m^3/s", "L/min", above=0.0, label="water", sample="1800 L/min")]

MOULD = "mould"
WallTemperature = Annotated[str | float | Table, CurveOr(Kind("K", "degC"), "time", MOULD)]

_GAP = "distance between strand and wall"


@dataclass(frozen=True, slots=True)
class Extent:
    """Where a law holds.

    Attributes:
        start: From the meniscus, m. end: Likewise, of its whole zone.
        perimeter: Of its groups on the whole strand, m.
    """

    start: float
    end: float
    perimeter: float


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a heat law may leave to the rest of the case.

    Attributes:
        steel: Of the strand.
        machine: When the slice is where.
        wall: Temperature of the mould's wall as the slice passes it, K, over time in s; None if
            the case gives none.
        extent: Where the law holds; None for one that does not ask (`HeatLaw.asks_extent`).
    """

    steel: Steel
    machine: Machine
    wall: float | Callable[[float], float] | None = None
    extent: Extent | None = None

    def over_time(self, given: str | float | Table) -> mould_flux.Value:
        """Return a number, a table of what the slice meets, or a named flux, over time in s."""
        if isinstance(given, str):
            return MOULD_FLUXES[given].formula
        return over_time(given, self.machine) if isinstance(given, Table) else given


class HeatLaw(Variants):
    """What every heat law has; a new one is a subclass with its own `law` and `build`."""

    tag_key = "law"
    kinds: ClassVar[dict[str, Any]] = {}
    crosses_gap: ClassVar[bool] = False
    """Whether it crosses the gap of contact beside it, (35)-(36), rather than add to it."""
    called: ClassVar[str] = ""
    """What a sentence calls it; by default as the case file does."""

    on: tuple[str, ...] | None = Field(
        None,
        min_length=1,
        description="boundary groups it holds on; a name also stands for all groups that begin "
        "with it; by default the whole outer surface",
    )

    @abstractmethod
    def build(self, around: Surroundings) -> flux_laws.SurfaceLaw | flux_laws.PrescribedTemperature:
        """Return the law as arrays in, flux out.

        Raises:
            InputError: The rest of the case lacks what the law leaves to it.
        """

    @property
    def asks_extent(self) -> bool:
        """Whether it must know how much of the strand it holds on (`Surroundings.extent`)."""
        return False

    def milestones(self, around: Surroundings) -> tuple[float, ...]:
        """Return the instants at which what it is given changes its slope in time, s."""
        given = (getattr(self, key) for key in type(self).model_fields)
        return tuple(kink for value in given for kink in kinks_in_time(value, around))


def kinks_in_time(value: Any, around: Surroundings) -> tuple[float, ...]:
    """Return the instants at which a value of a law changes its slope in time, s."""
    if isinstance(value, str) and value in MOULD_FLUXES:
        return MOULD_FLUXES[value].kinks
    if not isinstance(value, Table) or value.over == "temperature":
        return ()
    return over_time(value, around.machine).kinks


def times(factor: float, value: mould_flux.Value) -> mould_flux.Value:
    """Return a number, or a function of time, times a factor."""
    return mould_flux.Scaled(factor, value) if callable(value) else factor * value


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


def _over_temperature(given: object) -> Table | None:
    return given if isinstance(given, Table) and given.over == "temperature" else None


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
        description=_GAP + "; by default the one that opens in the mould, none without [mould]",
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


class Convection(HeatLaw):
    """Convection to the ambient (eq. 30); beside contact, across its gap alone."""

    crosses_gap: ClassVar[bool] = True

    law: Literal["convection"]
    coefficient: CoefficientOfTemperature = Field(description="heat transfer coefficient")
    ambient: Temperature = Field(
        description="temperature of the surroundings", examples=["25 degC"]
    )

    def build(self, around: Surroundings) -> flux_laws.Convection:
        """See `HeatLaw.build`."""
        return flux_laws.Convection(coefficient=self.coefficient, ambient=self.ambient)


class Radiation(HeatLaw):
    """Radiation to the ambient (eq. 32, 33); beside contact, across its gap alone."""

    crosses_gap: ClassVar[bool] = True

    law: Literal["radiation"]
    emissivity: EmissivityOfTemperature | None = Field(
        None, description="emissivity of the strand; by default the steel's"
    )
    ambient: Temperature = Field(
        description="temperature of the surroundings or the wall", examples=["25 degC"]
    )
    wall_emissivity: EmissivityOfTemperature = Field(1.0, description="emissivity of the wall")
    refractive_index: PositiveNumber = Field(
        1.0, description="of what fills the gap", examples=[1.5]
    )
    absorption: InverseLength = Field(
        written("0 1/m"), description="absorption of what fills the gap"
    )
    gap: Distance | None = Field(
        None,
        description=_GAP + "; by default that of a contact law on the same boundary group, none "
        "without one",
        examples=["0.2 mm"],
    )

    def build(self, around: Surroundings) -> flux_laws.Radiation:
        """See `HeatLaw.build`."""
        steel = around.steel
        if self.emissivity is None and not steel.has("emissivity"):
            raise InputError(
                f"radiation: steel {steel.name} has no emissivity; give one, emissivity = 0.8"
            )
        return flux_laws.Radiation(
            emissivity=steel.emissivity if self.emissivity is None else self.emissivity,
            ambient=self.ambient,
            wall_emissivity=self.wall_emissivity,
            refractive_index=self.refractive_index,
            absorption=self.absorption,
            gap=self.gap,
        )


class Flux(ScaledLaw):
    """A given heat flux; positive when heat leaves the strand."""

    called: ClassVar[str] = "a given flux"

    law: Literal["flux"]
    value: GivenFlux = Field(description="heat flux; over the time since the meniscus")

    def build(self, around: Surroundings) -> flux_laws.PrescribedFlux:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedFlux(self.scaled(self.value, around))


class PrescribedTemperature(HeatLaw):
    """A given surface temperature."""

    called: ClassVar[str] = "a given temperature"

    law: Literal["temperature"]
    value: Temperature = Field(description="surface temperature", examples=["1000 degC"])

    def build(self, around: Surroundings) -> flux_laws.PrescribedTemperature:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedTemperature(self.value)


class Spray(HeatLaw):
    """Water spray: convection with the coefficient of a published correlation.

    Its water is given per area, or as that of the whole zone.
    """

    called: ClassVar[str] = "a spray"

    law: Literal["spray"]
    water: WaterFlow | None = Field(
        None, description="water flow per surface area", examples=["5 L/(m^2 s)"]
    )
    flow: ZoneFlow | None = Field(
        None,
        description="instead of water, that of the zone on all faces of this law, of the whole "
        "strand; in a table over the casting speed it follows it, over time is since the meniscus",
        examples=["240 L/min"],
    )
    area: SprayedArea | None = Field(
        None,
        description="sprayed area of these faces, with flow; by default all of them in the zone",
        examples=["1.2 m^2"],
    )
    water_temperature: WaterTemperature = Field(
        description="temperature of the water", examples=["25 degC"]
    )
    correlation: Annotated[str, NameOf(CORRELATIONS)] = Field(
        description="formula of the coefficient"
    )
    machine_factor: PositiveNumber = Field(
        1.0,
        description="divides the coefficient: fit to the machine, about 4 for nozaki",
        examples=[4],
    )

    @property
    def asks_extent(self) -> bool:
        """See `HeatLaw.asks_extent`."""
        return self.flow is not None

    def build(self, around: Surroundings) -> flux_laws.Convection | flux_laws.Sprayed:
        """See `HeatLaw.build`."""
        water, correlation = self._water(around), CORRELATIONS[self.correlation]
        if not callable(water):
            coefficient = partial(
                correlation.coefficient, water, self.water_temperature, self.machine_factor
            )
            return flux_laws.Convection(coefficient=coefficient, ambient=self.water_temperature)
        assert isinstance(self.flow, Table)
        most = max(self.flow.values) * self._per_flow(around)
        return flux_laws.Sprayed(
            correlation, water, most, self.water_temperature, self.machine_factor
        )

    def _water(self, around: Surroundings) -> mould_flux.Value:
        """Return the water per area, kg/(m2 s): one number, or over time in s."""
        if self.flow is None:
            assert self.water is not None, "the case has been checked"
            return self.water
        return times(self._per_flow(around), around.over_time(self.flow))

    def _per_flow(self, around: Surroundings) -> float:
        """Water per area for a flow of the zone, kg/m3 over m2."""
        extent = around.extent
        assert extent is not None, "the law asks for it"
        whole = extent.perimeter * (extent.end - extent.start)
        return WATER_DENSITY / (whole if self.area is None else self.area)


class Zone(TableModel):
    """A part of the machine with its heat laws, which add up on a boundary group (eq. 36).

    Beside contact, radiation and convection cross its gap: where the strand touches there is
    contact alone (eq. 35).
    """

    name: str = Field(min_length=1, description="name of the zone, unique in the case")
    to: Length | None = Field(
        None,
        description="where it ends, from the meniscus; left out: it goes on to the end",
        examples=["600 mm"],
    )
    surface: tuple[HeatLaw, ...] = Field((), description="heat laws; none: insulated")
