"""Uniqueness of a stage of the heat balance: the longest stage with a single root.

A surface whose flux decreases with temperature (boiling between the peak and the film, dq/dT < 0)
may be in balance at several temperatures at the end of a long stage, while in time there is one
solution: the one that is reached continuously from the previous state. The balance of a vertex
increases with its temperature, and so has one root, if

    tau w (-dq/dT) < M dH/dT,

with w its perimeter share, M the volume of its steel. A step stays on its branch if this holds at
all temperatures that the vertex has passed; conduction only helps.
"""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.materials.curve import CurvePoint
from castfem.physics.thermal.boundary import Cooling
from castfem.physics.thermal.problem import ThermalProblem


class Branch:
    """Computes the longest stage with a single root.

    Args:
        problem: The heat balance.
    """

    def __init__(self, problem: ThermalProblem) -> None:
        self._problem = problem
        self._cooling: Cooling | None = None
        # For the present cooling: smallest rise of the heat leaving each vertex, W/m K, negative
        # where it decreases anywhere; None if it decreases nowhere.
        self._sharpest: Array | None = None

    def longest_stage(self, old: CurvePoint, new: CurvePoint, time: float, asked: float) -> float:
        """Longest stage from `old` to `new` with a single root, s.

        Args:
            old: State before the stage.
            new: State at its end.
            time: Time of its end, s.
            asked: Length of the stage, s; longer limits are not distinguished.
        """
        if self._cooling is not self._problem.cooling:
            self._look_at(self._problem.cooling, time)
        if self._sharpest is None:
            return np.inf
        # Of the two ends the state with the smaller heat capacity.
        warming = np.maximum(old.temperature_slope, new.temperature_slope) / self._problem.volume
        longest = self._bound(warming, self._sharpest)
        if longest >= asked:
            return longest
        return self._bound(warming, self._on_the_way(old.temperature, new.temperature, time))

    def _look_at(self, cooling: Cooling, time: float) -> None:
        """Determine whether and where a flux may decrease.

        Water may fall on the vertices of some ranks only, but all must reach the same answer.
        """
        knots = self._problem.curve.knots
        grid = np.arange(knots[0], knots[-1], 1.0)
        sharpest, falls = np.zeros_like(self._problem.area), False
        for patch, law in cooling.laws:
            least = np.minimum(law.least_rise(grid, time), 0.0)
            sharpest[patch.dofs] += patch.weights * least
            falls = falls or bool(np.any(least < 0.0))
        falls = reductions.any_of(self._problem.section.comm, falls)
        self._cooling, self._sharpest = cooling, sharpest if falls else None

    def _on_the_way(self, old: Array, new: Array, time: float) -> Array:
        """Smallest rise of the heat leaving each vertex along its way (owned,), W/m K."""
        sharpest, surface = np.zeros_like(old), self._problem.surface_heat
        cooled = surface.vertices
        for share in np.linspace(0.0, 1.0, 33):
            at = old + share * (new - old)
            sharpest[cooled] = np.minimum(sharpest[cooled], surface.at(at, time)[1])
        return sharpest

    def _bound(self, warming: Array, slope: Array) -> float:
        """Longest stage with a single root for these slopes (collective)."""
        worst = reductions.largest(self._problem.section.comm, -slope * warming)
        return np.inf if worst <= 0.0 else 1.0 / worst
