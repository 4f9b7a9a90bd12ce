"""The rolls of a machine: pairs, those of segments, and what pairs cannot be."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from castfem.base.constants import ROUNDING
from castfem.physics.machine.line import INWARD, Bent, Face

_SIZES = 5.0  # largest ratio of aperture and section, either way
# Smallest ratio at which a strand can pass: reduction with a liquid core takes up to about a third
# off a thin slab (from memory).
_PASSES = 0.6


@dataclass(frozen=True, slots=True)
class Pair:
    """A pair of rolls."""

    position: float  #: position along the strand from the meniscus, m
    diameter: float  #: diameter of its rolls, m
    radius: float = math.inf  #: radius of the strand there, m; inf where it is straight
    #: distance between its rolls, m; None for the thickness of the section
    aperture: float | None = None
    driven: bool = False  #: whether it is driven
    capacity: float | None = None  #: largest drive force, N; None if unknown
    offset: float = 0.0  #: displacement towards the centre of curvature, m
    locked: bool = False  #: whether it is locked
    lost: bool = False  #: whether it is missing; the radius is still that of the strand
    #: radius of the strand there without misaligned or missing rolls, m; None if equal to `radius`
    designed: float | None = None

    @property
    def defect(self) -> str:
        """Description of its defect; "" for none."""
        off = f"{1e3 * self.offset:g} mm off" if self.offset else ""
        listed = (off, "locked" if self.locked else "", "lost" if self.lost else "")
        return ", ".join(word for word in listed if word)


@dataclass(frozen=True, slots=True)
class Rolls:
    """All pairs of rolls in casting order, those of the wide faces and those of the narrow ones."""

    pairs: tuple[Pair, ...]  #: from the mould on
    #: face to which the radii refer, and along which positions are measured
    face: Face = "extrados"
    #: file and key of the definition of each pair, for messages
    places: tuple[str, ...] = field(default=(), compare=False)
    edges: Rolls | None = None  #: the pairs at the narrow faces; None without any

    def place(self, index: int) -> str:
        """File and key of the definition of a pair, for messages."""
        return self.places[index] if index < len(self.places) else f"roll {index + 1}"

    @property
    def there(self) -> tuple[int, ...]:
        """Indices of the pairs that hold the strand: all except missing ones."""
        return tuple(i for i, pair in enumerate(self.pairs) if not pair.lost)

    def aperture(self, index: int, thickness: float) -> float:
        """Aperture of a pair, m; the section's thickness if none is given."""
        given = self.pairs[index].aperture
        return thickness if given is None else given

    def line(self, thickness: float) -> Bent:
        """The line of a strand of some thickness (m) between these rolls."""
        apertures = [self.aperture(i, thickness) for i in range(len(self.pairs))]
        return Bent(
            [pair.position for pair in self.pairs],
            [pair.radius for pair in self.pairs],
            apertures,
            self.face,
        )

    def clearance(self, index: int, thickness: float) -> float:
        """Clear distance of a pair's rolls from those before on the tighter side, m.

        This is the intrados, on whose arcs the axes of the rolls are closer together.
        """
        before, pair = self.pairs[index - 1], self.pairs[index]
        mean = 0.5 * (1.0 / before.radius + 1.0 / pair.radius)
        to_axis = (1.0 - INWARD[self.face]) * self.aperture(index, thickness) + 0.5 * pair.diameter
        pitch = (pair.position - before.position) * (1.0 - mean * to_axis)
        return pitch - 0.5 * (before.diameter + pair.diameter)


@dataclass(frozen=True, slots=True)
class Segment:
    """Rolls of one pitch and diameter."""

    rolls: int  #: number of pairs
    pitch: float  #: distance of each from the pair before, m
    diameter: float  #: diameter, m
    #: radius at its last pair, m: 1/R is linear from the previous segment
    radius: float = math.inf
    aperture: float | None = None  #: aperture, m; None for the thickness of the section


