"""What is said of a caster: when its pool was longest, whether liquid left the machine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from castfem.base.shown_units import place_said, said
from castfem.base.types import Array, Flags
from castfem.runs.caster.files import CENTRE, definition, read_table
from castfem.runs.output.folder import CASTER_NAME, SLICES_NAME, STRAND_ROWS_NAME

_POOL = "metallurgical_length"


def answers(folder: Path, length: float) -> list[str]:
    """Return what a caster's files tell, a line each.

    Args:
        folder: Of the run.
        length: To the end of the machine, m.
    """
    numbers, _, words = read_table(folder / CASTER_NAME)
    time, pool, speed = (numbers[name] for name in ("time", _POOL, "speed"))
    strand, _, _ = read_table(folder / STRAND_ROWS_NAME)
    liquid = np.isin(time, strand["clock"][strand[CENTRE] < 1.0])
    lines = [*_pool(time, pool, speed, length, liquid)]
    lines += [
        f"{said(at, 's', '.6g')}: {event}"
        for at, event in zip(time, words.get("event", ()), strict=False)
        if event
    ]
    slices, _, _ = read_table(folder / SLICES_NAME)
    lines += _leaving(slices)
    worst = float(np.nanmax(np.abs(numbers["energy_error"]), initial=0.0))
    return [*lines, f"balance of heat of all slices: {worst:.1e} of the heat removed"]


def _pool(time: Array, pool: Array, speed: Array, length: float, liquid: Flags) -> Iterator[str]:
    inside = np.isfinite(pool)
    solid = ~inside & ~liquid
    if solid.any():
        yield (
            f"no slice has liquid at {solid.sum()} of {len(time)} instants, first at "
            f"{said(time[solid][0], 's', '.6g')}"
        )
    if (~inside & liquid).any():
        beyond = time[~inside & liquid]
        yield (
            f"the strand leaves the machine ({place_said(length)}) with liquid at {len(beyond)} of "
            f"{len(time)} instants, first at {said(beyond[0], 's', '.6g')} and last at "
            f"{said(beyond[-1], 's', '.6g')}"
        )
    if not inside.any():
        return
    for word, i in (("longest", int(np.nanargmax(pool))), ("shortest", int(np.nanargmin(pool)))):
        at = f"at {said(time[i], 's', '.6g')}, cast at {said(speed[i], 'm/min', '.3g')}"
        yield f"the pool is {word} {at}: it ends {place_said(float(pool[i]))} below the meniscus"
    if (inside | solid).all():
        yield (
            f"it ends within the machine at every instant, {place_said(length - np.nanmax(pool))} "
            "or more above its end"
        )


def _leaving(slices: dict[str, Array]) -> Iterator[str]:
    """Yield the range of the surface temperature with which slices leave the machine."""
    name = next((name for name in slices if name.startswith("surface_temperature_")), "")
    if not name or len(slices["left"]) < 2:
        return
    found, probe = definition(name)
    unit, values, left = found.unit, slices[name], slices["left"]
    ends = (int(np.argmin(values)), int(np.argmax(values)))
    cold, warm = (
        f"{said(float(values[i]), unit, '.0f', name)} at {said(left[i], 's', '.6g')}" for i in ends
    )
    label = found.result(math.nan, probe).label
    yield f"{label}, where slices leave the machine: from {cold} to {warm}"
