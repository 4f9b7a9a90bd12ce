"""Prediction of the shell in the middle of a pitch from the slice where it enters the pitch."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from castfem.base.types import Array
from castfem.fem.probes import Profile
from castfem.physics.constitutive import ThermoElastic
from castfem.physics.machine.bulging import CreepingStrip
from castfem.physics.machine.bulging.uneven import UnevenRolls
from castfem.physics.machine.defects import out_of_line

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.mechanics import Bulging
    from castfem.physics.constitutive.base import Law
    from castfem.physics.machine.rolls import Rolls
    from castfem.physics.materials import Steel
    from castfem.physics.mechanics.slice_definition import Ferrostatic


@dataclass(frozen=True, slots=True)
class ShellPrediction:
    """Prediction of the temperature below the middle of a wide face.

    Heat flows along the depth only, since neither the edges nor the next pitch matter there, and
    the surface temperature stays constant: a change takes the better part of a minute to reach the
    front of a 20 mm shell, and half a pitch takes some seconds.
    """

    steel: Steel  #: the steel
    cell: float = 5e-4  #: cell size of the conduction grid, m
    least_cells: int = 60  #: least number of cells, however thin the slab is
    #: explicit step, relative to the square of a cell over the diffusivity
    explicit: float = 0.45

    def at(
        self, time: float, step: tuple[float, float], before: Profile, after: Profile
    ) -> Profile:
        """A profile at a time: interpolated within a step, predicted beyond it."""
        start, end = step
        if time > end:
            return self.later(after, time - end)
        share = max(time - start, 0.0) / (end - start)
        temperature = (1.0 - share) * before.temperature + share * after.temperature
        return after.at_temperatures(np.asarray(temperature))

    def later(self, profile: Profile, duration: float) -> Profile:
        """Profile after some seconds; no heat flows through its end, the middle of the slab.

        Explicit finite volumes of the enthalpy, within the stability limit.
        """
        length = float(profile.depth[-1])
        if not duration > 0.0:
            return profile
        cells = max(self.least_cells, math.ceil(length / self.cell))
        x: Array = np.asarray(np.linspace(0.0, length, cells + 1))
        dx = length / cells
        start: Array = np.asarray(np.interp(x, profile.depth, profile.temperature))
        coldest, hottest = float(start.min()), float(start.max())
        curve = self.steel.thermal_curve(coldest - 1.0, hottest + 1.0, hottest)  # K of margin
        enthalpy = np.array(curve.enthalpy(start))
        fastest = float(curve.at(enthalpy).conduction_slope.max())
        steps = math.ceil(duration * fastest / (self.explicit * dx**2))
        for _ in range(steps):
            flux = np.diff(curve.at(enthalpy).conduction) / dx
            enthalpy[1:-1] += duration / steps / dx * np.diff(flux)
            enthalpy[-1] -= duration / steps / (0.5 * dx) * flux[-1]
        gained = curve.at(enthalpy).temperature - start
        ahead = profile.temperature + np.interp(profile.depth, x, gained)
        return profile.at_temperatures(np.asarray(ahead))


@dataclass(frozen=True, slots=True)
class Core:
    """The liquid inside the shell."""

    head: Callable[[float], float]  #: its pressure over time, Pa
    share: Callable[[Array], Array]  #: share of the pressure felt at temperatures (n,), K

    def share_handed_on(self, profile: Profile) -> float:
        """Share of the pressure passed on to the shell: none in liquid, none with a solid core."""
        surface, core = self.share(np.array([profile.temperature[0], profile.temperature.max()]))
        return float(max(core - surface, 0.0))

    def handed_on(self, profile: Profile, time: float) -> float:
        """Pressure passed on to the shell, Pa."""
        return float(self.head(time) * self.share_handed_on(profile))


def front_of(steel: Steel, solid_fraction: float) -> float:
    """Temperature at which the steel has a solid fraction, K."""
    if solid_fraction >= 1.0:
        return steel.solidus
    if solid_fraction <= 0.0:
        return steel.liquidus

    def excess(temperature: float) -> float:
        return float(np.asarray(steel.solid_fraction(np.array([temperature])))[0]) - solid_fraction

    return float(brentq(excess, steel.solidus, steel.liquidus, xtol=1e-6))


def core_of(liquid: Ferrostatic | None) -> Core:
    """The liquid core; no pressure where the case leaves it out."""
    if liquid is None:
        return Core(lambda time: 0.0, np.zeros_like)
    return Core(liquid.head, lambda heat: np.asarray(liquid.share(heat)))


def build_uneven_rolls(
    case: Case, table: Bulging, rolls: Rolls, law: Law, count: int
) -> tuple[UnevenRolls | None, Array]:
    """Return the rolls near which strips span several pitches, and all rolls' offsets.

    Returns:
        None for the thesis' plate, each of which is by itself; the offsets are those of the rolls
        that are there, m (`out_of_line`).
    """
    normal = None if case.machine is None else case.machine.normal()
    assert normal is not None, "the case was checked"
    there, lines = rolls.there, out_of_line(normal, rolls)
    if table.model == "thesis":
        return None, lines
    marks = {k for k in range(len(there) - 1) if there[k + 1] - there[k] > 1}
    for k, i in enumerate(there):
        if rolls.pairs[i].offset:
            marks |= {k - 1, k} & set(range(len(there) - 1))
    places = [pair.position for pair in normal.pairs]
    steel = law if table.model == "creep" else ThermoElastic(law.elasticity)
    strip = CreepingStrip(steel, shear=bool(table.shear))
    return UnevenRolls(
        strip,
        np.array([rolls.pairs[i].position for i in there]),
        lines,
        frozenset(marks),
        (places[1] - places[0], places[-1] - places[-2]),
        count,
    ), lines
