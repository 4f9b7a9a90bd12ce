"""The tables [casting], [steel], [output] and [[reference]] of a case file."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, Field

from castfem.base import units
from castfem.base.constants import ROUNDING
from castfem.base.quantities import Kind, Length, Percent, Temperature, Time
from castfem.base.shown_units import ShownUnits, UnitsNotation
from castfem.base.table_notation import Curve
from castfem.base.tables import Table, Tabled
from castfem.model.base import TableModel
from castfem.model.probe import Probe
from castfem.physics.machine.travel import Changing, Steady, Travel
from castfem.physics.materials.phase_table import Request, Scheil

ThermalField = Literal["temperature", "solid_fraction"]
MechanicalField = Literal[
    "displacement", "stress", "von_mises", "strain", "viscoplastic_strain", "pressure"
]
ContactField = Literal["gap", "contact_pressure"]
ReferenceKind = Literal["value", "at_least", "at_most"]
"""How a reference is compared: as a value, or as a bound."""


def _goes(speed: float | Table) -> float | Table:
    if max(speed.values if isinstance(speed, Table) else (speed,)) > 0.0:
        return speed
    raise ValueError("must be above 0 m/min")


def _is_table(profile: float | Table) -> float | Table:
    """Refuse a single temperature, which belongs in casting.temperature."""
    if isinstance(profile, Table):
        return profile
    fix = "the one temperature of a slice is casting.temperature"
    raise ValueError(f"a table over depth is needed; {fix}")


SpeedOverTime = Annotated[
    Tabled, Curve(Kind("m/s", "m/min", least=0.0), "time"), AfterValidator(_goes)
]
FieldName = Literal[ThermalField, MechanicalField, ContactField]
"""Fields that can be written."""
THERMAL_FIELDS: tuple[FieldName, ...] = get_args(ThermalField)
MECHANICAL_FIELDS: tuple[FieldName, ...] = get_args(MechanicalField)
CONTACT_FIELDS: tuple[FieldName, ...] = get_args(ContactField)


TemperatureOverDepth = Annotated[
    Tabled, Curve(Kind("K", "degC"), "depth"), AfterValidator(_is_table)
]


Instant = Annotated[float, Kind("s", "s")]
SuperheatOverTime = Annotated[Tabled, Curve(Kind("K", "K", difference=True, least=0.0), "time")]


class Start(TableModel):
    """Start of a run: position, time and state."""

    at: Literal["meniscus", "mould_exit"] = "meniscus"
    """where the run, its history and its mechanics begin. With mould_exit the slice starts
    unstrained, in its cold shape, after a thermal run through the zones of the mould, or with the
    profile"""
    profile: TemperatureOverDepth | None = None
    """temperature at the start over the depth below the surface; left out: the poured steel, cooled
    by the mould"""
    meniscus: Length | None = Field(None, examples=["8 mm"])
    """height of the meniscus along which the steel has touched the wall before the slice is formed:
    it is cooled as over the same height below, undeformed and unstrained; left out: 0"""

    time: Instant | None = Field(None, examples=["120 s"])
    """when the slice leaves the meniscus, on the clock of the tables over time of casting.speed,
    casting.superheat and water; negative before these begin, where their first rows hold; left out:
    0 s"""


class Casting(TableModel):
    """How the strand is cast. Exactly one of `superheat` and `temperature` is given."""

    speed: SpeedOverTime = Field(examples=["3.6 m/min"])
    """casting speed, a number or a table over time; the slice leaves the meniscus at time 0, or at
    casting.start.time"""
    length: Length = Field(examples=["600 mm"])
    """followed length, from the meniscus"""
    superheat: SuperheatOverTime | None = None
    """temperature of the steel at the meniscus, above the liquidus; of a table over time the value
    at the start of the slice (casting.start.time)"""
    temperature: Temperature | None = Field(None, examples=["1540 degC"])
    """temperature of the steel at the meniscus"""
    start: Start | None = None
    """where and in which state the run begins; left out: liquid, at the meniscus"""

    @property
    def travel(self) -> Travel:
        """Position of the slice over time."""
        if isinstance(self.speed, Table):
            return Changing([t - self.clock for t in self.speed.arguments], self.speed.values)
        return Steady(self.speed)

    @property
    def clock(self) -> float:
        """Time at which the slice leaves the meniscus, by the clock of the tables over time, s."""
        return 0.0 if self.start is None or self.start.time is None else self.start.time

    @property
    def poured_superheat(self) -> float | None:
        """Superheat at the meniscus, K; None if the temperature is given."""
        table = self.superheat
        return float(table(self.clock)) if isinstance(table, Table) else table

    @property
    def duration(self) -> float:
        """Time from the meniscus to the end of the followed length, s; inf if never reached."""
        return self.travel.time_at(self.length)


class ScheilFreezing(TableModel):
    """Freezing without diffusion of alloying elements in the solid (Scheil)."""

    end: Annotated[float, Kind("1", above=0.0, most=0.5, label="fraction", sample="0.01")] = 0.01
    """mass fraction of liquid at which the path ends: the rest freezes at that temperature"""
    carbon_diffuses: bool = Field(True, strict=True)
    """whether carbon has one chemical potential in liquid and solid (back diffusion); otherwise it
    stays where it has frozen"""


class Steel(TableModel):
    """The steel: a property set, its composition, and changes for this case."""

    name: str
    """a set shipped with castfem, or a TOML file of your own, relative to this file; it removes an
    inherited composition unless it is computed from one"""
    composition: dict[str, Percent] = Field(default_factory=dict)
    """weight percent of the elements (C = 0.42), for sets computed from it; if the inherited set is
    not, plain_carbon replaces it"""
    overrides: dict[str, Any] = Field(default_factory=dict)
    """keys of the property set to change for this case, written as in its file"""
    diagram: Literal["assessed", "pascon", "segregated"] | None = None
    """how a steel with a composition freezes: assessed, in equilibrium by curves fitted to an
    assessed database; pascon, in equilibrium by the straight lines of the thesis; segregated, by
    microsegregation of C, Si, Mn, P and S [Won2001]; left out: the set's own choice, assessed
    unless its file has `diagram`"""
    database: str | None = Field(None, examples=["steel.tdb"])
    """thermodynamic database (.tdb, needs the extra calphad), relative to this file, that gives
    phases, freezing and heat instead of the diagram; or the table that an earlier run has kept,
    properties/steel/phases.csv"""
    phases: tuple[str, ...] | None = Field(
        None, examples=[["LIQUID", "BCC_A2", "FCC_A1", "CEMENTITE"]]
    )
    """phases of the database to include, by its names; by default liquid, ferrite, austenite,
    carbides and MnS"""
    scheil: ScheilFreezing | None = None
    """with a database: freezing by Scheil; left out: in equilibrium"""

    @property
    def changes(self) -> dict[str, Any]:
        """Changes to the set, written as in its file; a database as a `Request`."""
        changes = dict(self.overrides)
        if self.diagram is not None:
            changes["diagram"] = self.diagram
        if self.database is not None:
            path = None
            if self.scheil is not None:
                path = Scheil(self.scheil.end, self.scheil.carbon_diffuses)
            changes["database"] = Request(self.database, self.phases or (), path)
        return changes


def _whole_percent(fraction: float | None) -> float | None:
    """Refuse fractions without a name of two digits, and the solidus, which is always there."""
    if fraction is not None and abs(100.0 * fraction - round(100.0 * fraction)) > 1e-6:
        raise ValueError("whole per cents are needed, such as 0.7")
    if fraction is not None and not 0.005 < fraction < 0.995:
        raise ValueError("must lie between 0 and 1; at 0 it is liquidus_depth, at 1 the shell")
    return fraction


WholePercent = Annotated[
    float, Kind("1", label="solid fraction", sample="0.7"), AfterValidator(_whole_percent)
]


MOST_STATES = 250
"""Largest number of field outputs of a case that sets no interval: a film of ten seconds."""


def usual_interval(duration: float) -> float:
    """Return the output interval of the fields for a case that gives none, s."""
    shortest = 0.5  # s
    if not shortest * MOST_STATES < duration < math.inf:
        return shortest
    least = duration / MOST_STATES * (1.0 - ROUNDING)
    decade = 10.0 ** math.floor(math.log10(least))
    return next(every for n in (1, 2, 5, 10) if (every := n * decade) >= least)


class Output(TableModel):
    """Output of a run, and how often it is written."""

    fields: tuple[FieldName, ...] | None = Field(None, examples=[["temperature", "displacement"]])
    """fields written to fields.xdmf, [] for none; by default the thermal ones, with [mechanics]
    also displacement, stress, von_mises and viscoplastic_strain, with [mould] also gap and
    contact_pressure"""
    every: Time | None = Field(
        None,
        description="time between two states of the fields, which end a step: none is longer. "
        f"By default 0.5 s, and where that makes more than {MOST_STATES} states the first of 1, "
        "2, 5, 10 s ... that does not",
        examples=["2 s"],
    )
    by_clock: bool = Field(False, strict=True)
    """count `every` from 0 s on the clock of casting.start.time instead of from when the slice
    leaves the meniscus, so that all slices of a strand are written at the same instants"""
    figures: bool = Field(True, strict=True)
    """draw the figures at the end of the run"""
    checkpoint_every: int | None = Field(None, ge=0, strict=True, examples=[20])
    """steps between two checkpoints (for --resume); 0 for none; left out: 20 or more, so that at
    least a second of run time lies between two"""
    smooth: bool | None = Field(None, strict=True, examples=[True])
    """compute smooth approximations of the largest von Mises stress, von_mises_smooth at the end
    and way_von_mises_smooth along the way; `castfem optimise` does so if [optimise] names them"""
    units: Annotated[ShownUnits, UnitsNotation()] | None = Field(None, examples=["si"])
    """units of numbers in tables, figures and the report: plant (mm, degC, MPa, kN ...), si, or a
    table of units by physical quantity or by name of a result, with `system` for all others
    ([output.md](output.md#units)); files keep their documented units; left out: plant"""
    shell_at: tuple[WholePercent, ...] = Field((), examples=[[0.3, 0.7]])
    """solid fractions, in whole per cents, for which the shell thickness is written besides that of
    the solidus: 0.7 gives the columns fs70_mid_face, fs70_corner ..."""
    probe: tuple[Probe, ...] = ()

    @property
    def steps_to_checkpoint(self) -> int:
        """Smallest number of steps between two checkpoints; 0 for none."""
        return 20 if self.checkpoint_every is None else self.checkpoint_every


def _quantity(text: str) -> str:
    units.parse_any(text)
    return text


class Reference(TableModel):
    """A reference number, printed beside the computed one at the end of the run."""

    quantity: str
    """name of the computed quantity, as in summary.json"""
    value: Annotated[str, AfterValidator(_quantity)]
    """expected value with its unit, such as "4.75 mm" """
    kind: ReferenceKind = "value"
    """whether `value` is the expected value or a bound (the computed value is at least, or at most,
    this)"""
    source: str
    """where the number comes from"""
    at: Length | None = Field(None, examples=["600 mm"])
    """position where it holds, from the meniscus; by default the end of the run"""
    note: str = ""
    """remark printed with it"""
    changed: tuple[str, ...] | None = Field(None, examples=[["casting.speed"]])
    """keys changed after the reference was written, by a file that extends this one, `--set` or a
    script: written by castfem, which then gives no difference from the reference"""

    @property
    def si(self) -> float:
        """The expected value in SI."""
        return units.parse_any(self.value)[0]

    @property
    def si_unit(self) -> str:
        """The SI unit of `si`, "1" for a plain number."""
        return units.parse_any(self.value)[1]

    @property
    def unit(self) -> str:
        """The unit in which the value was given, empty for a plain number."""
        return units.split(self.value)[1]
