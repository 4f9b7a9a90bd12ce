"""The tables [mechanics], with its bulging, and [coupling]: the mechanical problem and heat.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import Field

from castfem.base.constants import ZERO_STRENGTH
from castfem.base.errors import choices
from castfem.base.quantities import Kind, Notation, OrWord, PositiveDifference, Time
from castfem.base.table_notation import Curve
from castfem.base.tables import Tabled
from castfem.base.types import MushyZone
from castfem.base.units import parse_any
from castfem.model.base import OneWord, TableModel, written
from castfem.model.thermal import PetscOption

FREE = "free"
_TIME, _LENGTH = Kind("s", "s", above=0.0), Kind("m", "mm", above=0.0)
_DISTANCE = Kind("m", "mm")

Share = Annotated[float, Kind("1", least=0.0, most=1.0, label="share", sample="1")]
Ratio = Annotated[float, Kind("1", above=0.0, most=1.0, label="ratio", sample="1e-5")]
Solid = Annotated[float, Kind("1", least=0.0, most=0.99, label="solid fraction", sample="0.5")]
Growth = Annotated[float, Kind("1", least=1.0, most=100.0, label="growth", sample="8")]
Tolerance = Annotated[float, Kind("1", above=0.0, most=0.1, label="tolerance", sample="1e-8")]
Force = Annotated[
    Tabled, Curve(Kind("N", "kN", label="force", sample="10 kN"), "time", ("position",))
]
MomentOfTime = Annotated[
    Tabled, Curve(Kind("N m", "kN m", label="moment", sample="1 kN m"), "time")
]
DisplacementOfTime = Annotated[
    Tabled, Curve(Kind("m", "mm", label="displacement", sample="0.1 mm"), "time")
]


AxialStrain = Annotated[
    str | Tabled, OrWord(Curve(Kind("1", label="strain", sample="0.001"), "time"), (FREE,))
]
Gradient = Annotated[
    str | Tabled,
    OrWord(Curve(Kind("1/m", "1/m", label="gradient", sample="0.1 1/m"), "time"), (FREE,)),
]


AXES = {"intrados": 0.5, "centre": 0.0, "extrados": -0.5}
"""Positions of a neutral axis by name: from the middle towards the intrados, over the thickness."""
MOULD_EXIT = "mould_exit"
"""Name of the place where mechanics may end."""
BENT = ("bending", "straightening")
"""Regions of the machine for which a neutral axis may be imposed separately."""


@dataclass(frozen=True, slots=True)
class AxisMark(Notation):
    """Annotation of a field that takes the position of a neutral axis."""

    takes: str = (
        '`"free"`, `"intrados"`, `"centre"`, `"extrados"`, or distance from the middle towards '
        'the intrados: `"20 mm"`; or one of them in `{ bending, straightening }` each'
    )

    def read(self, given: object) -> Any:
        """Return a word, a distance in m, or both values of a table; raise ValueError otherwise."""
        if isinstance(given, Mapping):
            if set(given) != set(BENT):
                raise ValueError(
                    f"a table has the keys {' and '.join(BENT)}, where the axis lies while the "
                    "strand is bent and while it is straightened"
                )
            found = {name: self.read(given[name]) for name in BENT}
            if any(place is None or place == FREE for place in found.values()):
                raise ValueError(
                    f'"{FREE}" must hold for bending and straightening, or for neither'
                )
            return found
        if given is None or given == FREE or (isinstance(given, str) and given in AXES):
            return given
        try:
            return _DISTANCE.read(given)
        except ValueError as error:
            raise ValueError(f'{error}; or "{FREE}", {choices(AXES)}') from None

    def write(self, value: Any) -> Any:
        """Return what reads back to the same position."""
        if isinstance(value, Mapping):
            return {name: self.write(place) for name, place in value.items()}
        return _DISTANCE.write(value) if isinstance(value, float) else value

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        place = {"anyOf": [{"enum": list(AXES)}, _DISTANCE.json_schema()]}
        both = {
            "type": "object",
            "properties": {name: place for name in BENT},
            "required": list(BENT),
            "additionalProperties": False,
        }
        return {"anyOf": [{"enum": [FREE, *AXES]}, _DISTANCE.json_schema(), both]}


class GeneralizedPlaneStrain(TableModel):
    """Degrees of freedom of the two planes that bound the slice: e = 1 + a0 + a1 x + a2 y (37).

    Each is free, or imposed as a value or a table over time; those excluded by the symmetry of the
    section stay zero. Where the rolls of [machine] bend the strand they prescribe a2 as a function
    of a0, (41).
    """

    a0: AxialStrain = Field("free", examples=["free", 0.0])
    """axial strain: "free" or imposed"""
    a1: Gradient | None = None
    """gradient of the axial strain along x; free unless symmetry excludes it"""
    a2: Gradient | None = None
    """gradient of the axial strain along y; free unless symmetry excludes it"""
    across: AxialStrain | None = None
    """uniform strain along y, for a strip cut out of something wide"""
    force: Force = written("0 kN")
    """external axial force on the whole strand"""
    moment_x: MomentOfTime = written("0 kN m")
    """external moment with x, on the whole strand"""
    moment_y: MomentOfTime = written("0 kN m")
    """external moment with y, on the whole strand"""
    neutral_axis: Annotated[Any, AxisMark()] = Field(None, examples=["free"])
    """with a bending machine: where the thickness of the slice stays 1 (eq. 42-44); by default
    free, found by equilibrium"""
    closing: Literal["tangential", "axial"] | None = Field(None, examples=["tangential"])
    """with a bending machine: the force in the axial equilibrium. tangential: N - kM, which gives
    the work of bending; axial: N alone, as in the thesis; by default tangential"""
    force_contains_bending: bool | None = Field(None, examples=[True])
    """whether the force, such as a measured one, contains the work of bending; required for a table
    over position with tangential closing, otherwise false"""


class GivenDisplacement(TableModel):
    """A displacement prescribed on boundary groups, besides the lines of symmetry."""

    on: tuple[str, ...] = Field(min_length=1)
    """boundary groups; a name also matches all groups that begin with it"""
    component: Literal["x", "y"]
    """direction of the displacement"""
    value: DisplacementOfTime = written("0 mm")
    """the displacement"""


Model = Literal["creep", "elastic", "thesis", "none"]
MODELS: tuple[Model, ...] = get_args(Model)
SolidFraction = Annotated[float, Kind("1", least=0.0, most=1.0, label="solid fraction", sample="1")]
LargestBulge = Annotated[
    Tabled, Curve(Kind("m", "mm", above=0.0, label="bulge", sample="0.5 mm"), "position")
]


class Bulging(TableModel):
    """How the wide faces bulge between the rolls of [machine]; `bulging = "creep"` for short."""

    model: Model = "creep"
    """creep: a travelling strip that creeps by the law of the case; elastic: a strip clamped at the
    rolls; thesis: a plate with a cosine deflection (308); none: the wide faces are not supported"""
    solid_fraction: SolidFraction = 1.0
    """solid fraction that bounds the bulging shell on its inside"""
    largest: LargestBulge | None = Field(None, examples=["0.5 mm"])
    """for the plate of the thesis: largest bulge over position, to which its deflection is scaled
    (VI.2.2.3)"""

    axial_strain: bool = False
    """add the axial strain of the strip to that of the slice, in the shell between the edges of the
    wide faces"""

    shear: bool | None = Field(None, examples=[True])
    """include the elastic shear deformation of the strip, with the moduli of its own section (not
    for the plate of the thesis); by default it is left out"""

    pull: bool | None = Field(None, examples=[False])
    """rolls pull a face back to their line where it lies farther inside than the bulge, as long as
    the core is liquid; by default they do, except below a [mould], whose corners shrink away from
    the line"""

    @property
    def bears(self) -> bool:
        """Whether rolls support the wide faces."""
        return self.model != "none"


class Mechanics(TableModel):
    """The mechanical problem of the slice in generalized plane strain."""

    law: str = "norton_hoff_kozlowski"
    """constitutive law: a set shipped with castfem, or a TOML file of your own, relative to this
    file"""
    elasticity: str | None = Field(None, examples=["elastic_steel"])
    """Young's modulus and Poisson's ratio: a shipped set or a TOML file; by default those of the
    steel, where it has them, else those of elastic_steel"""
    liquid_stiffness: Ratio = 1e-5
    """Young's modulus of elastic liquid over that of the solid; the modulus of the mushy zone
    begins there, too (mush)"""
    liquid: Literal["fed", "elastic"] = "fed"
    """fed: liquid flows in from above where the shell moves away, and carries only its pressure;
    elastic: a soft elastic body that supports the shell, as in the thesis (V.1.6)"""
    mush: MushyZone | None = Field(None, examples=["skeleton"])
    """stiffness of the mushy zone. skeleton: stiffness and flow stress of the solid, in proportion
    to the solid fraction above coherency; geometric, linear: the modulus is interpolated in the
    solid fraction in this way; none: as the liquid. By default skeleton with fed liquid (none with
    coherency = 0), geometric with elastic liquid"""
    coherency: Solid | None = Field(
        None,
        description="solid fraction up to which the mushy zone is as soft as the liquid. By "
        f"default {ZERO_STRENGTH:g} of a skeleton, else 0",
    )
    ferrostatic: Literal["proportional", "full", "none", "off"] = "full"
    """pressure of the liquid in the mushy zone. full: until all is solid, since the liquid between
    the crystals transmits it; proportional: to the liquid fraction (eq. 219); none: only in pure
    liquid; off: no pressure at all"""
    until: Annotated[float | str, OrWord(_LENGTH, (MOULD_EXIT,))] | None = Field(
        None, examples=["1 m", "mould_exit"]
    )
    """where the mechanics end: a position of the slice, or mould_exit. Below it the run goes on
    with the temperature alone, in the shape that the slice has there; left out: at the end of the
    run"""
    strain: Literal["small", "large"] = "small"
    """small strain, or large with an objective update on the deformed slice"""
    tolerance: Tolerance = 1e-6
    """residual forces, relative to those of the stress"""
    planes: GeneralizedPlaneStrain = Field(
        default_factory=lambda: GeneralizedPlaneStrain.model_validate({})
    )
    """degrees of freedom of generalized plane strain"""
    bulging: Annotated[Bulging, OneWord("model", MODELS)] | None = None
    """how the wide faces bulge between the rolls of [machine], which support them; left out: not
    supported"""
    held: tuple[GivenDisplacement, ...] = ()
    """displacements prescribed on the surface"""
    solver: dict[str, PetscOption] = Field(default_factory=dict)
    """PETSc options of the nonlinear solver; they take precedence over castfem's"""

    @property
    def mushy_zone(self) -> MushyZone:
        """The model of the mushy zone, `mush` or its default."""
        if self.mush is not None:
            return self.mush
        if self.liquid == "elastic":
            return "geometric"
        return "none" if self.coherency == 0.0 else "skeleton"

    @property
    def coherent_from(self) -> float:
        """Solid fraction above which the mushy zone carries stress, `coherency` or its default."""
        if self.coherency is not None:
            return self.coherency
        return ZERO_STRENGTH if self.mushy_zone == "skeleton" else 0.0

    @property
    def liquid_has_modulus(self) -> bool:
        """Whether `liquid_stiffness` has an effect: fed liquid has no modulus."""
        return self.liquid == "elastic" or self.mushy_zone in ("geometric", "linear")


