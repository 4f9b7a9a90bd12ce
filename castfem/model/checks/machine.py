"""Checks of [machine] and its defects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from castfem.model.base import Faults, FaultyError
from castfem.model.checks.registry import caution, check
from castfem.model.defects import Defect, Lost, Misaligned, RollDefect, with_defects
from castfem.model.machine import Machine, thickness_of
from castfem.model.section import Rectangle, Strip

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.physics.machine.rolls import Fault, Rolls


@check("machine")
def _has_rolls(case: Case, table: Machine) -> Faults:
    if table.rolls is None and not table.segment:
        yield "", 'has no rolls; rolls = "rolls.csv", or first = "900 mm" and [[machine.segment]]'
    elif table.rolls is not None and table.segment:
        yield "rolls+segment", "rolls and segment exclude each other; give one of the two"
    elif table.segment and table.first is None:
        fix = 'where the first pair of the segments stands, such as "900 mm"'
        yield "first", f"is missing; {fix}"


@check("machine")
def _holds(case: Case, table: Machine) -> Faults:
    """Report rolls that cannot guide the strand."""
    if isinstance(case.section, Strip):
        yield "", "a strip has no thickness that rolls could hold; leave it out"
    thickness, rolls = thickness_of(case.section), table.normal()
    if thickness is None or rolls is None or (table.rolls is not None and table.segment):
        return
    from castfem.physics.machine.rolls import faults

    try:
        ends = case.mould_exit()
    except FaultyError:
        ends = None
    found = list(faults(rolls, thickness, ends))
    for text in _together(rolls, found):
        yield _key(table), text
    width = case.section.outline()[0]
    if rolls.edges is not None and not isinstance(case.section, Rectangle):
        text = f'only a section of shape "rectangle" has rolls there, not a "{case.section.tag}"'
        yield _key(table), f"{rolls.edges.place(0)}: {text}; leave out the rows of side narrow"
    elif rolls.edges is not None and width is not None:
        edges = list(faults(rolls.edges, width, ends, "narrow face"))
        yield from ((_key(table), text) for text in _together(rolls.edges, edges))
    if table.defect and not found:
        yield from at_an_end(case, table, rolls)
        yield from _impossible_defects(rolls, table.defect, thickness)


def _key(table: Machine) -> str:
    return "rolls" if table.rolls is not None else "segment"


def _together(rolls: Rolls, found: Sequence[Fault]) -> Iterator[str]:
    """Yield faults as text; of each kind the first few, and how many there are."""
    # number of faults of a kind that are reported one by one
    kinds, each = [fault.kind for fault in found], 3
    for i, fault in enumerate(found):
        count = kinds.count(fault.kind)
        if count <= each or fault.kind not in kinds[:i]:
            more = f" (and {count - 1} more like it)" if count > each else ""
            yield f"{rolls.place(fault.index)}: {fault.text}{more}"


def _impossible_defects(rolls: Rolls, defects: Sequence[Defect], thickness: float) -> Faults:
    """Report defects that leave other rolls no room, each with the first such roll."""
    from castfem.physics.machine.rolls import faults

    alone = False
    for i, defect in enumerate(defects):
        wrong = next(faults(with_defects(rolls, [defect]), thickness, None), None)
        if wrong is not None:
            alone = True
            yield f"defect.{i}", _no_room(rolls, [defect], wrong)
    wrong = next(faults(with_defects(rolls, defects), thickness, None), None)
    if wrong is not None and not alone:
        yield "defect", _no_room(rolls, defects, wrong)


def _no_room(rolls: Rolls, defects: Sequence[Defect], wrong: Fault) -> str:
    """Faults of the rolls including their defects, as text."""
    named = " and ".join(dict.fromkeys(str(defect) for defect in defects))
    where, what = rolls.place(wrong.index), wrong.text.rpartition("; ")[0]
    return f"with {named} the strand is bent too sharply: {where}: {what}; move it less"


@caution("machine")
def machine_warnings(case: Case, table: Machine) -> Faults:
    """Report unusual rolls of a sound case."""
    thickness, normal, rolls = thickness_of(case.section), table.normal(), table.pairs()
    if normal is None or rolls is None or thickness is None:
        return
    found = list(_doubtful(normal, thickness))
    yield from ((_key(table), text) for text in found)
    if not found and table.defect:
        of_rolls = [one for one in table.defect if isinstance(one, RollDefect)]
        named = " and ".join(dict.fromkeys(str(one).rstrip(",") for one in of_rolls))
        for text in _doubtful(rolls, thickness):
            yield "defect", f"with {named}: {text.partition('; ')[0]}"


@caution("machine")
def _edge_rolls(case: Case, table: Machine) -> Faults:
    """Report rolls at the narrow faces that do not fit the width, or that carry no load."""
    rolls = table.normal()
    bulging = None if case.mechanics is None else case.mechanics.bulging
    if rolls is None or rolls.edges is None:
        return
    width = case.section.outline()[0]
    if width is not None:
        yield from ((_key(table), text) for text in _far(rolls.edges, width, "wide"))
    if case.mechanics is None:
        return
    if bulging is None or not bulging.bears:
        fix = 'mechanics.bulging = "creep" has faces supported by rolls'
        yield _key(table), f"the rolls at the narrow faces carry no load; {fix}"


@caution("machine")
def _ends_above(case: Case, table: Machine) -> Faults:
    """Report a bulging strand that is followed by more than a pitch below its last roll."""
    bulging = None if case.mechanics is None else case.mechanics.bulging
    rolls = table.pairs()
    if rolls is None or bulging is None or not bulging.bears or len(rolls.there) < 2:
        return
    above, last = (rolls.pairs[i].position for i in rolls.there[-2:])
    if case.casting.length > last + (last - above):
        yield (
            "/casting.length",
            f"({case.casting.length:.4g} m) goes beyond the last roll, at {last:.4g} m: "
            "nothing bulges there, and a strand that is still liquid would not break out; give the "
            "rolls that hold it, or follow it to the last one",
        )


def _doubtful(rolls: Rolls, thickness: float) -> Iterator[str]:
    """Report unusual properties of the rolls."""
    line, last = rolls.line(thickness), rolls.pairs[-1]
    angle = line.inclination(last.position)
    if math.isfinite(last.radius):
        yield f"the strand is still bent at the last roll, R = {last.radius:g} m"
    elif angle > 0.0 and abs(angle - 0.5 * math.pi) > math.radians(0.1):
        yield (
            f"the angles do not close: the strand leaves the last bent roll at "
            f"{math.degrees(angle):.4g} degrees to the vertical, not at 90; are radii, positions "
            "and the face of the radii right?"
        )
    tightest = min(rolls.pairs, key=lambda pair: abs(pair.radius))
    strain = 0.5 * thickness / abs(tightest.radius)
    if strain > 0.05:
        strained = f"strains the faces of the strand by {100.0 * strain:.3g} %"
        yield f"{rolls.place(rolls.pairs.index(tightest))}: R = {tightest.radius:g} m {strained}"
    yield from _far(rolls, thickness, "thick")


def _far(rolls: Rolls, size: float, how: str) -> Iterator[str]:
    """Report the first aperture that differs by more than a tenth from the section's size."""
    for i in range(len(rolls.pairs)):
        aperture = rolls.aperture(i, size)
        if abs(aperture / size - 1.0) > 0.1:
            of = f"of a section {1e3 * size:g} mm {how}; is one of the two wrong?"
            yield f"{rolls.place(i)}: aperture ({1e3 * aperture:g} mm) {of}"
            return


