"""The array of tables [[cooling]]: zones in casting order and the heat laws that hold in them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from castfem.case.base import TableModel, written
from castfem.case.variants import Variants
from castfem.errors import InputError
from castfem.thermal import flux_laws
from castfem.thermal.sprays import CORRELATIONS
from castfem.values.quantities import (
    Conductivity,
    Distance,
    HeatTransferCoefficient,
    InverseLength,
    Kind,
    Length,
    NameOf,
    PositiveNumber,
    Temperature,
    WaterFlow,
    WaterTemperature,
)
from castfem.values.table_notation import Curve, CurveOr
from castfem.values.tables import Table

if TYPE_CHECKING:
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
FluxOfTime = Annotated[float | Table, Curve(Kind("W/m^2", "MW/m^2"), over="time")]
TemperatureOfTime = Annotated[float | Table, Curve(Kind("K", "degC"), over="time")]

MOULD = "mould"
WallTemperature = Annotated[str | float | Table, CurveOr(Kind("K", "degC"), "time", MOULD)]

_GAP = "distance between strand and wall"


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a heat law may leave to the rest of the case.

    Attributes:
        steel: Of the strand.
        wall: Temperature of the mould's wall as the slice passes it, K, over time in s; None if
            the case gives none.
    """

    steel: Steel
    wall: float | Callable[[float], float] | None = None


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

    def milestones(self) -> tuple[float, ...]:
        """Return the instants at which what it is given changes its slope in time, s."""
        given = (getattr(self, key) for key in type(self).model_fields)
        return tuple(
            kink
            for value in given
            if isinstance(value, Table) and value.over == "time"
            for kink in value.kinks
        )


class Contact(HeatLaw):
    """Contact with a wall, through a gap where there is one (thesis, eq. 301)."""

    called: ClassVar[str] = "contact with a gap of its own"

    law: Literal["contact"]
    coefficient: HeatTransferCoefficient = Field(description="coefficient without a gap")
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
            coefficient=self.coefficient,
            wall=wall,
            # Without a gap its conductivity is of no account.
            gap_conductivity=1.0 if self.gap_conductivity is None else self.gap_conductivity,
            gap=self.gap or 0.0,
            follows=self.gap is None,
        )


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


class Flux(HeatLaw):
    """A given heat flux; positive when heat leaves the strand."""

    called: ClassVar[str] = "a given flux"

    law: Literal["flux"]
    value: FluxOfTime = Field(description="heat flux; a table is over time since the meniscus")

    def build(self, around: Surroundings) -> flux_laws.PrescribedFlux:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedFlux(self.value)


class PrescribedTemperature(HeatLaw):
    """A given surface temperature."""

    called: ClassVar[str] = "a given temperature"

    law: Literal["temperature"]
    value: Temperature = Field(description="surface temperature", examples=["1000 degC"])

    def build(self, around: Surroundings) -> flux_laws.PrescribedTemperature:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedTemperature(self.value)


class Spray(HeatLaw):
    """Water spray: convection with the coefficient of a published correlation."""

    called: ClassVar[str] = "a spray"

    law: Literal["spray"]
    water: WaterFlow = Field(description="water flow per surface area")
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

    def build(self, around: Surroundings) -> flux_laws.Convection:
        """See `HeatLaw.build`."""
        coefficient = partial(
            CORRELATIONS[self.correlation].coefficient,
            self.water,
            self.water_temperature,
            self.machine_factor,
        )
        return flux_laws.Convection(coefficient=coefficient, ambient=self.water_temperature)


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
