"""Solid and liquid parts of the strand's surface in a step, and the liquid at the wall.

Fed liquid runs to the wall wherever it is, and presses on it with its ferrostatic pressure;
friction acts only on solid, and so does the stress in Nitsche's method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from scipy import sparse

from castfem.base.types import Array, Flags
from castfem.fem import dof_values, reductions
from castfem.physics.contact.facets import Facets
from castfem.physics.contact.interaction import Solid


@dataclass(frozen=True, slots=True)
class SurfaceTemperatures:
    """Operators from temperatures of the vertices to those of the surface."""

    facets: Facets  #: points of the surface
    at_vertices: sparse.csr_matrix  #: operator from vertex values to the points
    #: operator to the gradient at the points; None unless fed liquid meets friction
    slopes: sparse.csr_matrix | None

    @classmethod
    def at(cls, facets: Facets, slopes: bool) -> SurfaceTemperatures:
        """Return the operators for some facets (collective)."""
        space = facets.section.vertex_space
        trial = ufl.TrialFunction(space)
        own = facets.operator(trial, space)
        return cls(facets, own, facets.operator(ufl.grad(trial), space) if slopes else None)

    def hottest(self, local: Array) -> Array:
        """Largest temperature in the cell of each point (n,), K."""
        facets = self.facets
        cells = np.asarray(facets.section.vertex_space.dofmap.list)[facets.cells]
        found = local[cells].max(axis=1) if len(cells) else np.zeros(0)
        return np.asarray(np.repeat(found, facets.per_facet))

    def below(self, surface: Array, local: Array) -> Array:
        """Temperature at the depth of the first points of the mean stress below each point, K."""
        assert self.slopes is not None
        slope = (self.slopes @ local).reshape(-1, 2)
        outward = np.einsum("ni,ni->n", slope, self.facets.normal)
        # Relative to the height of surface cells: the first of two Gauss points, those of the mean
        # stress.
        skin = 0.5 - 0.5 / 3.0**0.5
        return np.asarray(surface - skin * self.facets.height * outward)


class SurfaceLiquid:
    """Liquid and solid points of the surface of one slice, one step at a time.

    Args:
        surface: Temperatures at the points of the surface.
        solid: Material of the slice.
        has_friction: Whether there is friction.
        like: Another slice on the same mesh, which determines where it is molten or liquid.

    Attributes:
        surface: Temperatures at the points of the surface.
        temperatures: Temperatures of the points (n,) at the start and the end of the step, K.
        molten: Points that carry no friction (n,); all False in a step without friction.
        fed: Whether the liquid is fed.
        pool: Pressure of fed liquid that reaches the surface (n,), Pa; 0 elsewhere.
    """

    def __init__(
        self,
        surface: SurfaceTemperatures,
        solid: Solid,
        has_friction: bool,
        like: SurfaceLiquid | None = None,
    ) -> None:
        self.surface, self._solid, self._has_friction = surface, solid, has_friction
        self.fed, self._like = solid.liquid == "fed", like
        nothing: Array = np.zeros(surface.facets.count)
        self.temperatures: tuple[Array, Array] = (nothing, nothing)
        self.pool = self._gap = nothing
        self.molten: Flags = np.zeros(len(nothing), dtype=bool)
        self._opened: Flags = self.molten
        self._fluid: Flags = self.molten

    def begin(self, gap: Array, before: Array, after: Array, end: float) -> None:
        """Prepare a step (collective).

        Args:
            gap: Gap to the wall at its start (n,), m.
            before: Temperatures of the owned vertices at its start, K.
            after: Temperatures at its end, K.
            end: End of the step, s.
        """
        surface = self.surface
        space = surface.facets.section.vertex_space
        self._local = tuple(dof_values.with_ghosts(space, t) for t in (before, after))
        old, new = (np.asarray(surface.at_vertices @ local) for local in self._local)
        self.temperatures, self._end, self._gap = (old, new), end, gap
        solidity = self._solid.law.elasticity.solidity
        if self._like is not None:
            self.molten, self._fluid = self._like.molten, self._like._fluid
        else:
            if self._has_friction:
                backed = np.maximum(new, surface.below(new, self._local[1])) if self.fed else new
                self.molten = backed > solidity.solidus
            if self.fed:
                self._fluid = solidity.weight(new) == 0.0
        if self.fed:
            self.pool = np.zeros(len(new))
            if self._fluid.any():
                self.pool = np.where(self._fluid, self._pressure(new), 0.0)
            leak = 1e-4  # m: gap across which liquid at the surface still runs to the wall
            self._opened = self._fluid & (old <= solidity.coherent) & (gap > leak)

    def breakout(self) -> str:
        """Place where the shell melts open off the wall in a step; "" if nowhere (collective).

        Fed liquid would run out there until the wall or freezing stops it, which is not modelled.
        """
        facets, comm = self.surface.facets, self.surface.facets.section.comm
        gap = np.where(self._opened, self._gap, -np.inf)
        if reductions.largest(comm, gap) == -np.inf:
            return ""
        widest, x, y = reductions.peak(comm, gap, facets.position)
        cells = reductions.largest(comm, np.where(self._opened, facets.height, 0.0))
        return (
            f"a breakout: the shell melts open at x = {1e3 * x:.4g} mm, y = {1e3 * y:.4g} mm, "
            + (f"{1e3 * widest:.3g} mm off the wall" if np.isfinite(widest) else "below the mould")
            + "; keep the mould nearer (taper), or cool more; a shell thinner than its cells "
            + f"({1e3 * cells:.2g} mm) is uncertain: confirm a breakout near the meniscus with "
            + "half the cells (mesh.surface_size, mesh.corner_size)"
        )

    def of_stress(self) -> tuple[tuple[Array, Array], Array]:
        """Temperatures for Nitsche's stress, K, and the liquid's pressure in it, Pa.

        With fed liquid they are the largest in each cell: a cell that has not frozen completely has
        hardly any stiffness, and a stress only at its surface would have no counterpart inside.
        """
        if not self.fed:
            return self.temperatures, self._pressure(self.temperatures[1])
        old, new = (self.surface.hottest(local) for local in self._local)
        return (old, new), self._pressure(new)

    def _pressure(self, temperature: Array) -> Array:
        """Ferrostatic pressure (n,), Pa, minus pressure held from outside except by the wall."""
        liquid = self._solid.ferrostatic
        if liquid is None:
            return np.zeros(len(temperature))
        found = np.asarray(liquid.pressure(temperature, self._end))
        if liquid.outside == "held":
            at_vertices = liquid.pressure(self._local[1], self._end)
            found = found - self.surface.at_vertices @ at_vertices
        return np.asarray(found)
