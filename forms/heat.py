"""Weak forms of heat conduction with solidification (thesis chapter II).

The heat balance (23) reads dH/dt = div(k grad T) in the slice, with the enthalpy per volume H of
(24), and k dT/dn = -q on its surface, q being the heat flux that leaves the strand (30)-(36).  With
the conduction integral theta(T) = int k dT (Kirchhoff) the flux is grad theta exactly.

All integrals of the enthalpy form use the vertex rule: storage becomes one number per vertex, and
on rectangles (of any aspect ratio) and Delaunay triangles conduction becomes an M-matrix. With both
the discrete temperature of backward Euler obeys the maximum principle for any step: sudden cooling
cannot make it oscillate in space (the numerical thermal shock of VI.3.2). Other quadrilaterals,
such as those along an arc, give some positive off-diagonal entries, with which the principle holds
only approximately.

On curved cells (second-order geometry) the vertex rule would make areas and arcs too large, by 5 %
with two cells round a corner: there a vertex gets the integral of its test function.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import ufl

VERTEX_RULE = {"quadrature_rule": "vertex", "quadrature_degree": 1}
CURVED_AREA = {"quadrature_degree": 6}  # exact for test function times det J of a second-order cell
CURVED_LENGTH = {"quadrature_degree": 14}  # ten digits for an arc of 45 degrees


def slice_measure(mesh: ufl.Mesh) -> ufl.Measure:
    """Area measure of the slice with the vertex rule."""
    return ufl.Measure("dx", domain=mesh, metadata=VERTEX_RULE)


def storage_measure(mesh: ufl.Mesh, curved: bool) -> ufl.Measure:
    """Area measure for the integrals of the test functions, exact for all cells.

    Args:
        mesh: The mesh.
        curved: Whether its cells are curved.
    """
    return ufl.Measure("dx", domain=mesh, metadata=CURVED_AREA if curved else VERTEX_RULE)


def surface_measure(mesh: ufl.Mesh, facet_tags: object, curved: bool = False) -> ufl.Measure:
    """Perimeter measure for the integrals of the test functions, split by boundary group.

    Args:
        mesh: The mesh.
        facet_tags: Tags of the boundary groups.
        curved: Whether its facets are curved, also by deformation.
    """
    rule = CURVED_LENGTH if curved else VERTEX_RULE
    return ufl.Measure("ds", domain=mesh, subdomain_data=facet_tags, metadata=rule)


def storage(amount: ufl.core.expr.Expr, v: ufl.Argument, dx: ufl.Measure) -> ufl.Form:
    """Int amount v dx: weak form of an amount stored per volume (left-hand side of (23))."""
    return amount * v * dx


def conduction(theta: ufl.core.expr.Expr, v: ufl.Argument, dx: ufl.Measure) -> ufl.Form:
    """Int grad theta . grad v dx: conduction by its integral theta (right of (23)), W/m.

    Args:
        theta: Conduction integral, W/m (or the trial function of the constant operator).
        v: Test function.
        dx: Area measure.
    """
    return ufl.inner(ufl.grad(theta), ufl.grad(v)) * dx


def conduction_moved(
    theta: ufl.core.expr.Expr,
    v: ufl.Argument,
    dx: ufl.Measure,
    gradient: ufl.core.expr.Expr,
    thickness: ufl.core.expr.Expr,
) -> ufl.Form:
    """Int e grad theta . grad v da over the present slice, pulled back: conduction, W/m.

    Args:
        theta: Conduction integral, W/m.
        v: Test function.
        dx: Area measure of the undeformed slice.
        gradient: In-plane deformation gradient F (2, 2).
        thickness: Thickness e of the slice, relative to the undeformed one.
    """
    pull = ufl.inv(gradient).T
    area = thickness * ufl.det(gradient)
    return area * ufl.inner(pull * ufl.grad(theta), pull * ufl.grad(v)) * dx


def surface_stretch(
    gradient: ufl.core.expr.Expr, thickness: ufl.core.expr.Expr, normal: ufl.core.expr.Expr
) -> ufl.core.expr.Expr:
    """Present surface of the slice over the undeformed one, e det F |F^-T N| (Nanson).

    Args:
        gradient: Deformation gradient F (2, 2).
        thickness: Thickness e, relative to the undeformed one.
        normal: Outward normal N of the undeformed surface.
    """
    turned = ufl.inv(gradient).T * normal
    return thickness * ufl.det(gradient) * ufl.sqrt(ufl.inner(turned, turned))


def surface_heat(flux: ufl.core.expr.Expr, v: ufl.Argument, ds: ufl.Measure) -> ufl.Form:
    """Int q v ds: heat flux q (W/m2) out of the strand through its surface (30)-(36)."""
    return flux * v * ds


def residual_enthalpy(
    enthalpy: ufl.core.expr.Expr,
    enthalpy_base: ufl.core.expr.Expr,
    theta: ufl.core.expr.Expr,
    flux: ufl.core.expr.Expr,
    step: ufl.core.expr.Expr,
    v: ufl.Argument,
    dx: ufl.Measure,
    ds: ufl.Measure,
) -> ufl.Form:
    """Enthalpy form (23) of one implicit stage: H - H_base = step div grad theta, with the flux q.

    H, theta and q are functions of one nodal unknown; using differences of H over the step (never c
    times dT) makes the heat balance exact for any step.
    """
    return storage(enthalpy - enthalpy_base, v, dx) + step * (
        conduction(theta, v, dx) + surface_heat(flux, v, ds)
    )
