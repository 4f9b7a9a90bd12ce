"""Weak forms of the slice's mechanics at large strain, pulled back to the undeformed mesh.

The mesh does not move.  A point X goes to x = X + u (+ the mode `across`), the in-plane deformation
gradient is F = dx/dX, the thickness has grown by the factor e = a0 + a1 x + a2 y (37) at the place
where the point is now, and J = e det F.  With sigma the Cauchy stress the virtual work reads

    int J sigma : d dX,      d = [ sym(grad v F^-1), (variation of e) / e ],

which for a virtual mode is the left-hand side of (38), the integral over the present section.

Stress is updated objectively over a step (the thesis' (195)-(196), Jaumann, in the limit of small
steps) by the midpoint rule of Hughes and Winget (Int. J. Numer. Meth. Engng 15 (1980) 1862): with G
= (F - F_old) F_mid^-1 the strain increment is sym G and the spin w = (G_21 - G_12)/2. The old
stress is turned by the angle 2 atan(w/2). The strain increment belongs to the middle of the step
and is turned by half of that angle (otherwise the update would be of first order where strain
turns). The law is integrated with both. A rotation of any angle gives no strain, and exactly its
own angle.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import ufl

from castfem.forms.mechanics import SQRT2, Direction, Expr, isotropic, mandel, trace


@dataclass(frozen=True, slots=True)
class Deformation:
    """Configuration of the slice."""

    position: Expr  #: present position of the points, (2,), m
    gradient: Expr  #: in-plane deformation gradient F, (2, 2)
    thickness: Expr  #: thickness e, relative to the undeformed one
    generalized_strains: Expr  #: generalized strains, (4,)


def deformation(u: Expr, generalized_strains: Expr, mesh: ufl.Mesh) -> Deformation:
    """Deformation from the displacement u and the generalized strains."""
    x = ufl.SpatialCoordinate(mesh)
    place = x + u + ufl.as_vector([0.0, generalized_strains[3] * x[1]])
    gradient = (
        ufl.Identity(2) + ufl.grad(u) + ufl.as_tensor([[0.0, 0.0], [0.0, generalized_strains[3]]])
    )
    thickness = (
        1.0
        + generalized_strains[0]
        + generalized_strains[1] * place[0]
        + generalized_strains[2] * place[1]
    )
    return Deformation(place, gradient, thickness, generalized_strains)


def thickening(at: Deformation, by: Direction) -> Expr:
    """First variation of the thickness."""
    m, shift = by.generalized_strains, by.shift
    moved = at.generalized_strains[1] * shift[0] + at.generalized_strains[2] * shift[1]
    return m[0] + m[1] * at.position[0] + m[2] * at.position[1] + moved


def second_thickening(one: Direction, other: Direction) -> Expr:
    """Second variation of the thickness, where the position is multiplied by the gradients."""
    return sum(
        one.generalized_strains[i + 1] * other.shift[i]
        + other.generalized_strains[i + 1] * one.shift[i]
        for i in range(2)
    )


def virtual_rate(at: Deformation, by: Direction) -> Expr:
    """Mandel vector of the rate of deformation d of a virtual motion."""
    return mandel(by.gradient * ufl.inv(at.gradient), thickening(at, by) / at.thickness)


def increment(now: Deformation, old: Deformation) -> Expr:
    """Strain increment D (Mandel), turned to the end of the step, and spin w as one vector (5,)."""
    g, zz = _midpoint(now, old)
    spin = 0.5 * (g[1, 0] - g[0, 1])
    d = _rotated(mandel(g, zz), 0.5 * spin)
    return ufl.as_vector([d[0], d[1], d[2], d[3], spin])


def _rotated(vector: Expr, tangent: Expr) -> Expr:
    """Mandel vector turned by an angle, given by its tangent."""
    c, s = (1.0 - tangent**2) / (1.0 + tangent**2), 2.0 * tangent / (1.0 + tangent**2)
    centre, half = 0.5 * (vector[0] + vector[1]), 0.5 * (vector[0] - vector[1])
    shear = vector[3] / SQRT2
    new, slant = c * half - s * shear, s * half + c * shear
    return ufl.as_vector([centre + new, centre - new, vector[2], SQRT2 * slant])


def _midpoint(now: Deformation, old: Deformation) -> tuple[Expr, Expr]:
    middle = 0.5 * (now.gradient + old.gradient)
    g = (now.gradient - old.gradient) * ufl.inv(middle)
    return g, 2.0 * (now.thickness - old.thickness) / (now.thickness + old.thickness)


def _turned(vector: Expr) -> Expr:
    """Change of a Mandel vector's tensor per unit angle of rotation, E s - s E."""
    s = SQRT2 * vector[3]
    return ufl.as_vector([-s, s, 0.0, SQRT2 * (vector[0] - vector[1])])


def _change(now: Deformation, old: Deformation, by: Direction) -> tuple[Expr, Expr]:
    """Variations of the strain increment before and after it is turned, and of the angle."""
    g, zz = _midpoint(now, old)
    middle = 0.5 * (now.gradient + old.gradient)
    dg = (ufl.Identity(2) - 0.5 * g) * by.gradient * ufl.inv(middle)
    thickness = 0.5 * (now.thickness + old.thickness)
    dzz = (1.0 - 0.5 * zz) * thickening(now, by) / thickness
    spin = 0.5 * (g[1, 0] - g[0, 1])
    angle = 0.5 * (dg[1, 0] - dg[0, 1]) / (1.0 + 0.25 * spin**2)
    return _rotated(mandel(dg, dzz), 0.5 * spin), angle


