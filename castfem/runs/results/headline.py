"""Headline results, and those among them that are derived from the history: shell, contact."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.result_registry import AT_FRACTION
from castfem.base.shown_quantity import Quantity
from castfem.base.types import Array
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.labels import last_quantities, probes_with
from castfem.runs.results.roll_load import RollLoads

_TWINS = (
    ("_left", "_right"),
    ("_extrados", "_intrados"),
    ("_extrados", ""),  # on a straight strand the intrados has no suffix
    ("_narrow_face", "_mid_face"),
)
"""Parts of names, and of the earlier place whose number may be the same."""
_PLACES = tuple(
    f"{face}{side}{half}"
    for face in ("mid_face", "narrow_face", "corner")
    for side in ("", "_intrados", "_extrados")
    for half in ("", "_right", "_left")
)


def at_places(quantity: str) -> tuple[str, ...]:
    """Return the names of a quantity at all possible places of a section, mid-faces first."""
    return tuple(f"{quantity}_{place}" for place in _PLACES)


AT_PROBES = (*at_places("shell"), *at_places("surface_temperature"))
# In display order; results that a run does not have are left out.
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
    "way_won_front_max",
    "way_clyne_davies_front_max",
    "way_rdg_front_max",
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
"""Additional results in tables of many runs."""
ENDS = ("liquid_end", "metallurgical_length")
"""Ends of the liquid core, shown first if any of the runs has reached them."""
# Place, position, roll, time and phase of the largest value of a map.
_PLACE = re.compile(
    r", (?:[^,]+, (?:corner|[^,]+ from the corner)|x = [^,]+, y = [^,]+(?:, [^,]+ deep)?)"
    r", \d+\.\d\d m(?: \(roll \d+\))?, .*$"
)


def headline(runs: Iterable[Mapping[str, Quantity]]) -> list[str]:
    """Return the headline results of any of the runs, without repeated ones.

    A face is left out if its values equal those of an earlier face in every run, as for a square
    section, or equally cooled intrados and extrados.
    """
    everything = list(runs)
    chosen = [n for run in everything for n in run if AT_FRACTION.fullmatch(n)]
    shells = HEADLINE.index(at_places("shell")[-1]) + 1
    names = (*HEADLINE[:shells], *dict.fromkeys(chosen), *HEADLINE[shells:], *FROM_HISTORY)
    found = [
        name
        for name in names
        if any(
            name in run and (name not in ENDS or math.isfinite(run[name].value))
            for run in everything
        )
    ]
    return [name for name in found if not repeats(name, everything)]


def plain_label(quantity: Quantity) -> str:
    """Return the label without the place where the value was found in this run."""
    return _PLACE.sub("", quantity.label.partition(", at x")[0])


def repeats(name: str, runs: Iterable[Mapping[str, Quantity]]) -> bool:
    """Whether a result equals that of an earlier place in every run (equal cooling)."""
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


_SHELLS = ("shell_", "solidus_cell_")  # prefixes of the columns of a shell and its cell size
OPEN = 1e-3  # mm; a larger gap counts as lost contact


def derived(folder: Path, summary: Summary) -> dict[str, Quantity]:
    """Return the derived results of a run; none without a history.

    The shell is the thinnest at the probes at the end of the mould. Contact is lost where the first
    probe loses it, and regained where the last of these has it again; NaN if not. Bulge and roll
    forces are the largest along the way.
    """
    try:
        table = read_columns(folder / HISTORY_NAME)
    except InputError:
        return {}
    if len(table) < 2 or "position" not in table:
        return {}
    position, units = table["position"], table.attrs["units"]
    loads = RollLoads.of(folder)
    found = {} if loads is None else loads.quantities()
    at, name = mould_exit(position, summary)
    shells = [c for c in map(str, table) if c in units and c.startswith(_SHELLS)]
    row = {c: float(np.interp(at, position, table[c])) for c in shells}
    depths = {n: q for n, q in last_quantities(row, units).items() if n.startswith("shell_")}
    if depths:
        thinnest = min(depths, key=lambda shell: depths[shell].value)
        found["shell_least"] = replace(
            depths[thinnest], label=f"thinnest shell of the probes, {name}", shown_unit="mm",
            error=summary.errors_near(at).get(thinnest),
        )  # fmt: skip
    gaps = [table[c] for c in probes_with(table, "gap").values()]
    lost = [spell for gap in gaps for spell in spells(gap, position, OPEN)]
    if gaps:
        first = min((spell.start for spell in lost), default=np.nan)
        found["contact_lost"] = Quantity(first, "mm", "where a probe first loses contact")
    if lost:
        open_ = any(not spell.regained for spell in lost)
        last = np.nan if open_ else max(spell.end for spell in lost)
        found["contact_regained"] = Quantity(last, "mm", "where the last probe regains contact")
    return found


@dataclass(frozen=True, slots=True)
class Spell:
    """A stretch without contact, between two positions [m]."""

    start: float  #: position at which contact was lost
    end: float  #: position at which contact was regained, or the end of the history
    regained: bool  #: whether contact was regained

    @property
    def length(self) -> float:
        """Length of the stretch [m]."""
        return self.end - self.start


def spells(gap: Array, position: Array, threshold: float) -> list[Spell]:
    """Return the stretches in which contact was lost after there had been contact.

    Args:
        gap: Gap between surface and wall (n,); unknown values (NaN) continue the previous state.
        position: Positions (n,), increasing.
        threshold: Gap above which there is no contact; its position is interpolated linearly.
    """
    known = np.isfinite(gap)
    gap, position = gap[known], position[known]
    apart = gap > threshold
    changes = np.flatnonzero(apart[1:] != apart[:-1])
    found: list[Spell] = []
    lost: float | None = None
    for i in changes:
        share = (threshold - gap[i]) / (gap[i + 1] - gap[i])
        at = float(position[i] + share * (position[i + 1] - position[i]))
        if apart[i + 1]:
            lost = at
        elif lost is not None:
            found.append(Spell(lost, at, True))
            lost = None
    if lost is not None:
        found.append(Spell(lost, float(position[-1]), False))
    return found


def mould_exit(position: Array, summary: Summary | None) -> tuple[float, str]:
    """Return the end of the mould [m] and its name: the end of the run if that comes first."""
    ends = None if summary is None else summary.mould_exit
    if ends is not None and ends <= position[-1] * (1 + ROUNDING):
        return ends, "mould exit"
    return float(position[-1]), "end of the run"