def expand(segments: Sequence[Segment], first: float, face: Face = "extrados") -> Rolls:
    """Return the rolls of successive segments, the first at `first` (m)."""
    pairs: list[Pair] = []
    position, chi = first, 1.0 / segments[0].radius
    for segment in segments:
        begun, change = (chi, 1.0 / segment.radius - chi)
        for k in range(1, segment.rolls + 1):
            position += segment.pitch if pairs else 0.0
            here = begun + change * k / segment.rolls
            radius = 1.0 / here if here > 1e-12 else math.inf
            pairs.append(Pair(position, segment.diameter, radius, segment.aperture))
        chi = 1.0 / segment.radius
    return Rolls(tuple(pairs), face)


@dataclass(frozen=True, slots=True)
class Fault:
    """Reason why a pair is impossible."""

    index: int  #: index of the pair
    kind: str  #: kind of fault, equal for equal faults of several pairs
    text: str  #: message


def faults(
    rolls: Rolls, thickness: float, mould_end: float | None, at: str = "intrados"
) -> Iterator[Fault]:
    """Yield each impossible pair with its fault.

    Args:
        rolls: The pairs.
        thickness: Thickness of the section between them, m.
        mould_end: End of the mould from the meniscus, m; None without a mould.
        at: The face at which they are nearest to each other.
    """
    first = rolls.pairs[0].position
    if mould_end is not None and first < mould_end:
        text = f"position ({first:g} m) lies within the mould, which ends at {mould_end:g} m; "
        text += "positions are measured from the meniscus along the strand"
        yield Fault(0, "mould", text)
    for i in range(len(rolls.pairs)):
        yield from _too_tight(rolls, i, thickness)
        if i > 0:
            yield from _after(rolls, i, thickness, at)


def _too_tight(rolls: Rolls, index: int, thickness: float) -> Iterator[Fault]:
    """Yield an aperture in wrong units, or a radius that leaves the rolls no room."""
    pair, aperture = rolls.pairs[index], rolls.aperture(index, thickness)
    if not thickness / _SIZES <= aperture <= thickness * _SIZES:
        text = f"the section between the rolls measures {1e3 * thickness:g} mm; is its unit right?"
        yield Fault(index, "size", f"aperture ({1e3 * aperture:g} mm): {text}")
        return
    if aperture < _PASSES * thickness:
        text = f"a section of {1e3 * thickness:g} mm cannot pass between these rolls; is one of the"
        yield Fault(index, "passes", f"aperture ({1e3 * aperture:g} mm): {text} two wrong?")
        return
    inner = (1.0 - INWARD[rolls.face]) * aperture + pair.diameter
    if abs(pair.radius) <= inner:
        yield Fault(
            index,
            "radius",
            f"radius_{rolls.face} ({pair.radius:g} m) is below the possible: the rolls of the "
            f"intrados would reach {inner:.4g} m from that face, beyond the centre of curvature; "
            "is its unit right?",
        )


def _after(rolls: Rolls, index: int, thickness: float, at: str) -> Iterator[Fault]:
    """Yield conflicts with the previous pair."""
    before, pair = rolls.pairs[index - 1], rolls.pairs[index]
    pitch = pair.position - before.position
    if pitch <= 0.0:
        yield Fault(
            index,
            "order",
            f"position ({pair.position:g} m) does not lie below the previous roll "
            f"({before.position:g} m); give the rolls in casting order",
        )
        return
    clear = rolls.clearance(index, thickness)
    if clear < 0.0 and not (pair.lost or before.lost):
        yield Fault(
            index,
            "overlap",
            f"diameter ({1e3 * pair.diameter:g} mm) overlaps the previous roll by "
            f"{-1e3 * clear:.3g} mm at the {at}, {1e3 * pitch:.4g} mm below it; make the rolls "
            "thinner or the pitch longer",
        )
    now, then = (rolls.aperture(k, thickness) for k in (index, index - 1))
    if now > then * (1.0 + ROUNDING):
        yield Fault(
            index,
            "aperture",
            f"aperture ({1e3 * now:g} mm) grows from {1e3 * then:g} mm at {rolls.place(index - 1)}:"
            " nothing would hold the strand there; apertures stay or decrease downwards, and one "
            "of the two is wrong",
        )
