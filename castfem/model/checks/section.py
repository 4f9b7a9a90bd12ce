"""Checks of [section] and [mesh]."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.base.constants import ROUNDING
from castfem.base.units import in_mm
from castfem.model.base import Faults, Unreadable
from castfem.model.checks.registry import caution, check
from castfem.model.section import Mesh, Rectangle, Section

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("section")
def _round_corners(case: Case, section: Section) -> Faults:
    if not isinstance(section, Rectangle):
        return
    radius, most = section.corner_radius, 0.5 * min(section.width, section.height)
    if radius >= most:
        fix = f'allowed: below half the smaller side ({in_mm(most)}), or shape = "round"'
        yield "corner_radius", f"({in_mm(radius)}) leaves no flat face; {fix}"


@check("mesh")
def _sizes(case: Case, mesh: Mesh) -> Faults:
    thin, large = case.section.halves()
    finest = 1e-5  # smallest cell over half the section
    for key in ("surface_size", "corner_size", "face_size", "core_size", "core_depth"):
        value, most = getattr(mesh, key), thin if key == "surface_size" else large
        if value is None or isinstance(value, Unreadable) or most is None or large is None:
            continue
        if value > most:
            what = "half the thickness of" if key == "surface_size" else "half"
            yield key, f"({in_mm(value)}) is larger than {what} the section ({in_mm(most)})"
        # The shape of flatter curved cells is lost in rounding, and DOLFINx finds no points in
        # them.
        if value < finest * large:
            fix = f"at least {in_mm(finest * large)}"
            yield key, f"({in_mm(value)}) is too fine to be told apart in the section; {fix}"


@check("mesh")
def _grading(case: Case, mesh: Mesh) -> Faults:
    for small, big in (("surface_size", "core_size"), ("corner_size", "face_size")):
        fine, coarse = getattr(mesh, small), getattr(mesh, big)
        if fine is not None and coarse is not None and fine > coarse:
            fix = "cells grow from the surface to the core, from the corner to the middle of a face"
            yield small, f"({in_mm(fine)}) is larger than {big} ({in_mm(coarse)}); {fix}"


@check("mesh")
def _order(case: Case, mesh: Mesh) -> Faults:
    if case.mould is None or mesh.order != 1:
        return
    if mesh.cell == "triangle":
        fix = 'give order = 2, or cell = "quadrilateral"'
        yield "order", f"(1) makes triangles too stiff for a freezing shell in its mould; {fix}"
    elif case.section.is_curved():
        fix = "give order = 2"
        yield "order", f"(1) makes a polygon of the round surface, which its mould is not; {fix}"


@check("mesh")
def _corner(case: Case, mesh: Mesh) -> Faults:
    if not case.section.has_corner and mesh.corner_size is not None:
        yield "corner_size", f'a section of shape "{case.section.tag}" has no corner'


@caution("mesh")
def _coarse(case: Case, mesh: Mesh) -> Faults:
    if mesh.surface_size > 15e-3:  # m: shells are some 10 to 25 mm thick at the exit of the mould
        fix = "castfem error tells what cells cost"
        yield "surface_size", f"({in_mm(mesh.surface_size)}) is as thick as a shell; {fix}"


@caution("mesh")
def _round_corner(case: Case, mesh: Mesh) -> Faults:
    """Report cells that are too long to resolve a round corner."""
    radius = getattr(case.section, "corner_radius", 0.0)
    key = "surface_size" if mesh.corner_size is None else "corner_size"
    size, most = getattr(mesh, key), radius / 6.0
    if case.mould is not None and radius > 0.0 and size > most * (1.0 + ROUNDING):
        fix = f"gap and shell may be wrong by a tenth; {1e3 * most:.6g} mm or less resolve it"
        yield key, f"cells of {in_mm(size)} along a corner of radius {in_mm(radius)}: {fix}"
