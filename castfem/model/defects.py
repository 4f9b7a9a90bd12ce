"""The array of tables [[machine.defect]]: defects of the rolls and nozzles (VI.4).

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
from castfem.model.base import Faults, Variants

if TYPE_CHECKING:
    from collections.abc import Sequence

    from castfem.base.types import Array
    from castfem.model.machine import Machine
    from castfem.model.secondary import Circuit
    from castfem.physics.machine.rolls import Pair, Rolls
    from castfem.physics.machine.spray_layout import Row

Offset = Annotated[float, Kind("m", "mm", label="distance", sample="2 mm")]
WaterShare = Annotated[  # no nozzle has ten times its water: 66 was meant as 66 percent
    float, Kind("1", "percent", least=0.0, most=10.0, label="share", sample="66 percent")
]
ExtraForce = Annotated[float, Kind("N", "kN", least=0.0, label="force", sample="120 kN")]


class Defect(Variants):
    """Base of the kinds of defect; a new one is a subclass with its own `kind`.

    It changes the rolls, their resistance or the rows of nozzles; a kind overrides only what it
    changes.
    """

    tag_key = "kind"
    kinds: ClassVar[dict[str, Any]] = {}

    def on(self, pairs: list[Pair]) -> None:
        """Change the defective pairs; values missing in a faulty case stay missing."""

    def watered(self, rows: tuple[Row, ...]) -> tuple[Row, ...]:
        """Return the rows of nozzles with the defect."""
        return rows

    def problems(self, machine: Machine, circuits: Sequence[Circuit], pairs: int) -> Faults:
        """Report key and fault of a defect that is impossible in a machine.

        Args:
            machine: The table [machine].
            circuits: The circuits of [secondary].
            pairs: Number of pairs of rolls.
        """
        yield from ()

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the resistance of each pair with the defect (n,), N, from that of a maker's curve.

        Args:
            steps: Resistance of each pair without this defect (n,), N.
            normal: The rolls without any defect.
            rolls: The rolls with all defects.
            sliding: Resistance of a locked roll over that of a turning one.
        """
        return steps


class RollDefect(Defect):
    """A defect of one pair."""

    roll: int = Field(ge=1, strict=True, examples=[48])
    """number of the pair, counted from 1"""

    def __str__(self) -> str:
        """Its name in messages."""
        return f"roll {self.roll}, {self.tag},"

    @abstractmethod
    def changed(self, pair: Pair) -> Pair:
        """Return the pair with the defect."""

    def on(self, pairs: list[Pair]) -> None:
        """See `Defect`."""
        if self.roll <= len(pairs):
            pairs[self.roll - 1] = self.changed(pairs[self.roll - 1])

    def problems(self, machine: Machine, circuits: Sequence[Circuit], pairs: int) -> Faults:
        """See `Defect`."""
        if self.roll > pairs:
            fix = f"the machine has {pairs} pairs, numbered from 1"
            yield "roll", f"({self.roll}) does not exist; {fix}"


