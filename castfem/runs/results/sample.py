"""A sample: what is read off the slice after a step, in SI.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from castfem.runs.results.mould_extremes import (
    BeyondData,
    LargestStress,
    MouldExtremes,
    SmoothPeak,
    SmoothStress,
)

if TYPE_CHECKING:
    from castfem.fem.probes import Profile
    from castfem.model.build.simulation import Simulation
    from castfem.physics.contact.state import ContactSummary
    from castfem.physics.coupling.staggered import StrandState
    from castfem.physics.machine.extraction.effort import Withdrawal
    from castfem.physics.mechanics.planes import Bending
    from castfem.physics.mechanics.state import Balance
    from castfem.runs.results.quality import QualityState


@dataclass(frozen=True, slots=True)
class MechanicalSample:
    """What is known of the strained slice at one time, in SI.

    Attributes:
        newton: Newton iterations of the step. flowing: Share of the area that flows.
        peak: Largest von Mises stress at a point, Pa. peak_at: Where, on the undeformed mesh, m.
        surface_stress: Von Mises stress at the start of each probe, Pa.
        moved: Outward displacement of the start of each probe, m.
        across: Size of the section through each probe that ends in its centre, m.
        strain: Axial strain of the slice at the origin.
        gradients: Of the axial strain along x and y, a1 and a2, 1/m: the slice's tilt.
        balance: Forces of the step; None at the start.
        load: External axial force, N.
        withdrawal_resistance: Friction of the strand above, accumulated, N. The sum of
            both is the force of the stress where the planes are free: (38).
        contact: With the mould, all of it together; None without a mould.
        gap: To the wall at the start of each probe, m, NaN where there is none, as below the end
            of the mould; empty without a mould.
        pressure: Contact pressure there, a mean over a length of the surface, Pa; likewise.
        beyond: Share of the solid that is colder, hotter, strained faster than the data of the law;
            empty where the law does not say, or while there is hardly a shell.
        axial_stress: Stress along the strand at the start of each probe, Pa.
        bending: By the machine's curvature. bending_force: Axial force that bending has left, N:
            the rolls turn it with the strand, and the drives pay for the work. With `load` and
            `withdrawal_resistance` it is the force of the stress where the neutral axis is free.
        smooth: Smooth twin of `peak`; None where it is not asked for.
    """

    newton: int
    flowing: float
    peak: float
    peak_at: tuple[float, float]
    surface_stress: dict[str, float]
    moved: dict[str, float]
    across: dict[str, float]
    strain: float
    gradients: tuple[float, float]
    balance: Balance | None
    load: float
    withdrawal_resistance: float
    contact: ContactSummary | None
    gap: dict[str, float]
    pressure: dict[str, float]
    beyond: dict[str, float]
    axial_stress: dict[str, float]
    bending: Bending
    bending_force: float
    smooth: SmoothPeak | None = None


@dataclass(slots=True)
class Sample:
    """What is known of the slice at one time, in SI, K; a quantity is computed from it.

    Attributes:
        simulation: The objects of the run. state: The committed state that was read.
        time: s. position: Below the meniscus, m. step: Length of the last step, s.
        newton: Newton iterations of the step. profiles: Temperature along each probe.
        shell: Depth of the solidus below the surface, by probe, m; liquidus likewise. Of a slice
            through which the heat flows as it has moved, where they are now.
        cell: Size of the cell in which the solidus lies, along the probe's line, m; NaN without.
        flux: Heat flux at the probe's surface point, W/m2.
        removed: Heat removed from the whole section since the meniscus, J per m of strand.
        temperature_range: Coldest and hottest vertex, K. balance: Heat balance of the step.
        mechanics: The strained slice; None in a simulation without mechanics.
        largest_stress: On the way to here. beyond_data: Likewise. smooth_stress: The smooth twin of
            that stress; None where it is not asked for.
        metallurgical_length: Where the last vertex passed the solidus, m; None while liquid is
            left. liquid_end: Where it passed the liquidus. mould_flux: Mean of the mould so far,
            W/m2; None without.
        extremes: Of the contact in the mould so far; None without a mould.
        quality: Crack indexes and end of the pool; None in a case without [quality].
    """

    simulation: Simulation
    state: StrandState
    time: float
    position: float
    step: float
    newton: int
    profiles: dict[str, Profile]
    shell: dict[str, float]
    liquidus: dict[str, float]
    cell: dict[str, float]
    flux: dict[str, float]
    removed: float
    temperature_range: tuple[float, float]
    balance: float
    mechanics: MechanicalSample | None = None
    largest_stress: LargestStress = field(default_factory=LargestStress)
    beyond_data: BeyondData = field(default_factory=BeyondData)
    smooth_stress: SmoothStress | None = None
    metallurgical_length: float | None = None
    liquid_end: float | None = None
    mould_flux: float | None = None
    extremes: MouldExtremes | None = None
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
