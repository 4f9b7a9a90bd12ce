"""A sample: what is read off the slice after a step, in SI, and the worst on the way.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar

from castfem.physics.mould.mould import is_below

if TYPE_CHECKING:
    from castfem.fem.probes import Profile
    from castfem.model.build.simulation import Simulation
    from castfem.physics.contact.state import ContactSummary
    from castfem.physics.coupling.staggered import StrandState
    from castfem.physics.machine.extraction.effort import Withdrawal
    from castfem.physics.mechanics.planes import Bending
    from castfem.physics.mechanics.state import Balance
    from castfem.runs.results.quality import QualityState


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
    """What the slice has met in its mould."""

    prefix: ClassVar[str] = "mould"
    length: float  #: of the mould, m
    gap: float = 0.0  #: largest so far, m
    share: float = 1.0  #: least part of the surface in contact
    pressure: float = 0.0  #: largest of the contact at a point, Pa
    mean_pressure: float = 0.0  #: as mean over a length
    penetration: float = 0.0  #: deepest of the surface into the wall, m
    heat: float = 0.0  #: removed per length of strand, J/m

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
    """The largest von Mises stress on the way, and where it was."""

    prefix: ClassVar[str] = "strained"
    stress: float = 0.0  #: Pa
    position: float = 0.0  #: of the slice below the meniscus, m
    x: float = 0.0  #: on the undeformed mesh, m
    y: float = 0.0  #: on the undeformed mesh, m

    def note(self, sample: Sample) -> None:
        """Take in one more coupling window."""
        mechanics = sample.mechanics
        if mechanics is not None and mechanics.peak > self.stress:
            self.stress, self.position = mechanics.peak, sample.position
            self.x, self.y = mechanics.peak_at


@dataclass(frozen=True, slots=True)
class SmoothPeak:
    """The smooth twin of the largest von Mises stress of a section: a ratio of two integrals."""

    peak: float  #: the largest, Pa
    above: float  #: integral over the section of (stress / peak)^32, m2
    below: float  #: of that to the power of 31

    @property
    def stress(self) -> float:
        """The twin, Pa."""
        return self.peak * self.above / self.below if self.below else 0.0


@dataclass(slots=True)
class SmoothStress(Extremes):
    """The smooth twin of the largest von Mises stress on the way: both integrals along it, too.

    By the trapezoidal rule between slices; stresses over the largest so far.
    """

    prefix: ClassVar[str] = "smooth"
    peak: float = 0.0  #: the largest so far, Pa
    above: float = 0.0  #: integral of (stress / peak)^32 over section and way, m3
    below: float = 0.0  #: of that to the power of 31
    position: float | None = None  #: of the last slice, m; None before the first one
    last_peak: float = 0.0  #: its own largest, Pa
    last_above: float = 0.0  #: its own integral, m2
    last_below: float = 0.0  #: likewise

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
    """The largest share of the shell on the way beyond the data of its law, and where it was."""

    #: by kind (`castfem.physics.constitutive.base.KINDS`) the share, and the position of the slice
    #: below the meniscus, m
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


@dataclass(frozen=True, slots=True)
class MechanicalSample:
    """What is known of the strained slice at one time, in SI."""

    newton: int  #: Newton iterations of the step
    flowing: float  #: share of the area that flows
    peak: float  #: largest von Mises stress at a point, Pa
    peak_at: tuple[float, float]  #: where, on the undeformed mesh, m
    surface_stress: dict[str, float]  #: von Mises stress at the start of each probe, Pa
    moved: dict[str, float]  #: outward displacement of the start of each probe, m
    across: dict[str, float]  #: size of the section through each probe that ends in its centre, m
    strain: float  #: axial strain of the slice at the origin
    #: of the axial strain along x and y, a1 and a2, 1/m: the slice's tilt
    gradients: tuple[float, float]
    balance: Balance | None  #: forces of the step; None at the start
    load: float  #: external axial force, N
    #: friction of the strand above, accumulated, N. The sum of both is the force of the stress
    #: where the planes are free: (38).
    withdrawal_resistance: float
    contact: ContactSummary | None  #: with the mould, all of it together; None without a mould
    #: to the wall at the start of each probe, m, NaN where there is none, as below the end of the
    #: mould; empty without a mould
    gap: dict[str, float]
    #: contact pressure there, a mean over a length of the surface, Pa; likewise
    pressure: dict[str, float]
    #: share of the solid that is colder, hotter, strained faster than the data of the law; empty
    #: where the law does not say, or while there is hardly a shell
    beyond: dict[str, float]
    axial_stress: dict[str, float]  #: stress along the strand at the start of each probe, Pa
    bending: Bending  #: by the machine's curvature
    #: axial force that bending has left, N: the rolls turn it with the strand, and the drives pay
    #: for the work. With `load` and `withdrawal_resistance` it is the force of the stress where the
    #: neutral axis is free.
    bending_force: float
    smooth: SmoothPeak | None = None  #: smooth twin of `peak`; None where it is not asked for


@dataclass(slots=True)
class Sample:
    """What is known of the slice at one time, in SI, K; a quantity is computed from it."""

    simulation: Simulation  #: the objects of the run
    state: StrandState  #: the committed state that was read
    time: float  #: s
    position: float  #: below the meniscus, m
    step: float  #: length of the last step, s
    newton: int  #: Newton iterations of the step
    profiles: dict[str, Profile]  #: temperature along each probe
    #: depth of the solidus below the surface, by probe, m; liquidus likewise. Of a slice through
    #: which the heat flows as it has moved, where they are now.
    shell: dict[str, float]
    liquidus: dict[str, float]
    #: size of the cell in which the solidus lies, along the probe's line, m; NaN without
    cell: dict[str, float]
    flux: dict[str, float]  #: heat flux at the probe's surface point, W/m2
    removed: float  #: heat removed from the whole section since the meniscus, J per m of strand
    temperature_range: tuple[float, float]  #: coldest and hottest vertex, K
    balance: float  #: heat balance of the step
    #: the strained slice; None in a simulation without mechanics
    mechanics: MechanicalSample | None = None
    largest_stress: LargestStress = field(default_factory=LargestStress)  #: on the way to here
    beyond_data: BeyondData = field(default_factory=BeyondData)  #: likewise
    #: the smooth twin of that stress; None where it is not asked for
    smooth_stress: SmoothStress | None = None
    #: where the last vertex passed the solidus, m; None while liquid is left
    metallurgical_length: float | None = None
    liquid_end: float | None = None  #: where it passed the liquidus
    mould_flux: float | None = None  #: mean of the mould so far, W/m2; None without
    #: of the contact in the mould so far; None without a mould
    extremes: MouldExtremes | None = None
    #: crack indexes and end of the pool; None in a case without [quality]
    quality: QualityState | None = None

    @property
    def strained(self) -> MechanicalSample:
        """The strained slice of a simulation with mechanics."""
        assert self.mechanics is not None, "of a quantity that needs mechanics"
        return self.mechanics

    @property
    def bending(self) -> Bending:
        """What the machine's curvature has done to the slice."""
        return self.strained.bending

    @property
    def withdrawal(self) -> Withdrawal:
        """What rolls and drives have done to the strand."""
        withdrawal = self.bending.withdrawal
        assert withdrawal is not None, "of a quantity that needs an effort"
        return withdrawal

    @property
    def contact(self) -> ContactSummary:
        """The contact of a simulation with a mould."""
        contact = self.strained.contact
        assert contact is not None, "of a quantity that needs a mould"
        return contact

    @property
    def in_mould(self) -> MouldExtremes:
        """What the slice has met in its mould."""
        assert self.extremes is not None, "of a quantity that needs a mould"
        return self.extremes

    @property
    def judged(self) -> QualityState:
        """The crack indexes of a case with [quality]."""
        assert self.quality is not None, "of a quantity that needs quality"
        return self.quality

    @property
    def has_stepped(self) -> bool:
        """Whether a mechanical step led here: at the meniscus nothing has been pressed yet."""
        return self.strained.balance is not None
