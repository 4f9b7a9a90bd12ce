"""Heat that leaves the surface vertices in one zone, by all laws together.

Most laws are sums of a few kinds of terms, which one compiled loop adds up for all vertices
(`castfem.physics.thermal.surface_loop`); the others are evaluated one by one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array, Indices
from castfem.physics.thermal.boundary import Cooling, Patch
from castfem.physics.thermal.flux_laws import OfTemperature, SurfaceLaw
from castfem.physics.thermal.mould_flux import with_slope
from castfem.physics.thermal.surface_loop import COLUMNS, add_up

if TYPE_CHECKING:
    from castfem.physics.thermal.spray_flux import CoefficientTable


class SurfaceHeat:
    """Heat that leaves the surface with a cooling.

    Args:
        cooling: The laws. Where weights of their patches change, make a new object.

    Attributes:
        vertices: Owned vertices that are cooled (n,).
    """

    def __init__(self, cooling: Cooling) -> None:
        self._cooling = cooling
        dofs = [patch.dofs for patch, _ in cooling.laws]
        self.vertices: npt.NDArray[np.int64]
        self.vertices = np.unique(np.concatenate(dofs)) if dofs else np.zeros(0, np.int64)
        self._laws: list[tuple[Patch, SurfaceLaw]] | None = None
        self._time = np.nan
        self._setting: tuple[tuple[float, ...], ...] = ()

    def _prepare(self, time: float) -> None:
        """Divide the laws into terms, and laws that have none."""
        laws = self._cooling.laws
        self._others: list[tuple[Indices, Array, SurfaceLaw]] = []
        curves: dict[OfTemperature, int] = {}
        tables: dict[int, tuple[int, CoefficientTable]] = {}
        places: list[Indices] = [np.zeros(0, np.int64)]
        blocks: list[Array] = [np.zeros((0, COLUMNS))]
        contents: list[Array] = [np.zeros(0)]
        for patch, law in laws:
            local, terms = np.searchsorted(self.vertices, patch.dofs), law.terms(time)
            if terms is None:
                self._others.append((local, patch.weights, law))
                continue
            for term in terms:
                which = 0
                if term.curve is not None:
                    which = curves.setdefault(term.curve, len(curves))
                elif term.table is not None:
                    if id(term.table) not in tables:
                        tables[id(term.table)] = sum(map(len, contents)), term.table
                        contents.append(term.table.packed)
                    which = tables[id(term.table)][0]
                block = np.empty((len(local), COLUMNS))
                block[:, 0], block[:, 1] = term.kind, patch.weights * term.factor
                block[:, 2], block[:, 3] = term.ambient, term.number
                block[:, 4], block[:, 5] = term.scale, which
                places.append(local)
                blocks.append(block)
        self._curves = tuple(curves)
        self._places, self._terms = np.concatenate(places), np.concatenate(blocks)
        self._tables = np.concatenate(contents)

    def at(self, temperature: Array, time: float) -> tuple[Array, Array]:
        """Heat that leaves each of the vertices.

        Args:
            temperature: Temperatures of all owned vertices (owned,), K.
            time: Time since the meniscus, s.

        Returns:
            The heat (n,), W/m, and its derivative by the temperature (n,), W/(m K).
        """
        laws = self._cooling.laws
        if laws is not self._laws or time != self._time:
            setting = tuple(law.setting(time) for _, law in laws)
            if laws is not self._laws or setting != self._setting:
                self._prepare(time)
            self._laws, self._time, self._setting = laws, time, setting
        surface = temperature[self.vertices]
        curves = np.empty((len(self._curves), 2, len(surface)))
        for values, curve in zip(curves, self._curves, strict=True):
            values[:] = with_slope(curve, surface) if callable(curve) else ((curve,), (0.0,))
        heat, slope = add_up(self._places, self._terms, surface, curves, self._tables)
        for places, weights, law in self._others:
            q, dq = law.flux(surface[places], time)
            heat[places] += weights * q
            slope[places] += weights * dq
        return heat, slope