@check("machine.defect.*")
def _of_machine(case: Case, defect: Defect) -> Faults:
    machine = case.machine
    normal = None if machine is None else machine.normal()
    circuits = () if case.secondary is None else case.secondary.circuit
    if machine is not None and normal is not None:
        yield from defect.problems(machine, circuits, len(normal.pairs))


@check("machine")
def _repeated(case: Case, table: Machine) -> Faults:
    defects = table.defect or ()
    lost = {one.roll for one in defects if isinstance(one, Lost)}
    for i, defect in enumerate(defects):
        if defect in defects[:i]:
            yield f"defect.{i}", "appears twice; leave one of the two out"
        if isinstance(defect, RollDefect) and not isinstance(defect, Lost) and defect.roll in lost:
            fix = "leave one of the two out"
            yield f"defect.{i}.roll", f"({defect.roll}): this pair is also missing; {fix}"


def at_an_end(case: Case, table: Machine, normal: Rolls) -> Faults:
    """Report defects of the first and last pair that need another pair beyond them."""
    defects = table.defect or ()
    rolls = with_defects(normal, defects)
    if len(rolls.there) < 2:
        yield "defect", "leave fewer than two pairs that hold the strand"
        return
    bulging = None if case.mechanics is None else case.mechanics.bulging
    ends = {rolls.there[0]: "above", rolls.there[-1]: "below"}
    for i, defect in enumerate(defects):
        if not isinstance(defect, RollDefect):
            continue
        index = defect.roll - 1
        if isinstance(defect, Misaligned) and index in ends and defect.by:
            text = f"({defect.roll}): no pair {ends[index]} it, and the strand is bent between"
            yield f"defect.{i}.roll", f"{text} three (329); only one between others can be off"
        elif isinstance(defect, Lost) and index < rolls.there[0] and bulging and bulging.bears:
            text = f"({defect.roll}): above the first pair the mould holds the faces"
            yield f"defect.{i}.roll", f"{text}; leave it in, or leave mechanics.bulging out"
