"""Contact of the slice with a rigid wall: weak forms and pressure laws (thesis III.4).

The wall acts on the strand's surface by a traction t = -p n + tau, with n the unit normal of the
wall (into it), p the contact pressure and tau the friction in the plane (r) and along the strand
(s).  With d the gap, that is the distance to the wall along n, and sigma_n the stress of the solid
along n,

    penalty (239)    p = K_p <-d>,
    Nitsche          p = <-sigma_n(u) - K_p d>,

where <.> is the positive part. Nitsche's method is the unsymmetric variant (theta = 0) of Chouly,
Hild and Renard (Math. Comp. 84 (2015) 1089) for a rigid wall: where contact is closed the pressure
is the solid's own stress, and the gap, weighted with K_p = gamma E / h, is zero instead of p / K_p.
Both laws lead to the same virtual work (274) and differ only in p.

The pressure laws take numbers, arrays and UFL expressions alike.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import ufl

from castfem.forms import finite_strain, mechanics
from castfem.forms.mechanics import Direction, Expr


def positive(x: Any) -> Any:
    """Positive part <x>."""
    return 0.5 * (x + abs(x))


def penalty_pressure(stiffness: Any, gap: Any) -> Any:
    """Contact pressure by penalty (239), Pa."""
    return stiffness * positive(-gap)


def nitsche_pressure(stiffness: Any, gap: Any, normal_stress: Any) -> Any:
    """Contact pressure by Nitsche's method, Pa; see the module."""
    return positive(-normal_stress - stiffness * gap)


@dataclass(frozen=True, slots=True)
class WallAction:
    """Action of the wall on a point of the surface, with derivatives by the motion."""

    #: traction on the strand: x, y and along the strand (z, casting direction), (3,), Pa
    traction: Expr
    by_pressure: Expr  #: its derivative with respect to the pressure at constant slip (3,)
    #: its derivative with respect to the slip in the plane, along (-n_y, n_x), at constant pressure
    #: (3,)
    by_slip: Expr
    normal: Expr  #: unit normal n of the wall (2,)
    stiffness: Expr  #: dp / d(n . u): K_p where closed, 0 where open, Pa/m
    #: -dp / d strain (4,), Mandel, Pa, for Nitsche's method; None with the penalty
    by_strain: Expr | None = None
    #: -dp / d angle by which the stress turns with the material, Pa; None with the penalty, and at
    #: small strain
    by_turn: Expr | None = None
    #: pressure of liquid at the surface, which `traction` contains along the strand's own normal,
    #: Pa; None if that does not turn, or no liquid is fed
    pool: Expr | None = None


class Surface(Protocol):
    """Geometry of the strand's surface: area and position of its points."""

    def place(self) -> Expr:
        """Position of a point, (2,)."""

    def length(self) -> Expr:
        """Present length in the plane, relative to the undeformed one."""

    def thickness(self) -> Expr:
        """Thickness of the slice there, relative to the undeformed one."""

    def length_change(self, by: Direction) -> Expr:
        """Derivative of the length along a motion."""

    def thickness_change(self, by: Direction) -> Expr:
        """Derivative of the thickness along a motion."""

    def normal_change(self, by: Direction) -> Expr:
        """Derivative of the strand's unit normal along a motion, (2,)."""

    def place_change(self, by: Direction) -> Expr:
        """Change of the position: 0 if the geometry is that of the undeformed slice."""

    def strain_change(self, by: Direction) -> tuple[Expr, Expr]:
        """Strain increment for the law, Mandel, and angle by which the stress turns."""


@dataclass(frozen=True, slots=True)
class Undeformed:
    """Small strain: area and place are those of the mesh."""

    mesh: ufl.Mesh

    def place(self) -> Expr:
        """See `Surface`."""
        return ufl.SpatialCoordinate(self.mesh)

    def length(self) -> Expr:
        """See `Surface`."""
        return 1.0

    def thickness(self) -> Expr:
        """See `Surface`."""
        return 1.0

    def length_change(self, by: Direction) -> Expr:
        """See `Surface`."""
        return 0.0

    def thickness_change(self, by: Direction) -> Expr:
        """See `Surface`."""
        return 0.0

    def normal_change(self, by: Direction) -> Expr:
        """See `Surface`."""
        return ufl.as_vector([0.0, 0.0])

    def place_change(self, by: Direction) -> Expr:
        """See `Surface`."""
        return ufl.as_vector([0.0, 0.0])

    def strain_change(self, by: Direction) -> tuple[Expr, Expr]:
        """See `Surface`."""
        return mechanics.strain(by, self.mesh), 0.0


