"""Base classes of the heat laws of [[cooling]], and the parts of the case they may use."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field

from castfem.base.errors import InputError
from castfem.base.quantities import Kind, OrWord
from castfem.base.table_notation import Curve
from castfem.base.tables import Table, Tabled
from castfem.model.base import Variants
from castfem.model.water import Supply, Water, Watered, seen_by_slice
from castfem.physics.machine import Machine
from castfem.physics.machine.machine import over_time
from castfem.physics.machine.travel import Steady
from castfem.physics.thermal import flux_laws, mould_flux
from castfem.physics.thermal.mould_flux import MOULD_FLUXES

if TYPE_CHECKING:
    from castfem.physics.materials import Steel


GAP = "distance between strand and wall"


@dataclass(frozen=True, slots=True)
class Extent:
    """Region where a law holds."""

    start: float  #: from the meniscus, m
    end: float  #: from the meniscus, of the whole zone, m
    perimeter: float  #: length of its boundary groups on the whole strand, m


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Data of the rest of the case that a heat law may need."""

    steel: Steel  #: steel of the strand
    machine: Machine  #: gives the time at which the slice reaches a position
    #: temperature of the mould wall as the slice passes it, K, over time in s; None if the case
    #: gives none
    wall: float | Callable[[float], float] | None = None
    #: range in which the law holds; None unless the law asks for it (`HeatLaw.asks_extent`)
    extent: Extent | None = None
    water: Water | None = None  #: water of the whole strand; None if the case does not give it
    supply: Supply | None = None  #: water supply; None unless the law needs it
    clock: float = 0.0  #: time at which the slice leaves the meniscus, by the clock of flows, s

    def supplied(self, amount: Watered) -> float | Table:
        """Return the flow of water, m3/s, given as a flow, per mass of steel or as a share."""
        assert self.supply is not None, "the law asks for it"
        return self.supply.flow(amount)

    def over_time(self, given: str | float | Table) -> mould_flux.Value:
        """Return a number, a table or a named flux as a number or function of time in s."""
        if isinstance(given, str):
            return MOULD_FLUXES[given].formula
        return over_time(given, self.machine) if isinstance(given, Table) else given


class HeatLaw(Variants):
    """Base of the heat laws; a new one is a subclass with its own `law` and `build`."""

    tag_key = "law"
    kinds: ClassVar[dict[str, Any]] = {}
    crosses_gap: ClassVar[bool] = False
    """Whether it acts across the gap of the contact beside it, (35)-(36), instead of adding to it.
    """
    called: ClassVar[str] = ""
    """Its name in messages; by default the name in the case file."""

    on: tuple[str, ...] | None = Field(None, min_length=1)
    """boundary groups on which it holds; a name also matches all groups that begin with it; by
    default the whole outer surface"""

    @abstractmethod
    def build(self, around: Surroundings) -> flux_laws.SurfaceLaw | flux_laws.PrescribedTemperature:
        """Return the surface law, which takes arrays and returns the flux.

        Raises:
            InputError: The rest of the case lacks data that the law needs.
        """

    @property
    def asks_extent(self) -> bool:
        """Whether it needs the area on which it holds (`Surroundings.extent`)."""
        return False

    def milestones(self, around: Surroundings) -> tuple[float, ...]:
        """Return the instants at which its input changes slope in time, s."""
        given = (getattr(self, key) for key in type(self).model_fields)
        return tuple(kink for value in given for kink in kinks_in_time(value, around))


def kinks_in_time(value: Any, around: Surroundings) -> tuple[float, ...]:
    """Return the instants at which a value of a law changes its slope in time, s."""
    if isinstance(value, str) and value in MOULD_FLUXES:
        return MOULD_FLUXES[value].kinks
    if not isinstance(value, Table) or value.over == "temperature":
        return ()
    return over_time(value, around.machine).kinks


def times(factor: mould_flux.Value, value: mould_flux.Value) -> mould_flux.Value:
    """Return the product of two numbers or functions of time."""
    if callable(factor) or callable(value):
        return mould_flux.Scaled(factor, value)
    return factor * value


def no_emissivity(given: object, steel: Steel) -> str:
    """Return a text if neither a table nor the steel gives an emissivity, else ""."""
    if given is not None or steel.has("emissivity"):
        return ""
    return f"steel {steel.name} has no emissivity; give one, emissivity = 0.8"


def no_expansion(steel: Steel) -> str:
    """Return a text if the steel has no thermal expansion, which mechanics need, else ""."""
    if steel.has("thermal_expansion"):
        return ""
    return (
        f"{steel.name} has no thermal_expansion, which [mechanics] needs; add "
        '[thermal_expansion] to its file, or steel.overrides.thermal_expansion = "13.5e-6 1/K"'
    )


ANY_SPEED = "any speed"
TOTALS = ("power", "water", "water_rise")
"""Keys of a measured total."""

