"""The table [mechanics.bulging]: how the wide faces bulge between the rolls."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field

from castfem.base.quantities import Kind
from castfem.base.table_notation import Curve
from castfem.base.tables import Tabled
from castfem.model.base import TableModel

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
