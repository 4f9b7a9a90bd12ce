"""What a strand that its machine bends may be, and how its planes may be constrained."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from castfem.base.tables import Table
from castfem.base.units import in_mm
from castfem.model.case import Case
from castfem.model.machine import thickness_of
from castfem.model.mechanics import AXES, FREE, GeneralizedPlaneStrain
from castfem.model.problems import Problem
from castfem.model.section import Strip

_PATH = ("mechanics", "planes")
# Keys of a bent strand, and what in them is the same as to leave them out, which a file that
# extends another one cannot do.
_ITS_OWN = {"neutral_axis": FREE, "closing": "tangential", "force_contains_bending": False}
_IMPOSED = ("a1", "a2", "across", "moment_x", "moment_y")


def axis_position(given: Any, thickness: float) -> float | None:
    """Return where an imposed neutral axis lies, m from the middle inwards; None if it is free."""
    if given is None or given == FREE:
        return None
    return AXES[given] * thickness if isinstance(given, str) else float(given)


def places_of(given: Any) -> tuple[Any, ...]:
    """Return the place of a neutral axis as a case has it, or both of a table."""
    return tuple(given.values()) if isinstance(given, Mapping) else (given,)


def check_bending(case: Case) -> Iterator[Problem]:
    """Yield what does not go with a machine that bends the strand, or goes with such a one alone.

    Of a faulty case it yields what can be told.
    """
    planes = None if case.mechanics is None else case.mechanics.planes
    if planes is None or case.section is None or isinstance(case.section, Strip):
        return
    machine = case.machine
    if machine is None and "machine" in case.model_fields_set:
        return  # a faulty one
    if not case.bends:
        if machine is not None and machine.pairs() is None:
            return
        for key, as_without in _ITS_OWN.items():
            if getattr(planes, key) not in (None, as_without):
                yield Problem(
                    (*_PATH, key),
                    "is for a strand that its machine bends; give the rolls of [machine] a radius, "
                    "or leave it out",
                )
        return
    if "a2" in case.section.barred():
        yield Problem(
            ("section", "symmetry"),
            '("quarter") mirrors the strand at y = 0, which the rolls of [machine] bend: intrados '
            'and extrados differ; give symmetry = "half" or "whole"',
        )
        return
    yield from _imposed(planes)
    yield from _axis(planes, thickness_of(case.section))
    yield from _work(planes)


def _imposed(planes: GeneralizedPlaneStrain) -> Iterator[Problem]:
    """Yield generalized strains that the rolls impose."""
    names = [n for n in _IMPOSED if getattr(planes, n) not in (None, 0.0)]
    if planes.a0 not in (None, FREE):
        names.insert(0, "a0")
    for name in names:
        yield Problem(
            (*_PATH, name),
            "is not free to be given: the rolls of [machine] impose the curvature, equilibrium or "
            "neutral_axis finds the rest; leave it out",
        )


def _axis(planes: GeneralizedPlaneStrain, thickness: float | None) -> Iterator[Problem]:
    """Yield a neutral axis that lies outside of the strand, or beside a force."""
    if thickness is None:
        return
    given = planes.neutral_axis
    axes = [axis_position(place, thickness) for place in places_of(given)]
    if None in axes:
        return
    for axis in (a for a in axes if a is not None and abs(a) > 0.5 * thickness):
        most = in_mm(0.5 * thickness)
        yield Problem(
            (*_PATH, "neutral_axis"),
            f"({in_mm(axis)}) lies outside of the strand; from -{most} (extrados) to "
            f"{most} (intrados)",
        )
    for name in ("force", "closing", "force_contains_bending"):
        if getattr(planes, name) not in (None, 0.0, _ITS_OWN.get(name)):
            yield Problem(
                (*_PATH, name),
                "has no effect where the neutral axis is imposed, nothing balances it; leave it "
                f'out, or give neutral_axis = "{FREE}"',
            )


def _work(planes: GeneralizedPlaneStrain) -> Iterator[Problem]:
    """Yield work of bending that would be counted twice, or never was."""
    key = "force_contains_bending"
    if planes.neutral_axis not in (None, FREE):
        return
    if planes.closing == "axial":
        if planes.force_contains_bending:
            yield Problem(
                (*_PATH, key),
                'tells what closing = "tangential" does with the force; leave one of the two out',
            )
        return
    along = isinstance(planes.force, Table) and planes.force.over == "position"
    if along and key not in planes.model_fields_set:
        yield Problem(
            (*_PATH, key),
            "is missing; true for a measured or maker's curve of the effort, which has the work of "
            "bending in it, false for a sum of resistances and drives without it",
        )
