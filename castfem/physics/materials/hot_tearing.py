"""Criteria of hot tearing: the strength of the mushy zone while its last liquid freezes.

All are functions of arrays in SI. Three concern a material point on its way through the brittle
range, solid fractions of 0.9 to 0.99, where crystals are bridged too little to carry tension and
too much for liquid to heal an opening:

* [Won2000] compares the strain across the range with a critical one, which decreases with the
  strain rate and with the width of the range, that is with the composition.
* [Clyne1981] compares the time in the range with the time before it, in which liquid still feeds.
* [Rappaz1999] gives the pressure drop that drives the liquid through the mushy zone to feed
  shrinkage and strain; a pore forms where it exceeds the available pressure.

The numbers are quoted from memory; docs/hot_tearing.md says which of them could be read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np

from castfem.base.types import Array

Fraction = Callable[[Array], Array]
"""Solid fraction over temperature in K."""


@dataclass(frozen=True, slots=True)
class TearingNumerics:
    """Numerical parameters of integrals over the mushy zone and over a step."""

    panels: int = 64  # panels of an integral over the mushy zone
    points: int = 16  # Gauss points of each panel
    parts: int = 8  # sub-steps of a step
    no_strain: float = 1e-12  # rounding of zero strain


NUMERICS = TearingNumerics()


@dataclass(frozen=True, slots=True)
class CriticalStrain:
    """Critical strain of the form of [Won2000], factor/(rate^m width^n); defaults of the paper.

    With both exponents 0 the strain is constant.
    """

    factor: float = 0.02821  #: for a rate in 1/s and a width in K
    rate_exponent: float = 0.3131
    range_exponent: float = 0.8638


WON = CriticalStrain()


def won_critical_strain(rate: Array, width: float, law: CriticalStrain = WON) -> Array:
    """Strain across the brittle range at which the steel tears (n,).

    Args:
        rate: Strain rate in the range (n,), 1/s; at rate 0 any strain is allowed.
        width: Width of the range, T(fs 0.9) - T(fs 0.99), K.
        law: Its parameters.
    """
    with np.errstate(divide="ignore"):
        slowed = np.asarray(rate, float) ** law.rate_exponent * width**law.range_exponent
        return np.asarray(law.factor / slowed)


def won_damage(strain: Array, time: Array, width: float, law: CriticalStrain = WON) -> Array:
    """Strain across the range over the critical one of its mean rate (n,).

    Args:
        strain: Strain across the range so far (n,), not negative.
        time: Time in the range so far (n,), s.
        width: See `won_critical_strain`.
        law: See `won_critical_strain`.
    """
    rate = strain / np.where(time > 0.0, time, np.inf)
    damage = strain / won_critical_strain(rate, width, law)
    return np.where(strain > NUMERICS.no_strain, damage, 0.0)


def clyne_davies(vulnerable: Array, relief: Array) -> Array:
    """Time in the brittle range over that from a solid fraction of 0.4 to it (n,) [Clyne1981].

    0 for points that were not followed through both.
    """
    return np.asarray(vulnerable / np.where(relief > 0.0, relief, np.inf))


def secondary_arm_spacing(cooling_rate: Array, carbon: float) -> Array:
    """Secondary dendrite arm spacing of carbon steel, m (n,) [Won2001].

    Args:
        cooling_rate: Cooling rate in the mushy zone (n,), K/s, above 0.
        carbon: Carbon content, wt%, above 0.
    """
    if carbon <= 0.15:
        return np.asarray(1e-6 * (169.1 - 720.9 * carbon) * cooling_rate**-0.4935)
    return np.asarray(1e-6 * 143.9 * cooling_rate**-0.3616 * carbon ** (0.5501 - 1.996 * carbon))


def feeding_integrals(fraction: Fraction, start: float, end: float) -> tuple[float, float]:
    """Integrals of the mushy zone of a steel for strain rate and shrinkage [Rappaz1999].

        A = int F fs^2 / (1 - fs)^3 dT,  F(T) = int_end^T fs dT',      B = int fs^2 / (1 - fs)^2 dT

    Liquid at T must feed all strain between T and the roots of the crystals, hence F.

    Args:
        fraction: Solid fraction over temperature.
        start: Liquidus, K.
        end: Temperature of the roots, where dendrites have coalesced, K.

    Returns:
        A, K2, and B, K.
    """
    # Panels grow from the roots, where both integrands are steep.
    edges = end + (start - end) * np.linspace(0.0, 1.0, NUMERICS.panels + 1) ** 2
    nodes, weights = np.polynomial.legendre.leggauss(NUMERICS.points)
    half = 0.5 * np.diff(edges)
    at = edges[:-1, None] + half[:, None] * (1.0 + nodes)
    fs = np.clip(fraction(at.ravel()).reshape(at.shape), 0.0, 1.0 - 1e-12)
    whole = (fs @ weights) * half
    before = np.concatenate([[0.0], np.cumsum(whole)[:-1]])
    inside = half[:, None] * (fs @ _cumulative(nodes).T)
    strained = (before[:, None] + inside) * fs**2 / (1.0 - fs) ** 3
    shrunk = fs**2 / (1.0 - fs) ** 2
    return float(half @ (strained @ weights)), float(half @ (shrunk @ weights))


def _cumulative(nodes: Array) -> Array:
    """Matrix (n, n) from values at Gauss points to their integrals from -1 to each point."""
    legendre = np.polynomial.legendre
    from_values = np.linalg.inv(legendre.legvander(nodes, len(nodes) - 1))
    terms = np.eye(len(nodes))
    integrals = np.stack([legendre.legval(nodes, legendre.legint(t, lbnd=-1.0)) for t in terms])
    return np.asarray(integrals.T @ from_values)


@dataclass(frozen=True, slots=True)
class Feeding:
    """The liquid between the crystals, and its feeding."""

    viscosity: float  #: viscosity of the liquid, Pa s
    shrinkage: float  #: density of the solid over that of the liquid, minus 1
    integrals: tuple[float, float]  #: result of `feeding_integrals`, K2 and K
    spacing: Callable[[Array], Array]  #: secondary arm spacing over cooling rate, m

    def pressure_drop(self, strain_rate: Array, gradient: Array, cooling_rate: Array) -> Array:
        """Pressure drop between liquid and roots [Rappaz1999], Pa (n,).

            dp = 180 mu/(G l2^2) [ (1 + beta) A eps'/G + beta v B ],      v = T'/G

        from Darcy's law with a permeability of l2^2 (1 - fs)^3/(180 fs^2).

        Args:
            strain_rate: Strain rate across the growth direction, sum of both directions (n,), 1/s.
            gradient: Temperature gradient G (n,), K/m.
            cooling_rate: Cooling rate T' (n,), K/s. Where either is not positive the drop is 0.
        """
        grows = (gradient > 0.0) & (cooling_rate > 0.0)
        g, cooling = np.where(grows, gradient, 1.0), np.where(grows, cooling_rate, 1.0)
        strained, shrunk = self.integrals
        fed = (1.0 + self.shrinkage) * strained * strain_rate / g
        fed = fed + self.shrinkage * cooling / g * shrunk
        drop = 180.0 * self.viscosity / (g * self.spacing(cooling) ** 2) * fed
        return np.asarray(np.where(grows, drop, 0.0))


def share_within(before: Array, after: Array, low: float, high: float) -> Array:
    """Fraction of a step in which a linearly changing value is between two limits (n,)."""
    least, most = np.minimum(before, after), np.maximum(before, after)
    inside = np.minimum(most, high) - np.maximum(least, low)
    still = np.asarray((least > low) & (least < high), float)
    span = most - least
    moving = np.clip(inside / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
    return np.where(span > 0.0, moving, still)


def cubic_between(
    start: Array, end: Array, rates: tuple[Array, Array], duration: float
) -> list[Array]:
    """Interpolate between two values with given rates at both ends, at even times (n,).

    A cubic in time that stays between the two values. Heat flows are continuous in time, so that
    enthalpies have continuous rates, even where the temperature has a kink.
    """
    least, most, found = np.minimum(start, end), np.maximum(start, end), [start]
    for s in np.linspace(0.0, 1.0, NUMERICS.parts + 1)[1:-1]:
        values = s**2 * (3.0 - 2.0 * s) * (end - start) + start
        values += duration * s * (1.0 - s) * ((1.0 - s) * rates[0] - s * rates[1])
        found.append(np.clip(values, least, most))
    return [*found, end]


def _none() -> Array:
    return np.zeros(0)


@dataclass(frozen=True, slots=True)
class MushyHistory:
    """History of points on their way through the mushy zone; its arrays are never modified."""

    #: time from a solid fraction of 0.4 to 0.9, s; infinite if it was not followed from its start
    relief: Array = field(default_factory=_none)
    vulnerable: Array = field(default_factory=_none)  #: time in the brittle range, s
    #: tension minus compression across the range, along the isotherm of the section
    around: Array = field(default_factory=_none)
    axial: Array = field(default_factory=_none)  #: the same along the strand
    #: integral of the temperature gradient over the time in the range, K s/m
    steepness: Array = field(default_factory=_none)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of the arrays."""
        return tuple(one.name for one in fields(cls))

    @classmethod
    def begun(cls, values: Array, feeds: float) -> MushyHistory:
        """Initial history of points with a known present state (see `advanced`) (n,)."""
        found = cls(*(np.zeros(len(values)) for _ in cls.names()))
        return replace(found, relief=np.where(values < feeds, np.inf, 0.0))

    def advanced(
        self,
        before: Array,
        after: Array,
        levels: tuple[float, float, float],
        duration: float,
        around: Array | float = 0.0,
        axial: Array | float = 0.0,
        gradient: Array | float = 0.0,
    ) -> tuple[MushyHistory, Array]:
        """The history after a step, and the fraction of the step in the brittle range (n,).

        Contributions of a step are uniform over it. A point that melts again starts from zero.

        Args:
            before: Enthalpy or temperature before the step (n,).
            after: Enthalpy or temperature after it (n,).
            levels: Levels of solid fraction 0.4 and of both ends of the range, decreasing.
            duration: Duration of the step, s.
            around: Strain increment along the isotherm (n,).
            axial: Strain increment along the strand.
            gradient: Temperature gradient (n,), K/m.
        """
        feeds, begins, ends = levels
        inside = share_within(before, after, ends, begins)
        melts, anew = after >= begins, after >= feeds
        relief = self.relief + duration * share_within(before, after, begins, feeds)
        passed = replace(
            self,
            relief=np.where(anew, 0.0, relief),
            vulnerable=np.where(melts, 0.0, self.vulnerable + duration * inside),
            around=np.where(melts, 0.0, np.maximum(self.around + inside * around, 0.0)),
            axial=np.where(melts, 0.0, np.maximum(self.axial + inside * axial, 0.0)),
            steepness=np.where(melts, 0.0, self.steepness + duration * inside * gradient),
        )
        return passed, inside

    @property
    def strain(self) -> Array:
        """The larger of both strains (n,): a tear runs along the growth and opens across it."""
        return np.maximum(self.around, self.axial)

    def strain_rate(self) -> Array:
        """Mean of the summed strain rates in the brittle range (n,), 1/s."""
        return (self.around + self.axial) / np.where(self.vulnerable > 0.0, self.vulnerable, np.inf)

    def gradient(self) -> Array:
        """Mean gradient in the brittle range (n,), K/m."""
        return self.steepness / np.where(self.vulnerable > 0.0, self.vulnerable, np.inf)
