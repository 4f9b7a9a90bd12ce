"""The table [machine]: the rolls that guide the strand below its mould, and its drives.

Equation numbers are those of [Pascon2003] (docs/references.md).

`castfem.physics.machine.rolls`, which reads and checks them, is only imported by cases with rolls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from castfem.base.quantities import Kind, Length, Notation, OrWord
from castfem.base.table_notation import Curve, schema_of_columns
from castfem.base.tables import Tabled
from castfem.model.base import TableModel
from castfem.model.defects import Defect, with_defects

if TYPE_CHECKING:
    from castfem.physics.machine.rolls import Rolls


@dataclass(frozen=True, slots=True)
class RollTable(Notation):
    """Annotation of a field that takes rolls: a CSV file, or columns."""

    takes: str = 'CSV file: `"rolls.csv"`, or its columns'

    def read(self, given: object) -> Rolls | None:
        """Return the rolls, or raise ValueError."""
        from castfem.physics.machine.roll_table import read_rolls
        from castfem.physics.machine.rolls import Rolls

        if given is None or isinstance(given, Rolls):
            return given
        if isinstance(given, str):
            given = {"file": given}
        if not isinstance(given, Mapping):
            raise ValueError('the rolls of a machine are a file, rolls = "rolls.csv", or columns')
        return read_rolls(given)

    def write(self, value: Rolls | None) -> Any:
        """Return what reads back to the same rolls."""
        from castfem.physics.machine.roll_table import columns_of

        return None if value is None else columns_of(value)

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        from castfem.physics.machine.roll_table import COLUMNS, KINDS

        ways = schema_of_columns(
            COLUMNS,
            [f"{name}_unit" for name in COLUMNS if name not in ("driven", "side")],
            needed=[name for name in KINDS if name in ("position", "diameter")],
            cells=("number", "string", "boolean"),
        )
        return {"anyOf": [{"type": "string"}, *ways], "description": "rolls, from a file"}


class RollSegment(TableModel):
    """Pairs of rolls with the same pitch and diameter."""

    rolls: int = Field(ge=1, strict=True, examples=[8])
    """number of pairs"""
    pitch: Length = Field(examples=["250 mm"])
    """distance along the strand between neighbouring pairs"""
    diameter: Length = Field(examples=["215 mm"])
    """diameter of the rolls"""
    radius: Length | None = Field(None, examples=["8 m"])
    """radius of the strand at the last pair; 1/R is linear from the previous segment; left out:
    straight"""
    aperture: Length | None = Field(None, examples=["222 mm"])
    """distance between the rolls of a pair; by default the section's height"""


COUPLED = "coupled"
ResistanceOverPosition = Annotated[
    str | Tabled,
    OrWord(
        Curve(Kind("N", "kN", least=0.0, label="force", sample="700 kN"), "position"), (COUPLED,)
    ),
]
FrictionCoefficient = Annotated[
    float, Kind("1", least=0.0, label="friction coefficient", sample="0.3")
]


class Extraction(TableModel):
    """Resistance of the rolls, shared by the drives of the machine (thesis III.1.3, VI.2.3)."""

    resistance: ResistanceOverPosition = Field(examples=[{"file": "resistance.csv"}])
    """cumulative resistance of all rolls from the first one to a position, as given by a maker,
    bending included; or "coupled": from the roll forces of the run"""
    friction_axis: FrictionCoefficient = 0.015
    """friction coefficient at the axes of the rolls (eq. 46)"""
    friction_surface: FrictionCoefficient = 0.3
    """friction coefficient between strand and a locked roll (eq. 45)"""
    bending: Literal["equilibrium", "hinges"] = "equilibrium"
    """bending force on a pair in a coupled resistance: equilibrium, from the moments of the
    neighbouring pairs; hinges, M/L at each pair by itself (eq. 320)"""

    @property
    def coupled(self) -> bool:
        """Whether the resistance follows from the roll forces of the run."""
        return bool(self.resistance == COUPLED)


class Machine(TableModel):
    """The rolls below the mould, which bend and straighten the strand: `rolls` or `segment`."""

    rolls: Annotated[Any, RollTable()] = None
    """table of the pairs (docs/machine.md)"""
    first: Length | None = Field(None, examples=["900 mm"])
    """with segments: position of the first pair, from the meniscus"""
    radius_of: Literal["extrados", "centreline", "intrados"] = "extrados"
    """with segments: the face whose radius is given"""
    segment: tuple[RollSegment, ...] = ()
    """pairs with the same pitch and diameter"""
    extraction: Extraction | None = None
    """resistance of the rolls, shared by the drives; left out: none"""

    defect: tuple[Defect, ...] | None = None
    """defects of the machine; left out: none"""

    def pairs(self) -> Rolls | None:
        """Return the rolls with their defects; None while data needed for them are missing."""
        rolls = self.normal()
        if rolls is None or not self.defect:
            return rolls
        return with_defects(rolls, self.defect)

    def normal(self) -> Rolls | None:
        """Return the rolls without defects; None while data needed for them are missing."""
        if self.rolls is not None or not self.segment or self.first is None:
            found: Rolls | None = self.rolls
            return found
        from castfem.physics.machine.rolls import Segment, expand

        parts = [
            Segment(s.rolls, s.pitch, s.diameter, s.radius or math.inf, s.aperture)
            for s in self.segment
        ]
        return expand(parts, self.first, self.radius_of)


def thickness_of(section: Any) -> float | None:
    """Return the size of a section from extrados to intrados, m; None if it has none."""
    for key in ("height", "diameter"):
        if getattr(section, key, None) is not None:
            return float(getattr(section, key))
    return None
