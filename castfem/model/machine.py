"""The table [machine]: the rolls that guide the strand below its mould.

`castfem.physics.machine.rolls`, which reads and checks them, is only imported by cases with rolls.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from castfem.base.quantities import Length, Notation
from castfem.base.table_notation import schema_of_columns
from castfem.model.base import FaultyError, TableModel
from castfem.model.checks import Faults, caution, check
from castfem.model.defects import Defect, RollDefect, at_an_end, with_defects
from castfem.model.extraction import Extraction
from castfem.model.section import Rectangle, Strip

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.physics.machine.rolls import Fault, Rolls


@dataclass(frozen=True, slots=True)
class RollTable(Notation):
    """Annotation of a field that takes rolls: a CSV file, or columns."""

    takes: str = 'CSV file: `"rolls.csv"`, or its columns'

    def read(self, given: object) -> Rolls | None:
        """Return the rolls, or raise ValueError."""
        from castfem.physics.machine.rolls import Rolls, read_rolls

        if given is None or isinstance(given, Rolls):
            return given
        if isinstance(given, str):
            given = {"file": given}
        if not isinstance(given, Mapping):
            raise ValueError('the rolls of a machine are a file, rolls = "rolls.csv", or columns')
        return read_rolls(given)

    def write(self, value: Rolls | None) -> Any:
        """Return what reads back to the same rolls."""
        from castfem.physics.machine.rolls import columns_of

        return None if value is None else columns_of(value)

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        from castfem.physics.machine.rolls import COLUMNS, KINDS

        ways = schema_of_columns(
            COLUMNS,
            [f"{name}_unit" for name in COLUMNS if name not in ("driven", "side")],
            needed=[name for name in KINDS if name in ("position", "diameter")],
            cells=("number", "string", "boolean"),
        )
        return {"anyOf": [{"type": "string"}, *ways], "description": "rolls, from a file"}


class RollSegment(TableModel):
    """Pairs of rolls with the same pitch and diameter."""

    rolls: int = Field(ge=1, strict=True, examples=[8])
    """number of pairs"""
    pitch: Length = Field(examples=["250 mm"])
    """distance along the strand between neighbouring pairs"""
    diameter: Length = Field(examples=["215 mm"])
    """diameter of the rolls"""
    radius: Length | None = Field(None, examples=["8 m"])
    """radius of the strand at the last pair; 1/R is linear from the previous segment; left out:
    straight"""
    aperture: Length | None = Field(None, examples=["222 mm"])
    """distance between the rolls of a pair; by default the section's height"""


class Machine(TableModel):
    """The rolls below the mould, which bend and straighten the strand: `rolls` or `segment`."""

    rolls: Annotated[Any, RollTable()] = None
    """table of the pairs (docs/machine.md)"""
    first: Length | None = Field(None, examples=["900 mm"])
    """with segments: position of the first pair, from the meniscus"""
    radius_of: Literal["extrados", "centreline", "intrados"] = "extrados"
    """with segments: the face whose radius is given"""
    segment: tuple[RollSegment, ...] = ()
    """pairs with the same pitch and diameter"""
    extraction: Extraction | None = None
    """resistance of the rolls, shared by the drives; left out: none"""

    defect: tuple[Defect, ...] | None = None
    """defects of the machine; left out: none"""

    def pairs(self) -> Rolls | None:
        """Return the rolls with their defects; None while data needed for them are missing."""
        rolls = self.normal()
        if rolls is None or not self.defect:
            return rolls
        return with_defects(rolls, self.defect)

    def normal(self) -> Rolls | None:
        """Return the rolls without defects; None while data needed for them are missing."""
        if self.rolls is not None or not self.segment or self.first is None:
            found: Rolls | None = self.rolls
            return found
        from castfem.physics.machine.rolls import Segment, expand

        parts = [
            Segment(s.rolls, s.pitch, s.diameter, s.radius or math.inf, s.aperture)
            for s in self.segment
        ]
        return expand(parts, self.first, self.radius_of)


def thickness_of(section: Any) -> float | None:
    """Return the size of a section from extrados to intrados, m; None if it has none."""
    for key in ("height", "diameter"):
        if getattr(section, key, None) is not None:
            return float(getattr(section, key))
    return None


@check("machine")
def _has_rolls(case: Case, table: Machine) -> Faults:
    if table.rolls is None and not table.segment:
        yield "", 'has no rolls; rolls = "rolls.csv", or first = "900 mm" and [[machine.segment]]'
    elif table.rolls is not None and table.segment:
        yield "", "rolls and segment exclude each other; give one of the two"
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
        other = f"a {case.section.tag} has no narrow faces that rolls could support"
        yield _key(table), f"{rolls.edges.place(0)}: {other}; leave out the rows of side narrow"
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
            of = f"of a section {1e3 * size:g} mm {how}"
            yield f"{rolls.place(i)}: aperture ({1e3 * aperture:g} mm) {of}"
            return
