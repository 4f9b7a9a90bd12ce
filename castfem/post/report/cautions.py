"""Cautions about a run's numbers: what is inaccurate or not modelled."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.result_registry import probe_label
from castfem.base.shown_units import said
from castfem.base.types import Array
from castfem.model.checks.cooling import law_groups
from castfem.model.section import Round
from castfem.physics.thermal.flux_laws import Radiation
from castfem.post.plots.history import curves
from castfem.post.plots.shape import Outline
from castfem.post.report.remarks import (
    LIMITS,
    NO_SHELL,
    NOT_CONVERGED,
    REMELTED,
    Remark,
    contact_share,
    in_mm,
    remarks,
)
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import HISTORY_NAME, Columns, read_columns
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import OPEN, Spell, spells
from castfem.runs.results.labels import has_values, probes_with, unit_of
from castfem.runs.results.run_case import case_with

if TYPE_CHECKING:
    from castfem.model import Case

SURFACE, WALL = 1200.0 + ZERO_CELSIUS, 150.0 + ZERO_CELSIUS  # K


def cautions(folder: Path, summary: Summary) -> list[str]:
    """Return the cautions about a run, one line each; none for most runs."""
    return _of_run(folder, summary, _history(folder))


def _of_run(folder: Path, summary: Summary, table: Columns | None) -> list[str]:
    bare = (_line(one) for one in _unsteady(table, summary) if NO_SHELL in one.where)
    found = (
        *summary.warnings,
        *bare,
        *_off_the_mould(folder, table),
        less_than_asked(summary),
        wide_gap(folder, summary),
        _even(folder),
    )
    return [line for line in found if line]


def cautions_of_all(runs: Mapping[str, tuple[Path, Summary | None]]) -> list[str]:
    """Return the cautions about the runs in a table, by label; shared ones appear once.

    Besides `cautions`, these cover a shell that melted again, flickering contact, and coupling
    windows that did not converge; for a single run those are among the remarks.
    """
    found: dict[str, list[str]] = {}
    for label, (folder, summary) in runs.items():
        table = _history(folder)
        own = [] if summary is None else _of_run(folder, summary, table)
        unsteady = (*map(_line, _unsteady(table, summary)), *_flickering(table))
        for line in dict.fromkeys((*own, *unsteady)):
            found.setdefault(line, []).append(label)
    lines = [
        f"{'all runs' if 1 < len(labels) == len(runs) else ', '.join(labels)}: {line}"
        for line, labels in found.items()
    ]
    most = 10
    if len(lines) > most:
        more = f"and {len(lines) - most} further ones"
        lines[most:] = [f"{more}; castfem show FOLDER has those of one run"]
    return lines


def _line(one: Remark) -> str:
    return f"{one.what}, {said(one.value, one.unit, '.2g', one.name)}: {one.where}"


def _history(folder: Path) -> Columns | None:
    """The history of a run; None without one or without a row with a position."""
    try:
        table = read_columns(folder / HISTORY_NAME)
    except InputError:
        return None
    return table if has_values(table, "position") else None


def _unsteady(table: Columns | None, summary: Summary | None) -> list[Remark]:
    """Remarks on a shell that melted again and on coupling windows; none without a history."""
    found = [] if table is None else remarks(table, summary)
    return [one for one in found if one.what in (REMELTED, NOT_CONVERGED)]


def _flickering(table: Columns | None) -> Iterator[str]:
    """Places that lose contact repeatedly; none without a history."""
    if table is None:
        return
    position = np.asarray(table["position"])
    for label, _, column in curves(table, "gap"):
        lost = len(spells(np.asarray(table[column]), position, OPEN))
        if lost >= LIMITS.flickers:
            yield f"contact lost {lost} times, {label}"


def _off_the_mould(folder: Path, table: Columns | None) -> Iterator[str]:
    """Positions where nothing touches the mould, and how much equivalent places then differ."""
    if table is None:
        return
    position = np.asarray(table["position"])
    yield lost_all_round(contact_share(table), position)
    if (case := case_with(folder, "[mould")) is not None:
        whole = isinstance(case.section, Round)
        for places in equal_places(case, probes_with(table, "surface_temperature")):
            who = "all points of the surface" if whole else " and ".join(map(probe_label, places))
            surface = _of_whole_surface(folder) if whole else (0.0, 0.0)
            if differences := _unequal(table, position, places, surface):
                yield f"{who} are the same by symmetry, yet their {differences}"


def lost_all_round(share: Array, position: Array) -> str:
    """Return a caution where no point of the surface touches the mould; "" if one always does.

    Args:
        share: Share of the surface in contact (n,), %; NaN where there is no mould.
        position: Position of the slice (n,), m.
    """
    found: list[Spell] = []
    start: float | None = None
    at, known = 0.0, np.isfinite(share)
    for percent, at in zip(share[known].tolist(), position[known].tolist(), strict=True):
        if percent > 0.0 and start is not None:
            found.append(Spell(start, at, True))
        start = None if percent > 0.0 else at if start is None else start
    if start is not None:
        found.append(Spell(start, at, False))
    if not found:
        return ""
    words = [
        f"from {in_mm(one.start)} to {in_mm(one.end)}"
        + ("" if one.regained else ", where mould or run ends")
        for one in (found[0], max(found, key=lambda one: one.length))
    ]
    text = words[0]
    if len(found) > 1:
        text = f"{len(found)} times, first {', longest '.join(dict.fromkeys(words))}"
    return f"contact lost all round {text}: no point of the surface touches the mould there"


def equal_places(case: Case, places: Iterable[str]) -> list[list[str]]:
    """Return the places of a strand in its mould that are equivalent by symmetry, in groups.

    None are equivalent where section, mould or cooling make a difference, or in a machine.
    """
    section, mould, mechanics = case.section, case.mould, case.mechanics
    if mould is None or mechanics is None or case.machine or case.secondary or mechanics.held:
        return []
    planes = mechanics.planes
    uneven = mould.displacement is not None or set(mould.taper.parts) - {"face"}
    if uneven or (planes.moment_x, planes.moment_y) != (0.0, 0.0):
        return []
    every = set(section.cooled_groups())
    if any(law_groups(section, law) != every for zone in case.cooling for law in zone.surface):
        return []
    width, height = section.outline()
    square = width == height and mould.width == mould.height
    images = ("_left", "_right", "_intrados", "_extrados")
    found: dict[str, list[str]] = {}
    for name in places:
        same = "" if isinstance(section, Round) else name
        for image in images:
            same = same.replace(image, "")
        found.setdefault(same.replace("narrow_face", "mid_face") if square else same, []).append(
            name
        )
    return [names for names in found.values() if len(names) > 1]


def _unequal(
    table: Columns, position: Array, places: list[str], surface: tuple[float, float]
) -> str:
    """Return by how much equivalent places differ; "" if they hardly differ.

    Args:
        table: The history.
        position: Position of its rows (n,), m.
        places: Probes.
        surface: Largest temperature difference over the whole surface, K, and its position, m.
    """
    apart = {}
    for prefix in ("surface_temperature", "gap"):
        names = [f"{prefix}_{place}" for place in places if f"{prefix}_{place}" in table]
        spread = np.ptp([table[n] for n in names], axis=0) if names else np.full(len(table), np.nan)
        if np.isfinite(spread).any():
            row = int(np.nanargmax(spread))
            apart[prefix] = float(spread[row]), float(position[row])
    kelvin, at = max(apart.get("surface_temperature", (0.0, 0.0)), surface)
    if kelvin < LIMITS.alike:
        return ""
    parts = [f"surface temperatures differ by up to {said(kelvin, 'K', '.3g')} (at {in_mm(at)})"]
    if "gap" in apart:
        size, at = apart["gap"]
        unit = unit_of(table, f"gap_{places[0]}")
        parts.append(f"gaps differ by up to {said(size, unit, '.2g', 'gap')} (at {in_mm(at)})")
    return (
        f"{' and their '.join(parts)}. This is numerical: errors of mesh and rounding grow where "
        "the gap determines the heat (docs/coupling.md), and where it is hot or cold means "
        "nothing. Take the values of these places as a range"
    )


def _of_whole_surface(folder: Path) -> tuple[float, float]:
    """Largest difference of equivalent surface temperatures in the fields, K, and where, m."""
    try:
        with Fields(folder) as fields:
            if "temperature" not in fields.names or "symmetry" not in fields.attributes:
                return 0.0, 0.0
            nodes = np.unique(Outline.of(fields).surface)
            found = [
                float(np.ptp(fields.values("temperature", i)[nodes]))
                for i in range(len(fields.times))
            ]
            return max(zip(found, map(float, fields.positions), strict=True), default=(0.0, 0.0))
    except (InputError, OSError):
        return 0.0, 0.0


def less_than_asked(summary: Summary) -> str:
    """Return a caution if gaps reduce the heat taken below the requested flux; "" otherwise.

    Heat per length of strand is converted to that of the mould by the mean casting speed.
    """
    names = ("mould_heat_removed", "mould_heat_asked", "heat_removed", "cooling_power")
    removed, asked, passed, power = (
        math.nan if (found := summary.quantities.get(name)) is None else found.value
        for name in names
    )
    if not (asked > 0.0 and passed > 0.0 and abs(removed / asked - 1.0) > LIMITS.missed):
        return ""
    took, wanted = (
        said(1e-3 * heat * power / passed, "kW", ".4g", "cooling_power")
        for heat in (removed, asked)
    )
    share = 100.0 * abs(removed / asked - 1.0)
    if removed > asked:
        return (
            f"the mould took {took}, {share:.1f} % more than the {wanted} of its given flux alone"
        )
    return (
        f"the mould took {took}, {share:.1f} % less than the {wanted} that its flux asks for "
        "without gaps. A heat measured at a mould already includes its gaps: raise power "
        "or water_rise, or the taper, until the run takes what was measured"
    )


def _even(folder: Path) -> str:
    """Return a caution that a flux cools the corner as much as the faces; "" without one."""
    case = case_with(folder, "flux")
    if case is None:
        return ""
    from castfem.model.checks.shared_heat import EVEN_FLUX, even_zones, fix

    zones = list(even_zones(case))
    if not zones:
        return ""
    return (
        f"zone {', '.join(zones)} has {EVEN_FLUX}. A mould takes less heat there: the surface of "
        "the corner comes out too cold and its shell too thick. Use [mould] with [mechanics], or "
        + fix(case)
    )


def radiated() -> float:
    """Radiation across a gap from a surface at 1200 degC to a mould, W/(m2 K)."""
    flux = Radiation(0.8, ambient=WALL).flux(np.array([SURFACE]), 0.0)[0]
    return float(flux[0]) / (SURFACE - WALL)


def wide_gap(folder: Path, summary: Summary) -> str:
    """Return a caution if the largest gap conducts less than radiation would; "" otherwise."""
    widest = summary.quantities.get("mould_gap_max")
    if widest is None or not widest.value > 0.0:
        return ""
    case = case_with(folder, "contact")
    if case is None:
        return ""
    from castfem.model import cooling

    for zone in case.cooling:
        contacts = [one for one in zone.surface if isinstance(one, cooling.Contact)]
        if not contacts or any(isinstance(one, cooling.Radiation) for one in zone.surface):
            continue
        best = max(one.gap_conductivity or 0.0 for one in contacts)
        conducted = best / widest.value
        if 0.0 < conducted < radiated():
            gap = said(1e3 * widest.value, "mm", ".3g", "mould_gap_max")
            return (
                f"the largest gap, {gap}, conducts {conducted:.0f} W/(m^2 K); radiation, which "
                f'zone "{zone.name}" leaves out, would transfer about {radiated():.0f} more: add a '
                'surface with law = "radiation" to the zone'
            )
    return ""