class Locked(RollDefect):
    """A locked pair: the strand slides on it, and it no longer drives (eq. 327)."""

    kind: Literal["locked"]

    def changed(self, pair: Pair) -> Pair:
        """See `RollDefect`."""
        return replace(pair, locked=True)

    def problems(self, machine: Machine, circuits: Sequence[Circuit], pairs: int) -> Faults:
        """See `Defect`."""
        yield from super().problems(machine, circuits, pairs)
        if machine.extraction is None:
            fix = "add it, or leave the defect out"
            yield "kind", f'("locked") has no effect without [machine.extraction]; {fix}'

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the resistances, that of this pair times the factor (328)."""
        found = steps.copy()
        found[self.roll - 1] *= sliding
        return found


class Misaligned(RollDefect):
    """A misaligned pair: the strand is bent there and back, with new radii (eq. 329)."""

    kind: Literal["misaligned"]
    by: Offset = Field(examples=["2 mm"])
    """distance towards the centre of curvature; negative: away from it"""
    resistance: ExtraForce | None = None
    """increase of a maker's curve of the resistance, as a coupled run computes it, over the pairs
    where the strand is bent more; left out: none"""

    def __str__(self) -> str:
        """Its name in messages."""
        return f"roll {self.roll} off by {1e3 * self.by:g} mm"

    def changed(self, pair: Pair) -> Pair:
        """See `RollDefect`."""
        return replace(pair, offset=pair.offset + self.by)

    def problems(self, machine: Machine, circuits: Sequence[Circuit], pairs: int) -> Faults:
        """See `Defect`."""
        yield from super().problems(machine, circuits, pairs)
        normal = machine.normal()
        if normal is not None and self.roll <= pairs:
            yield from self._far_off(normal)
        if self.resistance is None:
            return
        if machine.extraction is None or machine.extraction.coupled:
            what = "a maker's curve, machine.extraction.resistance"
            yield "resistance", f"has no effect without {what}, to be added to; leave it out"

    def _far_off(self, normal: Rolls) -> Faults:
        """Report a displacement that a strand cannot follow, or for which (329) does not hold."""
        places = [pair.position for pair in normal.pairs[max(self.roll - 2, 0) : self.roll + 1]]
        pitch = min((b - a for a, b in pairwise(places)), default=math.inf)
        if abs(self.by) > 0.1 * pitch:
            most = f"more than 0.1 of the {1e3 * pitch:.4g} mm to the next pair"
            yield "by", f"({1e3 * self.by:g} mm): roll {self.roll} cannot be misaligned by {most}"

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the resistances with the extra one, shared in proportion to the extra bending."""
        import numpy as np

        bends = [
            np.abs(np.diff([1.0 / pair.radius for pair in these.pairs], prepend=0.0))
            for these in (rolls, normal)
        ]
        more = np.maximum(bends[0] - bends[1], 0.0)
        # from the pair above it to the second below
        near = np.abs(np.arange(len(more)) - self.roll) <= 2
        more = np.where(near, more, 0.0)
        total = float(more.sum())
        return steps if total == 0.0 else steps + (self.resistance or 0.0) * more / total


class Lost(RollDefect):
    """A missing pair: its neighbours guide the strand and carry its load."""

    kind: Literal["lost"]

    def changed(self, pair: Pair) -> Pair:
        """See `RollDefect`."""
        return replace(pair, lost=True)

    def resisting(self, steps: Array, normal: Rolls, rolls: Rolls, sliding: float) -> Array:
        """Return the resistances, with that of the missing pair shared by its neighbours."""
        found, i = steps.copy(), self.roll - 1
        above, below = ([j for j in rolls.there if (j > i) == later] for later in (False, True))
        taking = above[-1:] + below[:1]
        for j in taking:
            found[j] += found[i] / len(taking)
        found[i] = 0.0
        return found


class Nozzles(Defect):
    """Nozzles of a circuit with less or more water than nominal (VI.4.1)."""

    kind: Literal["nozzles"]
    circuit: str = Field(examples=["bender"])
    """name of the circuit of [secondary]"""
    rolls: tuple[int, int] = Field(examples=[[47, 52]])
    """numbers of the rolls above the first and below the last affected row of nozzles"""
    share: WaterShare = Field(examples=["66 percent"])
    """their water over the nominal one"""

    def __str__(self) -> str:
        """Its name in messages."""
        between = f"from roll {self.rolls[0]} to {self.rolls[1]}"
        return f'nozzles of "{self.circuit}" {between} with {100.0 * self.share:g} % of their water'

    @property
    def water(self) -> str:
        """Share of the water and place, as text."""
        share = f"{100.0 * self.share:g} % of the water"
        return f"{share} from roll {self.rolls[0]} to {self.rolls[1]}"

    def watered(self, rows: tuple[Row, ...]) -> tuple[Row, ...]:
        """See `Defect`."""
        from castfem.physics.machine.spray_layout import scale_water

        return scale_water(rows, self.circuit, *self.rolls, self.share)

    def problems(self, machine: Machine, circuits: Sequence[Circuit], pairs: int) -> Faults:
        """See `Defect`."""
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
