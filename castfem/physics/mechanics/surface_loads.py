"""Tractions and pressures on groups of the boundary, and the liquid held from outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from castfem.fem.section import Section
from castfem.physics.mechanics.supports import SurfacePressure, Traction


@dataclass(frozen=True, slots=True)
class SurfaceLoads:
    """Loads on groups and the constants that carry their values.

    Attributes:
        tractions: Tag-restricted measure tags, constant and time history of each traction.
        pressures: Likewise.
        measure: Perimeter measure with the boundary tags.
        liquid: Pressure at the vertices of liquid that is held from outside; None if none is.
    """

    tractions: list[tuple[tuple[int, ...], fem.Constant, Traction]]
    pressures: list[tuple[tuple[int, ...], fem.Constant, SurfacePressure]]
    measure: ufl.Measure
    liquid: fem.Function | None

    @classmethod
    def on(
        cls, section: Section, loads: list[Traction | SurfacePressure], liquid: bool
    ) -> SurfaceLoads:
        """Prepare the loads; with `liquid` the surface is held where it is liquid."""
        mesh = section.mesh
        measure = ufl.Measure(
            "ds",
            domain=mesh,
            subdomain_data=section.facet_tags,
            metadata={"quadrature_rule": "default", "quadrature_degree": 5},
        )
        held = fem.Function(section.vertex_space) if liquid else None
        found = cls([], [], measure, held)
        for load in loads:
            tags = tuple(section.required(load.on))
            if isinstance(load, Traction):
                found.tractions.append((tags, fem.Constant(mesh, np.zeros(2)), load))
            else:
                found.pressures.append((tags, fem.Constant(mesh, np.float64(0.0)), load))
        return found

    def set(self, time: float) -> None:
        """Take up the loads at `time` (s)."""
        for _, constant, traction in self.tractions:
            constant.value[:] = traction.value(time)
        for _, scalar, pressure in self.pressures:
            scalar.value = pressure.value(time)

    def pressing(self, section: Section) -> list[tuple[tuple[int, ...], Any]]:
        """Tags and value of all that presses on the surface."""
        found: list[tuple[tuple[int, ...], Any]] = [(tags, p) for tags, p, _ in self.pressures]
        if self.liquid is not None:
            found.append((tuple(section.matching(section.outer_groups)), self.liquid))
        return found
