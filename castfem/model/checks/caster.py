"""Checks of [caster] and its plant's history."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from castfem.base import units
from castfem.base.constants import ROUNDING
from castfem.base.units import in_mm
from castfem.model.base import Faults
from castfem.model.caster import Caster
from castfem.model.checks.registry import caution, check
from castfem.model.heat_law import ScaledLaw
from castfem.model.mechanics import Way

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("caster")
def _plant_fits(case: Case, caster: Caster) -> Faults:
    """Report columns that have no key in the case, and values missing from the record."""
    plant, names = caster.plant, sprays(case)
    speeds, times = plant.values["speed"], plant.times
    if not speeds[0] > 0.0 and caster.cast_from is None:
        fix = "the caster begins with steady casting, or empty with cast_from"
        yield "plant", f"begins with the strand at rest; {fix}"
    if not speeds[-1] > 0.0:
        yield "plant", "ends with the strand at rest, so it never moves again; add a row"
    for name in plant.water:
        if name not in names:
            known = f"a circuit, or a zone with one spray: {', '.join(names) or 'there is none'}"
            yield "plant", f"column '{name}' is not {known}{units.nearest(name, names)}"
    if "mould_heat" in plant.values and not mould_laws(case):
        yield "plant", "column 'mould_heat': no law of a mould has a coefficient or a flux"
    if caster.longest_gap is not None:
        for before, after in itertools.pairwise(times):
            if after - before > caster.longest_gap * (1.0 + ROUNDING):
                allowed = f"caster.longest_gap allows {caster.longest_gap:g} s"
                yield "plant", f"has no row between {before:g} s and {after:g} s; {allowed}"


@caution("caster")
def _water_off(case: Case, caster: Caster) -> Faults:
    """Report each circuit that has no water while the strand moves, once."""
    plant = caster.plant
    for name in plant.water:
        rows = zip(plant.times, plant.values[name], plant.values["speed"], strict=True)
        if off := [time for time, flow, speed in rows if flow == 0.0 < speed]:
            yield "plant", f"'{name}' has no water at {off[0]:g} s, and the strand moves"


@check("caster")
def _window(case: Case, caster: Caster) -> Faults:
    """Report output times that the record does not cover, and a spacing that leaves no slice."""
    (start, end), times = caster.window, caster.plant.times
    span = f"the plant's history goes from {times[0]:g} s to {times[-1]:g} s"
    if start < times[0]:
        yield "start", f"({start:g} s): {span}"
    if end > times[-1] * (1.0 + ROUNDING):
        yield "end", f"({end:g} s): {span}"
    elif not end > start:
        yield "end", f"({end:g} s) is not after the start ({start:g} s)"
    elif len(caster.instants) < 2:
        yield "every", f"({caster.every:g} s): there are no two such instants in {end - start:g} s"
    length = case.casting.length
    speed = max(caster.plant.values["speed"])
    apart = caster.spacing
    gap = apart.length if isinstance(apart, Way) else apart * speed
    if not gap < length:
        text = f"leaves no slice within casting.length ({in_mm(length)})"
        yield "spacing", f"({in_mm(gap)} at the fastest) {text}"


@check("caster")
def _looks_at(case: Case, caster: Caster) -> Faults:
    """Report pyrometers beyond the strand or with equal names, and moments without an output."""
    (start, end), names = caster.window, [one.name for one in caster.pyrometer]
    for i, one in enumerate(caster.pyrometer):
        if one.at > case.casting.length * (1.0 + ROUNDING):
            text = f"({one.at:g} m): the strand is followed to {case.casting.length:g} m"
            yield f"pyrometer.{i}.at", text
        if one.name in names[:i]:
            yield f"pyrometer.{i}.name", f"'{one.name}' appears twice"
    for moment in caster.moments:
        if not start <= moment <= end:
            yield "moments", f"({moment:g} s): the run goes from {start:g} s to {end:g} s"


@check("caster")
def _ends_of_cast(case: Case, caster: Caster) -> Faults:
    """Report a begin or end of the cast that the record does not cover."""
    begun, until, times = caster.cast_from, caster.cast_until, caster.plant.times
    span = f"the plant's history goes from {times[0]:g} s to {times[-1]:g} s"
    if begun is not None and not times[0] <= begun < times[-1]:
        yield "cast_from", f"({begun:g} s): {span}"
    elif begun is not None and caster.window[0] < begun:
        yield "start", f"({caster.window[0]:g} s): the cast begins at {begun:g} s, cast_from"
    if until is not None and not (times[0] if begun is None else begun) < until <= times[-1]:
        after = "" if begun is None else f", the cast begins at {begun:g} s"
        yield "cast_until", f"({until:g} s): {span}{after}"


@check("caster")
def _goes_with(case: Case, caster: Caster) -> Faults:
    """Report what cannot be combined with a caster, whose slices begin at the meniscus."""
    start = case.casting.start
    if case.verification is not None:
        yield "", "does not go with [verification]: a closed form is of one slice"
    if start is None:
        return
    if start.at != "meniscus" or start.profile is not None:
        yield "/casting.start", "slices of a caster begin at the meniscus, as poured; leave it out"
    elif start.time is not None:
        yield "/casting.start.time", "each slice of a caster has its own; leave it out"


def mould_laws(case: Case) -> list[str]:
    """Keys of the heat laws of the mould that a factor may scale."""
    return [
        f"cooling.{i}.surface.{j}"
        for i, zone in enumerate(case.mould_zones())
        for j, law in enumerate(zone.surface)
        if isinstance(law, ScaledLaw)
    ]


def sprays(case: Case) -> dict[str, str]:
    """Keys of the flows of circuits, and of sprays that are alone in their zone, by name."""
    found = {}
    for i, zone in enumerate(case.cooling):
        sprays = [j for j, law in enumerate(zone.surface) if law.tag == "spray"]
        if len(sprays) == 1:
            found[zone.name] = f"cooling.{i}.surface.{sprays[0]}"
    circuits = () if case.secondary is None else case.secondary.circuit
    return found | {one.name: f"secondary.circuit.{i}" for i, one in enumerate(circuits)}
