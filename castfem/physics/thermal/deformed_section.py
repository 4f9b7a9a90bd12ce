"""The slice as it has moved, through which and out of which heat flows."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem.compat import assemble_owned
from castfem.fem.section import Section
from castfem.forms.finite_strain import deformation
from castfem.forms.heat import storage, storage_measure


class Shape:
    """Where the slice was at the end of the coupling window before (thesis IV): form and thickness.

    Args:
        section: The section.
        space: Of the displacement.
        solidus: Below it steel is solid, K.

    Attributes:
        gradient: In-plane deformation gradient F (2, 2).
        thickness: e, over the undeformed one.
        area: Of each owned vertex (owned,), undeformed, m2.
        displacement: Of the slice. generalized_strains: Likewise (4,).
        volume: Form of what the slice encloses at each vertex.
    """

    def __init__(self, section: Section, space: fem.FunctionSpace, solidus: float) -> None:
        mesh = section.mesh
        self.solidus = solidus
        self.displacement = fem.Function(space)
        self.generalized_strains = fem.Constant(mesh, np.zeros(4))
        moved = deformation(self.displacement, self.generalized_strains, mesh)
        # Liquid follows the shell with next to no stiffness and may fold where it has much to
        # follow. What does not keep this share of its area conducts as if it had not moved.
        sound = ufl.gt(ufl.det(moved.gradient), 0.1)
        still = ufl.Identity(2)
        self.gradient = ufl.as_tensor(
            [
                [ufl.conditional(sound, moved.gradient[i, j], still[i, j]) for j in range(2)]
                for i in range(2)
            ]
        )
        self.thickness = moved.thickness
        v = ufl.TestFunction(section.vertex_space)
        dx = storage_measure(mesh, section.order == 2)
        now = self.thickness * ufl.det(self.gradient)
        self._owned = section.owned
        self._enclosed: Array | None = None
        self.volume = storage(now, v, dx)
        self._volume = section.compile("heat.volume.moved", self.volume)
        one = fem.Constant(mesh, np.float64(1.0))
        area = section.compile("heat.storage", storage(one, v, dx))
        self.area = assemble_owned(area, section.owned)

    def filled(self, before: Array, temperature: Array) -> Array:
        """Volume that the steel of each vertex fills, over the undeformed one (owned,).

        Liquid is fed: it fills what the slice encloses now.  Solid has filled its share once for
        all when it froze.

        Args:
            before: The same before (owned,).
            temperature: At the vertices (owned,), K.
        """
        now = self.enclosed() / self.area
        return np.where(temperature < self.solidus, before, now)

    def enclosed(self) -> Array:
        """Volume that the slice encloses now at each vertex (owned,), m2 (collective)."""
        if self._enclosed is None:
            self._enclosed = assemble_owned(self._volume, self._owned)
        return self._enclosed

    def take(self, displacement: Array, generalized_strains: Array) -> None:
        """Move the slice.

        Args:
            displacement: Of this rank's nodes, ghosts included, x and y by turns, m.
            generalized_strains: Generalized strains [a0 - 1, a1, a2, across] (4,).
        """
        self._enclosed = None
        self.displacement.x.array[:] = displacement
        self.generalized_strains.value[:] = generalized_strains
