"""Checks of [mould] against the section."""

from __future__ import annotations

import math
from collections.abc import Iterator

from castfem.base.constants import ROUNDING
from castfem.base.tables import Table
from castfem.base.units import in_mm
from castfem.model.base import Faults, Unreadable
from castfem.model.case import Case
from castfem.model.checks.registry import caution, check
from castfem.model.mould import Mould
from castfem.model.mould_from_case import (
    SIZES,
    build_mould,
    hot_lengths,
    wall_cavity,
    wall_expansion,
    wall_tapers,
)
from castfem.model.section import Section, Strip
from castfem.physics import mould as wall
from castfem.physics.mould.taper import TaperProfile


@check("mould")
def _goes_with(case: Case, table: Mould) -> Faults:
    section = case.section
    if isinstance(section, Strip):
        yield "", "a strip has no mould; leave the table out"
        return
    if section.one_taper and not set(table.taper.parts) <= {"face"}:
        yield "taper", f'a section of shape "{section.tag}" has one taper for all: "1 %/m"'
    if getattr(section, "bulge", None) is not None and table.displacement is None:
        fix = 'mould.displacement = { file = "wall.csv" } (castfem section writes both)'
        yield "/section.bulge", f"the cavity must have the strand's outline, too: {fix}"


@check("mould")
def _sizes(case: Case, table: Mould) -> Faults:
    """Report sizes that a section of this shape does not have, or smaller than the strand."""
    section, hot = case.section, hot_lengths(table)
    known = section.mould_sizes
    for name in () if isinstance(section, Strip) else SIZES:
        size = getattr(table, name)
        if size is None or isinstance(size, Unreadable):
            continue
        if name not in known:
            sizes = f"; allowed: {', '.join(known)}" if known else "; its sizes are the section's"
            yield name, f'not a size of a section of shape "{section.tag}"{sizes}'
            continue
        own = getattr(section, name)
        if hot is None:
            continue
        if name == "corner_radius":
            bound, allowed = "at most", _widest_corner(table, section, hot)
            short = size > allowed + ROUNDING * own
        else:
            bound, allowed, short = "at least", own / hot, hot * size < own * (1.0 - ROUNDING)
        if short:
            limit = "that" if allowed == own else in_mm(allowed)
            fix = f"allowed: {bound} {limit}, or leave it out"
            yield name, f"({in_mm(size)}) does not fit the strand, which has {in_mm(own)}; {fix}"


def _widest_corner(table: Mould, section: Section, hot: float) -> float:
    """Return the largest corner radius of the cavity that still admits the strand, m.

    A rectangle with round corners is the set of points within the radius of an inner rectangle with
    sharp corners. The strand lies inside the mould if it reaches farther in no direction.
    """
    sizes = [(getattr(section, name), getattr(table, name)) for name in ("width", "height")]
    # Half of the clearance, and the allowed increase of the radius: the centres of the corners lie
    # (grown - a, grown - b) apart, and the strand's corner reaches that far.
    radius = getattr(section, "corner_radius", 0.0)
    a, b = (0.0 if size is None else max(0.5 * (hot * size - own), 0.0) for own, size in sizes)
    grown = a + b + math.sqrt(2.0 * a * b)
    return float((radius + grown) / hot)


@check("mould")
def _fits(case: Case, table: Mould) -> Faults:
    """Report why the mould cannot be built, unless another check reports it."""
    section, key = case.section, "wall_temperature"
    others = (*_goes_with(case, table), *_sizes(case, table), *table.friction.problems())
    if others or isinstance(section, Strip):
        return
    try:
        wall_expansion(table)
        key = "taper"
        wall_tapers(table)
        key = ""
        straight = wall.same(wall.Taper.single(0.0, table.length))
        wall.Mould(wall_cavity(table, section, 1.0), table.length, straight)
        key = "taper" if table.displacement is None else "displacement"
        build_mould(table, section)
    except ValueError as error:
        if key:
            yield key, str(error)


