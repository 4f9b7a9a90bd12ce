"""The worst of a slice on its way: of its contact in the mould, its stress, its law's data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar

from castfem.physics.mould.mould import is_below

if TYPE_CHECKING:
    from castfem.runs.results.sample import Sample

SMOOTH_ORDER = 32  # of smooth twins: ratio of the integrals of stress^32 and stress^31


@dataclass(slots=True)
class Extremes:
    """What a run would otherwise have forgotten; a checkpoint holds its numbers under a prefix."""

    prefix: ClassVar[str]

    def memory(self) -> dict[str, float | None]:
        """What a checkpoint must hold of it."""
        return {key: getattr(self, one.name) for key, one in self._numbers()}

    def recall(self, memory: dict[str, float | None]) -> None:
        """Restore what `memory` gave; an older checkpoint has not all of it."""
        for key, one in self._numbers():
            value = memory.get(key)
            setattr(self, one.name, one.default if value is None else value)

    def _numbers(self) -> Iterator[tuple[str, Field[Any]]]:
        """The fields that change on the way, by their keys in a checkpoint."""
        yield from ((f"{self.prefix}_{f.name}", f) for f in fields(self) if f.default != MISSING)


@dataclass(slots=True)
class MouldExtremes(Extremes):
    """What the slice has met in its mould.

    Attributes:
        length: Of the mould, m.
        gap: Largest so far, m. share: Least part of the surface in contact.
        pressure: Largest of the contact at a point, Pa. mean_pressure: As mean over a length.
        penetration: Deepest of the surface into the wall, m.
        heat: Removed per length of strand, J/m.
    """

    prefix: ClassVar[str] = "mould"
    length: float
    gap: float = 0.0
    share: float = 1.0
    pressure: float = 0.0
    mean_pressure: float = 0.0
    penetration: float = 0.0
    heat: float = 0.0

    def note(self, sample: Sample) -> None:
        """Take in one more coupling window."""
        if is_below(sample.position, self.length):
            return
        self.heat = sample.removed
        contact = None if sample.mechanics is None else sample.mechanics.contact
        if contact is not None and sample.position > 0.0:
            self.gap = max(self.gap, contact.gap)
            self.share = min(self.share, contact.share)
            self.pressure = max(self.pressure, contact.pressure)
            self.mean_pressure = max(self.mean_pressure, contact.mean_pressure)
            self.penetration = max(self.penetration, contact.penetration)


@dataclass(slots=True)
class LargestStress(Extremes):
    """The largest von Mises stress on the way, and where it was.

    Attributes:
        stress: Pa. position: Of the slice below the meniscus, m. x, y: On the undeformed mesh, m.
    """

    prefix: ClassVar[str] = "strained"
    stress: float = 0.0
    position: float = 0.0
    x: float = 0.0
    y: float = 0.0

    def note(self, sample: Sample) -> None:
        """Take in one more coupling window."""
        mechanics = sample.mechanics
        if mechanics is not None and mechanics.peak > self.stress:
            self.stress, self.position = mechanics.peak, sample.position
            self.x, self.y = mechanics.peak_at


@dataclass(frozen=True, slots=True)
class SmoothPeak:
    """The smooth twin of the largest von Mises stress of a section: a ratio of two integrals.

    Attributes:
        peak: The largest, Pa.
        above: Integral over the section of (stress / peak)^32, m2.
        below: Of that to the power of 31.
    """

    peak: float
    above: float
    below: float

    @property
    def stress(self) -> float:
        """The twin, Pa."""
        return self.peak * self.above / self.below if self.below else 0.0


@dataclass(slots=True)
class SmoothStress(Extremes):
    """The smooth twin of the largest von Mises stress on the way: both integrals along it, too.

    By the trapezoidal rule between slices; stresses over the largest so far.

    Attributes:
        peak: The largest so far, Pa.
        above: Integral of (stress / peak)^32 over section and way, m3.
        below: Of that to the power of 31.
        position: Of the last slice, m; None before the first one.
        last_peak: Its own largest, Pa.
        last_above: Its own integral, m2.
        last_below: Likewise.
    """

    prefix: ClassVar[str] = "smooth"
    peak: float = 0.0
    above: float = 0.0
    below: float = 0.0
    position: float | None = None
    last_peak: float = 0.0
    last_above: float = 0.0
    last_below: float = 0.0

    @property
    def stress(self) -> float:
        """The twin, Pa."""
        return self.peak * self.above / self.below if self.below else 0.0

    def note(self, sample: Sample) -> None:
        """Take in one more coupling window."""
        new = None if sample.mechanics is None else sample.mechanics.smooth
        if new is not None:
            self.add(new, sample.position)

    def add(self, new: SmoothPeak, position: float) -> None:
        """Take in a section at a position, m."""
        largest = max(self.peak, new.peak)
        half = 0.0 if self.position is None else 0.5 * (position - self.position)
        parts = (
            (self.peak, 1.0, self.above, self.below),
            (self.last_peak, half, self.last_above, self.last_below),
            (new.peak, half, new.above, new.below),
        )
        shares = [(peak / largest if largest else 0.0, *rest) for peak, *rest in parts]
        self.above = sum(s**SMOOTH_ORDER * w * above for s, w, above, _ in shares)
        self.below = sum(s ** (SMOOTH_ORDER - 1) * w * below for s, w, _, below in shares)
        self.peak, self.position = largest, position
        self.last_peak, self.last_above, self.last_below = new.peak, new.above, new.below


@dataclass(slots=True)
class BeyondData:
    """The largest share of the shell on the way beyond the data of its law, and where it was.

    Attributes:
        worst: By kind (`castfem.physics.constitutive.base.KINDS`) the share, and the position
            of the slice below the meniscus, m.
    """

    worst: dict[str, tuple[float, float]] = field(default_factory=dict)

    def note(self, sample: Sample) -> None:
        """Take in one more window."""
        beyond = {} if sample.mechanics is None else sample.mechanics.beyond
        for kind, share in beyond.items():
            if kind not in self.worst or share > self.worst[kind][0]:
                self.worst[kind] = share, sample.position

    def memory(self) -> dict[str, float | None]:
        """What a checkpoint must hold of it."""
        names = ("share", "position")
        return {
            f"{kind}_{name}": value
            for kind, values in self.worst.items()
            for name, value in zip(names, values, strict=True)
        }

    def recall(self, memory: dict[str, float | None]) -> None:
        """Restore what `memory` gave; an older checkpoint has nothing of it."""
        from castfem.physics.constitutive.base import (
            KINDS,  # no part of a run without mechanics
        )

        for kind in KINDS:
            share, position = memory.get(f"{kind}_share"), memory.get(f"{kind}_position")
            if share is not None and position is not None:
                self.worst[kind] = share, position
