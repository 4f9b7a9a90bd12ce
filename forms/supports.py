"""Weak forms of the support of the strand's surface by rolls, at and between them.

Between two rolls a wide face bulges by w(z). A slice passing them is supported as by an elastic
foundation (Winkler; [Hetenyi1946]) whose rest position moves with the slice: the traction on the
strand is -f n, n the outward normal of the face, with

    f = p + K (u_n - w - s),      u_n = N . u,

p is the pressure that the shell transmits to its rolls, K the stiffness of the foundation, w the
bulge of the middle of the face and s the position of the rolls, all at that moment. Where only the
foundation carries the pressure inside, u_n is w + s; near a stiff edge the shell approaches this
over the length (4 D/K)^(1/4), D its bending stiffness.

Rolls can only push. Where the face is within its rest position, u_n < w + s, the apparent pull of
the foundation is pressure of the liquid that the rolls do not carry there, but the shell that is
held back does. It cannot exceed the pressure, so that it must fade as the core solidifies: within
its rest position the face meets c K instead of K, c being the fraction of the pressure that the
shell transmits. Then f vanishes at the same distance for any remaining pressure. With a liquid
core, c = 1, f is linear and may pull further, as the opposite face has rolls, too. A solid strand,
c = 0, is free within its rest position, and pressed by K beyond it.

Where rolls cannot pull, whatever the core, f ends at 0 (`pushed`): a face farther within its rest
position than p/(c K) has left them.

N is the normal of the undeformed face, along which rolls and bulge are measured. At large strain f
acts on the present surface. At small strain it has the potential int p u_n + K/2 (u_n - w - s)^2
ds, with c K within the rest position, and its tangent is symmetric.
"""

from __future__ import annotations

import ufl

from castfem.forms import finite_strain, mechanics
from castfem.forms.mechanics import Direction, Expr

AWAY = 1e-3  # fraction of K for a face that has left its rolls


def outward(motion: Direction, mesh: ufl.Mesh) -> Expr:
    """Component of a motion along the outward normal of the undeformed surface."""
    return ufl.dot(ufl.FacetNormal(mesh), motion.shift)


def bed_stiffness(stiffness: Expr, within: Expr, rest: Expr, moved: Expr) -> Expr:
    """Stiffness of the foundation at the present position of the face, Pa/m.

    Args:
        stiffness: Stiffness K, Pa/m.
        within: Fraction c of K within the rest position.
        rest: Rest position w + s, m.
        moved: Normal displacement u_n, m.
    """
    return stiffness * ufl.conditional(ufl.ge(moved, rest), 1.0, within)


def bed_pressure(pressure: Expr, stiffness: Expr, rest: Expr, moved: Expr) -> Expr:
    """Traction f of the module, Pa.

    Args:
        pressure: Pressure p, Pa.
        stiffness: Result of `bed_stiffness`, Pa/m.
        rest: Rest position w + s, m.
        moved: Normal displacement u_n, m.
    """
    return pressure + stiffness * (moved - rest)


def pushed(pressure: Expr, stiffness: Expr, most: Expr) -> tuple[Expr, Expr]:
    """Traction f and its stiffness where rolls cannot pull: a face that has left them is free.

    K / 1000 remains, so that a face without contact does not drift.

    Args:
        pressure: Result of `bed_pressure`, Pa.
        stiffness: Result of `bed_stiffness`, Pa/m, not 0.
        most: Stiffness K, Pa/m.
    """
    touches, least = ufl.ge(pressure, 0.0), AWAY * most
    return (
        ufl.conditional(touches, pressure, pressure * least / stiffness),
        ufl.conditional(touches, stiffness, least),
    )


def virtual_work(
    pressure: Expr,
    virtual: Direction,
    now: finite_strain.Deformation | None,
    mesh: ufl.Mesh,
    ds: ufl.Measure,
) -> ufl.Form:
    """Int f n . v ds, to be added to the work of the stress.

    Args:
        pressure: Traction f, Pa.
        virtual: Virtual motion v.
        now: Deformation at large strain; None at small.
        mesh: The undeformed mesh.
        ds: Undeformed surface.
    """
    if now is None:
        return -mechanics.pressure_work(pressure, virtual.shift, mesh, ds)
    return -finite_strain.pressure_work(now, pressure, virtual.shift, mesh, ds)


def tangent(
    pressure: Expr,
    stiffness: Expr,
    by: Direction,
    virtual: Direction,
    now: finite_strain.Deformation | None,
    mesh: ufl.Mesh,
    ds: ufl.Measure,
) -> ufl.Form:
    """Derivative of `virtual_work` along a motion; `stiffness` from `bed_stiffness`, Pa/m."""
    found = virtual_work(stiffness * outward(by, mesh), virtual, now, mesh, ds)
    if now is None:
        return found
    turned = finite_strain.pressure_stiffness(now, pressure, by, virtual.shift, mesh, ds)
    return found - turned
