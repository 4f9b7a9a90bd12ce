"""What all heat laws of [[cooling]] have, and what they may leave to the rest of the case."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field

from castfem.base.tables import Table
from castfem.model.variants import Variants
from castfem.model.water import Supply, Water, Watered
from castfem.physics.machine.time_functions import over_time
from castfem.physics.thermal import flux_laws, mould_flux
from castfem.physics.thermal.mould_flux import MOULD_FLUXES

if TYPE_CHECKING:
    from castfem.physics.machine import Machine
    from castfem.physics.materials import Steel

GAP = "distance between strand and wall"


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
        water: Of the whole strand; None where the case does not tell it.
        supply: Of water; None for a law that does not ask.
        clock: When the slice leaves the meniscus, on the clock of flows over time, s.
    """

    steel: Steel
    machine: Machine
    wall: float | Callable[[float], float] | None = None
    extent: Extent | None = None
    water: Water | None = None
    supply: Supply | None = None
    clock: float = 0.0

    def supplied(self, told: Watered) -> float | Table:
        """Return the flow of water that is told as such, per mass of steel or as a share, m3/s."""
        assert self.supply is not None, "the law asks for it"
        return self.supply.flow(told)

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

    on: tuple[str, ...] | None = Field(None, min_length=1)
    """boundary groups it holds on; a name also stands for all groups that begin with it; by default
    the whole outer surface"""

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
