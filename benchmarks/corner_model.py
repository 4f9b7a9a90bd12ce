"""Corner of a billet as two columns of cells: has its gap with the heat one solution, or none?

Writes a table of docs/coupling.md. A face is a plane column that touches the wall; the corner is a
column of a cylinder, whose radius is that of the corner, and gives off its heat through a gap. The
faces contract as they cool below the solidus and draw the corner off the wall by half the billet's
width times their contraction, as long as its surface is solid enough to be drawn. Where it is not,
it flows back to the wall. Nothing but the columns' cells and steps is discretised, and all is
explicit: a corner that goes back and forth more often on finer cells has no solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.report import Output, table
from castfem.base.types import Array

SOLIDUS, LIQUIDUS, WALL = 1490.7, 1523.6, 160.0  # degC; steel of 0.12 % C
SUPERHEAT, TRANSITION = 28.0, 30.0  # K; the second from delta ferrite to austenite
DENSITY, HEAT, LATENT, CONDUCTIVITY = 7200.0, 750.0, 260e3, 30.0
EXPANSION = 2.3e-5  # 1/K, of austenite
HALF, DEPTH, RADIUS = 0.09, 0.02, 0.006  # m
COEFFICIENT = 2000.0  # W/(m2 K), of a surface at the wall: 2.7 MW/m2
DURATION = 6.0  # s
STABLE = 0.2  # of the square of a cell over diffusivity, that a step lasts
CELLS = (1e-3, 0.5e-3, 0.25e-3)
GAPS = (0.1, 0.15, 0.2, 0.3, 0.6)
"""Conductivity of what fills the gap, W/(m K)."""
CONTRACTIONS = (0.0, 0.001, 0.002, 0.003)
"""Of the transition."""
COHERENT = {"none": 1.0, "skeleton": 0.75}
"""Solid fraction from which the corner is drawn along."""
_MUSH = HEAT * (LIQUIDUS - SOLIDUS) + LATENT  # J/kg, from solidus to liquidus


@dataclass(slots=True)
class Column:
    """Cells below a surface, each with its enthalpy, J/m3, above that at the solidus."""

    size: float  #: of a cell, m
    areas: Array  #: of the cells' sides over that of the surface (cells + 1,)
    enthalpy: Array  #: (cells,)

    @classmethod
    def poured(cls, size: float, depth: float, radius: float = np.inf) -> Column:
        """Liquid of the pouring temperature, plane or with the surface of a cylinder."""
        cells = round(depth / size)
        sides = size * np.arange(cells + 1)
        areas = 1.0 - sides / radius if np.isfinite(radius) else np.ones(cells + 1)
        return cls(size, areas, np.full(cells, DENSITY * (_MUSH + HEAT * SUPERHEAT)))

    @property
    def temperature(self) -> Array:
        """In the middle of each cell, degC."""
        specific = self.enthalpy / DENSITY
        mushy = SOLIDUS + (LIQUIDUS - SOLIDUS) * specific / _MUSH
        liquid = LIQUIDUS + (specific - _MUSH) / HEAT
        solid = SOLIDUS + specific / HEAT
        return np.where(specific < 0.0, solid, np.where(specific < _MUSH, mushy, liquid))

    def cool(self, step: float, gap: float, conductivity: float) -> float:
        """Give off heat for a step and return the temperature of the surface at its start, degC."""
        temperature = self.temperature
        inside = 2.0 * CONDUCTIVITY / self.size
        outside = 1.0 / (1.0 / COEFFICIENT + gap / conductivity)
        surface = (inside * temperature[0] + outside * WALL) / (inside + outside)
        flux = np.zeros(len(temperature) + 1)  # towards the surface
        flux[0] = outside * (surface - WALL)
        flux[1:-1] = CONDUCTIVITY * np.diff(temperature) / self.size
        volume = 0.5 * self.size * (self.areas[:-1] + self.areas[1:])
        self.enthalpy = self.enthalpy + step * np.diff(flux * self.areas) / volume
        return float(surface)


def returns(size: float, gap_conductivity: float, contraction: float, coherent: float) -> int:
    """How often the corner melts and goes back to the wall.

    Args:
        size: Of the cells, m.
        gap_conductivity: W/(m K).
        contraction: Of the transition from delta ferrite to austenite.
        coherent: Solid fraction from which the corner is drawn along.
    """
    face, corner = Column.poured(size, DEPTH), Column.poured(size, RADIUS, RADIUS)
    holds = SOLIDUS + (1.0 - coherent) * (LIQUIDUS - SOLIDUS)
    step = STABLE * size**2 * DENSITY * HEAT / CONDUCTIVITY
    gap, count = 0.0, 0
    for _ in range(round(DURATION / step)):
        cold = max(SOLIDUS - face.cool(step, 0.0, gap_conductivity), 0.0)
        drawn = HALF * (contraction * min(cold / TRANSITION, 1.0) + EXPANSION * cold)
        solid = corner.cool(step, gap, gap_conductivity) <= holds
        count += gap > 0.0 and not solid
        gap = drawn if solid else 0.0
    return count


def main(output: Output, quick: bool) -> None:
    """Gap conductivity, contraction, and the mushy zone with and without a skeleton."""
    rows: list[dict[str, Any]] = []
    for contraction in CONTRACTIONS[: 1 if quick else None]:
        for conductivity in GAPS[: 1 if quick else None]:
            row: dict[str, Any] = {"contraction": 100.0 * contraction, "gap": conductivity}
            for name, coherent in COHERENT.items():
                for size in CELLS:
                    key = f"{name}_{1e3 * size:g}"
                    row[key] = returns(size, conductivity, contraction, coherent)
            rows.append(row)
    output.csv("corner_model", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {"contraction": "contraction [%]", "gap": "gap conducts [W/(m K)]"}
    for name in COHERENT:
        head |= {f"{name}_{1e3 * s:g}": f"{name}, {1e3 * s:g} mm" for s in CELLS}
    forms = {"contraction": ".1f", "gap": ".2f"}
    output.insert("corner model", table(output.rows("corner_model"), head, forms))
