"""The strand's surface: vertices and perimeter shares of the boundary groups, with their laws.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem.compat import assemble_owned
from castfem.fem.section import Section
from castfem.forms.heat import surface_heat, surface_measure, surface_stretch
from castfem.physics.thermal.deformed_section import Shape
from castfem.physics.thermal.flux_laws import PrescribedTemperature, SurfaceLaw


@dataclass(frozen=True, slots=True)
class Patch:
    """The owned surface vertices of some boundary groups."""

    dofs: npt.NDArray[np.int64]  #: their degrees of freedom (n,)
    #: perimeter share of each (n,), m; on a moving slice the present one times its thickness
    weights: Array


class Surface:
    """Perimeter shares of the boundary groups, which add up to their exact lengths.

    Args:
        section: The section.
        shape: Shape of the slice; None if it does not move, so that shares are assembled once.
    """

    def __init__(self, section: Section, shape: Shape | None = None) -> None:
        self.section, self._shape = section, shape
        self._patches: dict[tuple[int, ...], Patch] = {}
        self._shares: dict[int, Array] = {}
        self._forms: dict[int, fem.Form] = {}

    def forms(self) -> dict[int, tuple[str, ufl.Form]]:
        """Forms of the perimeter shares, with their names, by tag of the group."""
        section, shape = self.section, self._shape
        curved = section.order == 2 or shape is not None
        ds = surface_measure(section.mesh, section.facet_tags, curved)
        v = ufl.TestFunction(section.vertex_space)
        kind, stretch = "heat.surface", fem.Constant(section.mesh, np.float64(1.0))
        if shape is not None:
            normal = ufl.FacetNormal(section.mesh)
            kind = "heat.surface.moved"
            stretch = surface_stretch(shape.gradient, shape.thickness, normal)
        return {
            i: (f"{kind}.{name}", surface_heat(stretch, v, ds(i)))
            for i, name in enumerate(section.groups)
            if name in section.outer_groups
        }

    def _share(self, tag: int) -> Array:
        """Perimeter share of group `tag` at each owned vertex (owned,), m."""
        if not self._forms:
            forms = self.forms()
            self._forms = {i: self.section.compile(*form) for i, form in forms.items()}
        if tag not in self._shares:
            self._shares[tag] = assemble_owned(self._forms[tag], self.section.owned)
        return self._shares[tag]

    def follow_shape(self) -> None:
        """Update all patches to the present surface (collective)."""
        self._shares = {}
        for key, patch in self._patches.items():
            patch.weights[:] = np.sum([self._share(t) for t in key], axis=0)[patch.dofs]

    def spread(self, shares: Mapping[int, Array]) -> list[tuple[Patch, Array]]:
        """Shares of groups, by tag (..., owned), at the vertices of each patch (..., n)."""
        return [
            (patch, np.sum([shares[t] for t in key], axis=0)[..., patch.dofs])
            for key, patch in self._patches.items()
        ]

    def whole(self) -> Patch:
        """The whole surface of the strand, without the lines of symmetry."""
        return self.patch(self.section.matching(self.section.outer_groups))

    def patch(self, tags: list[int]) -> Patch:
        """Vertices and perimeter shares of the union of the groups with `tags`."""
        key = tuple(sorted(set(tags)))
        if key not in self._patches:
            weights = np.sum([self._share(t) for t in key], axis=0)
            dofs = np.flatnonzero(weights > 0)
            self._patches[key] = Patch(dofs, weights[dofs])
        return self._patches[key]


@dataclass(slots=True)
class Cooling:
    """Cooling of the surface in one zone."""

    #: pairs of a patch and its law; laws on one patch add up (36)
    laws: list[tuple[Patch, SurfaceLaw]]
    #: pairs of a patch and its prescribed temperature
    prescribed: list[tuple[Patch, PrescribedTemperature]] = field(default_factory=list)

    def ambient_range(self, time: float) -> tuple[float, float]:
        """Lowest and highest temperature this zone can drive the strand to; +-inf with a flux."""
        low, high = np.inf, -np.inf
        for _, law in self.laws:
            coldest, hottest = law.ambient_range(time)
            low, high = min(low, coldest), max(high, hottest)
        for _, given in self.prescribed:
            low, high = min(low, given.value), max(high, given.value)
        return low, high