@dataclass(frozen=True, slots=True)
class Way:
    """A coupling window given as a length of strand."""

    length: float  #: m


@dataclass(frozen=True, slots=True)
class WindowMark(Notation):
    """Annotation of a field that takes a time or a length of strand."""

    takes: str = 'time: `"0.1 s"`, or length: `"5 mm"`'

    def read(self, given: object) -> float | Way:
        """Return the time in s, or the length; raise ValueError if it is neither."""
        if isinstance(given, Way):
            return given
        try:
            of_length = isinstance(given, str) and parse_any(given)[1] == "m"
        except ValueError:
            of_length = False
        return Way(_LENGTH.read(given)) if of_length else _TIME.read(given)

    def write(self, value: float | Way) -> Any:
        """Return what reads back to the same window."""
        return _LENGTH.write(value.length) if isinstance(value, Way) else _TIME.write(value)

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        return {"anyOf": [_TIME.json_schema(), _LENGTH.json_schema()]}


class Coupling(TableModel):
    """How the thermal and the mechanical problem are coupled."""

    interval: Annotated[float | Way, WindowMark()] = written("0.1 s")
    """coupling window: time, or length of strand, after which the two problems exchange
    temperatures, gap and viscoplastic work"""
    mechanical_step: Time | None = Field(None, examples=["50 ms"])
    """longest mechanical step within a window; by default the window"""
    order: Literal["thermal_first", "mechanics_first"] = "thermal_first"
    """which problem is solved first; mechanics_first extrapolates the cooling of the previous
    window (thesis, Fig. 84)"""
    passes: int = Field(8, ge=1, strict=True)
    """largest number of coupling iterations in a window. A window is iterated until the gap to the
    mould converges, and shortened if it does not. 1: no iteration; windows whose gap has not
    converged are counted"""
    settled: PositiveDifference = written("1 K")
    """tolerance of the coupling iterations: the gap has converged when the newly computed gap would
    change the surface temperature by less"""
    window_error: PositiveDifference | None = Field(None, examples=["2 K"])
    """allowed error of the surface temperature in a window whose gap changes; with a larger one the
    window is shortened, unless it is already shorter than 0.1 s and than a fiftieth of the
    interval; by default 2 K"""
    growth: Growth | None = Field(None, examples=[8.0])
    """largest window as a multiple of `interval`, between events (rolls, ends of zones, edges of
    sprays, kinks of the speed); after each event the window is `interval` again; by default windows
    do not grow"""
    strain_error: Tolerance | None = Field(None, examples=[1e-5])
    """allowed error of the axial strain at the surface in a window that has grown; by default 1e-5
    """
    follow_shape: bool = True
    """whether heat is computed on the deformed slice (thesis IV); false: on the undeformed one"""
    dissipation: Share = 1.0
    """fraction of the viscoplastic work that becomes heat; 0: none"""


def free_strains(planes: GeneralizedPlaneStrain, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the free generalized strains; by default a0, and a1 and a2 as far as `allowed`."""
    given = {name: getattr(planes, name) for name in ("a0", "a1", "a2", "across")}
    return tuple(
        name
        for name, value in given.items()
        if value == FREE or (value is None and name in ("a1", "a2") and name in allowed)
    )


def axis_position(given: Any, thickness: float) -> float | None:
    """Return the position of a neutral axis, m from the middle inwards; None if it is free."""
    if given is None or given == FREE:
        return None
    return AXES[given] * thickness if isinstance(given, str) else float(given)


def places_of(given: Any) -> tuple[Any, ...]:
    """Return the positions of the neutral axis in a case: one, or both of a table."""
    return tuple(given.values()) if isinstance(given, Mapping) else (given,)
