"""Quantities of the contact with the mould, and of the wide faces on rolls."""

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
# From the meniscus to the mould's end, or to where the slice is.
on_the_way = partial(quantity, column=False, needs=("mould",), of_way=True)


def _at(find: Callable[[ContactSummary], Iterable[float] | None]) -> Callable[[Sample], str]:
    """In words, where in the section something is; "" where it is nowhere."""

    def words(sample: Sample) -> str:
        found = find(sample.contact)
        return "" if found is None else place(found)

    return words


of_contact(
    "gap", "mm", "gap to the mould, {}", each="probe", axis="gap",
    says="Gap between the surface and the wall; below 0 the surface lies in the wall. Empty where "
    "there is no wall, as below the mould. It is that at the end of the coupling window; what "
    "`heat_flux` tells has crossed the mean of the window's beginning and end.",
)(lambda sample, probe: sample.strained.gap[probe])  # fmt: skip
of_contact(
    "contact_pressure", "MPa", "contact pressure, {}", each="probe", row=False,
    says="Contact pressure, mean over 5 mm of the surface around the probe. Where facets are long "
    "it is the mean over three of them.",
)(lambda sample, probe: sample.strained.pressure[probe])  # fmt: skip
of_contact(
    "gap_max", "mm", "largest gap here", axis="gap",
    place=_at(lambda contact: contact.widest if contact.gap else None),
    says="Largest gap of the section to a wall; 0 if none is open. Of all integration points and "
    "vertices of the surface, those of the probes among them.",
)(lambda sample: sample.contact.gap)  # fmt: skip
of_contact(
    "mean_contact_pressure_max", "MPa", "largest contact pressure, mean over 5 mm",
    axis="contact pressure",
    place=_at(lambda contact: contact.highest_mean if contact.pressure else None),
    says="The highest such mean of the contact pressure anywhere; compare moulds by this.",
)(lambda sample: sample.contact.mean_pressure)  # fmt: skip
of_contact(
    "contact_pressure_max", "MPa", "largest contact pressure, at a point", axis="contact pressure",
    place=_at(lambda contact: contact.highest if contact.pressure else None),
    says="The highest contact pressure of a point. Where an arc of the section ends it hangs on "
    "the mesh ([billet](billet.md#pressure-of-the-wall)).",
)(lambda sample: sample.contact.pressure)  # fmt: skip
of_contact(
    "penetration", "um", "largest penetration into the mould here", axis="largest\npenetration",
    says="How deep the surface lies in the wall, at most.",
)(lambda sample: sample.contact.penetration)  # fmt: skip
of_contact(
    "contact_share", "percent", "share of the surface in contact",
    axis="share of the surface\nin contact",
    says="Share of the surface that touches the wall; empty at the meniscus.",
)(lambda sample: sample.contact.share if sample.has_stepped else np.nan)  # fmt: skip
of_contact(
    "friction_force", "kN/m", "friction along the strand, modelled part", row=False,
    axis="friction force,\nmodelled part",
    says="Friction along the strand, of the modelled part, per metre of strand. It is negative as "
    "it holds the strand back.",
)(lambda sample: sample.contact.axial)  # fmt: skip
of_contact(
    "friction_pull", "kN", "accumulated friction, modelled part", row=False,
    says="What friction has handed down the modelled part so far: its share of `axial_force`.",
)(lambda sample: sample.strained.withdrawal_resistance)  # fmt: skip
of_friction(
    "contact_sticking", "percent", "share of the surface that sticks to the mould", after="gap",
    says="Share of the surface that touches the wall and sticks; empty at the meniscus.",
)(lambda sample: sample.contact.sticking if sample.has_stepped else np.nan)  # fmt: skip
of_friction(
    "mould_friction", "kN/m", "friction of the mould, whole strand, per m",
    axis="friction force,\nwhole strand",
    says="Friction along the whole strand, per metre of it; positive as it holds the strand back.",
)(lambda sample: -sample.contact.axial * sample.simulation.section.multiplicity)  # fmt: skip
of_friction(
    "mould_pull", "kN", "withdrawal resistance of the mould",
    says="Withdrawal resistance of the mould, whole strand; positive as it holds the strand back.",
)(
    lambda sample: sample.strained.withdrawal_resistance * sample.simulation.section.multiplicity
)  # fmt: skip
on_the_way(
    "mould_heat_removed", "MJ/m", "heat removed in the mould",
    says="In the mould, per metre of the whole strand.",
)(lambda sample: sample.in_mould.heat)  # fmt: skip


