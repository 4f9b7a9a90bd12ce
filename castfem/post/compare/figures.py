"""Which figures a comparison has, as data: columns of the histories grouped by what they measure.

A column is named `quantity_place`: `shell_mid_face`. Columns of one quantity make one figure with a
panel for each place. A quantity that has no entry in `FIGURES` is drawn under its own name.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np
import pandas

from castfem.base.result_registry import AT_FRACTION
from castfem.post.compare.runs import Run
from castfem.post.plots.along_strand import rate_of
from castfem.post.plots.history import open_front
from castfem.post.plots.style import STYLE
from castfem.runs.results.labels import beside_wall

_PLACES = ("mid_face", "narrow_face", "corner", "max", "min", "mean", "core")
_LAST = ("max", "min", "mean")  # places that are none: their panels come after the others
_NOT_DRAWN = ("time", "position", "step", "cooling_power", "penetration", "solidus_cell")
_FRONTS = ("shell", "liquidus_depth")
_NOT_DRAWN_ENDINGS = ("error", "newton", "iterations", "newton_mechanics")


@dataclass(frozen=True, slots=True)
class Definition:
    """What a figure is called."""

    quantity: str  #: beginning of the names of its columns; also the name of its file
    title: str  #: of the figure
    label: str  #: of its axes, without unit
    zero: bool = False  #: the axis begins at zero
    #: what the largest and the smallest value of the section are called
    extremes: tuple[str, str] = ("largest", "smallest")
    span: float = 0.0  #: the least the axis spans, in the unit that is drawn: less is rounding


_HOTTEST = ("highest", "lowest")
FIGURES = (
    Definition("surface_temperature", "Surface temperature", "temperature"),
    Definition("temperature", "Temperature of the section", "temperature", extremes=_HOTTEST),
    Definition("shell", "Shell: depth of the solidus below the surface", "shell", zero=True),
    Definition("liquidus_depth", "Depth of the liquidus below the surface", "depth", zero=True),
    Definition("heat_flux", "Heat flux out of the surface", "heat flux", zero=True),
    Definition("heat_rate", "Heat leaving the strand", "heat leaving", zero=True),
    Definition("heat_removed", "Heat removed since the meniscus", "heat removed", zero=True),
    Definition("heat_share", "Heat removed since the meniscus, {base} = 100 %", "share", span=1.0),
    Definition("von_mises", "Von Mises stress", "stress", zero=True),
    Definition("stress", "Stress", "stress"),
    Definition("displacement", "Displacement of the surface, outwards", "displacement"),
    Definition("size", "Size of the section", "size"),
    Definition("gap", "Gap between strand and mould", "gap", zero=True, span=STYLE.gap),
    Definition("contact_pressure", "Contact pressure", "pressure", True, _HOTTEST),
    Definition(
        "mean_contact_pressure", "Contact pressure, mean over 5 mm", "pressure", True, _HOTTEST
    ),
    Definition("contact_share", "Share of the surface in contact", "share", True, span=1.0),
    Definition("contact_sticking", "Share of the surface that sticks", "share", True, span=1.0),
    Definition("axial_strain", "Axial strain", "strain"),
    Definition("axial_stress", "Axial stress at the surface", "stress"),
    Definition("effort", "Axial effort between rolls and drives", "effort"),
    Definition("axial_force", "Axial force, modelled part", "force"),
    Definition("friction_force", "Friction on the modelled part", "force per length"),
    Definition("mould_friction", "Friction of the mould on the strand", "force per length"),
    Definition("mould_pull", "Withdrawal resistance of the mould", "force"),
    Definition("friction_pull", "Accumulated friction", "force"),
)


@dataclass(frozen=True, slots=True)
class Curve:
    """A column of one run."""

    run: Run  #: whose
    position: np.ndarray  #: (n,) below the meniscus, m
    values: np.ndarray  #: (n,) in the unit of the panel


@dataclass(frozen=True, slots=True)
class Panel:
    """One place of a figure."""

    place: str  #: "mid_face", or empty
    unit: str  #: of the values
    curves: tuple[Curve, ...]  #: one a run


def figures(
    runs: Sequence[Run], base: Run, *, least: int = 2
) -> list[tuple[Definition, list[Panel]]]:
    """Return the figures of the columns that two or more runs have, each with its panels.

    Runs without a history are left out; an idealised mould is not in the figure of the gap.

    Args:
        runs: In the order of the curves.
        base: Whose heat is 100 %.
        least: How many runs must have a column.
    """
    tables = {id(run): history for run in runs if (history := run.history()) is not None}
    drawn = [run for run in runs if id(run) in tables]
    if len(drawn) < least:
        return []
    for run in drawn:
        _derive(tables[id(run)], tables.get(id(base)))
    names = dict.fromkeys(str(name) for run in drawn for name in tables[id(run)].columns)
    grouped: dict[str, list[Panel]] = {}
    for column in names:
        quantity, place = parts(column, list(names))
        if quantity in _NOT_DRAWN or column.endswith(_NOT_DRAWN_ENDINGS):
            continue
        having = {id(run): t for run in drawn if column in (t := tables[id(run)])}
        units = {str(t.attrs["units"][column]) for t in having.values()}
        if len(having) < least or len(units) > 1:
            continue
        if any(t[column].isna().all() for t in having.values()):
            continue
        front = quantity in _FRONTS or AT_FRACTION.fullmatch(column) is not None
        curves = tuple(
            Curve(run, t["position"].to_numpy(), open_front(v) if front else v)
            for run in drawn
            if (t := having.get(id(run))) is not None
            for v in (t[column].to_numpy(),)
        )
        if _vary(curves, units):
            grouped.setdefault(quantity, []).append(Panel(place, units.pop(), curves))
    return _ordered(grouped)


def parts(column: str, columns: Sequence[str]) -> tuple[str, str]:
    """Return quantity and place of a column; the places are those that have a temperature, too."""
    probes = [c.removeprefix("surface_temperature_") for c in columns]
    places = {p for p, c in zip(probes, columns, strict=True) if p != c} | set(_PLACES)
    for place in sorted(places, key=len, reverse=True):
        if column.endswith(f"_{place}"):
            return column.removesuffix(f"_{place}"), place
    return column, ""


def _vary(curves: Sequence[Curve], units: Set[str]) -> bool:
    """Whether there is anything to see.

    Not a core that stays liquid, a force that is rounding, a share that is zero; but a shell that
    has not begun or a gap that stays closed is a result.
    """
    values = np.concatenate([curve.values for curve in curves])
    values = values[np.isfinite(values)]
    largest = float(np.abs(values).max(initial=0.0))
    if units & {"kN", "kN/m"}:
        return largest > STYLE.force
    if largest == 0.0:
        return len(values) > 0 and "mm" in units
    return float(np.ptp(values)) > 1e-6 * largest  # else the same all the way and in all runs


def _ordered(grouped: dict[str, list[Panel]]) -> list[tuple[Definition, list[Panel]]]:
    """Return the known figures in their order and the others after them."""
    known = {d.quantity: d for d in FIGURES}
    names = [name for name in known if name in grouped]
    names += [name for name in grouped if name not in known]
    found = []
    for name in names:
        plain = name.replace("_", " ")
        definition = known.get(name, Definition(name, plain.capitalize(), plain))
        if name.startswith("fs") and name[2:].isdigit():
            title = f"Depth below the surface to fs = {int(name[2:]) / 100:g}"
            definition = Definition(name, title, "depth", zero=True)
        panels = sorted(grouped[name], key=lambda panel: panel.place in _LAST)
        found.append((definition, _different(panels)))
    return found


def _alike(one: Panel, other: Panel) -> bool:
    """Whether the same runs have curves that cannot be told apart."""
    if [id(c.run) for c in one.curves] != [id(c.run) for c in other.curves]:
        return False
    for mine, theirs in zip(one.curves, other.curves, strict=True):
        finite = theirs.values[np.isfinite(theirs.values)]
        unseen = 2e-3 * float(np.ptp(finite)) if len(finite) else 0.0
        if not np.allclose(mine.values, theirs.values, rtol=0.0, atol=unseen, equal_nan=True):
            return False
    return True


def _different(panels: list[Panel]) -> list[Panel]:
    """Drop panels whose curves are those of one before, as on the faces of a square section."""
    kept: list[Panel] = []
    for panel in panels:
        if panel.unit in (p.unit for p in kept) and any(_alike(panel, other) for other in kept):
            continue
        kept.append(panel)
    return kept


def _derive(table: pandas.DataFrame, base: pandas.DataFrame | None) -> None:
    """Add the heat that leaves per time, and the heat removed as a share of the base run's.

    Below the mould there is no largest gap, where a history has 0.
    """
    units = table.attrs["units"]
    if "gap_max" in table:
        table["gap_max"] = table["gap_max"].where(beside_wall(table))
    if "heat_removed" not in table or units["heat_removed"] != "J/m":
        return
    removed, position = np.asarray(table["heat_removed"]), np.asarray(table["position"])
    if "heat_rate" not in table:
        table["heat_rate"] = rate_of(table)
        units["heat_rate"] = "W/m"
    if base is not None and "heat_removed" in base:
        theirs = np.interp(position, base["position"], base["heat_removed"], right=np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            table["heat_share"] = np.where(theirs > 0, 100.0 * removed / theirs, np.nan)
        units["heat_share"] = "%"
