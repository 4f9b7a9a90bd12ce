"""What the equilibrium of a slice is made of: points, forms, supports and what acts on it."""

from __future__ import annotations

from typing import Literal

from dolfinx import fem

from castfem.fem import dof_values
from castfem.fem.section import Section
from castfem.physics.mechanics.definition import Slice
from castfem.physics.mechanics.fields import Fields
from castfem.physics.mechanics.interactions import Interactions
from castfem.physics.mechanics.kinematics import LargeStrain, SmallStrain
from castfem.physics.mechanics.liquid import FedLiquid
from castfem.physics.mechanics.plane_equations import PlaneEquations
from castfem.physics.mechanics.planes import check_strains
from castfem.physics.mechanics.quadrature import Points
from castfem.physics.mechanics.quadrature_rules import Integration, displacement_element
from castfem.physics.mechanics.scaling import Scales
from castfem.physics.mechanics.supports import SPRING, Constraints, SurfaceLoads, symmetry_supports


class SliceParts:
    """The parts of one slice on one section.

    Args:
        section: The distributed section.
        slice_: Material, supports and loads.
        springs: What takes away the motions that nothing holds: springs of this stiffness over
            Young's modulus, points held rigidly (None), or what its interactions ask for: springs
            where one of them holds the section, points where none does.

    Attributes:
        space: Space of the displacement. points: Quadrature points. scales: Sizes.
        owned: This rank's own displacement unknowns. free: Free generalized strains.
        fields: What the forms see. loads: On the surface. interactions: What acts on it.
        kinematics: From displacement to strain. constraints: What holds the slice.
        planes: Equilibrium along the free generalized strains.
        liquid: Where the liquid is fed; None where it is an elastic body.

    Raises:
        InputError: If a motion of the planes is excluded by symmetry, or a group does not exist.
    """

    def __init__(
        self, section: Section, slice_: Slice, springs: float | Literal["as held"] | None
    ) -> None:
        self.section, self.slice = section, slice_
        check_strains(slice_.planes.free, section.groups)
        self.free = len(slice_.planes.free)
        self.space = fem.functionspace(section.mesh, displacement_element(section.cell))
        self.owned = dof_values.owned_of(self.space)
        rules = slice_.integration or Integration.of(section.cell, section.order)
        self.points = Points(section, self.space, rules)
        self.scales = Scales(self.points, self.space)
        pressed = slice_.ferrostatic is not None
        self.fields = Fields.on(section, self.space, self.points, pressed)
        held_outside = slice_.ferrostatic is not None and slice_.ferrostatic.outside == "held"
        self.loads = SurfaceLoads.on(section, list(slice_.loads), held_outside)
        self.interactions = Interactions.build(section, slice_.interactions, slice_, self.fields)
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