@quantity(
    "mould_heat_asked", "MJ/m", "heat in the mould by its given flux, without gaps",
    column=False, needs=("mould", "given_heat"), of_way=True,
)  # fmt: skip
def mould_heat_asked(sample: Sample) -> float:
    """What the flux given for contact would take in the mould if no gap opened.

    Per metre of the whole strand; where a gap opens less is removed.
    """
    machine, mould = sample.simulation.machine, sample.simulation.case.mould
    assert mould is not None, "of a quantity that needs a mould"
    return sample.simulation.zones.heat_asked(min(sample.time, machine.time_at(mould.length)))


on_the_way(
    "mould_gap_max", "mm", "largest gap in the mould",
    says="On the way through the mould.",
)(lambda sample: sample.in_mould.gap)  # fmt: skip
on_the_way(
    "mould_contact_least", "percent", "least contact in the mould, share of the surface",
    says="On the way through the mould.",
)(lambda sample: sample.in_mould.share)  # fmt: skip
on_the_way(
    "mould_mean_pressure_max", "MPa", "largest contact pressure in the mould, mean over 5 mm",
    says="On the way through the mould.",
)(lambda sample: sample.in_mould.mean_pressure)  # fmt: skip
on_the_way(
    "mould_pressure_max", "MPa", "largest contact pressure in the mould, at a point",
    says="On the way through the mould.",
)(lambda sample: sample.in_mould.pressure)  # fmt: skip
on_the_way(
    "mould_penetration_max", "um", "largest penetration into the mould, on the way",
    says="On the way through the mould.",
)(lambda sample: sample.in_mould.penetration)  # fmt: skip
of_oscillation(
    "negative_strip_time", "s", "negative strip time of each stroke",
    says="Time of each stroke in which the mould goes down faster than the strand; 0 if it never "
    "does. Of a sine: arccos(v/(pi f s))/(pi f), with the mean casting speed v on the way to "
    "here.",
)(lambda sample: _oscillation(sample).negative_strip(_mean_speed(sample)))  # fmt: skip
of_oscillation(
    "oscillation_pitch", "mm", "pitch of the oscillation marks",
    says="How far the strand comes in a stroke of the mould.",
)(lambda sample: _mean_speed(sample) / _oscillation(sample).frequency)  # fmt: skip


def _oscillation(sample: Sample) -> Oscillation:
    mould = sample.simulation.case.mould
    assert mould is not None and mould.oscillation is not None
    return mould.oscillation


def _mean_speed(sample: Sample) -> float:
    """On the way to here, m/s; at the meniscus that there."""
    machine = sample.simulation.machine
    return machine.mean_speed(sample.time) if sample.time > 0.0 else machine.speed(0.0)


def _rolls(sample: Sample) -> RollSupportState:
    return _roll_supports(sample)[0]


def _roll_supports(sample: Sample) -> list[RollSupportState]:
    """That of the wide faces, and that of the narrow ones if these have rolls."""
    from castfem.physics.contact.roll_support import RollSupportState

    mechanical = sample.state.mechanical
    assert mechanical is not None, "of a quantity that needs mechanics"
    return [one for one in mechanical.interactions if isinstance(one, RollSupportState)]


def _edge_force(sample: Sample) -> float:
    """Largest force of the rolls at a narrow face, N per m of strand."""
    return float(_roll_supports(sample)[1].force.max())


def _bulge(sample: Sample, side: str) -> float:
    """Bulge of the strip at the middle of one of the wide faces, m."""
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
    says="Largest outward deflection within the pitch, of the face that bulges more.",
)(lambda sample: float(_rolls(sample).memory["largest"].max(initial=0.0)))  # fmt: skip
quantity(
    "bulge_error", "um", "largest error of a bulge so far", needs=("bulging",),
    says="Estimate of the error of the strip's deflection, the largest of all pitches so far. That "
    "of its steps and, where it should repeat itself and does not yet, what it still moves.",
)(lambda sample: float(_rolls(sample).memory["error"].max(initial=0.0)))  # fmt: skip
quantity(
    "roll_force", "kN/m", "force on the last pair of rolls, a metre of width", needs=("bulging",),
    says="By which the shell presses on each roll of the last pair, per metre of width. That is "
    "half of the pressure on the pitches above and below it, of the first roll below an "
    "idealised mould and of the last of the one that there is; near rolls that are lost or "
    "off it is the force of the strip over them.",
)(lambda sample: float(_rolls(sample).memory["force"].max(initial=0.0)))  # fmt: skip
quantity(
    "edge_roll_force", "kN/m", "force of the rolls at a narrow face, a metre of strand",
    needs=("edge_rolls",),
    says="By which a narrow face presses on its rolls, per metre of strand; 0 where it has shrunk "
    "off them, and where there are none.",
)(_edge_force)  # fmt: skip
