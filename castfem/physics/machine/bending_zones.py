"""Phases of the strand between its rolls: straight, bending, constant curvature, straightening.

They follow from the design of the machine. A misaligned roll bends and straightens the strand as
well, on a stretch of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from castfem.physics.machine.rolls import Rolls

Kind = Literal["vertical", "bending", "arc", "straightening", "straight"]


@dataclass(frozen=True, slots=True)
class Phase:
    """Consecutive rolls between which the curvature changes in one direction."""

    kind: Kind  #: kind of phase
    first: int  #: index of the pair at its start
    last: int  #: index of the pair at its end


@dataclass(frozen=True, slots=True)
class OffStretch:
    """Consecutive rolls between which the strand follows misaligned ones."""

    off: tuple[int, ...]  #: numbers of the misaligned rolls, from 1
    first: int  #: index of the pair at its start
    last: int  #: index of the pair at its end

    @property
    def name(self) -> str:
        """Name of the stretch."""
        return f"roll{'s' if len(self.off) > 1 else ''} {', '.join(map(str, self.off))} off"


def off_stretches(rolls: Rolls) -> list[OffStretch]:
    """Return the stretches whose curvature a misaligned roll changes, from top to bottom.

    It changes at the roll and its neighbours, so that the strand bends from the second pair above
    to the second below. Overlapping stretches are joined.
    """
    held, found = rolls.there, list[OffStretch]()
    for k, index in enumerate(held):
        if not rolls.pairs[index].offset:
            continue
        first, last = held[max(k - 2, 0)], held[min(k + 2, len(held) - 1)]
        if found and first < found[-1].last:
            before = found.pop()
            found.append(OffStretch((*before.off, index + 1), before.first, last))
        else:
            found.append(OffStretch((index + 1,), first, last))
    return found


def phases(rolls: Rolls) -> list[Phase]:
    """Return the phases from the first roll to the last, according to the design."""
    radii = [pair.radius if pair.designed is None else pair.designed for pair in rolls.pairs]
    chi = [1.0 / radius for radius in radii]
    hair = 1e-6 * max((abs(k) for k in chi), default=0.0)
    found: list[Phase] = []
    for i in range(1, len(chi)):
        kind = _kind(chi, i, hair, any(p.kind == "straightening" for p in found))
        if found and found[-1].kind == kind:
            found[-1] = Phase(kind, found[-1].first, i)
        else:
            found.append(Phase(kind, i - 1, i))
    return found


def _kind(chi: Sequence[float], i: int, hair: float, straightened: bool) -> Kind:
    """Kind of phase between a pair and the one before; changes below `hair` (1/m) do not count."""
    change = chi[i] - chi[i - 1]
    if abs(change) > hair:
        return "bending" if change > 0.0 else "straightening"
    if chi[i] > hair:
        return "arc"
    return "straight" if straightened else "vertical"