HeatFlow = Annotated[
    Tabled, Curve(Kind("W", "kW", above=0.0, label="heat flow", sample="1450 kW"), "speed")
]
VolumeFlow = Annotated[
    Tabled, Curve(Kind("m^3/s", "L/min", above=0.0, label="water", sample="1800 L/min"), "speed")
]
Rise = Annotated[Tabled, Curve(Kind("K", "K", difference=True, above=0.0, sample="7 K"), "speed")]
FactorOverTime = Annotated[
    Tabled, Curve(Kind("1", least=0.0, label="factor", sample="0.95"), "time")
]
MeasuredAt = Annotated[float | str, OrWord(Kind("m/s", "m/min", above=0.0), (ANY_SPEED,))]


class ScaledLaw(HeatLaw):
    """A law whose heat may be scaled to a measured total."""

    power: HeatFlow | None = None
    """total heat that the mould takes from the faces of this law, on the whole strand and over the
    whole zone; the flux is scaled to it"""
    water: VolumeFlow | None = None
    """cooling water that takes up this heat, instead of power"""
    water_rise: Rise | None = Field(None, examples=["7 K"])
    """temperature rise of the cooling water, with water"""
    measured_at: MeasuredAt | None = Field(None, examples=["2.8 m/min"])
    """casting speed at which this heat, or a flux over position, was measured: at another speed the
    flux is the same after the same time in the mould, so that the total changes; "any speed": the
    total is the same at every speed. Left out: the same, with a warning where speeds are compared
    """

    factor: FactorOverTime | None = None
    """factor on the coefficient or flux, also on a scaled one; a table over time uses the clock of
    casting.start.time"""

    @property
    def asks_extent(self) -> bool:
        """See `HeatLaw.asks_extent`."""
        return self.scales

    def with_factor(self, value: mould_flux.Value, around: Surroundings) -> mould_flux.Value:
        """Return a value of the law times its factor, a table of which uses the clock."""
        if self.factor is None:
            return value
        seen = seen_by_slice(self.factor, around.clock)
        return times(seen, value)

    @property
    def scales(self) -> bool:
        """Whether the flux is scaled to a total."""
        return self.power is not None or None not in (self.water, self.water_rise)

    @property
    def over_speed(self) -> bool:
        """Whether the total is a table over the casting speed."""
        return any(isinstance(it, Table) for it in (self.power, self.water, self.water_rise))

    @property
    def by_dwell_time(self) -> bool:
        """Whether a flux measured at one speed is used at others by the time in the mould."""
        return self.measured_at not in (None, ANY_SPEED)

    def total(self, speed: float) -> float | None:
        """Total heat to scale the flux to at a casting speed (m/s), W; None if it is not scaled."""
        if not self.scales:
            return None
        if self.power is not None:
            return _at(self.power, speed)
        assert self.water is not None and self.water_rise is not None, "it is scaled"
        return mould_flux.WATER * _at(self.water, speed) * _at(self.water_rise, speed)

    def scaled(self, given: str | float | Table, around: Surroundings) -> mould_flux.Value:
        """Return a flux over time, scaled to the measured total if there is one.

        A total over the casting speed is taken at the mean speed in the zone. A total measured at
        one speed gives, with this flux, a flux over the time since the meniscus, which is used at
        all other speeds.
        """
        measured = self._as_measured(around)
        value, extent = measured.over_time(given), around.extent
        if extent is None or not self.scales:
            return self.with_factor(value, around)
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
        return self.with_factor(times(total / heat, value), around)

    def kinks(self, given: str | float | Table, around: Surroundings) -> tuple[float, ...]:
        """Return the instants at which the flux changes slope in time, s."""
        return kinks_in_time(given, self._as_measured(around))

    def milestones(self, around: Surroundings) -> tuple[float, ...]:
        """See `HeatLaw.milestones`; totals do not change while a slice is in the mould."""
        given = (
            getattr(self, key)
            for key in type(self).model_fields
            if key not in (*TOTALS, "measured_at", "factor")
        )
        measured = self._as_measured(around)
        seen = None if self.factor is None else seen_by_slice(self.factor, around.clock)
        found: list[float] = [*kinks_in_time(seen, around)]
        for value in given:
            found += kinks_in_time(value, measured if value is self.curve else around)
        return tuple(found)

    curve_key: ClassVar[str] = "value"
    """The key of the flux to scale."""

    @property
    def curve(self) -> str | float | Table | None:
        """The flux to scale; None if the law has none."""
        found: str | float | Table | None = getattr(self, self.curve_key)
        return found

    def _as_measured(self, around: Surroundings) -> Surroundings:
        """Return the surroundings at the speed of the measurement."""
        if not self.by_dwell_time:
            return around
        assert isinstance(self.measured_at, float), "it is a speed"
        return replace(around, machine=Machine(Steady(self.measured_at)))


def _at(given: float | Table, speed: float) -> float:
    return float(given(speed)) if isinstance(given, Table) else given
