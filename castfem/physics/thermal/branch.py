"""Where a stage of the heat balance has one root, and how long it may be to keep to it.

A surface whose flux falls as it warms (boiling between the peak and the film, dq/dT < 0) may be in
balance at several temperatures at the end of a long stage, while in time there is one: the one
that is reached from the state before without a jump.  The balance of a vertex grows with its
temperature, and so has one root, where

    tau w (-dq/dT) < M dH/dT,

w its share of the perimeter, M the volume its steel fills.  A step keeps to the branch it is on if
this holds at all temperatures that the vertex has passed on the way; conduction only helps.
"""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.materials.curve import CurvePoint
from castfem.physics.thermal.boundary import Cooling
from castfem.physics.thermal.problem import ThermalProblem


class Branch:
    """Tells how long a stage may be to have one root.

    Args:
        problem: The heat balance.
    """

    def __init__(self, problem: ThermalProblem) -> None:
        self._problem = problem
        self._cooling: Cooling | None = None
        # Of the cooling that holds: least rise of the heat that leaves each vertex, W/m K, below 0
        # where it falls anywhere; None if it does so nowhere.
        self._sharpest: Array | None = None

    def longest_stage(self, old: CurvePoint, new: CurvePoint, time: float, asked: float) -> float:
        """Longest stage from `old` to `new` that has one root, s.

        Args:
            old: Before the stage.
            new: At its end.
            time: Of its end, s.
            asked: Length of the stage, s; what is longer is not told apart.
        """
        if self._cooling is not self._problem.cooling:
            self._look_at(self._problem.cooling, time)
        if self._sharpest is None:
            return np.inf
        # Of the two ends the state that takes up less heat per degree.
        warming = np.maximum(old.temperature_slope, new.temperature_slope) / self._problem.volume
        longest = self._bound(warming, self._sharpest)
        if longest >= asked:
            return longest
        return self._bound(warming, self._on_the_way(old.temperature, new.temperature, time))

    def _look_at(self, cooling: Cooling, time: float) -> None:
        """Find whether and where a flux may fall.

        Water may fall on the vertices of some ranks alone: all must come to the same answer.
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
        """Least rise of the heat that leaves each vertex on its way (owned,), W/m K."""
        sharpest = np.zeros_like(old)
        for share in np.linspace(0.0, 1.0, 33):
            at = old + share * (new - old)
            slope = np.zeros_like(old)
            for patch, law in self._problem.cooling.laws:
                slope[patch.dofs] += patch.weights * law.flux(at[patch.dofs], time)[1]
            sharpest = np.minimum(sharpest, slope)
        return sharpest

    def _bound(self, warming: Array, slope: Array) -> float:
        """Longest stage that has one root, with these slopes (collective)."""
        worst = reductions.largest(self._problem.section.comm, -slope * warming)
        return np.inf if worst <= 0.0 else 1.0 / worst
