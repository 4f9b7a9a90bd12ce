"""Checks of the probes of [output]."""

from __future__ import annotations

from collections.abc import Iterator

from castfem.base.tolerances import ROUNDING
from castfem.model.case import Case
from castfem.model.check_cooling import in_mm
from castfem.model.probe import Probe
from castfem.model.problems import Path, Problem
from castfem.model.shown_units import faults

_WAYS = (("x", "y"), ("under", "depth"))
_ONE_SIDED = {"quarter": "xy", "half": "x"}  # part of the section: coordinates without negatives


def check_output(case: Case) -> Iterator[Problem]:
    """Yield probes that do not say where they are or share a name, units that measure otherwise."""
    if case.output and case.output.units is not None:
        for key, text in faults(case.output.units):
            yield Problem(("output", "units", key), text)
    fractions = [f for f in (case.output and case.output.shell_at) or () if f is not None]
    if len({round(100.0 * f) for f in fractions}) < len(fractions):
        yield Problem(("output", "shell_at"), "has a solid fraction twice")
    names: list[str] = []
    for index, probe in enumerate((case.output and case.output.probe) or ()):
        path = ("output", "probe", index)
        if probe is None:
            continue
        has = probe.model_fields_set
        ways = [way for way in _WAYS if has & set(way)]
        if len(ways) != 1:
            yield Problem(
                path, "one of x with y, or under with depth, is needed to say where it is"
            )
        for one, other in [way for way in ways if len(has & set(way)) == 1]:
            missing = other if one in has else one
            yield Problem(path, f"{missing} is missing; {one} and {other} go together")
        if probe.name is not None and probe.name.lower() in names:
            yield Problem((*path, "name"), f'("{probe.name}") is used twice')
        names.append((probe.name or "").lower())
        yield from _beyond(case, probe, path)


def _beyond(case: Case, probe: Probe, path: Path) -> Iterator[Problem]:
    """Yield a place beyond the rectangle round the section; the run looks closer."""
    section = case.section
    if section is None or getattr(section, "bulge", None) is not None:
        return
    width, height = section.outline()
    if width is None or height is None:
        return
    part = getattr(section, "symmetry", None) or ""
    for key, size in (("x", width), ("y", height)):
        at = getattr(probe, key)
        if at is not None and abs(at) > 0.5 * size * (1.0 + ROUNDING):
            yield Problem(
                (*path, key),
                f"({in_mm(at)}) lies outside of the section, which reaches to {in_mm(0.5 * size)} "
                "from its middle",
            )
        elif at is not None and at < -ROUNDING * size and key in _ONE_SIDED.get(part, ""):
            yield Problem(
                (*path, key),
                f"({in_mm(at)}) lies beyond the line of symmetry: the modelled part is a {part}; "
                f"give its mirror image, {in_mm(-at)}",
            )
