"""What a reader of a run must know before he uses its numbers: what is not right, or left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.shown_units import said
from castfem.physics.thermal.flux_laws import Radiation
from castfem.post.plots.history import curves
from castfem.post.report.remarks import LIMITS, NO_SHELL, NOT_CONVERGED, REMELTED, Remark, remarks
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary
from castfem.runs.results.derived import OPEN, spells
from castfem.runs.results.labels import has_values
from castfem.runs.results.run_case import case_with

SURFACE, WALL = 1200.0 + ZERO_CELSIUS, 150.0 + ZERO_CELSIUS  # K


def cautions(folder: Path, summary: Summary) -> list[str]:
    """Return what to say of a run, a line each; nothing of most."""
    bare = (_line(one) for one in _unsteady(folder, summary) if NO_SHELL in one.where)
    found = (*summary.warnings, *bare, wide_gap(folder, summary), _even(folder))
    return [line for line in found if line]


def cautions_of_all(runs: Mapping[str, tuple[Path, Summary | None]]) -> list[str]:
    """Return what to say of runs below their table, by label; once where it is the same of several.

    Besides `cautions`, that a shell melted again, that contact flickers, or that coupling windows
    did not converge: a single run has these among the things to look at.
    """
    found: dict[str, list[str]] = {}
    for label, (folder, summary) in runs.items():
        told = [] if summary is None else cautions(folder, summary)
        restless = (*map(_line, _unsteady(folder, summary)), *_flickering(folder))
        for line in dict.fromkeys((*told, *restless)):
            found.setdefault(line, []).append(label)
    lines = [
        f"{'all runs' if 1 < len(labels) == len(runs) else ', '.join(labels)}: {line}"
        for line, labels in found.items()
    ]
    most = 10
    if len(lines) > most:
        more = f"and {len(lines) - most} more of this kind"
        lines[most:] = [f"{more}; castfem show FOLDER has those of one run"]
    return lines


def _line(one: Remark) -> str:
    return f"{one.what}, {said(one.value, one.unit, '.2g', one.name)}: {one.where}"


def _unsteady(folder: Path, summary: Summary | None) -> list[Remark]:
    """What a run says of a shell that melted again and of windows; none without a history."""
    try:
        table = read_history(folder / HISTORY_NAME)
    except InputError:
        return []
    return [one for one in remarks(table, summary) if one.what in (REMELTED, NOT_CONVERGED)]


def _flickering(folder: Path) -> Iterator[str]:
    """Places that lose contact again and again; none without a history."""
    try:
        table = read_history(folder / HISTORY_NAME)
    except InputError:
        return
    if not has_values(table, "position"):
        return
    position = table["position"].to_numpy()
    for label, _, column in curves(table, "gap"):
        lost = len(spells(table[column].to_numpy(), position, OPEN))
        if lost >= LIMITS.flickers:
            yield f"contact lost {lost} times, {label}"


def _even(folder: Path) -> str:
    """Say that a flux cools the corner as much as the faces; "" of a run without."""
    case = case_with(folder, "flux")
    if case is None:
        return ""
    from castfem.model.shared_heat import EVEN_FLUX, even_zones, fix

    zones = list(even_zones(case))
    if not zones:
        return ""
    return (
        f"zone {', '.join(zones)} has {EVEN_FLUX}. A mould takes less heat there: the surface of "
        "the corner comes out too cold and its shell too thick. Use [mould] with [mechanics], or "
        + fix(case)
    )


def radiated() -> float:
    """What radiates across a gap from a surface of 1200 degC to a mould, W/(m2 K)."""
    flux = Radiation(0.8, ambient=WALL).flux(np.array([SURFACE]), 0.0)[0]
    return float(flux[0]) / (SURFACE - WALL)


def wide_gap(folder: Path, summary: Summary) -> str:
    """What to say of a run whose largest gap conducts less than would radiate; "" of any other."""
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
                f'zone "{zone.name}" leaves out, would carry some {radiated():.0f}: lay law = '
                '"radiation" beside contact'
            )
    return ""