@dataclass(frozen=True, slots=True)
class Deformed:
    """Large strain: area and place are those of the deformed slice (279)-(284)."""

    now: finite_strain.Deformation  #: deformation at the end of the step
    old: finite_strain.Deformation  #: at its start
    mesh: ufl.Mesh  #: the undeformed mesh

    def place(self) -> Expr:
        """See `Surface`."""
        return self.now.position

    def _normal(self) -> Expr:
        return ufl.inv(self.now.gradient).T * ufl.FacetNormal(self.mesh)

    def length(self) -> Expr:
        """See `Surface`: det F |F^-T N| (Nanson)."""
        normal = self._normal()
        return ufl.det(self.now.gradient) * ufl.sqrt(ufl.dot(normal, normal))

    def thickness(self) -> Expr:
        """See `Surface`."""
        return self.now.thickness

    def length_change(self, by: Direction) -> Expr:
        """See `Surface`."""
        normal = self._normal()
        moving = by.gradient * ufl.inv(self.now.gradient)
        across = ufl.dot(normal, moving * normal) / ufl.dot(normal, normal)
        return self.length() * (ufl.tr(moving) - across)

    def thickness_change(self, by: Direction) -> Expr:
        """See `Surface`."""
        return finite_strain.thickening(self.now, by)

    def normal_change(self, by: Direction) -> Expr:
        """See `Surface`: -(I - n n) (grad v)^T n."""
        normal = self._normal()
        normal /= ufl.sqrt(ufl.dot(normal, normal))
        turned = ufl.transpose(by.gradient * ufl.inv(self.now.gradient)) * normal
        return ufl.dot(normal, turned) * normal - turned

    def place_change(self, by: Direction) -> Expr:
        """See `Surface`."""
        return by.shift

    def strain_change(self, by: Direction) -> tuple[Expr, Expr]:
        """See `Surface`."""
        return finite_strain.law_change(self.now, self.old, by)


def thickening(place: Expr, virtual: Direction) -> Expr:
    """Change of the thickness at a place by a virtual motion, (37)."""
    m = virtual.generalized_strains
    return m[0] + m[1] * place[0] + m[2] * place[1]


def in_plane(vector: Expr) -> Expr:
    """Its components x and y."""
    return ufl.as_vector([vector[0], vector[1]])


def virtual_work(
    action: WallAction, surface: Surface, virtual: Direction, travel: Expr, ds: ufl.Measure
) -> ufl.Form:
    """-Int t . v da, to be added to the work of the stress (274), with withdrawal resistance.

    In the plane v is the motion's own, and the area that of the slice. Along the strand, the
    friction of the wall over the travel L of a step is passed down the strand as withdrawal
    resistance (38), N(z) = N(z - L) - L int tau_s ds, and a virtual thickening of the slice draws
    the strand above it back by L times that; s is length of surface, whatever the slice's own
    thickness.

    Args:
        action: Action of the wall.
        surface: Geometry of the surface.
        virtual: Virtual motion v.
        travel: Travel L of the step, m.
        ds: Undeformed surface.
    """
    traction = action.traction
    work = surface.thickness() * ufl.dot(in_plane(traction), virtual.shift)
    work -= travel * traction[2] * thickening(surface.place(), virtual)
    return -surface.length() * work * ds


def pressure_change(action: WallAction, surface: Surface, by: Direction) -> Expr:
    """Derivative of the contact pressure along a motion, at a wall that is locally plane."""
    change = action.stiffness * ufl.dot(action.normal, by.shift)
    if action.by_strain is None:
        return change
    strain, turn = surface.strain_change(by)
    change -= ufl.inner(action.by_strain, strain)
    return change if action.by_turn is None else change - action.by_turn * turn


def traction_change(action: WallAction, surface: Surface, by: Direction) -> Expr:
    """Derivative of the traction along a motion (262), (3,)."""
    n = action.normal
    slip = n[0] * by.shift[1] - n[1] * by.shift[0]
    return action.by_pressure * pressure_change(action, surface, by) + action.by_slip * slip


def stiffness(
    action: WallAction,
    surface: Surface,
    by: Direction,
    virtual: Direction,
    travel: Expr,
    ds: ufl.Measure,
) -> ufl.Form:
    """Derivative of `virtual_work` along a motion, consistent with it (282)-(296)."""
    traction, change = action.traction, traction_change(action, surface, by)
    length, longer = surface.length(), surface.length_change(by)
    shift, moved = virtual.shift, surface.place_change(by)
    area = length * surface.thickness()
    larger = longer * surface.thickness() + length * surface.thickness_change(by)
    work = area * ufl.dot(in_plane(change), shift) + larger * ufl.dot(in_plane(traction), shift)
    if action.pool is not None:
        work -= area * action.pool * ufl.dot(surface.normal_change(by), shift)

    thicker = thickening(surface.place(), virtual)
    tilting = virtual.generalized_strains[1] * moved[0] + virtual.generalized_strains[2] * moved[1]
    resistance = (length * change[2] + longer * traction[2]) * thicker + length * traction[
        2
    ] * tilting
    return -(work - travel * resistance) * ds
