"""Geometry of the strand's surface: positions and normals of its points, distance to a wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.section import Section
from castfem.physics.contact.facets import Facets
from castfem.physics.contact.interaction import Motion
from castfem.physics.mould.wall import GapFunction, Wall


@dataclass(frozen=True, slots=True)
class Met:
    """Position of the points of a surface relative to a wall."""

    moved: Array  #: displacement of the points (n, 2), m
    strand: Array  #: outward normal of the strand (n, 2)
    near: Array  #: points of the raster nearest to them (n, 2), m
    found: GapFunction  #: result of the gap search from there

    @property
    def facing(self) -> Array:
        """Cosine of the angle between the normals of wall and strand (n,)."""
        return np.einsum("ni,ni->n", np.asarray(self.found.normal), self.strand)


class StrandSurface:
    """The points of some facets on the moving slice.

    Args:
        section: The distributed section.
        facets: Facets with the points.
        motion: Motion of the slice, with the space of the displacement.
        large: Whether the geometry is that of the deformed slice.

    Attributes:
        gradients: Operator from displacement to its gradient at the points.
        size: Largest coordinate of a point, m.
    """

    def __init__(self, section: Section, facets: Facets, motion: Motion, large: bool) -> None:
        self._facets, self._large = facets, large
        space = motion.u.function_space
        trial = ufl.TrialFunction(space)
        self._moves = facets.operator(trial, space)
        self.gradients = facets.operator(ufl.grad(trial), space)
        self.size = max(1e-300, reductions.largest(section.comm, np.abs(facets.position)))

    def moved(self, u: Array, generalized_strains: Array) -> Array:
        """Displacement of the points (n, 2), m.

        Args:
            u: Displacement of this rank's nodes, including ghosts, m.
            generalized_strains: Generalized strains (4,).
        """
        moved: Array = (self._moves @ u).reshape(-1, 2)
        moved[:, 1] += generalized_strains[3] * self._facets.position[:, 1]
        return moved

    def changes(self, u: Array, generalized_strains: Array) -> Array:
        """The same for k motions (dofs, k) and (4, k): (n, 2, k)."""
        found = (self._moves @ u).reshape(len(self._facets.position), 2, u.shape[1])
        found[:, 1] += np.outer(self._facets.position[:, 1], generalized_strains[3])
        return np.asarray(found)

    def facing(self, u: Array, generalized_strains: Array) -> tuple[Array, Array]:
        """Outward normal of the strand (n, 2), and length of surface over undeformed length.

        Args:
            u: Displacement of this rank's nodes, including ghosts, m.
            generalized_strains: Generalized strains (4,).
        """
        normal = self._facets.normal
        if not self._large:
            return normal, np.ones(len(normal))
        f = np.eye(2) + (self.gradients @ u).reshape(-1, 2, 2)
        f[:, 1, 1] += generalized_strains[3]
        # det F F^-T N
        turned = np.column_stack(
            [
                f[:, 1, 1] * normal[:, 0] - f[:, 1, 0] * normal[:, 1],
                f[:, 0, 0] * normal[:, 1] - f[:, 0, 1] * normal[:, 0],
            ]
        )
        stretch = np.hypot(*turned.T)
        return turned / stretch[:, None], stretch

    def meet(self, wall: Wall, position: float, moved: Array, strand: Array) -> Met:
        """Find the wall from points on a fine raster next to the points of the surface.

        Args:
            wall: The wall.
            position: Position of the slice below the meniscus, m.
            moved: Displacement of the points (n, 2), m.
            strand: Outward normal of the strand (n, 2).
        """
        start, raster = self._facets.position, self.size * 2.0**-32
        near = np.round((start + moved) / raster) * raster
        return Met(moved, strand, near, wall.gap_function(near, strand, position))

    def gap_to(self, met: Met) -> tuple[Array, Array, Array]:
        """Normal of a wall, distance to it along that (n,), m, and its curvature (n,), 1/m.

        The distance from the raster point is added to the gap found there, so that the gap is as
        accurate as the displacement, not as the position, which is a thousand times larger.

        Args:
            met: Position of the points relative to the wall.
        """
        n, facing = np.asarray(met.found.normal), met.facing
        rest = (self._facets.position - met.near) + met.moved
        gap = np.asarray(met.found.gap) * facing - np.einsum("ni,ni->n", n, rest)
        open_ = np.isfinite(gap)
        return n, np.where(open_, gap, np.inf), np.where(open_, met.found.curvature, 0.0)

    def forces(self, tractions: Array) -> Array:
        """Forces of tractions (n, 2, k), Pa, on this rank's nodes and ghosts, N/m (dofs, k)."""
        loads = self._facets.weight[:, None, None] * tractions
        return np.asarray(self._moves.T @ loads.reshape(-1, loads.shape[2]))
