"""Which of the many results of a run are looked at first."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping

from castfem.base.result_registry import AT_FRACTION
from castfem.base.shown_quantity import Quantity

_TWINS = (
    ("_left", "_right"),
    ("_extrados", "_intrados"),
    ("_extrados", ""),  # of a straight strand the intrados has no addition
    ("_narrow_face", "_mid_face"),
)
"""Parts of names, and of the place before that may have the same number."""
_PLACES = tuple(
    f"{face}{side}{half}"
    for face in ("mid_face", "narrow_face", "corner")
    for side in ("", "_intrados", "_extrados")
    for half in ("", "_right", "_left")
)


def at_places(quantity: str) -> tuple[str, ...]:
    """Return the names of a quantity at all places that a section may have, mid-faces first."""
    return tuple(f"{quantity}_{place}" for place in _PLACES)


AT_PROBES = (*at_places("shell"), *at_places("surface_temperature"))
# In the order in which they are shown; what a run does not have is left out.
HEADLINE = (
    "liquid_end",
    "metallurgical_length",
    *AT_PROBES,
    "heat_removed",
    "von_mises_max",
    "way_von_mises_max",
    "von_mises_mid_face",
    "von_mises_corner",
    "mould_heat_removed",
    "mould_gap_max",
    "mould_contact_least",
    "mould_mean_pressure_max",
    "mould_pressure_max",
    "mould_pull",
    "size_mid_face",
    "size_corner",
    "displacement_mid_face",
    "displacement_corner",
    "bending_I1_max",
    "bending_I2_max",
    "straightening_I1_max",
    "straightening_I2_max",
    "way_I1_max",
    "way_I2_max",
    "slice_thickness_centre",
    "mould_mean_flux",
)
FROM_HISTORY = (
    "shell_least",
    "contact_lost",
    "contact_regained",
    "bulge_largest",
    "roll_force_largest",
)
"""What tables of many runs have besides (`castfem.runs.results.derived`)."""
ENDS = ("liquid_end", "metallurgical_length")
"""Ends of the pool, which stand first, where any of the runs has come to them."""
# Place, position, roll, time and phase of the largest value of a map.
_PLACE = re.compile(
    r", (?:[^,]+, (?:corner|[^,]+ from the corner)|x = [^,]+, y = [^,]+)"
    r", \d+\.\d\d m(?: \(roll \d+\))?, .*$"
)


def headline(runs: Iterable[Mapping[str, Quantity]]) -> list[str]:
    """Return the headline quantities that any of the runs has, without those that say nothing new.

    A face is left out where it is in every run as one before: of a square section, or of a strand
    whose intrados and extrados are cooled alike.
    """
    everything = list(runs)
    chosen = [n for run in everything for n in run if AT_FRACTION.fullmatch(n)]
    shells = HEADLINE.index(at_places("shell")[-1]) + 1
    names = (*HEADLINE[:shells], *dict.fromkeys(chosen), *HEADLINE[shells:], *FROM_HISTORY)
    found = [
        name
        for name in names
        if any(name in run and _to_show(name, run[name]) for run in everything)
    ]
    return [name for name in found if not repeats(name, everything)]


def _to_show(name: str, quantity: Quantity) -> bool:
    return name not in ENDS or math.isfinite(quantity.value)


def plain_label(quantity: Quantity) -> str:
    """Return the label without where in this very run the value was found."""
    return _PLACE.sub("", quantity.label.partition(", at x")[0])


def repeats(name: str, runs: Iterable[Mapping[str, Quantity]]) -> bool:
    """Whether a quantity is in every run that of a place before: of a face that is cooled alike."""
    everything = list(runs)
    return any(all(_same(run, name, twin) for run in everything) for twin in _twins(name))


def _twins(name: str) -> Iterator[str]:
    for part, other in _TWINS:
        if part in name:
            yield name.replace(part, other)


def _same(run: Mapping[str, Quantity], name: str, twin: str) -> bool:
    this, other = run.get(name), run.get(twin)
    if this is None or other is None:
        return this is None
    return abs(this.value - other.value) <= 1e-6 * abs(other.value)
