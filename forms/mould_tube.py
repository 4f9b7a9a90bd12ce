"""Weak forms of a hot mould: heat conduction in its copper, and thermal distortion.

Steady heat conduction, div(k(T) grad T) = 0, with the conduction integral theta(T) = int k dT
(Kirchhoff) as the unknown, so that k may depend on T and the operator stays symmetric:

    int grad theta . grad v dx + int h (T(theta) - T_w) v ds_w = int q v ds_h     (conduction)

q is the heat flux from the strand into the hot face; h and T_w belong to the cooling water.

Small-strain thermoelasticity of an isotropic body [Boley1960], weak form of div sigma = 0:

    sigma = lambda tr(eps) I + 2 mu eps - (3 lambda + 2 mu) eps_T I               (Hooke)
    eps_T = int_{T_cold}^{T} alpha dT                                    (thermal strain)
    int 2 mu eps(u) : eps(v) + lambda div u div v dx = int (3 lambda + 2 mu) eps_T div v dx

This is the model of V.2.4 of [Pascon2003], which only calls it "3D thermo-elastic".
"""

from __future__ import annotations

import ufl

from castfem.forms.mechanics import Expr


def conduction(theta: Expr, v: ufl.Argument, dx: ufl.Measure) -> ufl.Form:
    """Int grad theta . grad v dx: heat through the copper, W."""
    return ufl.inner(ufl.grad(theta), ufl.grad(v)) * dx


def to_water(
    coefficient: Expr, temperature: Expr, water: Expr, v: ufl.Argument, ds: ufl.Measure
) -> ufl.Form:
    """Int h (T - T_w) v ds: heat to the water, W.

    Args:
        coefficient: Heat transfer coefficient h, W/(m2 K).
        temperature: Temperature T of the copper there, K.
        water: Temperature T_w of the water, K.
        v: Test function.
        ds: Surface of the water side.
    """
    return coefficient * (temperature - water) * v * ds


def from_strand(flux: Expr, v: ufl.Argument, ds: ufl.Measure) -> ufl.Form:
    """Int q v ds: heat from the strand, W; q in W/m2."""
    return flux * v * ds


def lame(youngs_modulus: Expr, poisson: Expr) -> tuple[Expr, Expr]:
    """Lame's lambda and mu, Pa."""
    return (
        youngs_modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
        youngs_modulus / (2.0 * (1.0 + poisson)),
    )


def strain(u: Expr) -> Expr:
    """Small strain eps(u) = sym grad u (3, 3)."""
    return ufl.sym(ufl.grad(u))


def stress(u: Expr, thermal_strain: Expr, youngs_modulus: Expr, poisson: Expr) -> Expr:
    """Hooke's law with thermal strain (3, 3), Pa.

    Args:
        u: Displacement, m.
        thermal_strain: Thermal strain eps_T.
        youngs_modulus: Young's modulus E, Pa.
        poisson: Poisson's ratio nu.
    """
    first, second = lame(youngs_modulus, poisson)
    eps, one = strain(u), ufl.Identity(3)
    pushed = (3.0 * first + 2.0 * second) * thermal_strain
    return (first * ufl.tr(eps) - pushed) * one + 2.0 * second * eps


def stiffness(
    u: ufl.Argument, v: ufl.Argument, youngs_modulus: Expr, poisson: Expr, dx: ufl.Measure
) -> ufl.Form:
    """Int 2 mu eps(u) : eps(v) + lambda div u div v dx, J/m."""
    first, second = lame(youngs_modulus, poisson)
    both = 2.0 * second * ufl.inner(strain(u), strain(v)) + first * ufl.div(u) * ufl.div(v)
    return both * dx


def thermal_load(
    v: ufl.Argument, thermal_strain: Expr, youngs_modulus: Expr, poisson: Expr, dx: ufl.Measure
) -> ufl.Form:
    """Int (3 lambda + 2 mu) eps_T div v dx: thermal load, N."""
    first, second = lame(youngs_modulus, poisson)
    return (3.0 * first + 2.0 * second) * thermal_strain * ufl.div(v) * dx
