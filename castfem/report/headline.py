"""Which of the many results of a run are looked at first."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping

from castfem.output.summary import Quantity
from castfem.results.registry import AT_FRACTION

AT_PROBES = (
    "shell_mid_face",
    "shell_narrow_face",
    "shell_corner",
    "surface_temperature_mid_face",
    "surface_temperature_narrow_face",
    "surface_temperature_corner",
)
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
FROM_HISTORY = ("shell_least", "contact_lost", "contact_regained")
"""What tables of many runs have besides (`castfem.report.derived`)."""
ENDS = ("liquid_end", "metallurgical_length")
"""Ends of the pool, which stand first, where any of the runs has come to them."""
# Place, position, roll, time and phase of the largest value of a map.
_PLACE = re.compile(
    r", (?:[^,]+, (?:corner|[^,]+ from the corner)|x = [^,]+, y = [^,]+)"
    r", \d+\.\d\d m(?: \(roll \d+\))?, .*$"
)
_SAME = 1e-6  # relative; faces of a square section differ by less


def headline(runs: Iterable[Mapping[str, Quantity]]) -> list[str]:
    """Return the headline quantities that any of the runs has, without those that say nothing new.

    The narrow face is left out where it is in every run as the mid-face.
    """
    everything = list(runs)
    chosen = [n for run in everything for n in run if AT_FRACTION.fullmatch(n)]
    shells = HEADLINE.index("shell_corner") + 1
    names = (*HEADLINE[:shells], *dict.fromkeys(chosen), *HEADLINE[shells:], *FROM_HISTORY)
    found = [
        name
        for name in names
        if any(name in run and _to_show(name, run[name]) for run in everything)
    ]
    return [
        name
        for name in found
        if not name.endswith("_narrow_face")
        or any(not _same_as_mid_face(run, name) for run in everything)
    ]


def _to_show(name: str, quantity: Quantity) -> bool:
    return name not in ENDS or math.isfinite(quantity.value)


def _same_as_mid_face(run: Mapping[str, Quantity], name: str) -> bool:
    this, other = run.get(name), run.get(name.replace("_narrow_face", "_mid_face"))
    if this is None or other is None:
        return this is None
    return abs(this.value - other.value) <= _SAME * abs(other.value)


def plain_label(quantity: Quantity) -> str:
    """Return the label without where in this very run the value was found."""
    return _PLACE.sub("", quantity.label.partition(", at x")[0])
