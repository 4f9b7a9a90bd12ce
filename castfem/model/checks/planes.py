"""Checks of the constraints on the planes of the slice, also of a strand bent by its machine."""

from __future__ import annotations

from castfem.base.tables import Table
from castfem.base.units import in_mm
from castfem.model.base import Faults
from castfem.model.case import Case
from castfem.model.checks.cooling import unknown_groups
from castfem.model.checks.registry import check, given
from castfem.model.machine import thickness_of
from castfem.model.mechanics import (
    FREE,
    GeneralizedPlaneStrain,
    GivenDisplacement,
    axis_position,
    places_of,
)
from castfem.model.section import Strip

# Keys of a strand bent by its machine, with the value that means the same as leaving the key out (a
# file that extends another one cannot remove a key).
_ITS_OWN = {"neutral_axis": FREE, "closing": "tangential", "force_contains_bending": False}
_IMPOSED = ("a1", "a2", "across", "moment_x", "moment_y")


@check()
def _strained(case: Case, _: object) -> Faults:
    if case.mould is not None and case.mechanics is None:
        yield "mould", "needs the table [mechanics]: contact needs the deformed slice"


@check("mechanics.held.*")
def _held(case: Case, held: GivenDisplacement) -> Faults:
    yield from unknown_groups(held.on, case.section.outer_groups())


@check("mechanics.planes")
def _exists(case: Case, planes: GeneralizedPlaneStrain) -> Faults:
    """Report generalized strains and moments that the section does not have."""
    if planes.across is not None and not isinstance(case.section, Strip):
        yield "across", "is for a strip; other sections widen by their displacements"
    for strain, moment, mirror, enough in (
        ("a1", "moment_x", "x = 0", '"whole"'),
        ("a2", "moment_y", "y = 0", '"half" or "whole"'),
    ):
        for name in (strain, moment) if strain in case.section.barred() else ():
            if getattr(planes, name) not in (None, 0.0):
                fix = f"leave it out, or give section.symmetry = {enough}"
                yield name, f"the section is mirrored at {mirror}; {fix}"


@check("mechanics.planes")
def _thinned(case: Case, planes: GeneralizedPlaneStrain) -> Faults:
    values = planes.a0.values if isinstance(planes.a0, Table) else (planes.a0,)
    least = min((v for v in values if isinstance(v, float)), default=0.0)
    if least <= -1.0:
        yield "a0", f"({least:g}) leaves the slice no thickness: it is the axial strain, above -1"


@check("mechanics.planes")
def _not_bent(case: Case, planes: GeneralizedPlaneStrain) -> Faults:
    """Report keys that need a machine that bends the strand where there is none."""
    if isinstance(case.section, Strip) or case.bends:
        return
    if case.machine is not None and case.machine.pairs() is None:
        return
    for key, as_without in _ITS_OWN.items():
        if getattr(planes, key) not in (None, as_without):
            as_left_out = str(as_without).lower() if as_without is False else f'"{as_without}"'
            fix = f"give the rolls of [machine] a radius, or {key} = {as_left_out}"
            yield key, f"is for a strand that its machine bends; {fix}"


@check("mechanics.planes")
def _bent(case: Case, planes: GeneralizedPlaneStrain) -> Faults:
    """Report keys that contradict a machine that bends the strand."""
    if isinstance(case.section, Strip) or not case.bends:
        return
    if "a2" in case.section.barred():
        fix = 'the rolls of [machine] bend it there; give symmetry = "half" or "whole"'
        yield "/section.symmetry", f'("quarter") mirrors the strand at y = 0: {fix}'
        return
    names = [name for name in _IMPOSED if getattr(planes, name) not in (None, 0.0)]
    for name in [*(["a0"] if planes.a0 not in (None, FREE) else []), *names]:
        why = "the rolls of [machine] impose the curvature, equilibrium the rest"
        yield name, f"is not free to be given: {why}; leave it out"
    if planes.neutral_axis in (None, FREE):
        yield from _work(planes)
    else:
        yield from _axis(planes, thickness_of(case.section) or 0.0)


def _axis(planes: GeneralizedPlaneStrain, thickness: float) -> Faults:
    """Report a neutral axis outside the strand, or combined with a prescribed force."""
    most = in_mm(0.5 * thickness)
    for place in places_of(planes.neutral_axis):
        axis = axis_position(place, thickness) or 0.0
        if abs(axis) > 0.5 * thickness:
            fix = f"from -{most} (extrados) to {most} (intrados)"
            yield "neutral_axis", f"({in_mm(axis)}) lies outside of the strand; {fix}"
    for name in ("force", "closing", "force_contains_bending"):
        if getattr(planes, name) not in (None, 0.0, _ITS_OWN.get(name)):
            fix = f'leave it out, or give neutral_axis = "{FREE}"'
            yield name, f"has no effect where the neutral axis is imposed; {fix}"


def _work(planes: GeneralizedPlaneStrain) -> Faults:
    """Report bending work that would be counted twice or not at all."""
    key = "force_contains_bending"
    over_position = isinstance(planes.force, Table) and planes.force.over == "position"
    if planes.closing == "axial":
        if planes.force_contains_bending:
            yield (
                key,
                'says what closing = "tangential" does with the force; leave one of the two out',
            )
    elif over_position and not given(planes, key):
        fix = "which has the work of bending in it, else false"
        yield key, f"is missing; true for a measured or maker's curve, {fix}"
