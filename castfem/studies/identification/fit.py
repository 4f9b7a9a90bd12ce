"""Fits the parameters of the modified Norton-Hoff law (163) to tensile curves (thesis V.1.5).

Above the elastic part, at constant rate, the logarithm of the curve is linear in the parameters:

    ln s - ln sqrt3  =  ln(K0 p2) - p1 e + p3 ln(sqrt3 r) + p4 ln e,

so that errors are relative, the best fit is unique, and the Jacobian shows what the data do not
determine. The parameters are found for each temperature separately or as polynomials over
temperature. Bounded least squares; the confidence intervals come from the Jacobian and are widened
for residuals that are correlated along a curve (the points of one curve are not independent
measurements).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import t as student

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.types import Array, Flags
from castfem.physics.constitutive.flow_curves import SQRT3
from castfem.studies.identification.measured import Indices, TensileData, read_tensile
from castfem.studies.identification.result import NAMES, Fit, IdentifiedLaw


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Settings of the fit of a law to tensile tests."""

    confidence: float = 0.95  #: probability of the intervals
    prior: float = 1e-5  #: weight of the prior on undetermined parameters, relative to one point
    #: prior values of p1, p3, p4
    prior_values: tuple[float, float, float] = (0.0, 0.13, 0.1)
    #: relative singular value below which the data leave a direction undetermined
    open: float = 1e-6
    points: int = 4  #: smallest number of points at a temperature


