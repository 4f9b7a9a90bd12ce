"""The table [mould]: the rigid mould, its contact with the strand and its friction."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from castfem.base.quantities import Distance, Kind, Length, PositiveNumber, Speed, Temperature
from castfem.base.table_notation import Curve
from castfem.base.tables import Tabled
from castfem.model.base import Faults, OneWord, TableModel, Variants, written
from castfem.model.mechanics import Share
from castfem.model.taper import Perimeter, TaperMark
from castfem.model.wall_shape import WallShape
from castfem.physics.mould.displaced import WallDisplacement

if TYPE_CHECKING:
    from castfem.physics.contact.friction import Friction as FrictionLaw


FluxOfPosition = Annotated[Tabled, Curve(Kind("W/m^2", "MW/m^2", least=0.0), "position")]
CoefficientOfPosition = Annotated[
    Tabled, Curve(Kind("W/(m^2 K)", "W/(m^2 K)", above=0.0), "position")
]
TemperatureOfPosition = Annotated[Tabled, Curve(Kind("K", "degC"), "position")]
Cells = Annotated[float, Kind("1", least=1.0, most=64.0, label="number of cells", sample="2")]
CornerShare = Annotated[float, Kind("1", least=0.0, most=2.0, label="share", sample="0.6")]


class CopperThermocouples(TableModel):
    """A vertical row of thermocouples in the copper, for `castfem calibrate`."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,99}$")
    """name of the row; NAME.temperature is its column in a file of measurements"""
    depth: Distance = Field(examples=["5 mm"])
    """distance from the hot face"""
    way: Distance = written("0 mm")
    """position round the wall: length at the meniscus from the middle of the right-hand face"""


class MouldTube(TableModel):
    """The copper tube of the mould, for its thermal distortion; as long as the mould."""

    thickness: Length = Field(examples=["10 mm"])
    """wall thickness"""
    above: Distance = written("100 mm")
    """length above the meniscus"""
    support: Literal["free", "hung", "clamped", "between"] = "hung"
    """support of the tube. hung: the upper end is fixed along the mould; clamped: the upper end is
    fixed in all directions; between: both ends are fixed along the mould; free: not at all"""
    flux: FluxOfPosition | None = Field(None, examples=["2 MW/m^2"])
    """heat flux into the hot face below the meniscus; by default that of the strand, which is
    computed first"""
    corner_flux: CornerShare = 1.0
    """flux on the arcs of the corners over that at mid-face, for a given flux"""
    corner_reach: Length = written("20 mm")
    """length of face over which the flux falls to that of the corner"""
    water_coefficient: CoefficientOfPosition = written("30000 W/(m^2 K)")
    """heat transfer coefficient of the cooling water"""
    water_temperature: TemperatureOfPosition = written("40 degC")
    """temperature of the cooling water"""
    hot_face: TemperatureOfPosition | None = None
    """temperature of the face towards the strand, below the meniscus, instead of flux"""
    water_side: TemperatureOfPosition | None = None
    """temperature of the water side, instead of the water"""
    cells_across: Cells = 2.0
    """number of cells through the wall"""
    cell_size: Length = written("12 mm")
    """largest cell size round the wall and along it; a third of it at the meniscus"""
    solver: Literal["auto", "direct", "multigrid"] = "auto"
    """linear solver; auto: direct for small systems"""
    thermocouple: list[CopperThermocouples] = Field(default_factory=list)
    """thermocouples in the copper; if given, a run writes wall_flux.csv"""

    @property
    def heated_by_strand(self) -> bool:
        """Whether the tube is heated by the strand, not by given values."""
        return self.flux is None and self.hot_face is None


ConductivityOfTemperature = Annotated[
    Tabled, Curve(Kind("W/(m K)", "W/(m K)", above=0.0), "temperature")
]
ExpansionOfTemperature = Annotated[Tabled, Curve(Kind("1/K", "1/K", above=0.0), "temperature")]
ModulusOfTemperature = Annotated[
    Tabled,
    Curve(Kind("Pa", "GPa", above=0.0, label="Young's modulus", sample="117 GPa"), "temperature"),
]
PoissonOfTemperature = Annotated[
    Tabled,
    Curve(Kind("1", least=0.0, most=0.49, label="Poisson's ratio", sample="0.34"), "temperature"),
]
ExpansionCoefficient = Annotated[float, Kind("1/K", "1/K", above=0.0)]
Stress = Annotated[float, Kind("Pa", "MPa", above=0.0, label="stress", sample="10 MPa")]
FrictionCoefficient = Annotated[
    float, Kind("1", least=0.0, label="friction coefficient", sample="0.3")
]
Frequency = Annotated[float, Kind("1/s", "1/min", above=0.0, label="frequency", sample="150 1/min")]
Exponent = Annotated[float, Kind("1", above=0.0, most=1.0, label="exponent", sample="0.5")]
EXAMPLES = {
    "contact": '{ method = "nitsche", factor = 100 }',
    "friction": '{ law = "coulomb", coefficient = 0.3 }',
}
"""Tables of [mould] that one word may replace."""


