"""The table [machine.extraction]: resistance of the rolls, and how the drives share it.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from castfem.base.quantities import Kind, OrWord
from castfem.base.table_notation import Curve
from castfem.base.tables import Tabled
from castfem.model.base import TableModel

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
