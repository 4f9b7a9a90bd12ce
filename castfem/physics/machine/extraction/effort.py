"""The axial effort that rolls and drives leave in the strand, as the slice meets it.

What a pair resists comes on linearly over the pitch above it, and what a drive takes goes over the
pitch below it: a force at the surface of a strand takes about its thickness to spread over the
section, and a step would be an infinite rate of strain.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.types import Array
from castfem.physics.machine.extraction import resistance
from castfem.physics.machine.extraction.drives import refuse_standstill, share, taken


@dataclass(frozen=True, slots=True)
class Withdrawal:
    """What rolls and drives have done to the strand down to the slice; part of its state.

    Forces are those of the whole strand, N.
    """

    pairs: int = 0  #: pairs of rolls that the slice has passed
    resistance: float = 0.0  #: of the strand above, with the work of bending in it
    drives: float = 0.0  #: what the drives above pull with: resistance less drives is the effort
    #: external axial force on the slice: the effort, the work of bending not in it where the
    #: equation of the planes has that by itself
    force: float = 0.0
    friction: float = 0.0  #: of the rolls that the slice has passed
    #: external force at the last of them, and what the drives above it pull with
    start: tuple[float, float] = (0.0, 0.0)
    aim: tuple[float, float] = (0.0, 0.0)  #: both as they will be at the next pair
    moments: tuple[float, float] = (0.0, 0.0)  #: of the strand at the two pairs last passed, N m

    @property
    def effort(self) -> float:
        """Axial effort in the strand, N."""
        return self.resistance - self.drives

    @classmethod
    def restored(cls, entries: dict[str, Any]) -> Withdrawal:
        """The state of a checkpoint, whose tuples are lists."""
        found: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value
            for key, value in entries.items()
        }
        return cls(**found)


@dataclass(frozen=True, slots=True)
class Passing:
    """What the rolls feel of the slice at the end of a step, of the whole strand."""

    moment: float  #: M, N m
    work: float  #: int M dk so far, J/m; bending takes less than zero
    temperature: Array  #: at the owned vertices (owned,), K
    #: what rolls that are not alike bear on both faces beyond the pressure of the length that is
    #: theirs: the pair that the slice comes to and the next, N per metre of width
    added: tuple[float, float] = (0.0, 0.0)


class RollForces(Protocol):
    """Forces of bulging on the rolls."""

    def on_pair(self, index: int, temperature: Array, added: float) -> float:
        """Force on both rolls of a pair of the whole strand, N (collective).

        Args:
            index: Of the pair, from 0.
            temperature: Of the slice as it comes to it, at the owned vertices (owned,), K.
            added: What both bear beyond the pressure of the length that is theirs, N per metre of
                width.
        """


class Effort(Protocol):
    """Gives the slice its axial force."""

    @property
    def contains_work(self) -> bool:
        """Whether the work of bending is in the force."""

    def initial(self, position: float) -> Withdrawal:
        """The state of a strand that is followed from `position` (m)."""

    def force(self, past: Withdrawal, position: float) -> float:
        """External axial force, N, of a step that leads from `past` to `position` (m)."""

    def after(self, past: Withdrawal, position: float, passing: Passing) -> Withdrawal:
        """The state after a step to `position` (m) (collective)."""


def _origin(places: Array) -> float:
    """Where the first pair begins to be felt, m: a pitch above it."""
    return float(places[0] - (places[1] - places[0])) if len(places) > 1 else 0.0


def _come(places: Array, position: float) -> int:
    """How many pairs the slice has come to."""
    hair = ROUNDING * max(1.0, abs(position))
    return int(np.searchsorted(places, position + hair, side="right"))


class KnownResistance:
    """Steps of resistance that are known beforehand, as of a maker's curve.

    A curve that was measured has the work of bending in it. `steps`, `capacities` and `shares` are
    kept as they are.

    Args:
        places: Of the pairs, increasing (n,), m.
        steps: What each resists (n,), N.
        capacities: Of the drives (n,), N: 0 of a pair that is not driven, inf if not known.

    Raises:
        StrandStopsError: The drives are weaker than the rolls.
    """

    contains_work = True

    def __init__(
        self, places: Sequence[float], steps: Sequence[float] | Array, capacities: Array
    ) -> None:
        self._places = np.asarray(places, float)
        self.steps, self.capacities = np.asarray(steps, float), capacities
        self.shares = share(steps, capacities)
        last = float(self._places[-1])
        below = last + (last - float(self._places[-2]) if len(self._places) > 1 else last)
        self._ends = np.array([_origin(self._places), *self._places, below])
        total = np.cumsum(steps)
        self._resistance = np.array([0.0, *total, total[-1]])
        left = self.shares.effort[-1] - self.shares.drive[-1]
        self._effort = np.array([0.0, *self.shares.effort, left])

    def initial(self, position: float) -> Withdrawal:
        """See `Effort`."""
        return self._at(position)

    def force(self, past: Withdrawal, position: float) -> float:
        """See `Effort`."""
        return float(np.interp(position, self._ends, self._effort))

    def after(self, past: Withdrawal, position: float, passing: Passing) -> Withdrawal:
        """See `Effort`."""
        return self._at(position)

    def _at(self, position: float) -> Withdrawal:
        effort = float(np.interp(position, self._ends, self._effort))
        total = float(np.interp(position, self._ends, self._resistance))
        return Withdrawal(_come(self._places, position), total, total - effort, effort)


@dataclass(frozen=True, slots=True)
class Pairs:
    """The pairs that hold the strand, as the coupled resistance needs them (n,)."""

    numbers: tuple[int, ...]  #: index of each among all pairs of the machine
    places: Array  #: positions, increasing, m
    frictions: Array  #: coefficients of friction (`resistance.friction`)
    capacities: Array  #: of the drives, N: 0 of a pair that is not driven, inf if not known


class CoupledResistance:
    """Resistance from the forces that the slice itself puts on the rolls (thesis VI.2.3.1).

    As the slice comes to a pair it tells the force of bulging on it and the strand's moment. The
    force of bending on a pair in equilibrium hangs on the moment at the pair below: what it resists
    is felt one pitch later. What the next pair resists by bulging is foreseen with the slice as it
    is. The work of bending is in the equation of the planes; a drive takes it with the rest.

    Args:
        pairs: The pairs of rolls.
        bulging: Forces of bulging on them.
        bending: From the moments: "equilibrium" with the pairs beside it, or "hinges" (320).
        pays_work: Whether the equation of the planes has the work of bending, as the tangential
            test direction has.
    """

    contains_work = False

    def __init__(
        self, pairs: Pairs, bulging: RollForces, bending: str, pays_work: bool = True
    ) -> None:
        self._pairs, self._bulging, self._hinges = pairs, bulging, bending == "hinges"
        self._pays_work = pays_work
        places = pairs.places
        gaps = np.diff(places) if len(places) > 1 else np.array([max(float(places[0]), 1e-3)])
        self._pitches = np.array([gaps[0], *gaps, gaps[-1]])  # above each, and below the last

    def initial(self, position: float) -> Withdrawal:
        """See `Effort`."""
        return Withdrawal(_come(self._pairs.places, position))

    def force(self, past: Withdrawal, position: float) -> float:
        """See `Effort`."""
        return self._between(past, position)[0]

    def after(self, past: Withdrawal, position: float, passing: Passing) -> Withdrawal:
        """See `Effort`."""
        found = past
        for i in range(past.pairs, _come(self._pairs.places, position)):
            found = self._passed(found, i, passing)
        force, drives = self._between(found, position)
        resistance = force + drives - self._work(passing)
        return replace(found, resistance=resistance, drives=drives, force=force)

    def _work(self, passing: Passing) -> float:
        return passing.work if self._pays_work else 0.0

    def _between(self, past: Withdrawal, position: float) -> tuple[float, float]:
        """External force and drives at a position below the last pair, N."""
        places, i = self._pairs.places, past.pairs
        start = float(places[i - 1]) if i else float(places[0] - self._pitches[0])
        along = (position - start) / float(self._pitches[i])
        along = min(max(along, 0.0), 1.0)
        force, drives = (
            (1.0 - along) * a + along * b for a, b in zip(past.start, past.aim, strict=True)
        )
        return force, drives

    def _passed(self, past: Withdrawal, i: int, passing: Passing) -> Withdrawal:
        """The state as the slice leaves a pair."""
        pairs, heat, added = self._pairs, passing.temperature, passing.added
        moments = (*past.moments, passing.moment)
        friction = past.friction + self._bulged(i, heat, added[0]) + self._bent(i, moments)
        resistance = friction - self._work(passing)
        refuse_standstill(resistance, pairs.capacities)
        above = past.aim[1]
        drives = above + taken(resistance - above, float(pairs.capacities[i]))
        foreseen = friction
        if i + 1 < len(pairs.places):
            foreseen += self._bulged(i + 1, heat, added[1])
        return replace(
            past,
            pairs=i + 1,
            friction=friction,
            start=past.aim,
            aim=(foreseen - drives, drives),
            moments=moments[1:],
        )

    def _bulged(self, i: int, temperature: Array, added: float) -> float:
        """Resistance of a pair by bulging, N."""
        force = self._bulging.on_pair(self._pairs.numbers[i], temperature, added)
        return float(resistance.pair_resistances(self._pairs.frictions[i], force, 0.0))

    def _bent(self, i: int, moments: tuple[float, float, float]) -> float:
        """Resistance by bending that is felt as the slice leaves a pair, N."""
        if self._hinges:
            j, force = i, resistance.hinge_force(moments[2], float(self._pitches[i + 1]))
        elif i:
            j, beside = i - 1, self._pitches[i - 1 : i + 1]
            force = resistance.bending_force(moments, [float(length) for length in beside])
        else:
            return 0.0
        return float(resistance.pair_resistances(self._pairs.frictions[j], 0.0, force))
