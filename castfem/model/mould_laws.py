"""Heat laws of a mould: contact with its wall, or a flux, scaled to totals measured there."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field

from castfem.base.curves import CurveOrName, CurveOverEither
from castfem.base.quantities import Conductivity, Distance, Kind
from castfem.base.table_notation import CurveOr
from castfem.base.tables import Table
from castfem.model.heat_law import GAP, Surroundings
from castfem.model.measured_heat import ScaledLaw
from castfem.physics.thermal import flux_laws, mould_flux
from castfem.physics.thermal.mould_flux import MOULD_FLUXES

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

MOULD = "mould"
WallTemperature = Annotated[str | float | Table, CurveOr(Kind("K", "degC"), "time", MOULD)]


class Contact(ScaledLaw):
    """Contact with a wall, through a gap where there is one (thesis, eq. 301)."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["coefficient"]}, {"required": ["flux"]}]}
    )

    called: ClassVar[str] = "contact with a gap of its own"
    curve_key: ClassVar[str] = "flux"

    law: Literal["contact"]
    coefficient: ContactCoefficient | None = Field(None, examples=["1600 W/(m^2 K)"])
    """coefficient without a gap; a table over temperature is over that of the surface"""
    flux: ContactFlux | None = Field(None, examples=["2 MW/m^2"])
    """heat flux of good contact, instead of coefficient: what is measured where there is no gap; a
    gap lowers it"""
    wall: WallTemperature | None = Field(None, examples=["160 degC"])
    """temperature of the wall; "mould", as by default: mould.wall_temperature"""
    gap: Distance | None = Field(
        None,
        description=GAP + "; by default the one that opens in the mould, none without [mould]",
        examples=["0.2 mm"],
    )
    gap_conductivity: Conductivity | None = Field(None, examples=["0.15 W/(m K)"])
    """conductivity of what fills the gap; needed where there can be one"""

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
    value: GivenFlux
    """heat flux; over the time since the meniscus"""

    def build(self, around: Surroundings) -> flux_laws.PrescribedFlux:
        """See `HeatLaw.build`."""
        return flux_laws.PrescribedFlux(self.scaled(self.value, around))


def _over_temperature(given: object) -> Table | None:
    return given if isinstance(given, Table) and given.over == "temperature" else None
