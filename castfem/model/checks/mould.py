"""Checks of [mould.tube] and its friction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from castfem.base.units import in_mm
from castfem.model.base import Faults
from castfem.model.checks.registry import check, twice
from castfem.model.mould import ContactSettings, CopperThermocouples, Friction, MouldTube
from castfem.model.section import BeamBlank, Rectangle

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("mould.tube")
def _names(case: Case, table: MouldTube) -> Faults:
    for key, text in twice([one.name for one in table.thermocouple], "name", str.lower):
        yield f"thermocouple.{key}", text


@check("mould.tube.thermocouple.*")
def _within_the_wall(case: Case, one: CopperThermocouples) -> Faults:
    if any(probe.name.lower() == one.name.lower() for probe in case.output.probe):
        yield "name", f'("{one.name}") is the name of a probe, too; choose another'
    if case.mould is None or case.mould.tube is None:
        return
    thickness = case.mould.tube.thickness
    if one.depth > thickness:
        yield "depth", f"({in_mm(one.depth)}) is deeper than the wall, {in_mm(thickness)}"


@check("mould.tube")
def _bricks(case: Case, table: MouldTube) -> Faults:
    """Report cells so small that the tube cannot be computed."""
    size, length = table.cell_size, case.mould.length if case.mould is not None else 0.0
    width, height = case.section.outline()
    if table.cells_across % 1.0:
        yield "cells_across", "must be a whole number"
    if width is None or height is None:
        return
    count = table.cells_across * 0.5 * (width + height) / size * (length + table.above) / size
    if count > 300_000:  # each has 27 nodes
        most = "at most 300000; give a larger one"
        yield "cell_size", f"({in_mm(size)}) makes about {count:.2g} cells of the tube, {most}"


@check("mould.tube")
def _surrounds(case: Case, table: MouldTube) -> Faults:
    if isinstance(case.section, BeamBlank):
        yield "", "only a rectangle or a round has a tube; leave the table out"
    if isinstance(case.section, Rectangle) and case.section.corner_radius == 0.0:
        fix = 'give [section] some: corner_radius = "5 mm"'
        yield "", f"a tube has rounded corners; {fix}"
    if table.flux is not None and table.hot_face is not None:
        yield "hot_face", "the flux is given, too: one of the two, leave the other out"


@check("mould.friction")
def _friction(case: Any, friction: Friction) -> Faults:
    yield from friction.problems()


@check("mould.contact")
def _stable(case: Any, contact: ContactSettings) -> Faults:
    """Report a factor with which Nitsche's method cannot solve a strand (docs/contact.md)."""
    if contact.factor is None or contact.method != "nitsche":
        return
    from castfem.physics.contact.settings import FACTOR, LEAST_NITSCHE

    if contact.factor < LEAST_NITSCHE:
        text = f"({contact.factor:g}) is too small for Nitsche's method; allowed: at least"
        yield "factor", f"{text} {LEAST_NITSCHE:g}, or leave it out for {FACTOR:g}"
