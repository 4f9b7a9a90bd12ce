"""Results of the contact with the mould, and of the wide faces on their rolls."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.result_registry import quantity
from castfem.runs.results.mechanical_quantities import place

if TYPE_CHECKING:
    from castfem.model.mould import Oscillation
    from castfem.physics.contact.roll_support import RollSupportState
    from castfem.physics.contact.state import ContactSummary
    from castfem.runs.results.sample import Sample


of_contact = partial(quantity, needs=("mould",))
of_friction = partial(quantity, needs=("friction",))
of_oscillation = partial(quantity, column=False, needs=("oscillation",))
# From the meniscus to the end of the mould, or to the present position of the slice.
on_the_way = partial(quantity, column=False, needs=("mould",), of_way=True)


def _at(find: Callable[[ContactSummary], Iterable[float] | None]) -> Callable[[Sample], str]:
    """Return a function that gives the place of an extreme as text; "" if there is none."""

    def words(sample: Sample) -> str:
        found = find(sample.contact)
        return "" if found is None else place(found)

    return words


of_contact(
    "gap", "mm", "gap to the mould, {}", each="probe", axis="gap",
    says="Gap between the surface and the wall at the end of the coupling window; negative where "
    "the surface penetrates the wall, empty where there is no wall, as below the mould. "
    "`heat_flux` belongs to the mean gap of the window.",
)(lambda sample, probe: sample.strained.gap[probe])  # fmt: skip
of_contact(
    "contact_pressure", "MPa", "contact pressure, {}", each="probe", row=False,
    says="Contact pressure averaged over 5 mm of the surface around the probe, or over three "
    "facets if these are longer.",
)(lambda sample, probe: sample.strained.pressure[probe])  # fmt: skip
of_contact(
    "gap_max", "mm", "largest gap here", axis="gap",
    place=_at(lambda contact: contact.widest if contact.gap else None),
    says="Largest gap of the section to a wall; 0 if none is open. All integration points and "
    "vertices of the surface count, including those of the probes.",
)(lambda sample: sample.contact.gap)  # fmt: skip
of_contact(
    "mean_contact_pressure_max", "MPa", "largest contact pressure, mean over 5 mm",
    axis="contact pressure",
    place=_at(lambda contact: contact.highest_mean if contact.pressure else None),
    says="Highest contact pressure anywhere, averaged over 5 mm; use this to compare moulds.",
)(lambda sample: sample.contact.mean_pressure)  # fmt: skip
of_contact(
    "contact_pressure_max", "MPa", "largest contact pressure, at a point", axis="contact pressure",
    place=_at(lambda contact: contact.highest if contact.pressure else None),
    says="Highest contact pressure at a point. Where an arc of the section ends it depends on the "
    "mesh ([billet](billet.md#pressure-of-the-wall)).",
)(lambda sample: sample.contact.pressure)  # fmt: skip
of_contact(
    "penetration", "um", "largest penetration into the mould here", axis="largest\npenetration",
    says="Largest penetration of the surface into the wall.",
)(lambda sample: sample.contact.penetration)  # fmt: skip
of_contact(
    "contact_share", "percent", "share of the surface in contact",
    axis="share of the surface\nin contact",
    says="Fraction of the surface that touches the wall; empty at the meniscus.",
)(lambda sample: sample.contact.share if sample.has_stepped else np.nan)  # fmt: skip
of_contact(
    "friction_force", "kN/m", "friction along the strand, modelled part", row=False,
    axis="friction force,\nmodelled part",
    says="Friction force along the strand on the modelled part, per metre of strand; negative if "
    "it holds the strand back.",
)(lambda sample: sample.contact.axial)  # fmt: skip
of_contact(
    "friction_pull", "kN", "accumulated friction, modelled part", row=False,
    says="Accumulated friction force of the modelled part: the contribution of friction to "
    "`axial_force`.",
)(lambda sample: sample.strained.withdrawal_resistance)  # fmt: skip
of_friction(
    "contact_sticking", "percent", "share of the surface that sticks to the mould", after="gap",
    says="Fraction of the surface that touches the wall and sticks; empty at the meniscus.",
)(lambda sample: sample.contact.sticking if sample.has_stepped else np.nan)  # fmt: skip
of_friction(
    "mould_friction", "kN/m", "friction of the mould, whole strand, per m",
    axis="friction force,\nwhole strand",
    says="Friction force along the whole strand, per metre of strand; positive if it holds the "
    "strand back.",
)(lambda sample: -sample.contact.axial * sample.simulation.section.multiplicity)  # fmt: skip
of_friction(
    "mould_pull", "kN", "withdrawal resistance of the mould",
    says="Withdrawal resistance of the mould, whole strand; positive if it holds the strand back.",
)(
    lambda sample: sample.strained.withdrawal_resistance * sample.simulation.section.multiplicity
)  # fmt: skip
on_the_way(
    "mould_heat_removed", "MJ/m", "heat removed in the mould",
    says="Heat removed in the mould, per metre of the whole strand.",
)(lambda sample: sample.in_mould.heat)  # fmt: skip


@quantity(
    "mould_heat_asked", "MJ/m", "heat in the mould by its given flux, without gaps",
    column=False, needs=("mould", "given_heat"), of_way=True,
)  # fmt: skip
def mould_heat_asked(sample: Sample) -> float:
    """Heat that the prescribed contact flux would remove in the mould without a gap.

    Per metre of the whole strand; a gap reduces it.
    """
    machine, mould = sample.simulation.machine, sample.simulation.case.mould
    assert mould is not None, "of a quantity that needs a mould"
    return sample.simulation.zones.heat_asked(min(sample.time, machine.time_at(mould.length)))


on_the_way(
    "mould_gap_max", "mm", "largest gap in the mould",
    says="Largest gap along the way through the mould.",
)(lambda sample: sample.in_mould.gap)  # fmt: skip
on_the_way(
    "mould_contact_least", "percent", "least contact in the mould, share of the surface",
    says="Smallest contact along the way through the mould.",
)(lambda sample: sample.in_mould.share)  # fmt: skip
on_the_way(
    "mould_mean_pressure_max", "MPa", "largest contact pressure in the mould, mean over 5 mm",
    says="Largest value along the way through the mould.",
)(lambda sample: sample.in_mould.mean_pressure)  # fmt: skip
on_the_way(
    "mould_pressure_max", "MPa", "largest contact pressure in the mould, at a point",
    says="Largest value along the way through the mould.",
)(lambda sample: sample.in_mould.pressure)  # fmt: skip
on_the_way(
    "mould_penetration_max", "um", "largest penetration into the mould, on the way",
    says="Largest value along the way through the mould.",
)(lambda sample: sample.in_mould.penetration)  # fmt: skip
of_oscillation(
    "negative_strip_time", "s", "negative strip time of each stroke",
    says="Time of each stroke in which the mould moves down faster than the strand; 0 if it never "
    "does. For a sine: arccos(v/(pi f s))/(pi f), with the mean casting speed v so far.",
)(lambda sample: _oscillation(sample).negative_strip(_mean_speed(sample)))  # fmt: skip
of_oscillation(
    "oscillation_pitch", "mm", "pitch of the oscillation marks",
    says="Length of strand cast during a stroke of the mould.",
)(lambda sample: _mean_speed(sample) / _oscillation(sample).frequency)  # fmt: skip


def _oscillation(sample: Sample) -> Oscillation:
    mould = sample.simulation.case.mould
    assert mould is not None and mould.oscillation is not None
    return mould.oscillation


def _mean_speed(sample: Sample) -> float:
    """Mean speed since the meniscus, m/s; at the meniscus the speed there."""
    machine = sample.simulation.machine
    return machine.mean_speed(sample.time) if sample.time > 0.0 else machine.speed(0.0)


def _rolls(sample: Sample) -> RollSupportState:
    return _roll_supports(sample)[0]


def _roll_supports(sample: Sample) -> list[RollSupportState]:
    """State of the wide faces on their rolls, and of the narrow faces if these have rolls."""
    from castfem.physics.contact.roll_support import RollSupportState

    mechanical = sample.state.mechanical
    assert mechanical is not None, "of a quantity that needs mechanics"
    return [one for one in mechanical.interactions if isinstance(one, RollSupportState)]


def _edge_force(sample: Sample) -> float:
    """Largest roll force at a narrow face, N per m of strand."""
    return float(_roll_supports(sample)[1].force.max())


def _bulge(sample: Sample, side: str) -> float:
    """Bulge at the middle of one of the wide faces, m."""
    beds = _rolls(sample).beds
    faces = [name for name in beds if name.startswith("wide_face")]
    opposite = [name for name in faces if name.endswith("_extrados")]
    wanted = opposite if side == "extrados" else [n for n in faces if n not in opposite]
    return beds[(wanted or faces)[0]].bulge


quantity(
    "bulge_intrados", "mm", "bulge, intrados", row=False, needs=("bulging",),
    says="Outward deflection of the strip between its rolls, middle of the intrados.",
)(lambda sample: _bulge(sample, "intrados"))  # fmt: skip
quantity(
    "bulge_extrados", "mm", "bulge, extrados", row=False, needs=("bulging",),
    says="Outward deflection of the strip between its rolls, middle of the extrados.",
)(lambda sample: _bulge(sample, "extrados"))  # fmt: skip
quantity(
    "bulge_pitch", "mm", "largest bulge of the pitch", needs=("bulging",),
    says="Largest outward deflection within the pitch, on the face that bulges more.",
)(lambda sample: float(_rolls(sample).memory["largest"].max(initial=0.0)))  # fmt: skip
quantity(
    "bulge_error", "um", "largest error of a bulge so far", needs=("bulging",),
    says="Estimated error of the strip's deflection, the largest of all pitches so far: that of "
    "the step size, and what the passes through a pitch have left (its change in the last pass "
    "or, if larger, the gap of the curvature from end to end).",
)(lambda sample: float(_rolls(sample).memory["error"].max(initial=0.0)))  # fmt: skip
quantity(
    "roll_force", "kN/m", "force on the last pair of rolls, a metre of width", needs=("bulging",),
    says="Force of the shell on each roll of the last pair, per metre of width: half of the "
    "pressure on the pitches above and below it; for the first roll below an idealised mould and "
    "for the last roll of the machine, half of that on its one pitch; near missing or misaligned "
    "rolls the force of the strip over them.",
)(lambda sample: float(_rolls(sample).memory["force"].max(initial=0.0)))  # fmt: skip
quantity(
    "edge_roll_force", "kN/m", "force of the rolls at a narrow face, a metre of strand",
    needs=("edge_rolls",),
    says="Force of a narrow face on its rolls, per metre of strand; 0 where the face has shrunk "
    "away from them, and without rolls.",
)(_edge_force)  # fmt: skip
