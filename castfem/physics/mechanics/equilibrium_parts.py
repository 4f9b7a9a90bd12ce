"""The parts of a slice's equilibrium: points, forms, supports and interactions."""

from __future__ import annotations

from typing import Literal

import numpy as np
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.fem.section import Section
from castfem.physics.contact.wall_contact import WallContact
from castfem.physics.mechanics.fields import Fields
from castfem.physics.mechanics.generalized_plane_strain import check_strains
from castfem.physics.mechanics.interactions import Interactions
from castfem.physics.mechanics.kinematics import LargeStrain, SmallStrain
from castfem.physics.mechanics.liquid import FedLiquid
from castfem.physics.mechanics.plane_equilibrium import PlaneEquations
from castfem.physics.mechanics.quadrature import Points
from castfem.physics.mechanics.quadrature_rules import Integration, displacement_element
from castfem.physics.mechanics.scaling import Scales
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.supports import SPRING, Constraints, SurfaceLoads, symmetry_supports


class StrainedSlice:
    """A slice on its mesh, with which its states are evaluated.

    Args:
        section: The distributed section.
        slice_: Material, supports and loads.
        space: Space of the displacement.
        points: Quadrature points.
        interactions: Interactions with the surface.
    """

    def __init__(
        self,
        section: Section,
        slice_: Slice,
        space: fem.FunctionSpace,
        points: Points,
        interactions: Interactions,
    ) -> None:
        self.section, self.slice, self.space = section, slice_, space
        self.points, self.interactions = points, interactions

    def of_slice(self, slice_: Slice) -> StrainedSlice:
        """Return a slice with other data on the same mesh; its interactions are of the same kinds.

        Raises:
            InputError: One of the interactions has no derivatives.
        """
        interactions = self.interactions.of_slice(slice_.interactions, slice_)
        return StrainedSlice(self.section, slice_, self.space, self.points, interactions)

    @property
    def contact(self) -> WallContact | None:
        """Contact with the wall of a mould; None without one."""
        return self.interactions.wall

    def at_points(self, temperature: Array) -> Array:
        """Temperatures at the points from those of the owned vertices."""
        local = dof_values.with_ghosts(self.section.vertex_space, temperature)
        return np.asarray(self.points.vertex @ local)


class SliceParts(StrainedSlice):
    """The parts of one slice on one section, from which its equilibrium is built.

    Args:
        section: The distributed section.
        slice_: Material, supports and loads.
        springs: How motions without restraint are prevented: by springs of this stiffness over
            Young's modulus, by fixed points (None), or as the interactions require: springs if one
            of them holds the section, points otherwise.

    Attributes:
        scales: Scales of the section for unknowns and residuals.
        owned: This rank's own displacement unknowns. free: Free generalized strains.
        fields: Functions in the forms. loads: Loads on the surface.
        kinematics: Strain from displacement. constraints: Supports of the slice.
        planes: Equilibrium in the free generalized strains.
        liquid: Fed liquid; None for an elastic body.

    Raises:
        InputError: A motion of the planes is excluded by symmetry, or a group does not exist.
    """

    def __init__(
        self, section: Section, slice_: Slice, springs: float | Literal["as held"] | None
    ) -> None:
        check_strains(slice_.planes.free, section.groups)
        space = fem.functionspace(section.mesh, displacement_element(section.cell))
        rules = slice_.integration or Integration.of(section.cell, section.order)
        points = Points(section, space, rules)
        self.fields = Fields.on(section, space, points, slice_.ferrostatic is not None)
        interactions = Interactions.build(section, slice_.interactions, slice_, self.fields)
        super().__init__(section, slice_, space, points, interactions)
        self.free = len(slice_.planes.free)
        self.owned = dof_values.owned_of(space)
        self.scales = Scales(points, space)
        held_outside = slice_.ferrostatic is not None and slice_.ferrostatic.outside == "held"
        self.loads = SurfaceLoads.on(section, list(slice_.loads), held_outside)
        kind = LargeStrain if slice_.large_strain else SmallStrain
        self.kinematics = kind(
            section, self.points, self.fields, self.loads, self.free > 0, self.interactions,
            slice_.law.symmetric,
        )  # fmt: skip
        if springs == "as held":
            springs = SPRING if any(one.holds for one in slice_.interactions) else None
        held = [*symmetry_supports(section.groups), *slice_.held]
        self.constraints = Constraints(
            section, self.space, held, slice_.pin, springs, self.interactions.always_held()
        )
        self.planes = PlaneEquations(
            slice_.planes, self.fields, self.kinematics, self.interactions, self.scales
        )
        self.liquid: FedLiquid | None = None
        if slice_.liquid == "fed":
            supports = self.constraints.conditions
            self.liquid = FedLiquid(section, self.space, self.points, supports)
