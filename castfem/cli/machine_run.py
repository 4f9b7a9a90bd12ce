"""What `castfem machine --run` has of a run: where the strand is solid, how its drives pulled."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from castfem.base.errors import InputError
from castfem.base.tolerances import ROUNDING
from castfem.base.types import Array
from castfem.base.units import factor_and_zero
from castfem.model import Case, load_case
from castfem.model.shipped_cases import CASE_NAME
from castfem.physics.machine.rolls import Pair, Rolls
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary

_DEFECTS = ("offset", "locked", "lost")
_SAME = ("position", "diameter", "aperture", *_DEFECTS, "radius", "driven", "capacity")


@dataclass(frozen=True, slots=True)
class Ended:
    """How far the strand of a run is solid."""

    to: float  #: position to which it was followed, m
    solid: float | None  #: where it is solid throughout, m; None where it is not
    liquid: float | None  #: where its liquid core (fs = 0) ends, m; None where it does not

    def __str__(self) -> str:
        """In words, but for where it is solid."""
        core = "liquid to there" if self.liquid is None else f"liquid to {self.liquid:.4g} m"
        return f"not down to {self.to:.4g} m, where the run ends; {core} (fs = 0)"

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Positions, m, and what is there, for the picture."""
        if self.solid is not None:
            return ((self.solid, f"solid at {self.solid:.4g} m"),)
        core = () if self.liquid is None else ((self.liquid, f"liquid to {self.liquid:.4g} m"),)
        return (*core, (self.to, f"not solid at {self.to:.4g} m"))


def ended(run: Path, case: Case) -> Ended:
    """Return how far the strand of a run is solid."""
    summary = Summary.load(run) if run.is_dir() else None
    if summary is None or not (run / CASE_NAME).is_file():
        raise InputError(f"--run {run}: holds no run that has ended")
    table = load_case(run / CASE_NAME).machine
    theirs, ours = (None if one is None else one.pairs() for one in (table, case.machine))
    if ours is not None and (what := _other(ours, theirs)):
        raise InputError(
            f"--run {run}: is a run through another machine: {what}; give a run of this case"
        )
    solid, liquid = (
        None if one is None or math.isnan(one.value) else one.value
        for one in map(summary.quantities.get, ("metallurgical_length", "liquid_end"))
    )
    reached = summary.quantities.get("position")
    return Ended(case.casting.length if reached is None else reached.value, solid, liquid)


def _other(ours: Rolls, theirs: Rolls | None) -> str:
    """In what the machine of a run is another one, in words; empty of the same."""
    if theirs is None:
        return "it has no rolls"
    counts = len(theirs.pairs), len(ours.pairs)
    if counts[0] != counts[1]:
        return f"it has {counts[0]} pairs of rolls, the case {counts[1]}"
    if theirs.face != ours.face:
        return f"its radii are those of the {theirs.face}, in the case of the {ours.face}"
    for key in _SAME:
        for i, (one, other) in enumerate(zip(theirs.pairs, ours.pairs, strict=True), 1):
            if _same(one, other, key):
                continue
            if key in _DEFECTS:
                now, then = (pair.defect or "in order" for pair in (other, one))
                return f"roll {i} is {then}, in the case {now}"
            return f"roll {i} has another {key}"
    return ""


def _same(one: Pair, other: Pair, key: str) -> bool:
    """Whether two pairs have the same, but for how it was written down."""
    a, b = getattr(one, key), getattr(other, key)
    if a is None or b is None or math.isinf(a) or math.isinf(b):
        return bool(a == b)
    return math.isclose(a, b, rel_tol=ROUNDING, abs_tol=ROUNDING)


def drives_of(run: Path, rolls: Rolls) -> tuple[Array, Array, float, float] | None:
    """Return what came to each pair and what it pulled, as the slice of a run met them.

    A drive pulls over the pitch below it: what it took is known as the slice comes to the next
    pair that holds the strand.

    Returns:
        Effort (n,) and pull (n,) of the pairs, N, not a number where the run did not come to them,
        what the rolls resist, N, and down to where they do, m; None of a run without it.
    """
    table = read_history(run / HISTORY_NAME)
    names = ("effort", "drive_force", "roll_resistance")
    if not set(names) <= set(table.columns):
        return None
    units = table.attrs["units"]
    position, effort, drives, resistance = (
        table[name].to_numpy() / factor_and_zero(si, units[name])[0]
        for name, si in (("position", "m"), *((name, "N") for name in names))
    )
    there = list(rolls.there)
    places = np.array([rolls.pairs[i].position for i in there])
    ends = np.append(places, 2.0 * places[-1] - places[-2])
    beyond = position[-1] * (1.0 + ROUNDING)

    def at(values: Array, where: Array) -> Array:
        return np.where(where <= beyond, np.interp(where, position, values), math.nan)

    found = np.full((2, len(rolls.pairs)), math.nan)
    found[0, there] = at(effort, places)
    found[1, there] = np.diff(at(drives, ends))
    return found[0], found[1], float(resistance[-1]), float(position[-1])
