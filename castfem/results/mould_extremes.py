"""The worst of a slice on its way: of its contact in the mould, its stress, its law's data."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from castfem.mould.mould import is_below

if TYPE_CHECKING:
    from castfem.results.sample import Sample


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


@dataclass(slots=True)
class BeyondData:
    """The largest share of the shell on the way beyond the data of its law, and where it was.

    Attributes:
        worst: By kind (`castfem.constitutive.data_range.KINDS`) the share, and the position of the
            slice below the meniscus, m.
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
        from castfem.constitutive.data_range import KINDS  # no part of a run without mechanics

        for kind in KINDS:
            share, position = memory.get(f"{kind}_share"), memory.get(f"{kind}_position")
            if share is not None and position is not None:
                self.worst[kind] = share, position