def law_change(now: Deformation, old: Deformation, by: Direction) -> tuple[Expr, Expr]:
    """Variation of the strain increment without its turning with the material, and of that angle.

    For an isotropic law d sigma = C : (the first) + (the second) times the derivative of the stress
    by rotation.
    """
    strain, angle = _change(now, old, by)
    return _with_material(now, old, strain, angle), angle


def _with_material(now: Deformation, old: Deformation, strain: Expr, angle: Expr) -> Expr:
    """Variation of the strain increment in the frame that turns with the material."""
    return strain - 0.5 * angle * _turned(ufl.as_vector([*increment(now, old)][:4]))


def volume_change(now: Deformation, old: Deformation, by: Direction) -> Expr:
    """Variation of the trace of the strain increment."""
    return trace(_change(now, old, by)[0])


def volume_rate(at: Deformation, virtual: Direction) -> Expr:
    """J tr d of a virtual motion: the work conjugate of the mean stress, per undeformed area."""
    return ufl.det(at.gradient) * at.thickness * trace(virtual_rate(at, virtual))


def virtual_work(
    at: Deformation,
    deviator: Expr,
    stress: Expr,
    virtual: Direction,
    dx_deviator: ufl.Measure,
    dx_mean: ufl.Measure,
) -> ufl.Form:
    """Int J sigma : d dX, see the module; arguments as for `forms.mechanics.virtual_work`."""
    rate = virtual_rate(at, virtual)
    volume = ufl.det(at.gradient) * at.thickness
    shape = volume * ufl.inner(deviator, rate) * dx_deviator
    return shape + volume * ufl.inner(stress, rate) * dx_mean


def _geometric(now: Deformation, stress: Expr, by: Direction, virtual: Direction) -> Expr:
    """Change of J d : sigma at constant sigma."""
    inverse = ufl.inv(now.gradient)
    moving, testing = by.gradient * inverse, virtual.gradient * inverse
    growth = thickening(now, by) / now.thickness
    rate = virtual_rate(now, virtual)
    zz = thickening(now, virtual) * growth - second_thickening(by, virtual)
    lost = mandel(testing * moving, zz / now.thickness)
    return (ufl.tr(moving) + growth) * ufl.inner(stress, rate) - ufl.inner(stress, lost)


def stiffness(
    now: Deformation,
    old: Deformation,
    material: tuple[Expr, Expr, Expr, Expr | None],
    by: Direction,
    virtual: Direction,
    measures: tuple[ufl.Measure, ufl.Measure],
) -> ufl.Form:
    """Derivative of `virtual_work`, consistent with the step, without the change of mean stress.

    For an isotropic law, whose response turns with stress and strain,

        d sigma = C : (dD - dW D + D dW) + dW sigma - sigma dW,      dW the spin of the variation,

    where dD itself contains half of dW D - D dW. The mean stress changes with the change of volume
    of its cell, which adds the term int K P(`volume_change`) P(`volume_rate`), see
    `forms.mechanics`.

    Args:
        now: Deformation at the end of the step.
        old: Deformation at its start.
        material: Deviatoric tangent (4, 4), stress deviator, mean stress, and ferrostatic pressure
            or None.
        by: Motion of the derivative.
        virtual: Virtual motion.
        measures: For the deviator and for the mean stress.
    """
    tangent, deviator, mean, pressure = material
    strain, angle = _change(now, old, by)
    turned = _with_material(now, old, strain, angle)
    rate = virtual_rate(now, virtual)
    volume = ufl.det(now.gradient) * now.thickness
    shape = ufl.inner(tangent * turned + angle * _turned(deviator), rate)
    shape += _geometric(now, deviator, by, virtual)
    size = _geometric(now, isotropic(mean, pressure), by, virtual)
    return volume * shape * measures[0] + volume * size * measures[1]


def pressure_work(
    at: Deformation, pressure: Expr, v: Expr, mesh: ufl.Mesh, ds: ufl.Measure
) -> ufl.Form:
    """Int -p n . v over the present surface, pulled back (Nanson)."""
    size = ufl.det(at.gradient) * at.thickness
    normal = ufl.inv(at.gradient).T * ufl.FacetNormal(mesh)
    return -pressure * size * ufl.inner(normal, v) * ds


def pressure_stiffness(
    at: Deformation, pressure: Expr, by: Direction, v: Expr, mesh: ufl.Mesh, ds: ufl.Measure
) -> ufl.Form:
    """Derivative of `pressure_work`: the pressure follows the surface."""
    inverse = ufl.inv(at.gradient)
    moving = by.gradient * inverse
    normal = inverse.T * ufl.FacetNormal(mesh)
    growth = ufl.tr(moving) + thickening(at, by) / at.thickness
    size = ufl.det(at.gradient) * at.thickness
    return -pressure * size * ufl.inner(growth * normal - moving.T * normal, v) * ds