SETTINGS = IdentificationSettings()
GUESSED = np.array([0.0, 1.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True)
class IdentifyOptions:
    """Options of the fit."""

    degree: int | None = None
    """None fits each temperature separately; a number makes ln(K0 p2), p1, p3 and p4 polynomials of
    that degree over temperature, fitted to all data together."""
    softening: Literal["positive", "free", "none"] = "positive"
    """"positive" restricts p1 to 0 or more, "free" does not restrict it, "none" fixes it at 0."""
    least_strain: float = 0.002
    """Points below this strain are left out: elastic part and compliance of the machine."""
    largest_strain: float = 1.0  #: points above this strain are left out: necking
    points: int = 40  #: Larger curves are thinned to this many points, evenly in ln(strain)
    p3: tuple[float, float] = (0.005, 1.0)  #: bounds
    p4: tuple[float, float] = (0.0, 0.95)  #: bounds

    @property
    def bounds(self) -> Array:
        """Lower and upper bounds of ln(K0 p2 / Pa), p1, p3, p4: (4, 2)."""
        p1 = {"positive": (0.0, 1e4), "free": (-1e4, 1e4), "none": (0.0, 0.0)}[self.softening]
        return np.array([(-50.0, 100.0), p1, self.p3, self.p4])


@dataclass(frozen=True, slots=True)
class _Problem:
    """The least-squares problem: residual = design @ unknowns - goal."""

    design: Array  #: (points, unknowns)
    goal: Array  #: ln(s / sqrt3), (points,)
    least: Array  #: lower bounds of the unknowns
    most: Array  #: upper bounds; equal to the lower one for a fixed unknown
    prior: Array  #: prior values of undetermined unknowns
    guessed: Array  #: 1 where the prior applies; 0 for the level, which follows from the others
    curves: list[Indices] = field(default_factory=list)  #: indices of the points along each curve


def identify(
    source: str | os.PathLike[str] | TensileData, options: IdentifyOptions | None = None
) -> IdentifiedLaw:
    """Fit the law to tensile curves."""
    chosen = options or IdentifyOptions()
    given = source if isinstance(source, TensileData) else read_tensile(source)
    data = _usable(given, chosen)
    temperatures = data.temperatures
    if chosen.degree is None:
        fits = [
            _fit_alone(data.select(np.flatnonzero(data.temperature == t)), float(t), chosen)
            for t in temperatures
        ]
    else:
        fits = _fit_together(data, temperatures, chosen)
    return IdentifiedLaw(tuple(fits), given, data, chosen.degree, SETTINGS.confidence)


def _usable(data: TensileData, options: IdentifyOptions) -> TensileData:
    """Remove the elastic part, necking and stresses without a logarithm; thin long curves."""
    inside = (
        (data.strain >= options.least_strain)
        & (data.strain <= options.largest_strain)
        & (data.stress > 0.0)
    )
    kept = data.select(np.flatnonzero(inside))
    chosen = []
    for curve in kept.curves():
        if len(curve) > options.points:
            ln_strain = np.log(kept.strain[curve])
            at = np.linspace(ln_strain[0], ln_strain[-1], options.points)
            apart = np.abs(ln_strain[:, None] - at)
            nearest = np.unique(apart.argmin(axis=0))
            curve = curve[nearest]
        chosen.append(curve)
    if not chosen:
        raise InputError(
            f"{data.name}: no point has a positive stress at a strain from "
            f"{options.least_strain:g} to {options.largest_strain:g}"
        )
    return kept.select(np.sort(np.concatenate(chosen)))


def _columns(data: TensileData) -> Array:
    """Derivatives of ln s by ln(K0 p2), p1, p3, p4: (points, 4)."""
    ones = np.ones_like(data.strain)
    return np.stack([ones, -data.strain, np.log(SQRT3 * data.rate), np.log(data.strain)], axis=1)


def _prior_of(data: TensileData, columns: Array) -> Array:
    """Prior values of the four parameters, with the level that fits the mean."""
    others = np.array(SETTINGS.prior_values)
    level = np.mean(np.log(data.stress / SQRT3) - columns[:, 1:] @ others)
    return np.array([level, *others])


def _solve(problem: _Problem) -> tuple[Array, Array]:
    """Return the unknowns and their covariance (infinite if undetermined, 0 if fixed)."""
    moving = problem.most > problem.least
    values = np.where(moving, 0.0, problem.least)
    weight = (SETTINGS.prior * np.abs(problem.design).max(axis=0) * problem.guessed)[moving]
    design = np.vstack([problem.design[:, moving], np.diag(weight)])
    held = problem.design[:, ~moving] @ values[~moving]
    goal = np.concatenate([problem.goal - held, weight * problem.prior[moving]])
    least, most = problem.least[moving], problem.most[moving]
    scale = np.abs(design).max(axis=0)
    found = lsq_linear(design / scale, goal, (scale * least, scale * most), method="bvls").x / scale
    close = 1e-6 * np.minimum(most - least, 1.0)
    at_least, at_most = found - least < close, most - found < close
    values[moving] = np.where(at_least, least, np.where(at_most, most, found))
    fixed = ~moving
    fixed[moving] = at_least | at_most
    residual = problem.design @ values - problem.goal
    return values, _covariance(problem, residual, fixed)


def _covariance(problem: _Problem, residual: Array, fixed: Flags) -> Array:
    """Covariance of the unknowns: 0 for fixed ones, infinite for undetermined ones."""
    size = len(fixed)
    covariance = np.zeros((size, size))
    free = np.flatnonzero(~fixed)
    if not free.size:
        return covariance
    scale = np.abs(problem.design[:, free]).max(axis=0)
    _, singular, right = np.linalg.svd(problem.design[:, free] / scale, full_matrices=False)
    known = singular > SETTINGS.open * singular[0]
    surplus = max(len(residual) - int(known.sum()), 1)
    variance = residual @ residual / surplus * _widening(residual, problem.curves)
    inverse = np.zeros_like(singular)
    inverse[known] = variance / singular[known] ** 2
    part = (right.T * inverse) @ right / np.outer(scale, scale)
    # A parameter that takes part in an undetermined direction is itself undetermined.
    open_ = (np.abs(right[~known]) > 1e-3).any(axis=0)
    part[open_, :], part[:, open_] = 0.0, 0.0
    part[open_, open_] = np.inf
    covariance[np.ix_(free, free)] = part
    return covariance


def _widening(residual: Array, curves: list[Indices]) -> float:
    """Factor on the variance for residuals that are correlated along a curve.

    With their lag-1 correlation k n points count as n (1 - k)/(1 + k) independent ones.
    """
    products = sum(float(residual[c][1:] @ residual[c][:-1]) for c in curves)
    squares = sum(float(residual[c] @ residual[c]) for c in curves)
    if squares <= 0.0:
        return 1.0
    k = min(max(products / squares, 0.0), 0.98)
    return (1.0 + k) / (1.0 - k)


def _fit_alone(data: TensileData, temperature: float, options: IdentifyOptions) -> Fit:
    if len(data.stress) < SETTINGS.points:
        raise InputError(
            f"{data.name}: {len(data.stress)} usable points at "
            f"{temperature - ZERO_CELSIUS:.0f} degC, {SETTINGS.points} are needed; "
            "give a degree to fit all temperatures together"
        )
    columns = _columns(data)
    bounds = options.bounds
    problem = _Problem(
        columns, np.log(data.stress / SQRT3), bounds[:, 0], bounds[:, 1],
        _prior_of(data, columns), GUESSED, data.curves(),
    )  # fmt: skip
    values, covariance = _solve(problem)
    count = len(data.stress)
    return _fit(temperature, values, covariance, data, bounds, count - len(NAMES))


def _fit_together(data: TensileData, temperatures: Array, options: IdentifyOptions) -> list[Fit]:
    """Fit polynomials over temperature; the unknowns are their values at Chebyshev points."""
    degree = options.degree or 0
    if degree < 0 or degree >= len(temperatures):
        raise InputError(
            f"{data.name}: {len(temperatures)} temperatures carry polynomials of degree "
            f"{len(temperatures) - 1} at most, not {degree}"
        )
    nodes = _nodes(temperatures, degree)
    columns = _columns(data)
    basis = _lagrange(nodes, data.temperature)
    design = (columns[:, :, None] * basis[:, None, :]).reshape(len(columns), -1)
    bounds = options.bounds
    least, most = (np.repeat(bounds[:, k], degree + 1) for k in (0, 1))
    prior = np.repeat(_prior_of(data, columns), degree + 1)
    guessed = np.repeat(GUESSED, degree + 1)
    goal = np.log(data.stress / SQRT3)
    problem = _Problem(design, goal, least, most, prior, guessed, data.curves())
    values, covariance = _solve(problem)
    surplus = len(data.stress) - len(values)
    fits = []
    for t in temperatures:
        weights = np.asarray(np.kron(np.eye(len(NAMES)), _lagrange(nodes, np.array([t]))))
        own = np.clip(weights @ values, bounds[:, 0], bounds[:, 1])
        spread = _combined(weights, covariance)
        here = data.select(np.flatnonzero(data.temperature == t))
        fits.append(_fit(float(t), own, spread, here, bounds, surplus))
    return fits


def _nodes(temperatures: Array, degree: int) -> Array:
    """Chebyshev points between the first and the last temperature, K."""
    if degree == 0:
        return np.array([temperatures.mean()])
    x = 0.5 * (1.0 - np.cos(np.pi * np.arange(degree + 1) / degree))
    return np.asarray(temperatures[0] + x * (temperatures[-1] - temperatures[0]))


def _lagrange(nodes: Array, at: Array) -> Array:
    """Values of the Lagrange polynomials of the nodes, (points, nodes)."""
    values = np.ones((len(at), len(nodes)))
    for k, node in enumerate(nodes):
        for other in np.delete(nodes, k):
            values[:, k] *= (at - other) / (node - other)
    return values


def _combined(weights: Array, covariance: Array) -> Array:
    """Covariance of weighted sums; infinite if that of an unknown with weight is."""
    open_ = np.isinf(np.diag(covariance))
    finite = np.where(np.isinf(covariance), 0.0, covariance)
    spread = weights @ finite @ weights.T
    unknown = (np.abs(weights[:, open_]) > 1e-12).any(axis=1)
    spread[unknown, unknown] = np.inf
    return np.asarray(spread)


def _fit(
    temperature: float, values: Array, covariance: Array, data: TensileData, bounds: Array,
    surplus: int,
) -> Fit:  # fmt: skip
    residual = _columns(data) @ values - np.log(data.stress / SQRT3)
    quantile = float(student.ppf(0.5 + 0.5 * SETTINGS.confidence, max(surplus, 1)))
    near = np.abs(values[:, None] - bounds).min(axis=1) < 1e-9
    at_bound = near & (bounds[:, 0] < bounds[:, 1])
    return Fit(
        temperature,
        tuple(float(v) for v in values),
        tuple(float(v) for v in quantile * np.sqrt(np.diag(covariance))),
        tuple(bool(b) for b in at_bound),
        len(data.stress),
        len(np.unique(data.rate)),
        float(np.sqrt(np.mean(residual**2))),
        float(np.abs(residual).max()),
    )
