"""The array of tables [[cooling]]: zones in casting order and the heat laws that hold in them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from castfem.case.base import TableModel, written
from castfem.values.quantities import (
    Conductivity,
    Distance,
    HeatTransferCoefficient,
    InverseLength,
    Kind,
    Length,
    PositiveNumber,
    Temperature,
    WaterFlow,
    WaterTemperature,
)
from castfem.values.tables import Curve, CurveOr, Table

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


class Law(TableModel):
    """What every heat law has."""

    on: tuple[str, ...] | None = Field(
        None,
        min_length=1,
        description="boundary groups it holds on; a name also stands for all groups that begin "
        "with it; by default the whole outer surface",
    )


class Contact(Law):
    """Contact with a wall, through a gap where there is one (thesis, eq. 301)."""

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


class Convection(Law):
    """Convection to the ambient (eq. 30); beside contact, across its gap alone."""

    law: Literal["convection"]
    coefficient: CoefficientOfTemperature = Field(description="heat transfer coefficient")
    ambient: Temperature = Field(
        description="temperature of the surroundings", examples=["25 degC"]
    )


class Radiation(Law):
    """Radiation to the ambient (eq. 32, 33); beside contact, across its gap alone."""

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


class Flux(Law):
    """A given heat flux; positive when heat leaves the strand."""

    law: Literal["flux"]
    value: FluxOfTime = Field(description="heat flux; a table is over time since the meniscus")


class PrescribedTemperature(Law):
    """A given surface temperature."""

    law: Literal["temperature"]
    value: Temperature = Field(description="surface temperature", examples=["1000 degC"])


class Spray(Law):
    """Water spray: convection with the coefficient of a published correlation."""

    law: Literal["spray"]
    water: WaterFlow = Field(description="water flow per surface area")
    water_temperature: WaterTemperature = Field(
        description="temperature of the water", examples=["25 degC"]
    )
    correlation: Literal["nozaki", "ishiguro", "bolle", "mizikar", "sasaki", "wendelstorf"] = Field(
        description="formula of the coefficient"
    )
    machine_factor: PositiveNumber = Field(
        1.0,
        description="divides the coefficient: fit to the machine, about 4 for nozaki",
        examples=[4],
    )


def _law(table: Any) -> str | None:
    if isinstance(table, dict):
        return table.get("law")
    return getattr(table, "law", None)


HeatLaw = Annotated[
    Annotated[Contact, Tag("contact")]
    | Annotated[Convection, Tag("convection")]
    | Annotated[Radiation, Tag("radiation")]
    | Annotated[Flux, Tag("flux")]
    | Annotated[PrescribedTemperature, Tag("temperature")]
    | Annotated[Spray, Tag("spray")],
    Discriminator(_law),
]


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
