"""The tables [casting], [steel], [output] and [[reference]] of a case file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import AfterValidator, Field

from castfem.base import result_registry, units
from castfem.base.constants import ROUNDING
from castfem.base.quantities import Kind, Length, Percent, Temperature, Time
from castfem.base.shown_units import ShownUnits, UnitsNotation
from castfem.base.table_notation import Curve
from castfem.base.tables import Table, Tabled
from castfem.base.units import in_mm
from castfem.model.base import TableModel
from castfem.model.checks import Faults, check, check_test, one_of
from castfem.model.probe import Probe
from castfem.physics.machine.travel import Changing, Steady, Travel
from castfem.physics.materials.phase_table import Request, Scheil

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.model.tensile import TensileCase

ThermalField = Literal["temperature", "solid_fraction"]
MechanicalField = Literal[
    "displacement", "stress", "von_mises", "strain", "viscoplastic_strain", "pressure"
]
ContactField = Literal["gap", "contact_pressure"]
ReferenceKind = Literal["value", "at_least", "at_most"]
"""What is known of a quantity: its value, or a bound."""


def _goes(speed: float | Table) -> float | Table:
    if max(speed.values if isinstance(speed, Table) else (speed,)) > 0.0:
        return speed
    raise ValueError("must be above 0 m/min")


def _is_table(profile: float | Table) -> float | Table:
    """Refuse one temperature, which is casting.temperature."""
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
    """Where, when and with what a run begins."""

    at: Literal["meniscus", "mould_exit"] = "meniscus"
    """where the run, its history and its mechanics begin: at mould_exit, unstrained and in its
    shape as cold, after a run of the temperature alone through the zones of the mould, or with the
    profile"""
    profile: TemperatureOverDepth | None = None
    """temperature there over the depth below the surface; left out: the steel as poured, cooled by
    the mould"""
    meniscus: Length | None = Field(None, examples=["8 mm"])
    """height of the meniscus over which the steel has met the wall already where the slice is
    formed: it is cooled as over the same height below, in its shape and unstrained; left out: not
    at all"""

    time: Instant | None = Field(None, examples=["120 s"])
    """when the slice leaves the meniscus, on the clock by which the tables over time of
    casting.speed, casting.superheat and of water go; below 0 before they begin, when their first
    rows hold; left out: at 0 s"""


class Casting(TableModel):
    """How the strand is cast. Exactly one of `superheat` and `temperature` is given."""

    speed: SpeedOverTime = Field(examples=["3.6 m/min"])
    """casting speed, or over time; the slice leaves the meniscus at time 0, or at
    casting.start.time"""
    length: Length = Field(examples=["600 mm"])
    """length that is followed, from the meniscus"""
    superheat: SuperheatOverTime | None = None
    """temperature of the steel at the meniscus, above the liquidus; over time a slice has that of
    its own start, casting.start.time"""
    temperature: Temperature | None = Field(None, examples=["1540 degC"])
    """temperature of the steel at the meniscus"""
    start: Start | None = None
    """where and with what it begins; left out: liquid, at the meniscus"""

    @property
    def travel(self) -> Travel:
        """The way of the slice over time."""
        if isinstance(self.speed, Table):
            return Changing([t - self.clock for t in self.speed.arguments], self.speed.values)
        return Steady(self.speed)

    @property
    def clock(self) -> float:
        """When the slice leaves the meniscus, on the clock of the tables over time, s."""
        return 0.0 if self.start is None or self.start.time is None else self.start.time

    @property
    def poured_superheat(self) -> float | None:
        """Superheat that the slice has at the meniscus, K; None where its temperature is given."""
        table = self.superheat
        return float(table(self.clock)) if isinstance(table, Table) else table

    @property
    def duration(self) -> float:
        """Time from the meniscus to the end of the followed length, s; inf if it is not reached."""
        return self.travel.time_at(self.length)


class ScheilFreezing(TableModel):
    """Freezing without diffusion in the solid, which is equilibrated at its mean composition."""

    end: Annotated[float, Kind("1", above=0.0, most=0.5, label="fraction", sample="0.01")] = 0.01
    """mass fraction of liquid at which the path ends: the rest freezes at that temperature"""
    carbon_diffuses: bool = Field(True, strict=True)
    """keep carbon at one chemical potential in liquid and solid (back diffusion), or let it stay
    where it has frozen"""


class Steel(TableModel):
    """The steel that is cast: a property set, its composition and changes for this case."""

    name: str
    """a set shipped with castfem, or a TOML file of your own, relative to this file; it does away
    with an inherited composition, unless it is to be computed from it"""
    composition: dict[str, Percent] = Field(default_factory=dict)
    """weight percent of the elements (C = 0.42), for sets computed from it; of an inherited set
    that is not, it makes plain_carbon"""
    overrides: dict[str, Any] = Field(default_factory=dict)
    """keys of the property set to change for this case, written as in its file"""
    diagram: Literal["assessed", "pascon", "segregated"] | None = None
    """how a steel with a composition freezes: by curves fitted to an assessed database, or by the
    straight lines of the thesis, in equilibrium; or segregated, by microsegregation of C, Si, Mn, P
    and S [Won2001]; by default as the set, which is assessed unless its file has `diagram`"""
    database: str | None = Field(None, examples=["steel.tdb"])
    """thermodynamic database (.tdb, with the extra calphad), relative to this file, by which
    phases, freezing and heat go instead of the diagram; or the table that an earlier run has kept,
    properties/steel/phases.csv"""
    phases: tuple[str, ...] | None = Field(
        None, examples=[["LIQUID", "BCC_A2", "FCC_A1", "CEMENTITE"]]
    )
    """phases of the database that are counted with, by its names; by default liquid, ferrite,
    austenite, carbides and MnS"""
    scheil: ScheilFreezing | None = None
    """with a database: freeze by Scheil; left out: in equilibrium"""

    @property
    def changes(self) -> dict[str, Any]:
        """What is changed of the set, written as in its file; a database as a `Request`."""
        changes = dict(self.overrides)
        if self.diagram is not None:
            changes["diagram"] = self.diagram
        if self.database is not None:
            path = None
            if self.scheil is not None:
                path = Scheil(self.scheil.end, self.scheil.carbon_diffuses)
            changes["database"] = Request(self.database, self.phases or (), path)
        return changes


@check("steel")
def _with_database(_: Any, steel: Steel) -> Faults:
    """Yield keys that ask something of a database where there is none."""
    for key in ("phases", "scheil"):
        if getattr(steel, key) and steel.database is None:
            yield key, 'is of a thermodynamic database; give one, database = "steel.tdb"'


def _whole_percent(fraction: float | None) -> float | None:
    """Refuse what has no name of two digits, and the solidus, whose shell is there anyway."""
    if fraction is not None and abs(100.0 * fraction - round(100.0 * fraction)) > 1e-6:
        raise ValueError("whole per cents are needed, such as 0.7")
    if fraction is not None and not 0.005 < fraction < 0.995:
        raise ValueError("must lie between 0 and 1; at 0 it is liquidus_depth, at 1 the shell")
    return fraction


WholePercent = Annotated[
    float, Kind("1", label="solid fraction", sample="0.7"), AfterValidator(_whole_percent)
]


MOST_STATES = 250
"""States of the fields, at most, of a case that does not say how often: a film of ten seconds."""


def usual_interval(duration: float) -> float:
    """Return the time between two states of the fields of a case that gives none, s."""
    shortest = 0.5  # s
    if not shortest * MOST_STATES < duration < math.inf:
        return shortest
    least = duration / MOST_STATES * (1.0 - ROUNDING)
    decade = 10.0 ** math.floor(math.log10(least))
    return next(every for n in (1, 2, 5, 10) if (every := n * decade) >= least)


class Output(TableModel):
    """What a run writes, and how often."""

    fields: tuple[FieldName, ...] | None = Field(None, examples=[["temperature", "displacement"]])
    """fields in fields.xdmf, [] for none; by default those of the temperature, with [mechanics]
    displacement, stress, von_mises and viscoplastic_strain, with [mould] gap and
    contact_pressure"""
    every: Time | None = Field(
        None,
        description="time between two states of the fields, which end a step: none is longer. "
        f"By default 0.5 s, and where that makes more than {MOST_STATES} states the first of 1, "
        "2, 5, 10 s ... that does not",
        examples=["2 s"],
    )
    by_clock: bool = Field(False, strict=True)
    """count `every` from 0 s by the clock of casting.start.time, rather than from when the slice
    leaves the meniscus: slices of one strand are then written at the same instants"""
    figures: bool = Field(True, strict=True)
    """draw the figures at the end of the run"""
    checkpoint_every: int | None = Field(None, ge=0, strict=True, examples=[20])
    """steps between two checkpoints (for --resume); 0 for none; left out: 20 or more, so that a
    second or more by the wall clock lies between two"""
    smooth: bool | None = Field(None, strict=True, examples=[True])
    """compute smooth twins of the largest von Mises stress, von_mises_smooth at the end and
    way_von_mises_smooth on the way; `castfem optimise` does where it is named there"""
    units: Annotated[ShownUnits, UnitsNotation()] | None = Field(None, examples=["si"])
    """in which units tables, figures and the report show numbers: plant (mm, degC, MPa, kN ...),
    si, or a table of units by what is measured or by the name of a quantity, with system for all
    others ([output.md](output.md#units)); files keep their documented units; left out: plant"""
    shell_at: tuple[WholePercent, ...] = Field((), examples=[[0.3, 0.7]])
    """solid fractions, whole per cents, to which the shell is told besides that of the solidus: 0.7
    gives the columns fs70_mid_face, fs70_corner ..."""
    probe: tuple[Probe, ...] = ()

    @property
    def steps_to_checkpoint(self) -> int:
        """Steps between two checkpoints, at least; 0 for none."""
        return 20 if self.checkpoint_every is None else self.checkpoint_every


def _quantity(text: str) -> str:
    units.parse_any(text)
    return text


class Reference(TableModel):
    """A number to compare with, printed beside the computed one where the run ends."""

    quantity: str
    """name of the computed quantity, as in summary.json"""
    value: Annotated[str, AfterValidator(_quantity)]
    """expected value with its unit, such as "4.75 mm" """
    kind: ReferenceKind = "value"
    """`value` is what is expected, or a bound: the computed one is at least, or at most, this"""
    source: str
    """where the number comes from"""
    at: Length | None = Field(None, examples=["600 mm"])
    """position where it holds, from the meniscus; by default the end of the run"""
    note: str = ""
    """remark printed with it"""
    changed: tuple[str, ...] | None = Field(None, examples=[["casting.speed"]])
    """keys that were changed since, by a file that extends this one, `--set` or a script: castfem
    writes them, and takes no difference from a number of the unchanged case"""

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


@check("casting")
def _temperature(case: Case, casting: Casting) -> Faults:
    yield from one_of(casting, {"superheat": '"40 K"', "temperature": '"1540 degC"'})


@check("casting")
def _stands(case: Case, casting: Casting) -> Faults:
    """Yield a strand that stands for good before it has come to the end."""
    table = casting.speed
    if not isinstance(table, Table) or math.isfinite(casting.duration):
        return
    last = table.arguments[-1]
    yield (
        "speed",
        f"the strand stands for good after {last:g} s, {casting.travel.position(last):.6g} m below "
        f"the meniscus: it never comes to casting.length ({casting.length:g} m); let the last row "
        "of the table be above 0 m/min, or shorten the length",
    )


@check("casting.start")
def _start(case: Case, start: Start) -> Faults:
    """Yield what a start below the mould, or from a profile, does not go with."""
    if case.verification is not None:
        yield "", "a closed form begins at the meniscus, at one temperature; leave it out"
    if start.at != "mould_exit":
        return
    if case.mould is not None:
        yield "at", '("mould_exit") begins below the mould; leave it or [mould] out'
        return
    ends, length = case.mould_exit(), case.casting.length
    if ends is None:
        yield "at", '("mould_exit"): there is no mould; name a zone of [[cooling]] so, with its end'
    elif not ends < length:
        text = f"{in_mm(ends)}, does not lie above casting.length ({in_mm(length)})"
        yield "at", f'("mould_exit"), {text}'


@check("casting.start")
def _meniscus(case: Case, start: Start) -> Faults:
    """Yield what a meniscus that has met the wall does not go with."""
    height = start.meniscus
    if height is None:
        return
    if start.profile is not None or start.at == "mould_exit":
        other = "profile" if start.profile is not None else 'at = "mould_exit"'
        yield "meniscus", f"and {other} both say what the run begins with; leave one of them out"
        return
    ends = case.cooling[0].to
    if ends is not None and not height < ends:
        most = f"the first zone of the cooling, which ends at {in_mm(ends)}"
        yield "meniscus", f"({in_mm(height)}) is not within {most}; it is about 10 mm high"


@check("output")
def _fields(case: Case, output: Output) -> Faults:
    names = output.fields or ()
    for index, name in enumerate(names):
        if name in names[:index]:
            yield "fields", f"'{name}' appears twice"
        if name in MECHANICAL_FIELDS and case.mechanics is None:
            yield "fields", f"'{name}' needs the table [mechanics], which is missing"
        if name in CONTACT_FIELDS and case.mould is None:
            yield "fields", f"'{name}' needs the table [mould], which is missing"
    if len({round(100.0 * fraction) for fraction in output.shell_at}) < len(output.shell_at):
        yield "shell_at", "has a solid fraction twice"


@check("reference.*")
def _compared(case: Case, reference: Reference) -> Faults:
    """Yield references that no run could ever be compared with."""
    if fault := result_registry.fault(reference.quantity, reference.value):
        yield fault


@check_test("reference.*")
def _without_position(case: TensileCase, reference: Reference) -> Faults:
    if reference.at is not None:
        fix = "the quantities stress_1, stress_2 ... hold at the ends of its segments"
        yield "at", f"a tensile test has no position; {fix}"
