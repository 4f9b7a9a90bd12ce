"""The axial force in the strand from rolls and drives at the position of the slice.

The resistance of a pair builds up linearly over the pitch above it, and the force of a drive over
the pitch below it: a surface force on a strand spreads over the section within about its thickness,
and a step would be an infinite strain rate.

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
    """Accumulated forces of rolls and drives down to the slice; part of its state.

    Forces are those of the whole strand, N.
    """

    pairs: int = 0  #: number of pairs that the slice has passed
    resistance: float = 0.0  #: resistance of the strand above, including the work of bending
    drives: float = 0.0  #: drive forces above; resistance minus drives is the axial force `effort`
    #: external axial force on the slice: the effort, without the work of bending if that is in the
    #: equation of the planes
    force: float = 0.0
    friction: float = 0.0  #: friction of the rolls that the slice has passed
    #: external force and drive forces at the last of them
    start: tuple[float, float] = (0.0, 0.0)
    aim: tuple[float, float] = (0.0, 0.0)  #: both at the next pair
    moments: tuple[float, float] = (0.0, 0.0)  #: moments of the strand at the last two pairs, N m

    @property
    def effort(self) -> float:
        """Axial force in the strand, N."""
        return self.resistance - self.drives

    @classmethod
    def restored(cls, entries: dict[str, Any]) -> Withdrawal:
        """The state from a checkpoint, which stores tuples as lists."""
        found: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value
            for key, value in entries.items()
        }
        return cls(**found)


@dataclass(frozen=True, slots=True)
class Passing:
    """State of the whole strand at the slice at the end of a step, as needed by the rolls."""

    moment: float  #: moment M, N m
    work: float  #: int M dk so far, J/m; negative in bending
    temperature: Array  #: temperatures at the owned vertices (owned,), K
    #: extra loads of unequal rolls on both faces, beyond the pressure on their tributary length: of
    #: the next pair and the one after, N per metre of width
    added: tuple[float, float] = (0.0, 0.0)


class RollForces(Protocol):
    """Bulging forces on the rolls."""

    def on_pair(self, index: int, temperature: Array, added: float) -> float:
        """Force on both rolls of a pair, whole strand, N (collective).

        Args:
            index: Index of the pair, from 0.
            temperature: Temperatures of the slice at the pair, at the owned vertices (owned,), K.
            added: Load beyond the pressure on the tributary length, both rolls, N per metre of
                width.
        """


class Effort(Protocol):
    """Gives the external axial force on the slice."""

    @property
    def contains_work(self) -> bool:
        """Whether the force contains the work of bending."""

    def initial(self, position: float) -> Withdrawal:
        """Initial state of a strand that is followed from `position` (m)."""

    def force(self, past: Withdrawal, position: float) -> float:
        """External axial force, N, of a step that leads from `past` to `position` (m)."""

    def after(self, past: Withdrawal, position: float, passing: Passing) -> Withdrawal:
        """The state after a step to `position` (m) (collective)."""


def _origin(places: Array) -> float:
    """Position at which the first pair begins to act, m: a pitch above it."""
    return float(places[0] - (places[1] - places[0])) if len(places) > 1 else 0.0


def _come(places: Array, position: float) -> int:
    """Number of pairs that the slice has reached."""
    hair = ROUNDING * max(1.0, abs(position))
    return int(np.searchsorted(places, position + hair, side="right"))


class KnownResistance:
    """Resistances that are known in advance, such as from a maker's curve.

    A measured curve contains the work of bending. `steps`, `capacities` and `shares` are stored as
    given.

    Args:
        places: Positions of the pairs, increasing (n,), m.
        steps: Resistance of each pair (n,), N.
        capacities: Capacities of the drives (n,), N: 0 if not driven, inf if unknown.

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
    """Data of the pairs that hold the strand for a coupled resistance (n,)."""

    numbers: tuple[int, ...]  #: index of each among all pairs of the machine
    places: Array  #: positions, increasing, m
    frictions: Array  #: coefficients of friction (`resistance.friction`)
    capacities: Array  #: capacities of the drives, N: 0 if not driven, inf if unknown


class CoupledResistance:
    """Resistance from the forces of the slice on the rolls (thesis VI.2.3.1).

    At each pair the slice gives the bulging force and the moment of the strand. The bending force
    on a pair in equilibrium depends on the moment at the next pair, so that this resistance acts
    one pitch later. The bulging resistance of the next pair is predicted with the present slice.
    The work of bending is in the equation of the planes; a drive supplies it with the rest.

    Args:
        pairs: The pairs of rolls.
        bulging: Bulging forces on them.
        bending: Bending force: from "equilibrium" with the neighbouring pairs, or of "hinges"
            (320).
        pays_work: Whether the equation of the planes contains the work of bending, as with the
            tangential test direction.
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
        """External force and drive forces at a position below the last pair, N."""
        places, i = self._pairs.places, past.pairs
        start = float(places[i - 1]) if i else float(places[0] - self._pitches[0])
        along = (position - start) / float(self._pitches[i])
        along = min(max(along, 0.0), 1.0)
        force, drives = (
            (1.0 - along) * a + along * b for a, b in zip(past.start, past.aim, strict=True)
        )
        return force, drives

    def _passed(self, past: Withdrawal, i: int, passing: Passing) -> Withdrawal:
        """The state when the slice leaves a pair."""
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
        """Resistance of a pair from bulging, N."""
        force = self._bulging.on_pair(self._pairs.numbers[i], temperature, added)
        return float(resistance.pair_resistances(self._pairs.frictions[i], force, 0.0))

    def _bent(self, i: int, moments: tuple[float, float, float]) -> float:
        """Resistance from bending that acts when the slice leaves a pair, N."""
        if self._hinges:
            j, force = i, resistance.hinge_force(moments[2], float(self._pitches[i + 1]))
        elif i:
            j, beside = i - 1, self._pitches[i - 1 : i + 1]
            force = resistance.bending_force(moments, [float(length) for length in beside])
        else:
            return 0.0
        return float(resistance.pair_resistances(self._pairs.frictions[j], 0.0, force))
