"""Words on a position along the strand: the nearest roll, and what the rolls do there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.values.same_place import same_or_before

if TYPE_CHECKING:
    from castfem.machine.rolls import Rolls

MOULD, BELOW = "mould", "below the mould"
BENDS = ("bending", "straightening")


@dataclass(frozen=True, slots=True)
class Stations:
    """The rolls as a strand passes them, or none.

    Attributes:
        rolls: From the mould on; None of a machine that has none.
        thickness: Of the section, m. mould_exit: m from the meniscus; None without a mould.
    """

    rolls: Rolls | None = None
    thickness: float = 0.0
    mould_exit: float | None = None

    @classmethod
    def of_columns(
        cls,
        rolls: Mapping[str, Any] | None,
        thickness: float | None = None,
        mould_exit: float | None = None,
    ) -> Stations:
        """Those of rolls as `castfem.machine.rolls.columns_of` gives them."""
        if rolls is None:
            return cls(None, thickness or 0.0, mould_exit)
        from castfem.machine.rolls import read_rolls

        return cls(read_rolls(rolls), thickness or 0.0, mould_exit)

    def nearest(self, position: float) -> int | None:
        """Index of the pair nearest to a position (m); None without rolls."""
        if self.rolls is None:
            return None
        return int(np.argmin([abs(pair.position - position) for pair in self.rolls.pairs]))

    def pitch(self, position: float) -> float:
        """Distance between the pairs around a position, beyond all that of the nearest two, m."""
        assert self.rolls is not None and len(self.rolls.pairs) > 1
        places = [pair.position for pair in self.rolls.pairs]
        i = int(np.clip(np.searchsorted(places, position, side="left"), 1, len(places) - 1))
        return places[i] - places[i - 1]

    @property
    def longest_pitch(self) -> float:
        """Largest distance of two pairs that follow one another, m; 0 without."""
        if self.rolls is None or len(self.rolls.pairs) < 2:
            return 0.0
        return float(np.diff([pair.position for pair in self.rolls.pairs]).max())

    def aperture(self, position: float) -> float:
        """Aperture at a position, linear between the pairs, m."""
        assert self.rolls is not None
        pairs = self.rolls.pairs
        apertures = [self.rolls.aperture(i, self.thickness) for i in range(len(pairs))]
        return float(np.interp(position, [pair.position for pair in pairs], apertures))

    def phase(self, position: float) -> str:
        """What is done to the strand at a position: mould, bending, arc, straightening ..."""
        if self.mould_exit is not None and position <= self.mould_exit:
            return MOULD
        if self.rolls is None:
            return BELOW
        from castfem.machine.phases import phases

        found, pairs = phases(self.rolls), self.rolls.pairs
        if not found or position < pairs[0].position:
            return BELOW
        # A roll belongs to what ends there.
        for phase in found:
            if same_or_before(position, pairs[phase.last].position):
                return phase.kind
        return found[-1].kind

    def words(self, position: float, time: float | None = None) -> str:
        """Position, nearest roll, time (s), phase: "16.73 m (roll 57), 836 s, straightening"."""
        near, phase = self.nearest(position), self.phase(position)
        roll = "" if near is None or phase == MOULD else f" (roll {near + 1})"
        when = "" if time is None else f", {time:.4g} s"
        return f"{position:.2f} m{roll}{when}, {phase}"

    def between(self, start: float, end: float) -> str:
        """From where to where, with the rolls."""
        rolls = [self.nearest(start), self.nearest(end)]
        if rolls[0] is None or rolls[1] is None:
            return f"{start:.2f} to {end:.2f} m"
        return f"{start:.2f} to {end:.2f} m, rolls {rolls[0] + 1} to {rolls[1] + 1}"
