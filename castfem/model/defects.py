"""The array of tables [[machine.defect]]: what is wrong with the rolls of a machine (VI.4).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from castfem.base.quantities import Kind
from castfem.model.base import Variants
from castfem.model.checks import Faults, check
from castfem.model.extraction import COUPLED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from castfem.base.types import Array
    from castfem.model.case import Case
    from castfem.model.machine import Machine
    from castfem.physics.machine.rolls import Pair, Rolls
    from castfem.physics.machine.sprays import Row

Offset = Annotated[float, Kind("m", "mm", label="distance", sample="2 mm")]
WaterShare = Annotated[  # no nozzle has ten times its water: 66 is meant as 66 percent
    float, Kind("1", "percent", least=0.0, most=10.0, label="share", sample="66 percent")
]
ExtraForce = Annotated[float, Kind("N", "kN", least=0.0, label="force", sample="120 kN")]


class Defect(Variants):
    """What every kind of defect has; a new one is a subclass with its own `kind`.

    It says what becomes of the rolls, of what they resist, of the rows of nozzles: what it leaves
    alone it need not name.
    """

    tag_key = "kind"
    kinds: ClassVar[dict[str, Any]] = {}

    def on(self, pairs: list[Pair]) -> None:
        """Change the pairs that have the defect; values missing in a faulty case stay."""

    def watered(self, rows: tuple[Row, ...]) -> tuple[Row, ...]:
        """Return the rows of nozzles."""
        return rows

    def problems(self, case: Case, pairs: int) -> Faults:
        """Yield key and fault of a defect that a machine with so many pairs cannot have."""
        yield from ()

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the resistance of each pair (n,), N, out of that of a maker's curve.

        Args:
            steps: Without this defect (n,), N.
            normal: The rolls without defects.
            rolls: With all of them.
            sliding: What a locked roll resists with, over what one that turns does.
        """
        return steps


class RollDefect(Defect):
    """A defect of one pair."""

    roll: int = Field(ge=1, strict=True, examples=[48])
    """number of the pair, from 1"""

    def __str__(self) -> str:
        """What messages call it."""
        return f"roll {self.roll}, {self.tag},"

    @abstractmethod
    def changed(self, pair: Pair) -> Pair:
        """Return the pair that has the defect."""

    def on(self, pairs: list[Pair]) -> None:
        """See `Defect`."""
        if self.roll <= len(pairs):
            pairs[self.roll - 1] = self.changed(pairs[self.roll - 1])

    def problems(self, case: Case, pairs: int) -> Faults:
        """See `Defect`."""
        if self.roll > pairs:
            yield "roll", f"({self.roll}): the machine has {pairs} pairs, numbered from 1"


class Locked(RollDefect):
    """A pair that does not turn: the strand slides on it, and it draws no more (eq. 327)."""

    kind: Literal["locked"]

    def changed(self, pair: Pair) -> Pair:
        """See `RollDefect`."""
        return replace(pair, locked=True)

    def problems(self, case: Case, pairs: int) -> Faults:
        """See `Defect`."""
        yield from super().problems(case, pairs)
        if case.machine is not None and case.machine.extraction is None:
            fix = "add it, or leave the defect out"
            yield "kind", f'("locked") has no effect without [machine.extraction]; {fix}'

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the steps of resistance, that of this pair times the factor (328)."""
        found = steps.copy()
        found[self.roll - 1] *= sliding
        return found


class Misaligned(RollDefect):
    """A pair that is off: the strand is bent there and back, with new radii (eq. 329)."""

    kind: Literal["misaligned"]
    by: Offset = Field(examples=["2 mm"])
    """distance towards the centre of curvature; negative: away from it"""
    resistance: ExtraForce | None = None
    """what a maker's curve of the resistance grows by, as a coupled run tells it, over the pairs
    where the strand is bent more than before; left out: nothing"""

    def __str__(self) -> str:
        """What messages call it."""
        return f"roll {self.roll} off by {1e3 * self.by:g} mm"

    def changed(self, pair: Pair) -> Pair:
        """See `RollDefect`."""
        return replace(pair, offset=pair.offset + self.by)

    def problems(self, case: Case, pairs: int) -> Faults:
        """See `Defect`."""
        yield from super().problems(case, pairs)
        machine = case.machine
        if machine is None:
            return
        normal = machine.normal()
        if normal is not None and self.roll <= pairs:
            yield from self._far_off(normal)
        if self.resistance is None:
            return
        if machine.extraction is None or machine.extraction.resistance == COUPLED:
            what = "a maker's curve, machine.extraction.resistance"
            yield "resistance", f"has no effect without {what}, to be added to; leave it out"

    def _far_off(self, normal: Rolls) -> Faults:
        """Yield a pair that is farther off than a strand would follow, or (329) holds."""
        places = [pair.position for pair in normal.pairs[max(self.roll - 2, 0) : self.roll + 1]]
        pitch = min((b - a for a, b in pairwise(places)), default=math.inf)
        if abs(self.by) > 0.1 * pitch:
            most = f"more than 0.1 of the {1e3 * pitch:.4g} mm to the next pair"
            yield "by", f"({1e3 * self.by:g} mm): by {most} roll {self.roll} cannot be off"

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the steps with the extra resistance, shared as the extra bending is."""
        import numpy as np

        bends = [
            np.abs(np.diff([1.0 / pair.radius for pair in these.pairs], prepend=0.0))
            for these in (rolls, normal)
        ]
        more = np.maximum(bends[0] - bends[1], 0.0)
        near = np.abs(np.arange(len(more)) - self.roll) <= 2  # from its pair above to two below
        more = np.where(near, more, 0.0)
        total = float(more.sum())
        return steps if total == 0.0 else steps + (self.resistance or 0.0) * more / total


