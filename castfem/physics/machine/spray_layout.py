"""Cooling from roll to roll: contact, shade of the roll, sprays, run-off water.

Four kinds of heat loss alternate along a caster ([Pascon2003] VI.1.2.3, Fig. 129): contact with a
roll; its shade, where the strand only radiates to rolls and surroundings; the spray between two
rolls; and its water, which runs down to the next roll and gathers there.

Gaps are numbered by the roll above them, from 1; gap 0 is above the first roll.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from castfem.physics.machine.rolls import Rolls

Kind = Literal["contact", "shade", "spray", "run_off"]
KINDS: tuple[Kind, ...] = ("contact", "shade", "spray", "run_off")
_SHORTEST = 1e-6  # m; less is rounding of the same position


def footprint(stand_off: float, angle: float) -> float:
    """Size of the sprayed area of a nozzle, w = 2 h tan(angle/2) (304), m.

    Args:
        stand_off: Distance h of the nozzle from the surface, m.
        angle: Spray angle, across the strand or along it, rad.
    """
    return 2.0 * stand_off * math.tan(0.5 * angle)


def longest_spray(clear: float, stand_off: float, diameter: float) -> float:
    """Longest spray along the strand between two rolls, 2 e h/(2 h - d) (305), m.

    Args:
        clear: Clear distance e of the rolls, m.
        stand_off: Distance h of the nozzle from the surface, m, which is beyond their axes.
        diameter: Diameter of the rolls, m.

    Raises:
        ValueError: The nozzle is not beyond the axes of the rolls.
    """
    if not 2.0 * stand_off > diameter:
        raise ValueError("the nozzle stands between the rolls, below their axes")
    return 2.0 * clear * stand_off / (2.0 * stand_off - diameter)


@dataclass(frozen=True, slots=True)
class Gap:
    """The clear gap between two pairs of rolls."""

    above: int  #: number of the pair above it, from 1
    middle: float  #: middle of the gap, from the meniscus, m
    clear: float  #: clear distance on the tighter side, m
    diameter: float  #: smaller diameter of the rolls, which limits a spray more, m


def gap_below(rolls: Rolls, number: int, thickness: float) -> Gap:
    """Return the gap below a pair (from 1) of rolls around a section of some thickness, m."""
    upper, lower = rolls.pairs[number - 1], rolls.pairs[number]
    ends = upper.position + 0.5 * upper.diameter, lower.position - 0.5 * lower.diameter
    return Gap(
        number,
        0.5 * (ends[0] + ends[1]),
        rolls.clearance(number, thickness),
        min(upper.diameter, lower.diameter),
    )


@dataclass(frozen=True, slots=True)
class Row:
    """The nozzles of a circuit in one gap."""

    circuit: str  #: name of the circuit
    gap: int  #: number of the roll above
    start: float  #: start of their sprays, from the meniscus, m
    end: float  #: end of their sprays, m
    share: float = 1.0  #: water of these nozzles over the nominal one


def scale_water(
    rows: Sequence[Row], circuit: str, first: int, last: int, share: float
) -> tuple[Row, ...]:
    """Return the rows with another share of water in those of a circuit between two rolls.

    The other nozzles of the circuit are unchanged: these ones are worn, clogged, or get more.

    Args:
        rows: All rows.
        circuit: Name of the circuit.
        first: Number of the roll above the first row, from 1.
        last: Number of the roll below the last row.
        share: Water over the nominal one, such as 0.66.

    Raises:
        ValueError: The circuit has no nozzles there, or the share is negative.
    """
    if not share >= 0.0:
        raise ValueError(f"a share of water must not be negative ({share:g})")
    changed = tuple(
        replace(row, share=row.share * share)
        if row.circuit == circuit and first <= row.gap < last
        else row
        for row in rows
    )
    if not any(row.circuit == circuit and first <= row.gap < last for row in rows):
        raise ValueError(f"circuit '{circuit}' has no nozzles between rolls {first} and {last}")
    return changed


@dataclass(frozen=True, slots=True)
class Stretch:
    """A length of strand with one kind of heat loss."""

    kind: Kind  #: kind of heat loss
    start: float  #: start, from the meniscus, m
    end: float  #: end, from the meniscus, m
    gap: int  #: number of the roll above; for contact the number of the roll
    rows: tuple[int, ...] = ()  #: indices of the rows that spray it


def stretches(
    contacts: Sequence[tuple[float, float]],
    rows: Sequence[Row],
    start: float,
    end: float,
    *,
    gathers: Callable[[int], bool],
) -> tuple[Stretch, ...]:
    """Return the stretches of a face between two positions, in casting order, without gaps.

    Args:
        contacts: Start and end of contact with each roll, m; equal positions for no contact.
        rows: Nozzles that spray it.
        start: Start, from the meniscus, m.
        end: End, from the meniscus, m.
        gathers: Whether, in a gap, water runs on from a spray to the next roll and gathers there.
    """
    found = [
        piece
        for piece in _along(contacts, rows, gathers)
        if piece.end > start + _SHORTEST and piece.start < end - _SHORTEST
    ]
    cut = [
        replace(piece, start=max(piece.start, start), end=min(piece.end, end)) for piece in found
    ]
    return tuple(cut)


def _along(
    contacts: Sequence[tuple[float, float]], rows: Sequence[Row], gathers: Callable[[int], bool]
) -> Iterator[Stretch]:
    """Yield all stretches of a face, from the meniscus to far below the last roll."""
    places = [(-math.inf, 0.0), *contacts, (math.inf, math.inf)]
    for number, (upper, lower) in enumerate(itertools.pairwise(places)):
        if number > 0 and upper[1] - upper[0] > _SHORTEST:
            yield Stretch("contact", *upper, number)
        within = [i for i, row in enumerate(rows) if row.gap == number]
        yield from _between(upper[1], lower[0], number, rows, within, gathers(number))


def _between(
    begin: float, finish: float, gap: int, rows: Sequence[Row], within: list[int], gathers: bool
) -> Iterator[Stretch]:
    """Yield the stretches between two contacts."""
    places = [begin, finish, *(x for i in within for x in (rows[i].start, rows[i].end))]
    sprayed = False
    for here, there in itertools.pairwise(sorted(set(places))):
        if there - here < _SHORTEST:
            continue
        active = tuple(i for i in within if rows[i].start <= here and there <= rows[i].end)
        sprayed |= bool(active)
        kind: Kind = "spray" if active else "run_off" if sprayed and gathers else "shade"
        yield Stretch(kind, here, there, gap, active)
