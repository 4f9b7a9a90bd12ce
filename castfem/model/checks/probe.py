"""Checks of [output]: probes and units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from castfem.base.constants import ROUNDING
from castfem.base.shown_units import (
    ShownUnits,
)
from castfem.base.units import in_mm
from castfem.model.base import Faults
from castfem.model.checks.registry import check, given, twice
from castfem.model.checks.registry import check as check_of_case
from castfem.model.probe import Probe
from castfem.model.shown_units import faults

if TYPE_CHECKING:
    from castfem.model.case import Case


_ONE_SIDED = {"quarter": "xy", "half": "x"}  # parts of the section without negative coordinates


@check("output")
def _names(case: Case, output: Any) -> Faults:
    for key, text in twice([probe.name for probe in output.probe], "name", str.lower):
        yield f"probe.{key}", text


@check("output.probe.*")
def _says_where(case: Case, probe: Probe) -> Faults:
    found = [given(probe, *way) for way in (("x", "y"), ("under", "depth"))]
    if all(found) or not any(found):
        yield "", "one of x with y, or under with depth, is needed to give its position"
    for one, other in (("x", "y"), ("y", "x"), ("under", "depth"), ("depth", "under")):
        if given(probe, one) and not given(probe, other):
            yield "", f"{other} is missing; {one} and {other} go together"


@check("output.probe.*")
def _is_within(case: Case, probe: Probe) -> Faults:
    """Report a probe beyond the rectangle around the section; the run checks more closely."""
    section = case.section
    width, height = section.outline()
    if width is None or height is None or getattr(section, "bulge", None) is not None:
        return
    part = getattr(section, "symmetry", "")
    for key, size in (("x", width), ("y", height)):
        at = getattr(probe, key)
        if at is not None and abs(at) > 0.5 * size * (1.0 + ROUNDING):
            most = f"which reaches to {in_mm(0.5 * size)} from its middle"
            yield key, f"({in_mm(at)}) lies outside of the section, {most}"
        elif at is not None and at < -ROUNDING * size and key in _ONE_SIDED.get(part, ""):
            fix = f"the modelled part is a {part}; give its mirror image, {in_mm(-at)}"
            yield key, f"({in_mm(at)}) lies beyond the line of symmetry: {fix}"


@check_of_case("output.units")
def _measures(case: Case, choice: ShownUnits) -> Faults:
    yield from faults(choice)