class ContactSettings(TableModel):
    """How contact with the wall is enforced: penalty (eq. 239) or Nitsche's method."""

    method: Literal["penalty", "nitsche"] = "penalty"
    """method; `contact = "nitsche"` in [mould] says the same in one line"""
    factor: PositiveNumber | None = Field(None, examples=[1000])
    """stiffness of the contact over that of the cell behind it; by default 10"""


class Friction(Variants):
    """Base of the friction laws; a new one is a subclass with its own `law` and `build`."""

    tag_key = "law"
    kinds: ClassVar[dict[str, Any]] = {}

    def build(self) -> FrictionLaw | None:
        """Return the law as the contact solver needs it, None for a wall without friction."""
        return None

    def problems(self) -> Faults:
        """Report inconsistent values: key and fault."""
        yield from ()


class NoFriction(Friction):
    """The strand slides freely."""

    law: Literal["none"]


class Coulomb(Friction):
    """Coulomb: the friction stress is at most the coefficient times the pressure (eq. 231)."""

    law: Literal["coulomb"]
    coefficient: FrictionCoefficient
    """friction stress over pressure"""

    def build(self) -> FrictionLaw:
        """See `Friction.build`."""
        from castfem.physics.contact import friction

        return friction.Coulomb(self.coefficient)


class Limited(Friction):
    """Coulomb, limited by the yielding of the surface under pressure and friction (eq. 233)."""

    law: Literal["limited"]
    coefficient: FrictionCoefficient
    """friction stress over pressure"""
    yield_stress: Stress
    """yield stress p0 of the weaker material, sqrt(p^2 + 3 tau^2) <= p0"""

    def build(self) -> FrictionLaw:
        """See `Friction.build`."""
        from castfem.physics.contact import friction

        return friction.Coulomb(self.coefficient, yield_stress=self.yield_stress)


class Tresca(Friction):
    """Tresca: the friction stress is at most a fraction of the yield stress (eq. 234, 235)."""

    law: Literal["tresca"]
    share: Share
    """share m in m p0 / sqrt(3)"""
    yield_stress: Stress
    """yield stress p0 of the weaker material"""
    steepest: PositiveNumber = 1.0
    """largest friction stress over pressure"""

    def build(self) -> FrictionLaw:
        """See `Friction.build`."""
        from castfem.physics.contact import friction

        return friction.Tresca(self.share, self.yield_stress, self.steepest)


class Viscous(Friction):
    """Friction as a power of the sliding speed, above a threshold (eq. 236, 237)."""

    law: Literal["viscous"]
    stress: Stress = Field(examples=["20 kPa"])
    """friction stress at the reference speed"""
    speed: Speed = Field(examples=["3.6 m/min"])
    """reference sliding speed"""
    exponent: Exponent = 1.0
    """exponent n of the speed"""
    coefficient: FrictionCoefficient = 0.0
    """friction stress over pressure below which the strand sticks; 0 for a lubricant"""
    yield_stress: Stress | None = None
    """yield stress p0: above the threshold the stress is at most p0 / sqrt(3); required with a
    threshold"""
    steepest: PositiveNumber = 1.0
    """largest friction stress over pressure above the threshold"""

    def build(self) -> FrictionLaw:
        """See `Friction.build`; without a yield stress there is no limit from one."""
        from castfem.physics.contact import friction

        speed, exponent, steepest = self.speed, self.exponent, self.steepest
        if self.yield_stress is None:
            return friction.Lubricant(self.stress / speed**exponent, exponent, steepest)
        share = math.sqrt(3.0) * self.stress / self.yield_stress
        base = friction.Coulomb(self.coefficient)
        return friction.Viscous(base, share, self.yield_stress, speed, exponent, steepest)

    def problems(self) -> Faults:
        """See `Friction.problems`."""
        if self.yield_stress is None:
            if self.coefficient:
                yield "", 'a threshold needs the limit of what is above it: yield_stress = "10 MPa"'
            return
        most = self.yield_stress / math.sqrt(3.0)
        if self.stress > most:
            yield (
                "stress",
                f"({1e-6 * self.stress:.4g} MPa) is above yield_stress / sqrt(3), "
                f"{1e-6 * most:.4g} MPa, its limit at any speed; lower it, or raise yield_stress",
            )


