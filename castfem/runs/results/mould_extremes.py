"""The worst of a slice on its way: of its contact in the mould, its stress, its law's data."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING

from castfem.physics.mould.mould import is_below

if TYPE_CHECKING:
    from castfem.runs.results.sample import Sample

SMOOTH_ORDER = 32  # of smooth twins: ratio of the integrals of stress^32 and stress^31


@dataclass(slots=True)
class MouldExtremes:
    """What a run that goes on below its mould would otherwise have forgotten.

    Attributes:
        length: Of the mould, m.
        gap: Largest so far, m. share: Least part of the surface in contact.
        pressure: Largest of the contact at a point, Pa. mean_pressure: As mean over a length.
        penetration: Deepest of the surface into the wall, m.
        heat: Removed per length of strand, J/m.
    """

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

    def memory(self) -> dict[str, float | None]:
        """What a checkpoint must hold of it."""
        return {f"mould_{name}": value for name, value in asdict(self).items() if name != "length"}

    def recall(self, memory: dict[str, float | None]) -> None:
        """Take up what `memory` gave."""
        for name in ("gap", "share", "pressure", "mean_pressure", "penetration", "heat"):
            value = memory.get(f"mould_{name}")  # of an older checkpoint not all are there
            if value is not None:
                setattr(self, name, value)


@dataclass(slots=True)
class LargestStress:
    """The largest von Mises stress on the way, and where it was.

    Attributes:
        stress: Pa. position: Of the slice below the meniscus, m. x, y: On the undeformed mesh, m.
    """

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

    def memory(self) -> dict[str, float | None]:
        """What a checkpoint must hold of it."""
        return {f"strained_{name}": value for name, value in asdict(self).items()}

    def recall(self, memory: dict[str, float | None]) -> None:
        """Take up what `memory` gave; an older checkpoint has nothing of it."""
        for name in ("stress", "position", "x", "y"):
            setattr(self, name, memory.get(f"strained_{name}") or 0.0)


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
class SmoothStress:
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

    def memory(self) -> dict[str, float | None]:
        """What a checkpoint must hold of it."""
        return {f"smooth_{name}": value for name, value in asdict(self).items()}

    def recall(self, memory: dict[str, float | None]) -> None:
        """Take up what `memory` gave."""
        for one in fields(self):
            setattr(self, one.name, memory.get(f"smooth_{one.name}", one.default))


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
        """Take up what `memory` gave; an older checkpoint has nothing of it."""
        from castfem.physics.constitutive.base import (
            KINDS,  # no part of a run without mechanics
        )

        for kind in KINDS:
            share, position = memory.get(f"{kind}_share"), memory.get(f"{kind}_position")
            if share is not None and position is not None:
                self.worst[kind] = share, position
