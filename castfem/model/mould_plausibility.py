"""What of a mould may be meant but seldom is."""

from __future__ import annotations

from collections.abc import Iterator

from castfem.base.tables import Table
from castfem.base.tolerances import ROUNDING
from castfem.base.units import in_mm
from castfem.model.build_mould import hot_lengths
from castfem.model.case import Case
from castfem.model.checks import Faults, caution
from castfem.model.mould import Mould
from castfem.model.section import Mesh, Section
from castfem.physics.mould.taper import TaperProfile

_CLOSED = 0.07  # of the section, beyond what cases made to be extreme have (10 %/m over 0.6 m)
_USUAL_TAPER = 0.03  # 1/m, single
_FILLED = 1e-3  # of the section: a wider cavity is meant otherwise
_SIZE = 0.5  # of half the section, that a table has at the meniscus: no wall has moved as far
_STEP = 0.2  # 1/m, of half the section: a wall that moves faster has a step there
_ENDS = 0.02  # of the mould's length, that a table may end above or below it
_CELLS = 6.0  # along the radius of a corner; with fewer its gap and shell are off by a tenth


@caution("mould")
def _wider(case: Case, mould: Mould) -> Faults:
    """Yield a cavity that is wider than the strand at the meniscus, where liquid fills it."""
    hot = hot_lengths(mould) or 0.0
    for name in ("width", "height", "diameter"):
        size, own = getattr(mould, name), getattr(case.section, name, None)
        if size is not None and own is not None and hot * size > own * (1.0 + _FILLED):
            yield (
                name,
                f"({in_mm(size)}) leaves a gap to the strand at the meniscus ({in_mm(own)}), but "
                f"liquid fills its mould: give section.{name} the size of the cavity, not that of "
                "the cold product",
            )


@caution("mesh")
def _corner(case: Case, mesh: Mesh) -> Faults:
    """Yield that the cells at a round corner are too long for what happens there."""
    radius = getattr(case.section, "corner_radius", 0.0)
    key = "surface_size" if mesh.corner_size is None else "corner_size"
    size = getattr(mesh, key)
    if case.mould is not None and radius > 0.0 and size * _CELLS > radius * (1.0 + ROUNDING):
        yield (
            key,
            f"cells of {_mm(size)} along a corner of radius {_mm(radius)}: gap, shell and stress "
            f"there may be off by a tenth or more; {_mm(radius / _CELLS)} or less resolve it",
        )


@caution("mould")
def _taper(case: Case, mould: Mould) -> Faults:
    """Yield the tapers that close or open the mould by much more than a strand shrinks."""
    for name, given in mould.taper.parts.items():
        half, part = _half(case.section, name), "" if name == "face" else f"{name}: "
        if given.closing is not None:
            yield from (("taper", part + t) for t in _rows(given.closing, half, mould.length))
        closed = _closure(given.profile(mould.length), half, mould.length)
        if abs(closed) <= _CLOSED:
            continue
        how, near = "closes" if closed > 0.0 else "opens", ""
        if len(given.segments) == 1:
            tenth = 0.1 * given.segments[0].mean
            single = given.segments[0].top == given.segments[0].bottom
            if single and abs(tenth) <= _USUAL_TAPER:
                near = f"; did you mean {100.0 * tenth:.3g} %/m?"
        yield "taper", f"{part}the mould {how} by {100.0 * abs(closed):.3g} %{near}"


def _rows(closing: Table, half: float, length: float) -> Iterator[str]:
    """Yield why rows of a wall are no movement, or not from the meniscus of this mould."""
    first, last, there = closing.arguments[0], closing.arguments[-1], closing(0.0)
    if abs(there) > _SIZE * half:
        yield (
            f"{_mm(there)} at the meniscus look like a size of the cavity, not like a movement of "
            "its wall; the table has how far each face has moved in since the meniscus: half of "
            "what width or height have lost, larger where the mould closes"
        )
    elif first > ROUNDING * length and there != 0.0:
        yield (
            f"the table begins {_mm(first)} below the meniscus with {_mm(there)}, which is taken "
            "off all its rows; give the row of the meniscus, where the wall has not moved"
        )
    below = f"below the meniscus, the mould ends {_mm(length)} below it"
    asked = "are the positions from the meniscus, not from the top of the mould?"
    if last > (1.0 + _ENDS) * length:
        yield f"the table goes on to {_mm(last)} {below}; {asked}"
    elif last < (1.0 - _ENDS) * length and 0.0 < abs(_slope(closing)) < _STEP * half:
        yield f"the table ends {_mm(last)} {below}; the wall is straight from there on: {asked}"


def _slope(closing: Table) -> float:
    """Return how much the wall moves per length between the last two rows."""
    if len(closing.values) == 1:
        return 0.0
    (*_, above, last), (*_, before, end) = closing.values, closing.arguments
    return (last - above) / (end - before)


def _mm(value: float) -> str:
    return f"{1e3 * value:.6g} mm"


def _closure(profile: TaperProfile, start: float, length: float) -> float:
    """Return the largest closing (w_in - w_out) / w_out at any position, negative: opening."""
    positions = [z for z in profile.knots() if z < length] + [length]
    closed = [start / profile.half(z, start) - 1.0 for z in positions]
    return max(closed, key=abs)


def _half(section: Section, face: str) -> float:
    """Return half the dimension that a face's taper governs; the smaller one if it is both, m."""
    width, height = section.outline()
    assert width is not None and height is not None, "the case has been checked"
    return 0.5 * {"narrow_face": width, "wide_face": height}.get(face, min(width, height))
