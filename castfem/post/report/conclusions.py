"""Main results of a run in a few sentences: shell, solidification end, unbending, worst place."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from castfem.base.constants import ROUNDING, ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.shown_units import said
from castfem.post.plots.history import curves
from castfem.post.report.cracks import CrackPlaces, crack_places
from castfem.post.report.remarks import REMELTED, THINNEST, Remark, remarks_of
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.numbers import cells, finely
from castfem.runs.results.run_case import case_with

_REMARKS = (REMELTED, "largest gap on the way", "largest bulge between rolls")


def conclusions(
    folder: Path, summary: Summary, base: tuple[str, Path, Summary] | None = None
) -> list[tuple[str, str]]:
    """Return the main results of a run: subject and sentence."""
    remarks = {one.what: one for one in remarks_of(folder, summary)}
    found = [*_shell(summary, remarks.get(THINNEST)), *_pool(summary), *_unbending(folder)]
    found += list(_worst(folder, summary, base))
    return found + [(name, _remark(remarks[name])) for name in _REMARKS if name in remarks]


def _remark(one: Remark) -> str:
    return f"{finely(one.value, one.unit, one.name)}, {one.where}"


def _shell(summary: Summary, anywhere: Remark | None) -> Iterator[tuple[str, str]]:
    """The thinnest shell at the mould exit, over the whole surface if it is thinner there."""
    least = summary.quantities.get("shell_least")
    if least is None or not math.isfinite(least.value):
        return
    if anywhere is not None and anywhere.value < least.shown * (1.0 - ROUNDING):
        yield anywhere.what, _remark(anywhere)
    else:
        yield least.label, " ".join(cells("shell_least", least))


def _pool(summary: Summary) -> Iterator[tuple[str, str]]:
    """Position of complete solidification, or the end of a run without it."""
    length, end = (summary.quantities.get(n) for n in ("metallurgical_length", "position"))
    if length is not None and math.isfinite(length.value):
        yield length.label, " ".join(cells("metallurgical_length", length))
    elif end is not None and ("solidus" in summary.quantities or length is not None):
        yield (
            "metallurgical length",
            f"not reached: the run ends at {' '.join(cells('position', end))}",
        )


def _unbending(folder: Path) -> Iterator[tuple[str, str]]:
    """Surface temperatures where the strand is straightened, and whether they are critical."""
    case = case_with(folder, "[machine")
    rolls = None if case is None or case.machine is None else case.machine.pairs()
    try:
        table = read_columns(folder / HISTORY_NAME)
    except InputError:
        return
    if case is None or rolls is None or len(table) < 2:
        return
    from castfem.physics.machine.bending_zones import phases

    position = table["position"]
    band = None if case.quality is None else case.quality.band
    for phase in phases(rolls):
        start, end = (rolls.pairs[i].position for i in (phase.first, phase.last))
        if phase.kind != "straightening" or end > position[-1]:
            continue
        rows = (position >= start) & (position <= end)
        parts = []
        for label, _, column in curves(table, "surface_temperature"):
            ends = np.interp([start, end], position, table[column])
            values = np.r_[ends, table[column][rows]]
            low, high = float(values.min()), float(values.max())
            critical = band is not None and low < band[1] - ZERO_CELSIUS and (
                high > band[0] - ZERO_CELSIUS
            )  # fmt: skip
            parts.append(
                f"{label} {said(low, 'degC', '.0f')} to {said(high, 'degC', '.0f')}"
                + (" (in the low-ductility band)" if critical else "")
            )
        where = f"between {start:.2f} and {end:.2f} m"
        yield "surface temperature in straightening", f"{'; '.join(parts)}, {where}"


def _worst(
    folder: Path, summary: Summary, base: tuple[str, Path, Summary] | None
) -> Iterator[tuple[str, str]]:
    """The worst places of the crack indexes, compared with the base."""
    found = crack_places(folder, summary)
    if found is None:
        return
    theirs = None if base is None else crack_places(base[1], base[2])
    for name, value, _, where in found.ranking:
        if name not in ("I1", "I2"):
            continue
        ratio = f"no limit is known: compare with {_another(folder)}"
        if base is not None and theirs is not None:
            ratio = _ratio(found, theirs, name, base[0])
        yield f"worst place by {name}", f"{where}: {value}; {ratio}"
    if found.nowhere:
        yield "worst place", found.nowhere


def _another(folder: Path) -> str:
    """The run to compare indexes with: of the machine without its defects, if it has any."""
    case = case_with(folder, "defect")
    flawed = case is not None and case.machine is not None and case.machine.defect
    return "a run of the intact machine" if flawed else "a run of another machine or cooling"


def _ratio(found: CrackPlaces, theirs: CrackPlaces, name: str, label: str) -> str:
    """Ratio of the largest value of an index to that of the base."""
    mine, other = found.largest.get(name, 0.0), theirs.largest.get(name, 0.0)
    if not other > 0.0:
        return f"nowhere above 0 in {label}"
    return f"{mine / other:.2f} times that of {label}"
