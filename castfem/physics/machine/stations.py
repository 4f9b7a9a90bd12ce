"""Description of a position along the strand: nearest roll, and phase of the machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import same_or_before

if TYPE_CHECKING:
    from castfem.physics.machine.rolls import Rolls

MOULD, BELOW = "mould", "below the mould"
_OFF, _DESIGNED = "offset", "radius_designed"  # columns of misaligned rolls, m


@dataclass(frozen=True, slots=True)
class Stations:
    """The rolls along a strand, or none."""

    rolls: Rolls | None = None  #: from the mould on; None without rolls
    thickness: float = 0.0  #: thickness of the section, m
    mould_exit: float | None = None  #: end of the mould, m from the meniscus; None without a mould

    @classmethod
    def of_columns(
        cls,
        rolls: Mapping[str, Any] | None,
        thickness: float | None = None,
        mould_exit: float | None = None,
    ) -> Stations:
        """Make those of rolls from `columns`."""
        if rolls is None:
            return cls(None, thickness or 0.0, mould_exit)
        from castfem.physics.machine.roll_table import read_rolls

        found = read_rolls({name: rolls[name] for name in rolls if name not in (_OFF, _DESIGNED)})
        offsets, designed = (rolls.get(name) for name in (_OFF, _DESIGNED))
        if offsets is not None and designed is not None:
            pairs = tuple(
                replace(pair, offset=offset, designed=None if radius is None else float(radius))
                for pair, offset, radius in zip(found.pairs, offsets, designed, strict=True)
            )
            found = replace(found, pairs=pairs)
        return cls(found, thickness or 0.0, mould_exit)

    def columns(self) -> dict[str, Any] | None:
        """Return the rolls as columns, with displacements of misaligned ones; None without any."""
        if self.rolls is None:
            return None
        from castfem.physics.machine.roll_table import columns_of

        found, pairs = columns_of(self.rolls), self.rolls.pairs
        if any(pair.offset for pair in pairs):
            found[_OFF] = [pair.offset for pair in pairs]
            radii = [pair.designed for pair in pairs]
            found[_DESIGNED] = [None if radius is None else str(radius) for radius in radii]
        return found

    def nearest(self, position: float) -> int | None:
        """Index of the pair nearest to a position (m); None without rolls."""
        if self.rolls is None:
            return None
        return int(np.argmin([abs(pair.position - position) for pair in self.rolls.pairs]))

    def pitch(self, position: float) -> float:
        """Roll pitch around a position, m; beyond the rolls that of the nearest two."""
        assert self.rolls is not None and len(self.rolls.pairs) > 1
        places = [pair.position for pair in self.rolls.pairs]
        i = int(np.clip(np.searchsorted(places, position, side="left"), 1, len(places) - 1))
        return places[i] - places[i - 1]

    @property
    def longest_pitch(self) -> float:
        """Largest roll pitch, m; 0 without rolls."""
        if self.rolls is None or len(self.rolls.pairs) < 2:
            return 0.0
        return float(np.diff([pair.position for pair in self.rolls.pairs]).max())

    def aperture(self, position: float) -> float:
        """Aperture at a position, m, linear between the pairs."""
        assert self.rolls is not None
        pairs = self.rolls.pairs
        apertures = [self.rolls.aperture(i, self.thickness) for i in range(len(pairs))]
        return float(np.interp(position, [pair.position for pair in pairs], apertures))

    def phase(self, position: float) -> str:
        """Phase of the strand at a position: mould, bending, arc, "roll 30 off" ..."""
        if self.mould_exit is not None and position <= self.mould_exit:
            return MOULD
        if self.rolls is None:
            return BELOW
        from castfem.physics.machine.bending_zones import off_stretches, phases

        found, pairs = phases(self.rolls), self.rolls.pairs
        if not found or position < pairs[0].position:
            return BELOW
        for off in off_stretches(self.rolls):
            start, end = pairs[off.first].position, pairs[off.last].position
            if not same_or_before(position, start) and same_or_before(position, end):
                return off.name
        # A roll belongs to the phase that ends there.
        for phase in found:
            if same_or_before(position, pairs[phase.last].position):
                return phase.kind
        return found[-1].kind

    def words(self, position: float, time: float | None = None) -> str:
        """Description of a position, "16.73 m (roll 57), 836 s, straightening"; time in s."""
        near, phase = self.nearest(position), self.phase(position)
        roll = "" if near is None or phase == MOULD else f" (roll {near + 1})"
        when = "" if time is None else f", {time:.4g} s"
        return f"{position:.2f} m{roll}{when}, {phase}"

    def between(self, start: float, end: float) -> str:
        """Description of a range of positions, with the rolls."""
        rolls = [self.nearest(start), self.nearest(end)]
        if rolls[0] is None or rolls[1] is None:
            return f"{start:.2f} to {end:.2f} m"
        return f"{start:.2f} to {end:.2f} m, rolls {rolls[0] + 1} to {rolls[1] + 1}"
