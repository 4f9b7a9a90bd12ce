"""The array of tables [[cooling]]: zones in casting order and the heat laws that hold in them.

What the laws have in common stands in `castfem.model.heat_law`, those of a mould in
`castfem.model.mould_laws`, sprays in `castfem.model.spray`; the other laws are here.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from castfem.base.errors import InputError
from castfem.base.quantities import (
    Distance,
    InverseLength,
    Kind,
    Length,
    PositiveNumber,
    Temperature,
)
from castfem.base.table_notation import Curve
from castfem.base.tables import Table
from castfem.model.base import TableModel, written
from castfem.model.heat_law import GAP, HeatLaw, Surroundings
from castfem.model.missing_data import no_emissivity
from castfem.model.mould_laws import Contact, Flux
from castfem.model.spray import Spray
from castfem.physics.thermal import flux_laws

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


class Convection(HeatLaw):
    """Convection to the ambient (eq. 30); beside contact, across its gap alone."""

    crosses_gap: ClassVar[bool] = True

    law: Literal["convection"]
    coefficient: CoefficientOfTemperature
    """heat transfer coefficient"""
    ambient: Temperature = Field(examples=["25 degC"])
    """temperature of the surroundings"""

    def build(self, around: Surroundings) -> flux_laws.Convection:
        """See `HeatLaw.build`."""
        return flux_laws.Convection(coefficient=self.coefficient, ambient=self.ambient)


class Radiation(HeatLaw):
    """Radiation to the ambient (eq. 32, 33); beside contact, across its gap alone."""

    crosses_gap: ClassVar[bool] = True

    law: Literal["radiation"]
    emissivity: EmissivityOfTemperature | None = None
    """emissivity of the strand; by default the steel's"""
    ambient: Temperature = Field(examples=["25 degC"])
    """temperature of the surroundings or the wall"""
    wall_emissivity: EmissivityOfTemperature = 1.0
    """emissivity of the wall"""
    refractive_index: PositiveNumber = Field(1.0, examples=[1.5])
    """of what fills the gap"""
    absorption: InverseLength = written("0 1/m")
    """absorption of what fills the gap"""
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
    """A part of the machine with its heat laws, which add up on a boundary group (eq. 36).

    Beside contact, radiation and convection cross its gap: where the strand touches there is
    contact alone (eq. 35).
    """

    name: str = Field(min_length=1)
    """name of the zone, unique in the case"""
    to: Length | None = Field(None, examples=["600 mm"])
    """where it ends, from the meniscus; left out: it goes on to the end"""
    surface: tuple[HeatLaw, ...] = ()
    """heat laws; none: insulated"""
