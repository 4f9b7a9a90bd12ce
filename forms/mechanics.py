"""Weak forms of the slice in generalized plane strain, small strain (thesis III.1-III.3).

The slice lies between two planes whose distance is e(x, y) = a0 + a1 x + a2 y (37). Besides the
displacement in its plane it has up to four scalar degrees of freedom, the generalized strains:

    a0 - 1, a1, a2   strain of the thickness at the origin and its gradients (1, 1/m, 1/m),
    across           a uniform strain along y, for strips cut out of something wide.

A `Direction` is any motion of both kinds, real or virtual; work and stiffness are written once for
it, and give the rows and columns of the nodal displacements and of the generalized strains.

Stress and strain are Mandel vectors [xx, yy, zz, sqrt(2) xy]. The stress deviator is integrated
with one rule and the mean stress with a lower one: with a mean stress at every point of the full
rule, second-order cells lock where flow leaves the volume unchanged. On each cell mean stress,
pressure and change of volume are linear in x and y (docs/mechanics.md), and the law gets a strain
with this trace. In the stiffness this leads to products of integrals over a cell, int K P(tr
eps(u)) P(tr eps(v)), with P the projection on 1, x, y; UFL cannot express them, so they are added
to these forms cell by cell (`castfem.physics.mechanics.mean_stress`).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl

Expr = Any
SQRT2 = 2.0**0.5
GENERALIZED_STRAINS = ("a0", "a1", "a2", "across")


@dataclass(frozen=True, slots=True)
class Direction:
    """Motion of the slice, per unit of any parameter."""

    gradient: Expr  #: gradient of the displacement in the plane, (2, 2)
    shift: Expr  #: displacement in the plane, (2,), m
    generalized_strains: Expr  #: of the generalized strains, (4,), see the module


def of_displacement(u: Expr) -> Direction:
    """Motion by a displacement in the plane."""
    return Direction(ufl.grad(u), u, ufl.as_vector([0.0, 0.0, 0.0, 0.0]))


def of_generalized_strains(generalized_strains: Expr, mesh: ufl.Mesh) -> Direction:
    """Motion by generalized strains alone."""
    y = ufl.SpatialCoordinate(mesh)[1]
    gradient = ufl.as_tensor([[0.0, 0.0], [0.0, generalized_strains[3]]])
    return Direction(
        gradient, ufl.as_vector([0.0, generalized_strains[3] * y]), generalized_strains
    )


def mandel(in_plane: Expr, zz: Expr) -> Expr:
    """Mandel vector of the symmetric part of a tensor (2, 2) and its zz component."""
    return ufl.as_vector(
        [in_plane[0, 0], in_plane[1, 1], zz, (in_plane[0, 1] + in_plane[1, 0]) / SQRT2]
    )


def trace(vector: Expr) -> Expr:
    """Trace of the tensor that a Mandel vector stands for."""
    return vector[0] + vector[1] + vector[2]


def strain(direction: Direction, mesh: ufl.Mesh) -> Expr:
    """Strain of a motion: in the plane, and of the thickness (37)."""
    x, m = ufl.SpatialCoordinate(mesh), direction.generalized_strains
    return mandel(direction.gradient, m[0] + m[1] * x[0] + m[2] * x[1])


def isotropic(mean: Expr, pressure: Expr | None = None) -> Expr:
    """Stress of a mean stress and a ferrostatic pressure p.

    The pressure acts in the plane alone, as -p div v, p by (219): along the strand the column of
    liquid carries itself.
    """
    if pressure is None:
        return ufl.as_vector([mean, mean, mean, 0.0])
    return ufl.as_vector([mean - pressure, mean - pressure, mean, 0.0])


def virtual_work(
    deviator: Expr, stress: Expr, virtual: Expr, dx_deviator: ufl.Measure, dx_mean: ufl.Measure
) -> ufl.Form:
    """Int sigma : eps(v): nodal forces for a nodal v, otherwise the left-hand side of (38).

    Args:
        deviator: Stress deviator at the points of `dx_deviator`.
        stress: Isotropic stress, see `isotropic`, at the points of `dx_mean`.
        virtual: Strain of the virtual motion.
        dx_deviator: Area measure for the deviator.
        dx_mean: Area measure for the mean stress.
    """
    return ufl.inner(deviator, virtual) * dx_deviator + ufl.inner(stress, virtual) * dx_mean


def stiffness(tangent: Expr, change: Expr, virtual: Expr, dx_deviator: ufl.Measure) -> ufl.Form:
    """Int (C eps(u)) : eps(v), the derivative of `virtual_work` without the change of volume.

    Args:
        tangent: Deviatoric part of the material's tangent (4, 4).
        change: Strain of the motion u.
        virtual: Strain of the virtual motion v.
        dx_deviator: Area measure for the deviator.
    """
    return ufl.inner(tangent * change, virtual) * dx_deviator


def following(u: Expr, v: Expr) -> ufl.Form:
    """Int eps(u) : eps(v): fictitious elastic liquid that follows the shell, without its stress.

    Args:
        u: Displacement.
        v: Virtual displacement.
    """
    return ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx


def traction_work(traction: Expr, v: Expr, ds: ufl.Measure) -> ufl.Form:
    """Int t . v ds: work of a force per area of the undeformed surface, Pa."""
    return ufl.inner(traction, v) * ds


def pressure_work(pressure: Expr, v: Expr, mesh: ufl.Mesh, ds: ufl.Measure) -> ufl.Form:
    """Int -p n . v ds: work of a pressure on the surface, Pa."""
    return -pressure * ufl.inner(ufl.FacetNormal(mesh), v) * ds
