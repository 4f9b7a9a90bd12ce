"""The table [secondary]: cooling below the mould, from roll to roll.

The modules that build its geometry and laws (`castfem.physics.machine.spray_layout`,
`castfem.physics.thermal.spray_flux`) are only imported by cases that have the table.
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
from castfem.physics.thermal.spray_correlations import CORRELATIONS

if TYPE_CHECKING:
    from castfem.physics.machine.rolls import Rolls
    from castfem.physics.machine.spray_layout import Row, Stretch
    from castfem.physics.thermal.spray_flux import Coefficient, CoefficientTable


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
        from castfem.physics.thermal.spray_flux import CoefficientTable

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
    """Return the table from rows of temperature and flow in any order."""
    from castfem.physics.thermal.spray_flux import CoefficientTable

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
    """Whether a name of boundary groups includes a wide face."""
    return name.startswith(_WIDE) or _WIDE.startswith(name)


class RollContact(TableModel):
    """Contact with the rolls; one of `share` and `coefficient`."""

    angle: Angle = Field(examples=["10 deg"])
    """angle of a roll's circumference that touches the strand; its arc is the length of contact"""
    share: Share | None = None
    """share of the heat of a pitch that the roll takes, 0.01 to 0.22 [Meng2003]"""
    coefficient: HeatTransferCoefficient | None = None
    """heat transfer coefficient of contact"""
    temperature: Temperature | None = Field(None, examples=["150 degC"])
    """temperature of the rolls, with coefficient"""


class NozzleModel(TableModel):
    """A type of nozzle; one of `table` and `correlation`."""

    name: str = Field(min_length=1)
    """name of the model"""
    angle: Angle = Field(examples=["110 deg"])
    """spray angle across the strand"""
    angle_along: Angle = Field(examples=["14 deg"])
    """spray angle along the strand"""
    edge: Edge = 0.0
    """fraction of the half width at each end over which the water falls to zero; 0: uniform, 1: a
    triangle"""
    table: Annotated[Any, NozzleTable()] = None
    """measured coefficients of the water alone over surface temperature and water flow, starting at
    no water"""
    correlation: Annotated[str, NameOf(CORRELATIONS)] | None = None
    """correlation for the heat transfer coefficient; below its smallest flow it falls to zero"""
    machine_factor: PositiveNumber = Field(1.0, examples=[4])
    """divides the coefficient, to fit it to the machine"""

    def coefficient(self, water_temperature: float) -> Coefficient:
        """Return the coefficient h(water, surface temperature)."""
        from castfem.physics.thermal.spray_flux import OfCorrelation

        if self.correlation is None:
            found: Coefficient = self.table
            return found
        return OfCorrelation(CORRELATIONS[self.correlation], water_temperature, self.machine_factor)

    def most_water(self) -> float:
        """Return the largest flow per area for which h is known, kg/(m2 s)."""
        if self.correlation is None:
            return float(self.table.most)
        return CORRELATIONS[self.correlation].water[1]


class Circuit(TableModel):
    """Nozzles of one model fed by one valve: a row in each gap between some rolls."""

    name: str = Field(min_length=1)
    """name of the circuit"""
    on: tuple[str, ...] = Field(min_length=1)
    """faces it sprays; a name also matches all groups that begin with it"""
    rolls: tuple[int, int] = Field(examples=[[8, 15]])
    """numbers of the rolls above the first and below the last row"""
    nozzle: str
    """name of their [[secondary.nozzle]]"""
    across: tuple[Place, ...] = Field(min_length=1, examples=[["-300 mm", "300 mm"]])
    """positions of the nozzles of a row, from the middle of the face"""
    stand_off: Length = Field(examples=["210 mm"])
    """distance of the nozzles from the surface"""
    flow: ZoneFlow | None = Field(None, examples=["445 L/min"])
    """total flow of its nozzles on the whole strand; a number, or a table over the casting speed or
    over time by the clock of casting.start.time"""
    specific: SpecificWater | None = Field(None, examples=["0.12 L/kg"])
    """water per mass of passing steel, instead of flow; its flow follows the casting speed"""
    share: WaterShare | None = Field(None, examples=[0.3])
    """its share of [water], instead of flow"""

    def nozzles(self) -> int:
        """Return the number of its nozzles on the whole strand."""
        faces = sum(any(face.startswith(name) for name in self.on) for face in FACES)
        return faces * len(self.across) * (self.rolls[1] - self.rolls[0])

    @property
    def wide(self) -> bool:
        """Whether it sprays a wide face."""
        return any(map(is_wide, self.on))


class Secondary(TableModel):
    """Cooling from roll to roll below [[cooling]]: contact, spray, run-off water, radiation.

    The strand radiates to the surroundings everywhere except at the contacts.
    """

    ambient: Temperature = Field(examples=["60 degC"])
    """temperature of the rolls and surroundings for radiation"""
    emissivity: EmissivityOfTemperature | None = None
    """emissivity of the strand; by default that of the steel"""
    water_temperature: WaterTemperature = written("25 degC")
    """temperature of the water"""
    contact: RollContact | None = None
    """contact with the rolls, on the wide faces; left out: none"""
    run_off: CoefficientOfTemperature | None = Field(None, examples=["150 W/(m^2 K)"])
    """heat transfer coefficient of the water between a spray and the next roll, on the wide faces;
    left out: none"""
    falls_off: Angle | None = Field(None, examples=["60 deg"])
    """inclination to the vertical above which water falls off the extrados instead of running on to
    the next roll; left out: it never falls off"""
    nozzle: tuple[NozzleModel, ...] = ()
    """types of nozzles"""
    circuit: tuple[Circuit, ...] = ()
    """water circuits"""

    def model_of(self, circuit: Circuit) -> NozzleModel:
        """Return the model of a circuit's nozzles, in a sound case."""
        return next(model for model in self.nozzle if model.name == circuit.nozzle)

    def rows(self, rolls: Rolls, thickness: float) -> tuple[Row, ...]:
        """Return the rows of nozzles of a sound case, circuit by circuit."""
        from castfem.physics.machine.spray_layout import Row, footprint, gap_below

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
        """Return the rows that spray a face, and its stretches from the meniscus on."""
        from castfem.physics.machine.spray_layout import stretches

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
        """Return where a wide face touches each roll, m; zero length for a missing roll."""
        angle = 0.0 if self.contact is None else self.contact.angle
        halves = [0.0 if pair.lost else 0.25 * angle * pair.diameter for pair in rolls.pairs]
        return tuple(
            (pair.position - half, pair.position + half)
            for pair, half in zip(rolls.pairs, halves, strict=True)
        )
