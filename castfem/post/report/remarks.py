"""Remarks on a run: where the shell is thin, hot, stressed, or out of contact with the mould.

They are computed from history.csv, with the mould exit from the summary, and from the fields where
the surface is worse than at the probes; missing data are skipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.shown_units import documented, place_said, plain_unit, said, scale_of
from castfem.base.types import Array
from castfem.post.plots.history import curves
from castfem.post.plots.section import Steel
from castfem.post.report.hot_spots import HotSpot, hottest, thinnest
from castfem.runs.output.field_files import HDF5_NAME
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import HISTORY_NAME, Columns, read_columns
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import OPEN, mould_exit, spells
from castfem.runs.results.labels import STAIR, beside_wall, has_values, unit_of
from castfem.runs.results.roll_load import BULGE, RollLoads

NOT_CONVERGED = "coupling windows not converged"
THINNEST, _HOTTEST = "thinnest shell", "hottest surface"


@dataclass(frozen=True, slots=True)
class RemarkLimits:
    """Thresholds from which something is remarked on."""

    thinner: float = 0.03  #: shell missing beside the probes, relative to that at them
    hotter: float = 3.0  #: excess surface temperature beside the probes, K
    coarse: float = 0.2  #: error of the shell due to its cells, mm
    more: float = 1.0  #: share of the surface that touches again after the least contact, %
    bulged: float = 0.01  #: motion of a face relative to the size of the section
    melted: float = 0.1  #: shell that melts again, mm
    shrunk: float = 0.02  #: shrinkage of a completely solid section relative to its depth
    reheated: float = 5.0  #: rise of the surface temperature, K
    flickers: int = 3  #: losses of contact at one probe: taper and shrinkage cause one or two
    alike: float = 5.0  #: temperature difference of equivalent surfaces, K
    missed: float = 0.03  #: heat that gaps keep from the mould, relative to the requested heat


LIMITS = RemarkLimits()
REMELTED = "shell melted again"
NO_SHELL = "no shell there"


@dataclass(frozen=True, slots=True)
class Remark:
    """One line: quantity, value and place."""

    what: str  #: quantity
    value: float  #: value in `unit`
    unit: str  #: unit as in history.csv
    where: str  #: place and position, in words
    name: str = ""  #: column, where it determines the shown unit
    #: resolution by the cells, in `unit`; None if unknown
    resolution: float | None = None


def in_mm(position: float) -> str:
    """A position below the meniscus, in words."""
    return place_said(position, near=".0f", far=".2f")


def at_place(position: float, table: Columns) -> str:
    """A position, and the time when the slice is there."""
    time = float(np.interp(position, table["position"], table["time"]))
    digits = ".3g" if time < 1e3 else ".0f"  # 1100 s, not 1.1e+03 s
    return f"{in_mm(position)}, t = {said(time, 's', digits, 'time')}"


def remarks_of(folder: Path, summary: Summary | None) -> list[Remark]:
    """Remarks on the run in a folder, including its fields if written.

    None without a history or with a damaged one, which is reported where figures are drawn.
    """
    try:
        table, loads = read_columns(folder / HISTORY_NAME), RollLoads.of(folder)
        bulge = [] if loads is None else list(_between_rolls(loads))
        if not (folder / HDF5_NAME).is_file():
            return [*remarks(table, summary), *bulge]
        with Fields(folder) as fields:
            return [*remarks(table, summary, fields), *bulge]
    except InputError:
        return []


def remarks(table: Columns, summary: Summary | None, fields: Fields | None = None) -> list[Remark]:
    """Remarks on a run."""
    if len(table) < 2 or not has_values(table, "position"):
        return []
    position = np.asarray(table["position"])
    if (np.diff(position) < 0).any() or position[-1] <= position[0]:
        return []
    at, name = mould_exit(position, summary)
    where = f"{name} at {in_mm(at)}"
    weakest = _at_exit(table, position, at, where)
    index = None if fields is None else _state_of_surface(fields, at)
    if fields is None or index is None:
        weakest = {k: replace(one, what=f"{one.what} of the probes") for k, one in weakest.items()}
    else:
        weakest |= _between_probes(fields, index, where, weakest)
    if THINNEST in weakest and weakest[THINNEST].value <= 0.0:
        bare = weakest[THINNEST]
        weakest[THINNEST] = replace(bare, where=f"no shell at all; {bare.where}")
    return [
        *_contact(table, position),
        *_bulging(table, position),
        *weakest.values(),
        *_stairs(table, position),
        *_remelting(table, position),
        *_reheating(table, position),
        *_largest(table, position, "von_mises", "largest von Mises stress"),
        *_coupling(summary),
    ]


def _contact(table: Columns, position: Array) -> Iterator[Remark]:
    for label, _, column in curves(table, "gap"):
        gap, unit = np.asarray(table[column]), unit_of(table, column)
        stretches = spells(gap, position, OPEN)
        if not stretches:
            continue
        longest = max(stretches, key=lambda spell: spell.length)
        first = stretches[0]
        where = f"contact lost at {at_place(first.start, table)}, "
        where += f"regained at {in_mm(first.end)}" if first.regained else "not regained"
        if len(stretches) > 1:
            where += (
                f"; {len(stretches)} times, longest {in_mm(longest.start)} to {in_mm(longest.end)}"
            )
        yield Remark(f"largest gap, {label}", float(np.nanmax(_finite(gap))), unit, where, column)
    yield from _share(table, position)
    yield from _largest(table, position, "gap", "largest gap on the way", least=OPEN)
    what = "highest contact pressure"
    if has_values(table, "mean_contact_pressure_max"):
        what += ", mean over 5 mm"
        yield from _largest(table, position, "contact_pressure", what, of="mean_contact_pressure")
    else:
        yield from _largest(table, position, "contact_pressure", what)


def contact_share(table: Columns) -> Array:
    """Share of the surface that touches the mould, %; NaN below it and in a run without one."""
    if not has_values(table, "contact_share"):
        return np.full(len(table), np.nan)
    scale = 1.0 if unit_of(table, "contact_share") == "%" else 100.0  # older runs have fractions
    return np.where(beside_wall(table), scale * np.asarray(table["contact_share"]), np.nan)


def _share(table: Columns, position: Array) -> Iterator[Remark]:
    """The least contact share, unless the whole surface is always in contact."""
    share = contact_share(table)
    if np.isnan(share).all():
        return
    row = int(np.nanargmin(share))
    if share[row] < 100.0:
        where = f"of the surface, at {at_place(float(position[row]), table)}"
        if share[-1] > share[row] + LIMITS.more:
            where += f"; {share[-1]:.3g} % at the end of the run"
        yield Remark("least contact", float(share[row]), "%", where)


def _stairs(table: Columns, position: Array) -> Iterator[Remark]:
    """The shell where its cells resolve it worst, if that is visible."""
    worst: tuple[float, str, int, str] | None = None
    for label, _, column in curves(table, "shell"):
        name = column.replace("shell_", "solidus_cell_", 1)
        if not has_values(table, name):
            continue
        off = _finite(STAIR * np.asarray(table[name]))
        row = int(np.nanargmax(off))
        if worst is None or off[row] > worst[0]:
            worst = float(off[row]), label, row, name
    if worst is None or worst[0] < LIMITS.coarse:
        return
    off_, label, row, name = worst
    where = (
        f"{label}, at {at_place(float(position[row]), table)}: the curve has steps, as the solidus"
    )
    cell = float(np.asarray(table[name])[row])
    where += f" lies in cells of {said(cell, 'mm', '.2g', name)} there"
    yield Remark("resolution of the shell, ±", off_, unit_of(table, name), where, name)


def _bulging(table: Columns, position: Array) -> Iterator[Remark]:
    """A face that the liquid has pushed out further than is plausible in a caster."""
    for label, _, column in curves(table, "displacement"):
        size = column.replace("displacement", "size", 1)
        if not has_values(table, size):
            continue
        moved, across = np.asarray(table[column]), np.asarray(table[size])
        row = int(np.nanargmax(moved))
        if moved[row] > LIMITS.bulged * across[0]:
            where = (
                f"at {at_place(float(position[row]), table)}; nothing holds the shell there, see "
            )
            where += "mechanics.liquid in docs/case_files.md"
            yield Remark(
                f"bulge, {label}", float(moved[row]), unit_of(table, column), where, column
            )


def _between_rolls(loads: RollLoads) -> Iterator[Remark]:
    if (one := loads.largest(BULGE)) is not None:
        number, value = one
        where = f"below {loads.where(number)}"
        yield Remark("largest bulge between rolls", value, loads.units[BULGE], where, BULGE)


def _largest_way_back(
    table: Columns, prefix: str, sign: float, least: float = 0.0
) -> tuple[float, str, int, int, str] | None:
    """Largest decrease (sign 1) or increase (-1) of a quantity along the way at any probe.

    Args:
        table: The history.
        prefix: Prefix of the columns.
        sign: Direction.
        least: Share of the largest value so far below which a change does not count.

    Returns:
        The difference, the label of the probe, the rows between which it occurs, and the column.
    """
    best: tuple[float, str, int, int, str] | None = None
    for label, _, column in curves(table, prefix):
        values = sign * np.asarray(table[column])
        most = np.fmax.accumulate(values)
        lost = np.where(most - values < least * np.abs(most), 0.0, most - values)
        if not np.isfinite(lost).any():
            continue
        end = int(np.nanargmax(lost))
        start = int(np.nanargmax(values[: end + 1]))
        if best is None or lost[end] > best[0]:
            best = float(lost[end]), label, start, end, column
    return best


def _remelting(table: Columns, position: Array) -> Iterator[Remark]:
    """Positions between which the shell becomes thinner on the way down, at the worst probe.

    If the whole shell melts, the steel breaks out, which the run does not model.
    """
    best = _largest_way_back(table, "shell", 1.0, LIMITS.shrunk)
    if best is None or best[0] < LIMITS.melted:
        return
    value, label, start, end, column = best
    rest, unit = float(np.asarray(table[column])[end]), unit_of(table, column)
    left = f"where {said(rest, unit, '.2g', column)} are left"
    if rest <= 0.0:
        solid = np.flatnonzero(np.asarray(table[column])[end:] > 0.0)
        until = f"to {in_mm(position[end + solid[0]])}" if len(solid) else "on"
        left = f"{NO_SHELL} from {in_mm(position[end])} {until}: a sign of a breakout"
    where = f"{label}, from {in_mm(position[start])} to {in_mm(position[end])}, {left}"
    yield Remark(REMELTED, value, unit, where, column)


def _reheating(table: Columns, position: Array) -> Iterator[Remark]:
    """The largest rise of a surface temperature on the way down."""
    best = _largest_way_back(table, "surface_temperature", -1.0)
    if best is None or best[0] < LIMITS.reheated:
        return
    value, label, start, end, _ = best
    where = f"{label}, from {in_mm(position[start])} to {in_mm(position[end])}"
    yield Remark("largest reheating of the surface", value, "K", where)


def _coupling(summary: Summary | None) -> Iterator[Remark]:
    """Coupling windows whose gap has not converged: their results are unreliable."""
    steps = {} if summary is None else summary.steps
    missed, of = (steps.get(f"coupling windows{name}", 0.0) for name in (" not converged", ""))
    if missed and of:
        where = f"{missed:.0f} of {of:.0f}: heat and gap differ by more than coupling.settled; "
        where += "shorten coupling.interval or allow more coupling.passes"
        yield Remark(NOT_CONVERGED, 100.0 * missed / of, "%", where)


def _largest(
    table: Columns,
    position: Array,
    prefix: str,
    what: str,
    least: float = 0.0,
    of: str = "",
) -> Iterator[Remark]:
    """The largest value of the columns `prefix_max`, and the largest probe value there.

    Values not above `least` are omitted; `of` is the prefix of the maximum if it differs.
    """
    whole = f"{of or prefix}_max"
    probes = [(label, column) for label, _, column in curves(table, prefix)]
    columns = [whole] if has_values(table, whole) else [column for _, column in probes]
    finite = {column: _finite(np.asarray(table[column])) for column in columns}
    peaks = [(float(np.nanmax(v)), column) for column, v in finite.items() if not np.isnan(v).all()]
    if not peaks or max(peaks)[0] <= least:
        return
    value, column = max(peaks)
    row = int(np.nanargmax(finite[column]))
    where = f"at {at_place(float(position[row]), table)}"
    there = [(float(np.asarray(table[column])[row]), label) for label, column in probes]
    there = [entry for entry in there if np.isfinite(entry[0])]
    unit = unit_of(table, column)
    if there and max(there)[0] > least:
        most, label = max(there)
        if most > value and not of:  # at the probe itself; the maximum is from points beside it
            yield Remark(what, most, unit, f"{label}, {where}", column)
            return
        scale = scale_of(documented(unit), column)
        where += f"; {label}: {scale(most):.3g} {plain_unit(scale.unit)}"
    yield Remark(what, value, unit, where, column)


def _at_exit(table: Columns, position: Array, at: float, where: str) -> dict[str, Remark]:
    """The thinnest shell and the hottest place of the surface among the probes at the exit."""
    found = {}
    for prefix, what, pick in (("shell", THINNEST, min), ("surface_temperature", _HOTTEST, max)):
        values = {
            label: (float(np.interp(at, position, np.asarray(table[column]))), column)
            for label, _, column in curves(table, prefix)
        }
        values = {label: entry for label, entry in values.items() if np.isfinite(entry[0])}
        if values:
            label = pick(values, key=lambda label: values[label][0])
            value, column = values[label]
            unit, cell = unit_of(table, column), column.replace("shell_", "solidus_cell_", 1)
            off = None
            if cell != column and has_values(table, cell):
                size = float(np.interp(at, position, np.asarray(table[cell])))
                off = STAIR * size if np.isfinite(size) else None  # no cell without a shell
            found[what] = Remark(what, value, unit, f"{label}, {where}", column, off)
    return found


def _state_of_surface(fields: Fields, at: float) -> int | None:
    """Return which state has the temperature of the whole surface at a position [m], if any."""
    times = np.flatnonzero(np.isclose(fields.positions, at, rtol=1e-6, atol=0.0))
    return int(times[0]) if "temperature" in fields.names and len(times) else None


def _between_probes(
    fields: Fields, index: int, where: str, probes: dict[str, Remark]
) -> dict[str, Remark]:
    """Places of the surface at the exit that are worse than every probe, which they replace."""
    steel, found = Steel.of(fields.attributes), {}
    if "symmetry" not in fields.attributes:
        return {}  # a strip has sides, but no surface beside its probe
    thin = None if steel is None else thinnest(fields, steel.solidus, index)
    known = probes.get(THINNEST)
    if thin and known and 1e3 * thin.value < (1 - LIMITS.thinner) * known.value:
        found[THINNEST] = _instead(known, 1e3 * thin.value, thin, where)
    hot, known = hottest(fields, index), probes.get(_HOTTEST)
    if known and hot.value - ZERO_CELSIUS > known.value + LIMITS.hotter:
        found[_HOTTEST] = _instead(known, hot.value - ZERO_CELSIUS, hot, where)
    return found


def _instead(probe: Remark, value: float, hot_spot: HotSpot, where: str) -> Remark:
    """The value at a hot spot, and the worst one among the probes."""
    label = probe.where.removesuffix(f", {where}")
    digits = ".4g" if probe.unit == "°C" else ".3g"
    own = scale_of(documented(probe.unit), probe.name)
    across = scale_of("mm")
    far = ".1f" if across.unit == "mm" else ".4g"
    x, y = (across(1e3 * place) for place in (hot_spot.x, hot_spot.y))
    place = f"x = {x:{far}}, y = {y:{far}} {plain_unit(across.unit)}, {where}"
    said_ = f"{place}; {label}: {own(probe.value):{digits}} {plain_unit(own.unit)}"
    return Remark(probe.what, value, probe.unit, said_, probe.name, probe.resolution)


def _finite(values: Array) -> Array:
    """Values with NaN for infinite ones, such as a gap where there is no wall."""
    return np.where(np.isfinite(values), values, np.nan)