@caution("mould")
def wider(case: Case, mould: Mould) -> Faults:
    """Report a cavity wider than the strand at the meniscus, where liquid fills it."""
    hot = hot_lengths(mould) or 0.0
    for name in ("width", "height", "diameter"):
        size, own = getattr(mould, name), getattr(case.section, name, None)
        if size is not None and own is not None and hot * size > 1.001 * own:
            fix = f"liquid fills its mould: give section.{name} the size of the cavity"
            at = f"the strand at the meniscus ({in_mm(own)})"
            yield name, f"({in_mm(size)}) leaves a gap to {at}, but {fix}"


@caution("mould")
def _taper(case: Case, mould: Mould) -> Faults:
    """Report tapers that close or open the mould by much more than a strand shrinks."""
    for name, given in mould.taper.parts.items():
        half, part = _half(case.section, name), "" if name == "face" else f"{name}: "
        if given.closing is not None:
            yield from (("taper", part + t) for t in _rows(given.closing, half, mould.length))
        closed = _closure(given.profile(mould.length), half, mould.length)
        if abs(closed) <= 0.07:  # more than deliberately extreme cases have (10 %/m over 0.6 m)
            continue
        how, near = "closes" if closed > 0.0 else "opens", ""
        if len(given.segments) == 1:
            tenth = 0.1 * given.segments[0].mean
            single = given.segments[0].top == given.segments[0].bottom
            if single and abs(tenth) <= 0.03:  # 1/m
                near = f"; did you mean {100.0 * tenth:.3g} %/m?"
        yield "taper", f"{part}the mould {how} by {100.0 * abs(closed):.3g} %{near}"


def _rows(closing: Table, half: float, length: float) -> Iterator[str]:
    """Report rows that are no wall displacement, or do not begin at the meniscus of this mould."""
    first, last, there = closing.arguments[0], closing.arguments[-1], closing(0.0)
    if abs(there) > 0.5 * half:  # no wall has moved this far at the meniscus
        what = (
            "the inward displacement of each face since the meniscus: half of the decrease in size"
        )
        yield f"{_mm(there)} at the meniscus look like a size of the cavity; the table gives {what}"
    elif first > ROUNDING * length and there != 0.0:
        fix = "give the row of the meniscus, where the wall has not moved"
        yield f"the table begins {_mm(first)} below the meniscus with {_mm(there)}, {fix}"
    below = f"below the meniscus, the mould ends {_mm(length)} below it"
    asked = "are the positions from the meniscus, not from the top of the mould?"
    ends = 0.02  # tolerance on where a table ends, relative to the length of the mould
    steep = 0.2 * half  # 1/m: a steeper wall has a step there
    if last > (1.0 + ends) * length:
        yield f"the table continues to {_mm(last)} {below}; {asked}"
    elif last < (1.0 - ends) * length and 0.0 < abs(_slope(closing)) < steep:
        yield f"the table ends {_mm(last)} {below}; the wall is straight from there on: {asked}"


def _slope(closing: Table) -> float:
    """Return the displacement of the wall per length between the last two rows."""
    if len(closing.values) == 1:
        return 0.0
    (*_, above, last), (*_, before, end) = closing.values, closing.arguments
    return (last - above) / (end - before)


def _mm(value: float) -> str:
    return f"{1e3 * value:.6g} mm"


def _closure(profile: TaperProfile, start: float, length: float) -> float:
    """Return the largest closing (w_in - w_out) / w_out at any position; negative if it opens."""
    positions = [z for z in profile.knots() if z < length] + [length]
    closed = [start / profile.half(z, start) - 1.0 for z in positions]
    return max(closed, key=abs)


def _half(section: Section, face: str) -> float:
    """Return half the dimension that a face's taper governs, m; of two the smaller one."""
    width, height = section.outline()
    assert width is not None and height is not None, "the case has been checked"
    return 0.5 * {"narrow_face": width, "wide_face": height}.get(face, min(width, height))
