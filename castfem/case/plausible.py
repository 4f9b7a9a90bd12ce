"""What may be meant but seldom is: values of a sound case that look like slips.

A case with them runs; the bounds lie beyond what strands are cast with, not beyond what can be
computed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from castfem.case.model import Case
from castfem.case.mould import Mould
from castfem.case.problems import Problem
from castfem.mould.taper import Course
from castfem.units import convert

_FASTEST = 20.0 / 60.0  # m/s; billets are cast at some 6 m/min, thin slabs at some 8
_CLOSED = 0.07  # of the section, beyond what cases made to be extreme have (10 %/m over 0.6 m)
_USUAL_TAPER = 0.03  # 1/m, single
_ROUGHEST = 2.0  # friction coefficient


def doubts(case: Case) -> Iterator[Problem]:
    """Yield what a sound case has that was probably not meant."""
    speed = case.casting.speed
    if speed > _FASTEST:
        yield Problem(
            ("casting", "speed"),
            f"({convert(speed, 'm/s', 'm/min'):.4g} m/min) is far beyond what strands are cast at; "
            "are number and unit right?",
        )
    if case.mould is not None:
        yield from _taper(case.mould, case.section)
        yield from _friction(case.mould)


def _taper(mould: Mould, section: Any) -> Iterator[Problem]:
    """Yield the tapers that close or open the mould by much more than a strand shrinks."""
    for name, given in mould.taper.parts.items():
        closed = _closing(given.course(mould.length), _half(section, name), mould.length)
        if abs(closed) <= _CLOSED:
            continue
        part = "" if name == "face" else f"{name}: "
        how = "closes" if closed > 0.0 else "opens"
        near = ""
        if len(given.stretches) == 1:
            tenth = 0.1 * given.stretches[0].mean
            single = given.stretches[0].top == given.stretches[0].bottom
            if single and abs(tenth) <= _USUAL_TAPER:
                near = f"; did you mean {100.0 * tenth:.3g} %/m?"
        yield Problem(
            ("mould", "taper"), f"{part}the mould {how} by {100.0 * abs(closed):.3g} %{near}"
        )


def _closing(course: Course, start: float, length: float) -> float:
    """Return the largest closing (w_in - w_out) / w_out at any position, negative: opening."""
    positions = [z for z in course.knots() if z < length] + [length]
    closed = [start / course.half(z, start) - 1.0 for z in positions]
    return max(closed, key=abs)


def _half(section: Any, face: str) -> float:
    """Return half the dimension that a face's taper governs; the smaller one if it is both, m."""
    sizes = {"narrow_face": ("width",), "wide_face": ("height",)}.get(face, ("width", "height"))
    diameter = getattr(section, "diameter", None)
    found = [getattr(section, name) for name in sizes] if diameter is None else [diameter]
    return 0.5 * float(min(found))


def _friction(mould: Mould) -> Iterator[Problem]:
    coefficient = getattr(mould.friction, "coefficient", 0.0)
    if coefficient > _ROUGHEST:
        near = f"; did you mean {0.01 * coefficient:.3g}?" if 5.0 <= coefficient <= 100.0 else ""
        yield Problem(
            ("mould", "friction", "coefficient"),
            f"({coefficient:g}) is more than {_ROUGHEST:g} times the pressure{near}",
        )
