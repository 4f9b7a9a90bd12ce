"""Freezing and cooling of a steel, step by step: in equilibrium, or by Scheil.

Scheil: nothing diffuses in the solid except, on request, carbon, whose chemical potential is then
equal in liquid and solid at each step. The solid is taken at its mean composition, at which its
phases are in equilibrium with each other: delta ferrite transforms to austenite in it. At the given
end the rest of the liquid freezes at once, and the steel is in equilibrium below.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from scipy.constants import R as GAS_CONSTANT
from scipy.optimize import brentq

from castfem.base.constants import ZERO_CELSIUS
from castfem.physics.materials.equilibria import SETTINGS, Equilibria, Moles, State
from castfem.physics.materials.phase_table import Scheil

# K: up to HOTTEST, or up to LIMIT if not yet liquid
COLDEST, HOTTEST, LIMIT = 298.15, 1873.15, 2473.15


def refined(at: Callable[[float], State], cold: State, hot: State) -> list[State]:
    """States between two others, so close that values are linear in between.

    Where a phase appears, the last two are `Settings.narrowest` apart.
    """
    width = hot.temperature - cold.temperature
    if width <= SETTINGS.narrowest:
        return []
    middle = at(0.5 * (cold.temperature + hot.temperature))
    same = cold.names == middle.names == hot.names
    if same and width <= 2.0 * SETTINGS.longest and _is_linear(cold, middle, hot):
        return [middle]
    return [*refined(at, cold, middle), middle, *refined(at, middle, hot)]


def _is_linear(cold: State, middle: State, hot: State) -> bool:
    mass = middle.mass - 0.5 * (cold.mass + hot.mass)
    heat = middle.enthalpy - 0.5 * (cold.enthalpy + hot.enthalpy)
    return bool(np.abs(mass).max() < SETTINGS.fraction and abs(heat) < SETTINGS.enthalpy)


def joined(rows: Sequence[State]) -> list[State]:
    """Join rows at phase changes: one without mass of the new phase, or two at a jump.

    A row whose enthalpy falls by no more than `Settings.misfit` is left out.
    """
    found = [rows[0]]
    for cold, hot in itertools.pairwise(rows):
        near = hot.temperature - cold.temperature <= SETTINGS.narrowest
        if not near or cold.names == hot.names:
            fall = found[-1].enthalpy - hot.enthalpy
            if cold.names != hot.names or not 0.0 <= fall < SETTINGS.misfit:
                found.append(hot)
            continue
        middle = 0.5 * (cold.temperature + hot.temperature)
        found[-1] = replace(found[-1], temperature=middle)
        if np.abs(hot.mass - cold.mass).max() > SETTINGS.jump:
            found.append(replace(hot, temperature=middle))
        else:
            found[-1] = _without_new(found[-1], hot)
    return found


def _without_new(cold: State, hot: State) -> State:
    """The state at which a phase appears or vanishes, from both sides of it."""
    none = (cold.mass == 0.0) | (hot.mass == 0.0)
    mass = np.where(none, 0.0, 0.5 * (cold.mass + hot.mass))
    carbon = np.where(np.isnan(cold.carbon), hot.carbon, cold.carbon)
    enthalpy = 0.5 * (cold.enthalpy + hot.enthalpy)
    return replace(cold, mass=mass, carbon=carbon, enthalpy=enthalpy)


def equilibrium_rows(solve: Equilibria, moles: Moles) -> list[State]:
    """Rows from `COLDEST` to liquid steel."""
    hot = _liquid(solve, moles)
    at = partial(solve.state, moles=moles)
    cold = at(COLDEST)
    return joined([cold, *refined(at, cold, hot), hot])


def _liquid(solve: Equilibria, moles: Moles) -> State:
    temperature = HOTTEST
    while temperature <= LIMIT:
        hot = solve.state(temperature, moles)
        if hot.mass[1:].sum() == 0.0:
            return hot
        temperature += 50.0
    solids = ", ".join(sorted(name[:-1] for name in hot.names))
    raise ValueError(
        f"gives no liquid steel at {LIMIT - ZERO_CELSIUS:.0f} degC ({solids}); name the phases "
        "without it in steel.phases"
    )


# -- Scheil -----------------------------------------------------------------------------------


def scheil_rows(solve: Equilibria, moles: Moles, scheil: Scheil) -> list[State]:
    """Rows from `COLDEST` to liquid steel, freezing by Scheil."""
    hot = _liquid(solve, moles)
    at = partial(solve.state, moles=moles)
    start = hot
    while start.mass[1:].sum() == 0.0:
        start = at(start.temperature - SETTINGS.longest)
    molten = [row for row in (*refined(at, start, hot), hot) if row.mass[1:].sum() == 0.0]
    path = ScheilPath(solve, scheil, molten[0].temperature, dict(moles), dict.fromkeys(moles, 0.0))
    freezing = path.rows()
    end = (freezing or molten)[0].temperature
    solid = partial(solve.state, moles=moles, phases=solve.solids)
    frozen, cold = solid(end), solid(COLDEST)
    return [*joined([cold, *refined(solid, cold, frozen), frozen]), *freezing, *molten]


@dataclass
class ScheilPath:
    """A steel on its path from the liquidus: remaining liquid and solid."""

    solve: Equilibria
    scheil: Scheil
    temperature: float  #: K
    liquid: Moles
    solid: Moles

    def rows(self) -> list[State]:
        """States with some liquid, from the end of the path up to the liquidus (excluded)."""
        rows: list[State] = []
        step, left = 0.5, 1.0
        while left > self.scheil.end:
            if self.temperature - step < COLDEST:
                raise ValueError(
                    f"leaves {left:.3g} of the steel liquid at {COLDEST:g} K; "
                    "take a larger steel.scheil.end"
                )
            least = left - SETTINGS.freezing if step > SETTINGS.narrowest else -1.0
            found = self._cooled(self.temperature - step, least)
            if found is None:
                step *= 0.5
                continue
            self.liquid, self.solid, self.temperature = found.liquid, found.solid, found.temperature
            if not self.liquid:
                break
            row = self.solve.state(self.temperature, self.solid, self.solve.solids).plus(
                self.solve.state(self.temperature, self.liquid, ("LIQUID",))
            )
            rows.append(row)
            left = float(row.mass[0])
            step = min(1.5 * step, SETTINGS.step)
        return rows[::-1]

    def _cooled(self, temperature: float, least: float) -> ScheilPath | None:
        """The steel at a lower temperature; None if less than `least` kg stay liquid at first."""
        liquid, solid = dict(self.liquid), dict(self.solid)
        for number in range(SETTINGS.passes):
            state = self.solve.state(temperature, liquid)
            if number == 0 and state.mass[0] < least:
                return None
            left = {e: state.liquid.get(e, 0.0) for e in liquid} if state.liquid else {}
            solid = {e: solid[e] + liquid[e] - left.get(e, 0.0) for e in solid}
            liquid = left
            diffuses = self.scheil.carbon_diffuses and solid.get("C", 0.0) > 0.0
            if not liquid or not diffuses or float(state.mass[1:].sum()) < SETTINGS.settled:
                break
            self._share_carbon(temperature, liquid, solid)
        return replace(self, temperature=temperature, liquid=liquid, solid=solid)

    def _share_carbon(self, temperature: float, liquid: Moles, solid: Moles) -> None:
        """Equalise the chemical potential of carbon in liquid and solid; all else is constant."""
        carbon = liquid["C"] + solid["C"]

        @cache
        def gap(place: float) -> float:
            """Difference of the potentials over RT; `place` is the logarithm of the ratio."""
            solid["C"] = carbon / (1.0 + math.exp(-place))
            liquid["C"] = carbon - solid["C"]
            ours = self.solve.state(temperature, solid, self.solve.solids).potential
            theirs = self.solve.state(temperature, liquid, ("LIQUID",)).potential
            return (ours - theirs) / (GAS_CONSTANT * temperature)

        start = math.log(solid["C"] / liquid["C"])
        apart = gap(start)
        if abs(apart) < SETTINGS.potential:
            return
        end = start - 1.5 * apart
        while gap(end) * apart > 0.0:
            end -= apart
        place = brentq(gap, start, end, xtol=SETTINGS.potential)
        solid["C"] = carbon / (1.0 + math.exp(-place))
        liquid["C"] = carbon - solid["C"]