class Lost(RollDefect):
    """A pair that is not there: those beside it hold the strand, and carry what it did."""

    kind: Literal["lost"]

    def changed(self, pair: Pair) -> Pair:
        """See `RollDefect`."""
        return replace(pair, lost=True)

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the steps with that of the pair on those beside it."""
        found, i = steps.copy(), self.roll - 1
        above, below = ([j for j in rolls.there if (j > i) == later] for later in (False, True))
        taking = above[-1:] + below[:1]
        for j in taking:
            found[j] += found[i] / len(taking)
        found[i] = 0.0
        return found


class Nozzles(Defect):
    """Nozzles of a circuit that bring less, or more, water than they are meant to (VI.4.1)."""

    kind: Literal["nozzles"]
    circuit: str = Field(examples=["bender"])
    """name of the circuit of [secondary]"""
    rolls: tuple[int, int] = Field(examples=[[47, 52]])
    """numbers of the roll above the first row of nozzles and of that below the last"""
    share: WaterShare = Field(examples=["66 percent"])
    """of their water"""

    def __str__(self) -> str:
        """What messages call it."""
        between = f"from roll {self.rolls[0]} to {self.rolls[1]}"
        return f'nozzles of "{self.circuit}" {between} with {100.0 * self.share:g} % of their water'

    @property
    def water(self) -> str:
        """How much of it there is, and where, in words."""
        share = f"{100.0 * self.share:g} % of the water"
        return f"{share} from roll {self.rolls[0]} to {self.rolls[1]}"

    def watered(self, rows: tuple[Row, ...]) -> tuple[Row, ...]:
        """See `Defect`."""
        from castfem.physics.machine.sprays import scale_water

        return scale_water(rows, self.circuit, *self.rolls, self.share)

    def problems(self, case: Case, pairs: int) -> Faults:
        """See `Defect`."""
        circuits = () if case.secondary is None else case.secondary.circuit
        found = [circuit for circuit in circuits if circuit.name == self.circuit]
        if not found:
            known = ", ".join(f'"{circuit.name}"' for circuit in circuits) or "no [secondary]"
            yield "circuit", f'("{self.circuit}") is not there; the case has {known}'
            return
        first, last = max(self.rolls[0], found[0].rolls[0]), min(self.rolls[1], found[0].rolls[1])
        if first >= last:
            text = f"(from {self.rolls[0]} to {self.rolls[1]}) meet no nozzles of"
            ends = f"which goes from roll {found[0].rolls[0]} to {found[0].rolls[1]}"
            yield "rolls", f'{text} "{self.circuit}", {ends}'


def with_defects(rolls: Rolls, defects: Sequence[Defect]) -> Rolls:
    """Return the rolls with their defects."""
    from castfem.physics.machine.defects import with_radii

    pairs = list(rolls.pairs)
    for defect in defects:
        defect.on(pairs)
    return with_radii(replace(rolls, pairs=tuple(pairs)))


@check("machine.defect.*")
def _of_machine(case: Case, defect: Defect) -> Faults:
    normal = None if case.machine is None else case.machine.normal()
    if normal is not None:
        yield from defect.problems(case, len(normal.pairs))


@check("machine")
def _repeated(case: Case, table: Machine) -> Faults:
    defects = table.defect or ()
    lost = {one.roll for one in defects if isinstance(one, Lost)}
    for i, defect in enumerate(defects):
        if defect in defects[:i]:
            yield f"defect.{i}", "appears twice; leave one of the two out"
        if isinstance(defect, RollDefect) and not isinstance(defect, Lost) and defect.roll in lost:
            fix = "leave one of the two out"
            yield f"defect.{i}.roll", f"({defect.roll}): this pair is lost as well; {fix}"


def at_an_end(case: Case, table: Machine, normal: Rolls) -> Faults:
    """Yield defects of the first and last pair that want another pair beyond them."""
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
