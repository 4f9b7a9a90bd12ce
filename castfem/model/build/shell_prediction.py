"""The shell that a pitch has in its middle, from what is known where the slice enters it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.fem.line_probes import Profile
from castfem.base.types import Array

if TYPE_CHECKING:
    from castfem.physics.materials import Steel

CELL = 5e-4  # m: of the grid that heat is conducted on
LEAST_CELLS = 60  # of it, however thin the slab is
STABLE = 0.45  # of the square of a cell over the diffusivity: an explicit step
MARGIN = 1.0  # K: to which the curve goes beyond the temperatures that are there


@dataclass(frozen=True, slots=True)
class ShellAhead:
    """Temperatures under the middle of a wide face, some time ahead.

    Heat flows along the depth alone, since neither the edges nor the next pitch reach there, and
    the surface stays as warm as it is: a change there takes the better part of a minute to reach
    the front of a shell of 20 mm, and half a pitch takes some seconds.

    Attributes:
        steel: The steel.
    """

    steel: Steel

    def at(
        self, time: float, step: tuple[float, float], before: Profile, after: Profile
    ) -> Profile:
        """A profile at a time: within a step between those of its ends, beyond it foreseen.

        Args:
            time: s; before the step it is that of its start.
            step: Its start and its end, s.
            before: Profile at its start.
            after: At its end.
        """
        start, end = step
        if time > end:
            return self.later(after, time - end)
        share = max(time - start, 0.0) / (end - start)
        temperature = (1.0 - share) * before.temperature + share * after.temperature
        return replace(after, temperature=np.asarray(temperature))

    def later(self, profile: Profile, duration: float) -> Profile:
        """A profile after so many seconds; no heat flows through its end, the middle of the slab.

        Explicit finite volumes of the enthalpy, as long as they are stable.

        Args:
            profile: Now.
            duration: s; nothing changes within a time that is not positive.
        """
        length = float(profile.depth[-1])
        if not duration > 0.0:
            return profile
        cells = max(LEAST_CELLS, math.ceil(length / CELL))
        x: Array = np.asarray(np.linspace(0.0, length, cells + 1))
        dx = length / cells
        start: Array = np.asarray(np.interp(x, profile.depth, profile.temperature))
        coldest, hottest = float(start.min()), float(start.max())
        curve = self.steel.thermal_curve(coldest - MARGIN, hottest + MARGIN, hottest)
        enthalpy = np.array(curve.enthalpy(start))
        fastest = float(curve.at(enthalpy).conduction_slope.max())
        steps = math.ceil(duration * fastest / (STABLE * dx**2))
        for _ in range(steps):
            flux = np.diff(curve.at(enthalpy).conduction) / dx
            enthalpy[1:-1] += duration / steps / dx * np.diff(flux)
            enthalpy[-1] -= duration / steps / (0.5 * dx) * flux[-1]
        gained = curve.at(enthalpy).temperature - start
        ahead = profile.temperature + np.interp(profile.depth, x, gained)
        return replace(profile, temperature=np.asarray(ahead))
