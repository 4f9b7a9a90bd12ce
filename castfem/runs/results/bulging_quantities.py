"""Bulging between the rolls of the machine, and what the rolls bear."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.base.result_registry import quantity

if TYPE_CHECKING:
    from castfem.physics.contact.roll_support import RollSupportState
    from castfem.runs.results.sample import Sample


def _rolls(sample: Sample) -> RollSupportState:
    """The support of the wide faces by rolls."""
    from castfem.physics.contact.roll_support import RollSupportState

    mechanical = sample.state.mechanical
    assert mechanical is not None, "of a quantity that needs mechanics"
    return next(one for one in mechanical.interactions if isinstance(one, RollSupportState))


def _bulge(sample: Sample, side: str) -> float:
    """Bulge of the strip at the middle of one of the wide faces, m."""
    beds = _rolls(sample).beds
    faces = [name for name in beds if name.startswith("wide_face")]
    opposite = [name for name in faces if name.endswith("_extrados")]
    wanted = opposite if side == "extrados" else [n for n in faces if n not in opposite]
    return beds[(wanted or faces)[0]].bulge


@quantity("bulge_intrados", "mm", "bulge, intrados", row=False, needs=("bulging",))
def bulge_intrados(sample: Sample) -> float:
    """Outward deflection of the strip between its rolls, middle of the intrados."""
    return _bulge(sample, "intrados")


@quantity("bulge_extrados", "mm", "bulge, extrados", row=False, needs=("bulging",))
def bulge_extrados(sample: Sample) -> float:
    """Outward deflection of the strip between its rolls, middle of the extrados."""
    return _bulge(sample, "extrados")


@quantity("bulge_pitch", "mm", "largest bulge of the pitch", needs=("bulging",))
def bulge_pitch(sample: Sample) -> float:
    """Largest outward deflection within the pitch, of the face that bulges more."""
    return float(_rolls(sample).memory["largest"].max(initial=0.0))


@quantity("bulge_error", "um", "largest error of a bulge so far", needs=("bulging",))
def bulge_error(sample: Sample) -> float:
    """Estimate of the error of the strip's deflection, the largest of all pitches so far.

    That of its steps and, where it should repeat itself and does not yet, what it still moves.
    """
    return float(_rolls(sample).memory["error"].max(initial=0.0))


@quantity(
    "roll_force", "kN/m", "force on the last pair of rolls, a metre of width", needs=("bulging",)
)
def roll_force(sample: Sample) -> float:
    """By which the shell presses on each roll of the last pair, per metre of width.

    That is half of the pressure on the pitches above and below it, of the first roll below an
    idealised mould and of the last of the one that there is; near rolls that are lost or off it is
    the force of the strip over them.
    """
    return float(_rolls(sample).memory["force"].max(initial=0.0))
