"""What may be meant but seldom is: values of a sound case that look like slips.

A case with them runs; the bounds lie beyond what strands are cast with, not beyond what can be
computed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from castfem.case.checks import law_groups
from castfem.case.cooling import Contact, Convection, HeatLaw, Radiation, Zone
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
    start = 0.0
    for index, zone in enumerate(case.cooling):
        yield from _wasted(case, zone, ("cooling", index))
        if case.mould is not None and start < case.mould.length:
            yield from _fixed(case, zone, ("cooling", index))
        start = case.casting.length if zone.to is None else zone.to


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


def _wasted(case: Case, zone: Zone, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield radiation and convection beside contact that has no gap for them to cross."""
    touching: set[str] = set()
    for law in zone.surface:
        if isinstance(law, Contact) and (law.gap == 0.0 or (law.gap is None and not case.mould)):
            touching |= law_groups(case.section, law)
    for index, law in enumerate(zone.surface):
        if isinstance(law, Radiation | Convection) and touching & law_groups(case.section, law):
            yield Problem(
                (*path, "surface", index),
                f"{law.law} has no effect beside contact without a gap: where the strand touches "
                "there is contact alone (eq. 35); what is meant as a mean of both is convection "
                "with a mean coefficient",
            )


def _fixed(case: Case, zone: Zone, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield heat in the mould that the gap which opens there does not change."""
    following = [law for law in zone.surface if isinstance(law, Contact) and law.gap is None]
    met = {group for law in following for group in law_groups(case.section, law)}
    for index, law in enumerate(zone.surface):
        if law in following or _crosses(law, law_groups(case.section, law), met):
            continue
        own = "contact with a gap of its own" if isinstance(law, Contact) else f"a given {law.law}"
        yield Problem(
            (*path, "surface", index),
            f"{_OF_LAW.get(law.law, own)} is not changed by the gap that opens in the mould; heat "
            'that is to follow it is law = "contact" without the key gap',
        )


_OF_LAW = {"spray": "a spray", "radiation": "radiation", "convection": "convection"}


def _crosses(law: HeatLaw, groups: set[str], met: set[str]) -> bool:
    """Return whether a law crosses the gap of contact wherever it holds."""
    return isinstance(law, Radiation | Convection) and groups <= met
