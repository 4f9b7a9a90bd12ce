"""The table [mould.tube]: the copper tube round the cavity, and what heats, cools and holds it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from castfem.base.quantities import Distance, Kind, Length
from castfem.base.table_notation import Curve
from castfem.base.tables import Table
from castfem.base.units import in_mm
from castfem.model.base import TableModel, written
from castfem.model.checks import Faults, check
from castfem.model.section import BeamBlank, Rectangle

if TYPE_CHECKING:
    from castfem.model.case import Case

FluxOfPosition = Annotated[
    float | Table, Curve(Kind("W/m^2", "MW/m^2", least=0.0), over="position")
]
CoefficientOfPosition = Annotated[
    float | Table, Curve(Kind("W/(m^2 K)", "W/(m^2 K)", above=0.0), over="position")
]
TemperatureOfPosition = Annotated[float | Table, Curve(Kind("K", "degC"), over="position")]
Cells = Annotated[float, Kind("1", least=1.0, most=64.0, label="number of cells", sample="2")]
Share = Annotated[float, Kind("1", least=0.0, most=2.0, label="share", sample="0.6")]


MOST_BRICKS = 300_000
"""Cells of a tube, at most: each has 27 nodes."""


class MouldTube(TableModel):
    """The copper tube of a mould, for its distortion by heat; the length is the mould's."""

    thickness: Length = Field(examples=["10 mm"])
    """of the wall"""
    above: Distance = written("100 mm")
    """how far it goes on above the meniscus"""
    support: Literal["free", "hung", "clamped", "between"] = "hung"
    """hung: its upper end is held along the mould; clamped: in all directions; between: both ends
    along the mould; free: not at all"""
    flux: FluxOfPosition | None = Field(None, examples=["2 MW/m^2"])
    """into the hot face below the meniscus; by default that of the strand, which is run for it"""
    corner_flux: Share = 1.0
    """flux on the arcs of the corners over that at mid-face; of a given flux"""
    corner_reach: Length = written("20 mm")
    """length of face over which it falls to that"""
    water_coefficient: CoefficientOfPosition = written("30000 W/(m^2 K)")
    """heat transfer to the cooling water"""
    water_temperature: TemperatureOfPosition = written("40 degC")
    """of the cooling water"""
    hot_face: TemperatureOfPosition | None = None
    """temperature of the face towards the strand, below the meniscus, instead of a flux"""
    water_side: TemperatureOfPosition | None = None
    """temperature of the water side, instead of water"""
    cells_across: Cells = 2.0
    """cells through the wall"""
    cell_size: Length = written("12 mm")
    """largest cell round the wall and along it; at the meniscus a third of it"""
    solver: Literal["auto", "direct", "multigrid"] = "auto"
    """of the linear systems; auto: direct where they are small"""


@check("mould.tube")
def _bricks(case: Case, table: MouldTube) -> Faults:
    """Yield cells so small that there would be no end to them."""
    size, length = table.cell_size, case.mould.length if case.mould is not None else 0.0
    width, height = case.section.outline()
    if table.cells_across % 1.0:
        yield "cells_across", "must be a whole number"
    if width is None or height is None:
        return
    count = table.cells_across * 0.5 * (width + height) / size * (length + table.above) / size
    if count > MOST_BRICKS:
        yield (
            "cell_size",
            f"({in_mm(size)}) makes about {count:.2g} cells of the tube, at most {MOST_BRICKS:g}; "
            "give a larger one",
        )


@check("mould.tube")
def _surrounds(case: Case, table: MouldTube) -> Faults:
    if isinstance(case.section, BeamBlank):
        yield "", "only a rectangle or a round has a tube; leave the table out"
    if isinstance(case.section, Rectangle) and case.section.corner_radius == 0.0:
        yield (
            "",
            'a tube has rounded corners; give [section] some: corner_radius = "5 mm"',
        )
    if table.flux is not None and table.hot_face is not None:
        yield "hot_face", "the flux is given, too: one of the two, leave the other out"
