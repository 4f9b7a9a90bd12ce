"""Spray water per mass of steel, or as shares of a total; it follows the casting speed.

The mass of passing steel is that of the section as cast, at the density of the solidus: the shell
forms with this density, and the strand keeps its mass while it shrinks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Protocol

from pydantic import Field

from castfem.base.quantities import Kind
from castfem.base.table_notation import Curve
from castfem.base.tables import Table, Tabled
from castfem.model.base import TableModel

if TYPE_CHECKING:
    from castfem.meshes import SectionMesh
    from castfem.physics.machine.travel import Travel
    from castfem.physics.materials import Steel

Flow = float | Table
ZoneFlow = Annotated[
    Tabled,
    Curve(
        Kind("m^3/s", "L/min", least=0.0, label="water flow", sample="240 L/min"),
        "speed",
        ("time",),
    ),
]
SpecificWater = Annotated[
    float, Kind("m^3/kg", "L/kg", least=0.0, label="water per mass of steel", sample="0.8 L/kg")
]
WaterShare = Annotated[float, Kind("1", least=0.0, most=1.0, label="share", sample="0.3")]
PER_LITRE_AND_KG = 1e3  # converts L/kg to m3/kg


class Water(TableModel):
    """Spray water of the whole strand, shared by zones and circuits: `specific` or `flow`."""

    specific: SpecificWater | None = Field(None, examples=["0.8 L/kg"])
    """water per mass of steel; its flow follows the casting speed"""
    flow: ZoneFlow | None = Field(None, examples=["1200 L/min"])
    """flow, instead of specific"""


class Watered(Protocol):
    """Anything with water: the spray of a zone, or a circuit."""

    flow: Flow | None
    specific: float | None
    share: float | None


@dataclass(frozen=True, slots=True)
class Supply:
    """Converts an amount of water as given into a flow."""

    mass: float  #: mass of the strand per length, kg/m
    travel: Travel  #: gives the casting speed
    total: Water | None  #: water of the whole strand; None if the case does not give it
    clock: float = 0.0  #: time at which the slice leaves the meniscus, by the clock of flows, s

    def flow(self, amount: Watered) -> Flow:
        """Return the flow, m3/s: a number, or a table over casting speed or time."""
        if amount.share is not None:
            assert self.total is not None, "the case has been checked"
            total = self._of(self.total.flow, self.total.specific)
            return _times(amount.share, total)
        return self._of(amount.flow, amount.specific)

    def most(self, amount: Watered) -> float:
        """Return the largest flow, m3/s; of a table over casting speed, at the speeds cast."""
        flow = self.flow(amount)
        if not isinstance(flow, Table) or flow.over != "speed":
            return largest(flow)
        slowest, fastest = self.travel.slowest, self.travel.fastest
        within = (speed for speed in flow.arguments if slowest < speed < fastest)
        return max(float(flow(speed)) for speed in (slowest, *within, fastest))

    def specific(self, amount: Watered) -> float:
        """Return the water per mass of steel, m3/kg, for the largest flow at the highest speed."""
        return self.most(amount) / (self.mass * self.travel.fastest)

    def _of(self, flow: Flow | None, specific: float | None) -> Flow:
        if flow is not None:
            return seen_by_slice(flow, self.clock)
        assert specific is not None, "the case has been checked"
        fastest = self.travel.fastest
        most = specific * self.mass * fastest
        if not self.travel.kinks:
            return most
        return Table("speed", (0.0, fastest), (0.0, most))


def seen_by_slice(flow: Flow, clock: float) -> Flow:
    """Convert a flow over clock time into one over the time of a slice that starts at `clock`."""
    if not isinstance(flow, Table) or flow.over != "time" or clock == 0.0:
        return flow
    later = [(t - clock, v) for t, v in zip(flow.arguments, flow.values, strict=True) if t > clock]
    rows = [(0.0, float(flow(clock))), *later]
    return Table("time", tuple(t for t, _ in rows), tuple(v for _, v in rows))


def steel_per_length(mesh: SectionMesh, steel: Steel) -> float:
    """Return the mass of the whole strand per length, kg/m."""
    area = mesh.multiplicity * mesh.exact_area
    return area * float(steel.density(steel.solidus, "below"))


def largest(flow: Flow) -> float:
    """Return the largest flow of a table, m3/s, or the number itself."""
    return max(flow.values) if isinstance(flow, Table) else flow


def _times(share: float, flow: Flow) -> Flow:
    if isinstance(flow, Table):
        return Table(flow.over, flow.arguments, tuple(share * value for value in flow.values))
    return share * flow
