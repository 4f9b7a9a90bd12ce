"""Supports of the strand's surface between and under rolls: weak forms.

Between two rolls a wide face bulges by w(z); a slice that passes them is borne as if by an elastic
foundation (Winkler; [Hetenyi1946]), whose rest moves as the slice does: the traction on
the strand is -f n, n the outward normal of the face, with

    f = p + K (u_n - w - s),      u_n = N . u,

p the pressure that the shell hands on to its rolls, K the stiffness of the foundation, w the bulge
of the middle of the face and s the place of the rolls, all of them at that moment. Where nothing
else bears the pressure within, u_n is w + s; near an edge that holds itself the shell gets there
over the length (4 D/K)^(1/4), D its stiffness against bending.

Rolls push only.  What the foundation seems to pull, where the face is within its rest, u_n < w + s,
is pressure of the liquid that rolls do not bear there: the shell that is held back bears it.
There can be no more of that than there is pressure, so that it fades as the core dies: within its
rest the face meets c K instead of K, c being the share of the pressure that the shell hands on.
Then f vanishes at the same distance whatever is left of the pressure.  With a liquid core, c = 1,
f is linear and may pull further: the face opposite has rolls too.  A solid strand, c = 0, is free
within its rest, and pressed by K beyond it.

Where rolls cannot pull whatever the core is, f ends at 0 (`pushed`): a face that is farther within
its rest than p/(c K) has left them.

N is the normal of the undeformed face, across which rolls and their bulge are measured. At large
strain f acts on the surface as it is now. At small strain it has the potential
int p u_n + K/2 (u_n - w - s)^2 ds, with c K where it is within its rest, and its tangent is
symmetric.
"""

from __future__ import annotations

import ufl

from castfem.forms import finite_strain, mechanics
from castfem.forms.mechanics import Direction, Expr

AWAY = 1e-3  # of K: what a face meets that has left its rolls


def outward(motion: Direction, mesh: ufl.Mesh) -> Expr:
    """Part of a motion along the outward normal of the undeformed surface."""
    return ufl.dot(ufl.FacetNormal(mesh), motion.shift)


def bed_stiffness(stiffness: Expr, within: Expr, rest: Expr, moved: Expr) -> Expr:
    """Stiffness that the face meets where it is, Pa/m.

    Args:
        stiffness: K, Pa/m.
        within: c, the share of K that it meets within its rest.
        rest: w + s, m.
        moved: u_n, m.
    """
    return stiffness * ufl.conditional(ufl.ge(moved, rest), 1.0, within)


def bed_pressure(pressure: Expr, stiffness: Expr, rest: Expr, moved: Expr) -> Expr:
    """F of the module, Pa.

    Args:
        pressure: p, Pa.
        stiffness: Of `bed_stiffness`, Pa/m.
        rest: w + s, m.
        moved: u_n, m.
    """
    return pressure + stiffness * (moved - rest)


def pushed(pressure: Expr, stiffness: Expr, most: Expr) -> tuple[Expr, Expr]:
    """F and its stiffness where rolls cannot pull: a face that has left them is free.

    K / 1000 is left, so that a face without contact is not free to drift.

    Args:
        pressure: Of `bed_pressure`, Pa.
        stiffness: Of `bed_stiffness`, Pa/m, not 0.
        most: K, Pa/m.
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
        pressure: f, Pa.
        virtual: Motion v.
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
    """Derivative of `virtual_work` along a motion; `stiffness` is that of `bed_stiffness`, Pa/m."""
    found = virtual_work(stiffness * outward(by, mesh), virtual, now, mesh, ds)
    if now is None:
        return found
    turned = finite_strain.pressure_stiffness(now, pressure, by, virtual.shift, mesh, ds)
    return found - turned
