"""Report of a caster: liquid core, events, and pieces with low ductility."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import place_said, said
from castfem.base.types import Array, Flags
from castfem.model.caster import DIGITS
from castfem.model.caster_slices import cast_of
from castfem.physics.machine.bending_zones import phases
from castfem.runs.caster.files import CENTRE, definition, read_table
from castfem.runs.output.folder import CASTER_NAME, SLICES_NAME, STRAND_ROWS_NAME

if TYPE_CHECKING:
    from castfem.model import Case

_POOL, _SURFACE = "metallurgical_length", "surface_temperature_"


def answers(folder: Path, case: Case) -> list[str]:
    """Return the findings from a caster's files, one line each.

    Args:
        folder: Folder of the run.
        case: Case of the run.
    """
    assert case.caster is not None
    numbers, _, _ = read_table(folder / CASTER_NAME)
    time, length = numbers["time"], case.casting.length
    plant = case.caster.plant  # an instant of caster.csv may be as late as the next look
    named = [(at, event) for at, event in zip(plant.times, plant.events, strict=True) if event]
    events = [one for one in named if one[0] <= time[-1]]
    strand, _, _ = read_table(folder / STRAND_ROWS_NAME)
    liquid = np.isin(time, strand["clock"][strand[CENTRE] < 1.0])
    lines = [*_pool(time, numbers[_POOL], numbers["speed"], length, events, liquid)]
    lines += [f"{_clock(at)}: {event}" for at, event in events]
    slices, _, _ = read_table(folder / SLICES_NAME)
    lines += _leaving(slices)
    lines += pieces_in_band(strand, case, events)
    worst = float(np.nanmax(np.abs(numbers["energy_error"]), initial=0.0))
    return [*lines, f"balance of heat of all slices: {worst:.1e} of the heat removed"]


def _clock(time: float) -> str:
    return said(time, "s", ".6g")


def _after(time: float, events: Sequence[tuple[float, str]]) -> str:
    """The last event before a time, in words; empty if there is none."""
    before = [one for one in events if one[0] <= time]
    return f", {_clock(time - before[-1][0])} after: {before[-1][1]}" if before else ""


def _pool(
    time: Array,
    pool: Array,
    speed: Array,
    length: float,
    events: Sequence[tuple[float, str]],
    liquid: Flags,
) -> Iterator[str]:
    inside = np.isfinite(pool)
    solid = ~inside & ~liquid
    if solid.any():
        yield (
            f"no slice has liquid at {solid.sum()} of {len(time)} instants, first at "
            f"{_clock(time[solid][0])}{_after(time[solid][0], events)}"
        )
    if (~inside & liquid).any():
        beyond = time[~inside & liquid]
        yield (
            f"the strand leaves the machine ({place_said(length)}) with liquid at {len(beyond)} of "
            f"{len(time)} instants, first at {_clock(beyond[0])} and last at {_clock(beyond[-1])}"
            f"{_after(beyond[0], events)}"
        )
    if not inside.any():
        return
    longest = "longest" if (inside | solid).all() else "longest within the machine"
    for word, i in ((longest, int(np.nanargmax(pool))), ("shortest", int(np.nanargmin(pool)))):
        at = f"at {_clock(time[i])}, cast at {said(speed[i], 'm/min', '.3g')}"
        place = place_said(float(pool[i]))
        after = _after(time[i], events)
        yield f"the pool is {word} {at}: it ends {place} below the meniscus{after}"
    if (inside | solid).all():
        yield (
            f"it ends within the machine at every instant, {place_said(length - np.nanmax(pool))} "
            "or more above its end"
        )


def pieces_in_band(
    strand: dict[str, Array], case: Case, events: Sequence[tuple[float, str]]
) -> Iterator[str]:
    """Yield which pieces have low ductility at the surface while they are straightened.

    Pieces are counted from the steel at the meniscus at the plant's first row; earlier steel has
    numbers from 0 downwards.

    Args:
        strand: Columns of strand.csv.
        case: Case of the caster; without the key `cut` there are no pieces.
        events: Clock time, s, and description.
    """
    caster, rolls = case.caster, None if case.machine is None else case.machine.pairs()
    if caster is None or caster.cut is None or rolls is None:
        return
    cast, low_high = cast_of(case), case.brittle_band
    low, high = (end - ZERO_CELSIUS for end in low_high)
    first = cast.length(caster.plant.times[0])
    band = f"{said(low, 'degC', '.0f')} to {said(high, 'degC', '.0f')}"
    names = [name for name in strand if name.startswith(_SURFACE)]
    left, cut = strand["clock"] - strand["time"], caster.cut

    def pieces(rows: Flags) -> list[int]:
        found = (math.floor((cast.length(at) - first) / cut) + 1 for at in np.unique(left[rows]))
        return sorted({*found})

    for phase in (one for one in phases(rolls) if one.kind == "straightening"):
        start, end = (rolls.pairs[i].position for i in (phase.first, phase.last))
        there = (strand["position"] >= start) & (strand["position"] <= end)
        where = f"in the straightener ({start:.2f} to {end:.2f} m)"
        for name in names:
            found, probe = definition(name)
            label = found.result(math.nan, probe).label
            values = strand[name]
            spans = (float(values[there].min()), float(values[there].max())) if there.any() else ()
            met = ", which has " + " to ".join(said(one, "degC", ".0f", name) for one in spans)
            within = there & (values > low) & (values < high)
            if not within.any():
                yield f"{label}: no piece is within {band} {where}{met if spans else ''}"
                continue
            first_in, last_in = (end(strand["clock"][within]) for end in (np.min, np.max))
            some, passed = pieces(within), pieces(there)
            every = "all that pass: " if some == passed else ""
            yield (
                f"{label}: {every}{_runs(some)} of {place_said(caster.cut)} within {band} {where}"
                f"{met}; first at {_clock(first_in)}{_after(first_in, events)}; last at "
                f"{_clock(last_in)}"
            )


def _runs(numbers: Sequence[int]) -> str:
    """Numbers of pieces, consecutive ones as a range."""
    found: list[list[int]] = []
    for number in numbers:
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    ranges = [f"{a}" if a == b else f"{a} to {b}" for a, b in found]
    return f"piece{'s' if len(numbers) > 1 else ''} {', '.join(ranges)}"


def _leaving(slices: dict[str, Array]) -> Iterator[str]:
    """Yield the range of surface temperatures at which slices leave the machine."""
    name = next((name for name in slices if name.startswith("surface_temperature_")), "")
    if not name or len(slices["left"]) < 2:
        return
    found, probe = definition(name)
    unit, values = found.unit, slices[name]
    left = np.round(slices["left"], DIGITS) + 0.0  # start and duration may leave -7e-15 s, or -0
    ends = (int(np.argmin(values)), int(np.argmax(values)))
    cold, warm = (
        f"{said(float(values[i]), unit, '.0f', name)} at {said(left[i], 's', '.6g')}" for i in ends
    )
    label = found.result(math.nan, probe).label
    yield f"{label}, where slices leave the machine: from {cold} to {warm}"
