"""Bulging near a missing or misaligned pair of rolls, with a strip over several rolls.

Where the rolls are equal the strip of a single pitch is enough. Near unequal rolls each pitch has
its own strip over the surrounding rolls, with one shell, of which the part between its two rolls is
used. A roll that would have to pull is left by the shell.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.physics.machine.bulging.creep import CreepingStrip, nodes
from castfem.physics.machine.bulging.result import Bulge, Span, along
from castfem.physics.machine.bulging.shell import Shell
from castfem.physics.machine.bulging.spans import Rolls, over_rolls

# pitches above and below over which unequal rolls have an effect, since creep persists
ABOVE, BELOW = 2, 3


@dataclass(frozen=True, slots=True)
class UnevenPitch:
    """A pitch near unequal rolls."""

    #: bulge of the pitch, from the straight line between its two rolls; `roll_force` is the force
    #: on the roll above it
    bulge: Bulge
    #: extra loads of the rolls beyond half of the pressure on the neighbouring pitches: the roll
    #: above the pitch, the one below it and the next (3,), N per metre of width
    added: Array


@dataclass(frozen=True, slots=True)
class UnevenRolls:
    """Rolls of a machine with missing or misaligned ones."""

    strip: CreepingStrip  #: model of the strip
    positions: Array  #: positions of the existing rolls, m, (n,)
    #: displacements from the line of the strand, towards the centre of curvature, m, (n,)
    offsets: Array
    marks: Collection[int]  #: pitches at the defects, by index of the roll above each
    #: pitch of the nominal machine at its top and at its end, m, used to continue the rolls beyond
    #: them
    ends: tuple[float, float]
    count: int  #: number of nodes of a bulge

    def near(self, pitch: int) -> bool:
        """Whether a defect affects a pitch, given by index of the roll above it."""
        return any(-ABOVE <= pitch - mark <= BELOW for mark in self.marks)

    def around(self, pitch: int) -> tuple[int, int]:
        """First and last roll of the strip of a pitch; indices continue beyond the machine."""
        marks = [mark for mark in self.marks if -ABOVE <= pitch - mark <= BELOW] or [pitch]
        first, last = min(marks), max(marks)
        for mark in sorted(self.marks, reverse=True):
            first = mark if 0 < first - mark <= ABOVE + BELOW else first
        for mark in sorted(self.marks):
            last = mark if 0 < mark - last <= ABOVE + BELOW else last
        return first - ABOVE - 1, last + BELOW + 2

    def position(self, index: int) -> float:
        """Position of a roll, or of a fictitious one beyond the machine, m."""
        last = len(self.positions) - 1
        if index < 0:
            return float(self.positions[0]) + index * self.ends[0]
        if index > last:
            return float(self.positions[last]) + (index - last) * self.ends[1]
        return float(self.positions[index])

    def offset(self, index: int) -> float:
        """Displacement of a roll, m."""
        return float(self.offsets[index]) if 0 <= index < len(self.offsets) else 0.0

    def bulge(self, pitch: int, span: Span, shell: Shell, outward: float) -> UnevenPitch:
        """Return the bulge of a shell in a pitch.

        Args:
            pitch: Index of the roll above it.
            span: The pitch.
            shell: Shell of the face.
            outward: 1 for the face towards the centre of curvature, -1 for the other.

        Raises:
            RunFailure: The shell cannot carry the pressure, or the moments cannot be found.
        """
        first, last = self.around(pitch)
        numbers = list(range(first, last + 1))
        offsets = {i: outward * self.offset(i) for i in numbers}
        whole, forces = self._touching(numbers, offsets, span, shell)
        ends = offsets[pitch], offsets[pitch + 1]
        z = nodes(span.length, self.count - 1)
        there = self.position(pitch) + z
        tilt = (ends[1] - ends[0]) / span.length

        def read(values: Array) -> Array:
            return np.asarray(np.interp(there, whole.z, values))

        axial = read(whole.axial_strain)
        part = Bulge(
            z=z,
            deflection=along(whole.z, whole.deflection, whole.slope, there) - ends[0] - tilt * z,
            slope=read(whole.slope) - tilt,
            moment=read(whole.moment),
            curvature=read(whole.curvature),
            axial_strain=axial - axial[0],
            neutral=whole.neutral,
            thickness=whole.thickness,
            roll_force=np.array([forces[pitch]]),
            error=whole.error,
        )
        added = [
            forces[i] - self._load(i, span.pressure) if i in forces else 0.0
            for i in (pitch, pitch + 1, pitch + 2)
        ]
        return UnevenPitch(part, np.array(added))

    def _load(self, index: int, pressure: float) -> float:
        """Half of the pressure on the pitches beside a roll, N per metre of width."""
        return 0.5 * pressure * (self.position(index + 1) - self.position(index - 1))

    def _touching(
        self, numbers: list[int], offsets: dict[int, float], span: Span, shell: Shell
    ) -> tuple[Bulge, dict[int, float]]:
        """The strip over the rolls that it touches.

        A roll that would pull by more than a thousandth of the pressure on a pitch is released; a
        shell that would be 1 um beyond a released roll touches it again.

        Returns:
            The strip, and the force on each roll except the outermost ones, N per metre of width,
            zero for rolls that it does not touch.
        """
        left: list[int] = []
        firm = (*numbers[:2], *numbers[-2:])
        least = -1e-3 * span.pressure * span.length
        for _ in range(2 * len(numbers)):
            held = [i for i in numbers if i not in left]
            rolls = Rolls(
                tuple(self.position(i) for i in held), tuple(offsets[i] for i in held),
                span.pressure, span.speed,
            )  # fmt: skip
            whole = over_rolls(self.strip, rolls, shell)
            forces = dict(zip(held[1:-1], map(float, whole.roll_force), strict=True))
            loose = {i: f for i, f in forces.items() if i not in firm and f < least}
            into = {i: float(whole.at(self.position(i))) - offsets[i] for i in left}
            if loose:
                left.append(min(loose, key=lambda i: loose[i]))
            elif into and max(into.values()) > 1e-6:
                left.remove(max(into, key=lambda i: into[i]))
            else:
                return whole, forces | dict.fromkeys(left, 0.0)
        raise RunFailure("which rolls the shell touches near a defect cannot be found")
