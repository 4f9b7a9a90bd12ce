"""Sample of the slice after a step, in SI, and extremes along the way.

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
    from castfem.physics.mechanics.generalized_plane_strain import Bending
    from castfem.physics.mechanics.state import Balance
    from castfem.runs.results.crack_state import QualityState


SMOOTH_ORDER = 32  # smooth maximum: ratio of the integrals of stress^32 and stress^31


@dataclass(slots=True)
class Extremes:
    """Base of values over the whole run; a checkpoint stores them under a prefix."""

    prefix: ClassVar[str]

    def memory(self) -> dict[str, float | None]:
        """Numbers for a checkpoint."""
        return {key: getattr(self, one.name) for key, one in self._numbers()}

    def recall(self, memory: dict[str, float | None]) -> None:
        """Restore `memory`; an older checkpoint may lack entries."""
        for key, one in self._numbers():
            value = memory.get(key)
            setattr(self, one.name, one.default if value is None else value)

    def _numbers(self) -> Iterator[tuple[str, Field[Any]]]:
        """Fields that change during the run, by their keys in a checkpoint."""
        yield from ((f"{self.prefix}_{f.name}", f) for f in fields(self) if f.default != MISSING)


@dataclass(slots=True)
class MouldExtremes(Extremes):
    """Extremes of the contact of the slice with its mould."""

    prefix: ClassVar[str] = "mould"
    length: float  #: length of the mould, m
    gap: float = 0.0  #: largest gap so far, m
    share: float = 1.0  #: smallest part of the surface in contact
    pressure: float = 0.0  #: largest contact pressure at a point, Pa
    mean_pressure: float = 0.0  #: largest contact pressure averaged over a length, Pa
    penetration: float = 0.0  #: deepest penetration of the surface into the wall, m
    heat: float = 0.0  #: heat removed per length of strand, J/m

    def note(self, sample: Sample) -> None:
        """Process a coupling window."""
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
    """The largest von Mises stress along the way, and where it was."""

    prefix: ClassVar[str] = "strained"
    stress: float = 0.0  #: Pa
    position: float = 0.0  #: position of the slice below the meniscus, m
    x: float = 0.0  #: coordinate on the undeformed mesh, m
    y: float = 0.0  #: coordinate on the undeformed mesh, m

    def note(self, sample: Sample) -> None:
        """Process a coupling window."""
        mechanics = sample.mechanics
        if mechanics is not None and mechanics.peak > self.stress:
            self.stress, self.position = mechanics.peak, sample.position
            self.x, self.y = mechanics.peak_at


@dataclass(frozen=True, slots=True)
class SmoothPeak:
    """Smooth approximation of the largest von Mises stress: ratio of two integrals."""

    peak: float  #: the largest stress, Pa
    above: float  #: integral over the section of (stress / peak)^32, m2
    below: float  #: the same with exponent 31

    @property
    def stress(self) -> float:
        """The smooth approximation, Pa."""
        return self.peak * self.above / self.below if self.below else 0.0


@dataclass(slots=True)
class SmoothStress(Extremes):
    """The smooth approximation along the way: both integrals over section and position.

    Integrated by the trapezoidal rule between slices; stresses relative to the largest so far.
    """

    prefix: ClassVar[str] = "smooth"
    peak: float = 0.0  #: the largest so far, Pa
    above: float = 0.0  #: integral of (stress / peak)^32 over section and way, m3
    below: float = 0.0  #: the same with exponent 31
    position: float | None = None  #: position of the last slice, m; None before the first one
    last_peak: float = 0.0  #: largest stress of the last slice, Pa
    last_above: float = 0.0  #: integral over the last slice, m2
    last_below: float = 0.0  #: the same with exponent 31

    @property
    def stress(self) -> float:
        """The smooth approximation, Pa."""
        return self.peak * self.above / self.below if self.below else 0.0

    def note(self, sample: Sample) -> None:
        """Process a coupling window."""
        new = None if sample.mechanics is None else sample.mechanics.smooth
        if new is not None:
            self.add(new, sample.position)

    def add(self, new: SmoothPeak, position: float) -> None:
        """Add a section at a position, m."""
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
    """Largest fraction of the shell beyond the data of its law so far, and where."""

    #: by kind (`castfem.physics.constitutive.base.KINDS`): the fraction, and the position of the
    #: slice below the meniscus, m
    worst: dict[str, tuple[float, float]] = field(default_factory=dict)

    def note(self, sample: Sample) -> None:
        """Process a window."""
        beyond = {} if sample.mechanics is None else sample.mechanics.beyond
        for kind, share in beyond.items():
            if kind not in self.worst or share > self.worst[kind][0]:
                self.worst[kind] = share, sample.position

    def memory(self) -> dict[str, float | None]:
        """Numbers for a checkpoint."""
        names = ("share", "position")
        return {
            f"{kind}_{name}": value
            for kind, values in self.worst.items()
            for name, value in zip(names, values, strict=True)
        }

    def recall(self, memory: dict[str, float | None]) -> None:
        """Restore `memory`; an older checkpoint lacks it."""
        from castfem.physics.constitutive.base import (
            KINDS,  # not needed without mechanics
        )

        for kind in KINDS:
            share, position = memory.get(f"{kind}_share"), memory.get(f"{kind}_position")
            if share is not None and position is not None:
                self.worst[kind] = share, position


@dataclass(frozen=True, slots=True)
class MechanicalSample:
    """Sample of the strained slice, in SI."""

    newton: int  #: Newton iterations of the step
    flowing: float  #: fraction of the area that is yielding
    peak: float  #: largest von Mises stress at a point, Pa
    peak_at: tuple[float, float]  #: its place on the undeformed mesh, m
    surface_stress: dict[str, float]  #: von Mises stress at the start of each probe, Pa
    moved: dict[str, float]  #: outward displacement of the start of each probe, m
    across: dict[str, float]  #: size of the section through each probe that ends in its centre, m
    strain: float  #: axial strain of the slice at the origin
    #: gradients of the axial strain along x and y, a1 and a2, 1/m: the slice's tilt
    gradients: tuple[float, float]
    balance: Balance | None  #: forces of the step; None at the start
    load: float  #: external axial force, N
    #: accumulated friction of the strand above, N. With free planes the sum of both is the force of
    #: the stress: (38).
    withdrawal_resistance: float
    contact: ContactSummary | None  #: contact with the whole mould; None without a mould
    #: gap at the start of each probe, m, NaN without a wall, as below the end of the mould; empty
    #: without a mould
    gap: dict[str, float]
    #: contact pressure there, averaged over a length of the surface, Pa; empty without a mould
    pressure: dict[str, float]
    #: fractions of the solid that are colder, hotter or strained faster than the data of the law;
    #: empty if the law has no such limits, or if there is hardly a shell
    beyond: dict[str, float]
    axial_stress: dict[str, float]  #: axial stress at the start of each probe, Pa
    bending: Bending  #: bending by the curvature of the machine
    #: axial force from bending, N: the rolls turn it with the strand, and the drives supply the
    #: work. With `load` and `withdrawal_resistance` it is the force of the stress if the neutral
    #: axis is free.
    bending_force: float
    smooth: SmoothPeak | None = None  #: smooth approximation of `peak`; None if not requested


@dataclass(slots=True)
class Sample:
    """Sample of the slice at one time, in SI, K, from which quantities are computed."""

    simulation: Simulation  #: the simulation
    state: StrandState  #: the sampled committed state
    time: float  #: s
    position: float  #: position below the meniscus, m
    step: float  #: length of the last step, s
    newton: int  #: Newton iterations of the step
    profiles: dict[str, Profile]  #: temperature along each probe
    #: depth of the solidus below the surface, by probe, m; at present places if heat is computed on
    #: the deformed slice
    shell: dict[str, float]
    liquidus: dict[str, float]  #: depth of the liquidus, in the same form
    #: size of the cell that contains the solidus, along the probe's line, m; NaN without a solidus
    cell: dict[str, float]
    flux: dict[str, float]  #: heat flux at the probe's surface point, W/m2
    removed: float  #: heat removed from the whole section since the meniscus, J per m of strand
    temperature_range: tuple[float, float]  #: coldest and hottest vertex, K
    balance: float  #: heat balance of the step
    #: sample of the strained slice; None without mechanics
    mechanics: MechanicalSample | None = None
    largest_stress: LargestStress = field(default_factory=LargestStress)  #: along the way
    beyond_data: BeyondData = field(default_factory=BeyondData)  #: along the way
    #: smooth approximation of that stress; None if not requested
    smooth_stress: SmoothStress | None = None
    #: position at which the last vertex passed the solidus, m; None while liquid is left
    metallurgical_length: float | None = None
    liquid_end: float | None = None  #: position at which it passed the liquidus, m
    mould_flux: float | None = None  #: mean in the mould so far, W/m2; None without a mould
    #: extremes of the contact in the mould so far; None without a mould
    extremes: MouldExtremes | None = None
    #: crack indexes and end of the liquid core; None without [quality]
    quality: QualityState | None = None

    @property
    def strained(self) -> MechanicalSample:
        """Sample of the strained slice; only with mechanics."""
        assert self.mechanics is not None, "of a quantity that needs mechanics"
        return self.mechanics

    @property
    def bending(self) -> Bending:
        """Bending by the curvature of the machine; only with a bending machine."""
        return self.strained.bending

    @property
    def withdrawal(self) -> Withdrawal:
        """Forces of rolls and drives on the strand."""
        withdrawal = self.bending.withdrawal
        assert withdrawal is not None, "of a quantity that needs an effort"
        return withdrawal

    @property
    def contact(self) -> ContactSummary:
        """Contact with the mould; only with a mould."""
        contact = self.strained.contact
        assert contact is not None, "of a quantity that needs a mould"
        return contact

    @property
    def in_mould(self) -> MouldExtremes:
        """Extremes of the contact in the mould; only with a mould."""
        assert self.extremes is not None, "of a quantity that needs a mould"
        return self.extremes

    @property
    def judged(self) -> QualityState:
        """Crack indexes; only with [quality]."""
        assert self.quality is not None, "of a quantity that needs quality"
        return self.quality

    @property
    def has_stepped(self) -> bool:
        """Whether there was a mechanical step: at the meniscus there is no contact pressure yet."""
        return self.strained.balance is not None