class Copper(TableModel):
    """Thermal expansion of the mould, for sizes given for the cold mould."""

    expansion: ExpansionCoefficient = Field(written("17e-6 1/K"), examples=["17e-6 1/K"])
    """mean expansion coefficient"""
    cold: Temperature = Field(written("25 degC"), examples=["25 degC"])
    """temperature at which the sizes hold"""
    temperature: TemperatureOfPosition | None = Field(None, examples=["120 degC"])
    """wall temperature averaged over the thickness; by default wall_temperature"""
    conductivity: ConductivityOfTemperature | None = None
    """conductivity for [mould.tube]; by default that of [Calcutt2001], 394 to 377 W/(m K)"""
    mean_expansion: ExpansionOfTemperature | None = None
    """mean expansion coefficient from 20 degC over temperature, for [mould.tube]; by default that
    of [Calcutt2001], 16.8e-6 to 17.7e-6 1/K"""
    youngs_modulus: ModulusOfTemperature | None = None
    """Young's modulus, for [mould.tube]; by default 117 GPa at 20 degC, 106 GPa at 300 degC"""
    poisson: PoissonOfTemperature | None = None
    """Poisson's ratio, for [mould.tube]; by default 0.34"""


class Oscillation(TableModel):
    """Sinusoidal oscillation of the mould; only its own numbers are computed from it."""

    stroke: Length = Field(examples=["6 mm"])
    """distance from the highest to the lowest point"""
    frequency: Frequency = Field(examples=["150 1/min"])
    """strokes per unit of time"""

    def negative_strip(self, speed: float) -> float:
        """Time of each stroke in which the mould moves down faster than the strand (m/s), s."""
        fastest = math.pi * self.frequency * self.stroke
        if not speed < fastest:
            return 0.0
        return math.acos(speed / fastest) / (math.pi * self.frequency)


class Mould(TableModel):
    """The rigid mould around the slice; left out: an idealised mould that follows the strand."""

    length: Length = Field(examples=["600 mm"])
    """from the meniscus to the end of the mould"""
    taper: Annotated[Perimeter, TaperMark()] = Field(written("0 %/m"), examples=["1 %/m"])
    """relative change of the section's sizes per metre (eq. 300); positive if the mould narrows
    downwards"""
    width: Length | None = None
    """width of the cavity at the meniscus; by default that of the strand"""
    height: Length | None = None
    """height of the cavity (y), likewise"""
    diameter: Length | None = None
    """diameter of the cavity of a round, likewise"""
    corner_radius: Distance | None = None
    """corner radius of the cavity at the meniscus; by default that of the strand"""
    wall_temperature: TemperatureOfPosition | None = Field(None, examples=["160 degC"])
    """temperature of the face towards the strand, constant or along the mould"""
    condition: Literal["working", "cold"] = "working"
    """condition in which sizes and taper hold: working (hot) or cold; a cold mould is expanded by
    [mould.copper]"""
    copper: Copper = Field(default_factory=lambda: Copper.model_validate({}))
    """thermal expansion of a mould whose cold sizes are given"""
    displacement: Annotated[WallDisplacement, WallShape()] | None = None
    """displacement of the working wall from the cavity of sizes and taper, all round and along,
    instead of the expansion of [mould.copper]; written by `castfem mould --hot` and `castfem
    section`"""
    tube: MouldTube | None = None
    """the copper tube, for `castfem mould --hot`; other commands ignore it"""
    oscillation: Oscillation | None = None
    """oscillation of the mould"""
    contact: Annotated[
        ContactSettings, OneWord("method", ("penalty", "nitsche"), EXAMPLES["contact"])
    ] = Field(default_factory=lambda: ContactSettings.model_validate({}))
    """contact method"""
    friction: Annotated[Friction, OneWord("law", ("none",), EXAMPLES["friction"])] = Field(
        default_factory=lambda: NoFriction(law="none")
    )
    """friction law"""
