"""The table [secondary]: cooling below the mould, from roll to roll.

What reads it into geometry and laws (`castfem.physics.machine.sprays`,
`castfem.physics.thermal.spray_water`) is imported by a case that has some alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from castfem.base.named_columns import Columns, grid_of, rows_of
from castfem.base.quantities import (
    HeatTransferCoefficient,
    Kind,
    Length,
    NameOf,
    Notation,
    PositiveNumber,
    Temperature,
    WaterFlow,
    WaterTemperature,
)
from castfem.base.table_notation import schema_of_columns
from castfem.base.types import Array
from castfem.model.base import TableModel, written
from castfem.model.cooling import CoefficientOfTemperature, EmissivityOfTemperature
from castfem.model.water import SpecificWater, WaterShare, ZoneFlow
from castfem.physics.thermal.sprays import CORRELATIONS

if TYPE_CHECKING:
    from castfem.physics.machine.rolls import Rolls
    from castfem.physics.machine.sprays import Row, Stretch
    from castfem.physics.thermal.spray_water import Coefficient, CoefficientTable


_COLUMNS = Columns(
    {
        "temperature": Kind("K", "degC"),
        "water": WaterFlow.__metadata__[0],  # type: ignore[attr-defined]
        "value": HeatTransferCoefficient.__metadata__[0],  # type: ignore[attr-defined]
    },
    {"temperature": "temperature_unit", "water": "water_unit", "value": "unit"},
    "table h(T, W)",
    "temperature [degC], water [L/(m^2 s)], value [W/(m^2 K)]",
)


@dataclass(frozen=True, slots=True)
class NozzleTable(Notation):
    """Annotation of a field that takes h(T, W): a CSV file, or columns."""

    takes: str = 'CSV file `{ file = "nozzle.csv" }`, or its columns'

    def read(self, given: object) -> CoefficientTable | None:
        """Return the table, or raise ValueError."""
        from castfem.physics.thermal.spray_water import CoefficientTable

        if given is None or isinstance(given, CoefficientTable):
            return given
        if not isinstance(given, Mapping):
            fix = f'{{ file = "nozzle.csv" }} with {_COLUMNS.header}'
            raise ValueError(f"a table is needed, {fix}")
        return _COLUMNS.read(given, _coefficients)

    def write(self, value: CoefficientTable | None) -> Any:
        """Return what reads back to the same table."""
        if value is None:
            return None
        rows = rows_of((value.temperatures, value.water, value.values))
        return {
            name: [kind.write(row[i]) for row in rows]
            for i, (name, kind) in enumerate(_COLUMNS.kinds.items())
        }

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        ways = schema_of_columns(_COLUMNS.kinds, tuple(_COLUMNS.units.values()))
        return {"anyOf": ways, "description": "h(T, W), from a file"}


def _coefficients(rows: Array, places: Sequence[str]) -> CoefficientTable:
    """Return the table of a row for each temperature and flow, in any order."""
    from castfem.physics.thermal.spray_water import CoefficientTable

    kinds = tuple(_COLUMNS.kinds.values())
    temperatures, water, values = grid_of(rows, places, kinds, "temperature and flow")
    if len(temperatures) < 2 or len(water) < 2:
        raise ValueError("at least two temperatures and two flows are needed")
    if water[0] != 0.0:
        raise ValueError("the flows must begin at 0, which holds at the edge of a spray")
    return CoefficientTable(temperatures, water, values)


Angle = Annotated[float, Kind("rad", "deg", above=0.0, most=3.0)]
Place = Annotated[float, Kind("m", "mm")]
Share = Annotated[float, Kind("1", above=0.0, most=0.9, label="share", sample="0.2")]
Edge = Annotated[float, Kind("1", least=0.0, most=1.0, label="share", sample="0.5")]
FACES = ("wide_face_intrados", "wide_face_extrados", "narrow_face_right", "narrow_face_left")
"""Faces of a whole strand."""
_WIDE = "wide_face"


def is_wide(name: str) -> bool:
    """Whether the name of a group stands for a wide face, too."""
    return name.startswith(_WIDE) or _WIDE.startswith(name)


class RollContact(TableModel):
    """Contact with the rolls; one of `share` and `coefficient`."""

    angle: Angle = Field(examples=["10 deg"])
    """part of a roll's circumference that touches the strand; the length of contact is that of the
    arc"""
    share: Share | None = None
    """share of a roll in the heat of its pitch, 0.01 to 0.22 [Meng2003]"""
    coefficient: HeatTransferCoefficient | None = None
    """heat transfer coefficient of contact"""
    temperature: Temperature | None = Field(None, examples=["150 degC"])
    """temperature of the rolls, with coefficient"""


class NozzleModel(TableModel):
    """A model of nozzle; one of `table` and `correlation`."""

    name: str = Field(min_length=1)
    """name of the model"""
    angle: Angle = Field(examples=["110 deg"])
    """of its spray across the strand"""
    angle_along: Angle = Field(examples=["14 deg"])
    """of its spray along the strand"""
    edge: Edge = 0.0
    """share of the half width over which its water falls to zero at the ends; 0 is even all over, 1
    a triangle"""
    table: Annotated[Any, NozzleTable()] = None
    """measured coefficients of the water alone over surface temperature and water, beginning at no
    water"""
    correlation: Annotated[str, NameOf(CORRELATIONS)] | None = None
    """formula of the coefficient; below its least water it falls to zero"""
    machine_factor: PositiveNumber = Field(1.0, examples=[4])
    """divides the coefficient: fit to the machine"""

    def coefficient(self, water_temperature: float) -> Coefficient:
        """Return h of water and surface temperature."""
        from castfem.physics.thermal.spray_water import OfCorrelation

        if self.correlation is None:
            found: Coefficient = self.table
            return found
        return OfCorrelation(CORRELATIONS[self.correlation], water_temperature, self.machine_factor)

    def most_water(self) -> float:
        """Return the largest flow per area that h is known for, kg/(m2 s)."""
        if self.correlation is None:
            return float(self.table.most)
        return CORRELATIONS[self.correlation].water[1]


class Circuit(TableModel):
    """Nozzles of one model that one valve feeds: a row of them in each gap between some rolls."""

    name: str = Field(min_length=1)
    """name of the circuit"""
    on: tuple[str, ...] = Field(min_length=1)
    """faces it sprays; a name also stands for all groups that begin with it"""
    rolls: tuple[int, int] = Field(examples=[[8, 15]])
    """number of the roll above the first row and of that below the last"""
    nozzle: str
    """their model, the name of a [[secondary.nozzle]]"""
    across: tuple[Place, ...] = Field(min_length=1, examples=[["-300 mm", "300 mm"]])
    """where the nozzles of a row stand, from the middle of the face"""
    stand_off: Length = Field(examples=["210 mm"])
    """distance of the nozzles from the surface"""
    flow: ZoneFlow | None = Field(None, examples=["445 L/min"])
    """water of all its nozzles together, on the whole strand; over the casting speed, or the time
    by the clock of casting.start.time"""
    specific: SpecificWater | None = Field(None, examples=["0.12 L/kg"])
    """instead, per mass of steel that passes; it follows the casting speed"""
    share: WaterShare | None = Field(None, examples=[0.3])
    """instead, its share of [water]"""

    def nozzles(self) -> int:
        """Return how many nozzles share its flow, on the whole strand."""
        faces = sum(any(face.startswith(name) for name in self.on) for face in FACES)
        return faces * len(self.across) * (self.rolls[1] - self.rolls[0])

    @property
    def wide(self) -> bool:
        """Whether it sprays a wide face."""
        return any(map(is_wide, self.on))


class Secondary(TableModel):
    """Cooling from roll to roll, below [[cooling]]: contact, shade, spray, run-off water.

    All but contact radiates to the surroundings.
    """

    ambient: Temperature = Field(examples=["60 degC"])
    """temperature of rolls and surroundings that the strand radiates to"""
    emissivity: EmissivityOfTemperature | None = None
    """emissivity of the strand; by default the steel's"""
    water_temperature: WaterTemperature = written("25 degC")
    """temperature of the water"""
    contact: RollContact | None = None
    """contact with the rolls, on the wide faces; left out: none"""
    run_off: CoefficientOfTemperature | None = Field(None, examples=["150 W/(m^2 K)"])
    """coefficient of the water between a spray and the next roll, on the wide faces; left out:
    none"""
    falls_off: Angle | None = Field(None, examples=["60 deg"])
    """inclination to the vertical from which on water falls off the extrados rather than run on to
    the next roll; left out: it never does"""
    nozzle: tuple[NozzleModel, ...] = ()
    """models of nozzles"""
    circuit: tuple[Circuit, ...] = ()
    """circuits of water"""

    def model_of(self, circuit: Circuit) -> NozzleModel:
        """Return the model of a circuit's nozzles, in a sound case."""
        return next(model for model in self.nozzle if model.name == circuit.nozzle)

    def rows(self, rolls: Rolls, thickness: float) -> tuple[Row, ...]:
        """Return the rows of nozzles of a sound case, circuit by circuit."""
        from castfem.physics.machine.sprays import Row, footprint, gap_below

        found = []
        for circuit in self.circuit:
            half = 0.5 * footprint(circuit.stand_off, self.model_of(circuit).angle_along)
            for number in range(*circuit.rolls):
                middle = gap_below(rolls, number, thickness).middle
                found.append(Row(circuit.name, number, middle - half, middle + half))
        return tuple(found)

    def on_face(
        self,
        face: str,
        rolls: Rolls,
        rows: Sequence[Row],
        inclination: Callable[[float], float],
        end: float,
    ) -> tuple[tuple[Row, ...], tuple[Stretch, ...]]:
        """Return the rows that spray a face, and the stretches it meets from the meniscus on."""
        from castfem.physics.machine.sprays import stretches

        names = {circuit.name: circuit.on for circuit in self.circuit}
        mine = tuple(r for r in rows if any(face.startswith(n) for n in names[r.circuit]))
        wide = face.startswith(_WIDE)
        contacts = self.contacts(rolls) if wide else tuple((p.position,) * 2 for p in rolls.pairs)
        below = face.endswith("extrados") and self.falls_off is not None

        def gathers(above: int) -> bool:
            if not wide or self.run_off is None:
                return False
            lying = inclination(rolls.pairs[max(above - 1, 0)].position)
            return not below or self.falls_off is None or lying < self.falls_off

        return mine, stretches(contacts, mine, 0.0, end, gathers=gathers)

    def contacts(self, rolls: Rolls) -> tuple[tuple[float, float], ...]:
        """Return where a wide face touches each roll, m; a length of nothing for a lost one."""
        angle = 0.0 if self.contact is None else self.contact.angle
        halves = [0.0 if pair.lost else 0.25 * angle * pair.diameter for pair in rolls.pairs]
        return tuple(
            (pair.position - half, pair.position + half)
            for pair, half in zip(rolls.pairs, halves, strict=True)
        )
