"""What rolls do to the strand between them: nothing, bend it, hold its curvature, straighten it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from castfem.machine.rolls import Rolls

_SAME = 1e-6  # of the largest curvature

Kind = Literal["vertical", "bending", "arc", "straightening", "straight"]


@dataclass(frozen=True, slots=True)
class Phase:
    """Rolls between which the curvature goes one way.

    Attributes:
        kind: What they do.
        first: Index of the pair at its beginning. last: At its end.
    """

    kind: Kind
    first: int
    last: int


def phases(rolls: Rolls) -> list[Phase]:
    """Return the phases from the first roll to the last."""
    chi = [1.0 / pair.radius for pair in rolls.pairs]
    hair = _SAME * max((abs(k) for k in chi), default=0.0)
    found: list[Phase] = []
    for i in range(1, len(chi)):
        kind = _kind(chi, i, hair, any(p.kind == "straightening" for p in found))
        if found and found[-1].kind == kind:
            found[-1] = Phase(kind, found[-1].first, i)
        else:
            found.append(Phase(kind, i - 1, i))
    return found


def _kind(chi: Sequence[float], i: int, hair: float, straightened: bool) -> Kind:
    """What happens between a pair and the one before; a change below `hair` (1/m) is none."""
    change = chi[i] - chi[i - 1]
    if abs(change) > hair:
        return "bending" if change > 0.0 else "straightening"
    if chi[i] > hair:
        return "arc"
    return "straight" if straightened else "vertical"
