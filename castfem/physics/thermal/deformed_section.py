"""The deformed slice, on which heat is computed."""

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
    """Deformation of the slice at the end of the previous coupling window (thesis IV).

    Args:
        section: The section.
        space: Space of the displacement.
        solidus: Solidus of the steel, K.

    Attributes:
        gradient: In-plane deformation gradient F (2, 2).
        thickness: Thickness e, relative to the undeformed one.
        area: Undeformed area of each owned vertex (owned,), m2.
        displacement: Displacement of the slice.
        generalized_strains: Generalized strains of the slice (4,).
        volume: Form of the volume enclosed by the slice at each vertex.
    """

    def __init__(self, section: Section, space: fem.FunctionSpace, solidus: float) -> None:
        mesh = section.mesh
        self.solidus = solidus
        self.displacement = fem.Function(space)
        self.generalized_strains = fem.Constant(mesh, np.zeros(4))
        moved = deformation(self.displacement, self.generalized_strains, mesh)
        # Liquid follows the shell almost without stiffness and may fold where it moves far. Cells
        # below this relative area conduct as if undeformed.
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
        """Volume of the steel of each vertex, relative to the undeformed one (owned,).

        Liquid is fed: it fills the volume now enclosed by the slice. Solid keeps the volume at
        which it froze.

        Args:
            before: The previous volumes (owned,).
            temperature: Temperatures at the vertices (owned,), K.
        """
        now = self.enclosed() / self.area
        return np.where(temperature < self.solidus, before, now)

    def enclosed(self) -> Array:
        """Volume now enclosed by the slice at each vertex (owned,), m2 (collective)."""
        if self._enclosed is None:
            self._enclosed = assemble_owned(self._volume, self._owned)
        return self._enclosed

    def take(self, displacement: Array, generalized_strains: Array) -> None:
        """Set the deformation.

        Args:
            displacement: Displacement of this rank's nodes, including ghosts, x and y alternating,
                m.
            generalized_strains: Generalized strains [a0 - 1, a1, a2, across] (4,).
        """
        self._enclosed = None
        self.displacement.x.array[:] = displacement
        self.generalized_strains.value[:] = generalized_strains
