"""Temperature and conductivity integral as exact functions of the enthalpy.

The thermal problem is solved for the volumetric enthalpy H (thesis (24)): T(H) is single valued
even where H(T) jumps (isothermal freezing), so that one code covers every freezing range, zero
included. The conductivity enters as its integral theta(T) = int k dT, which turns div(k grad T)
into div(grad theta) (Kirchhoff's transformation): the flux between two points is then exact for any
k(T).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from castfem.base.types import Array
from castfem.physics.materials.curve_loop import evaluate

Side = Literal["left", "right"]
CELLS = 8  # cells per piece of the grid on which pieces are looked up


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """State at given enthalpies; all arrays have the shape of the enthalpy."""

    temperature: Array  #: T, K
    temperature_slope: Array  #: dT/dH, K m3/J; zero where freezing is isothermal
    conduction: Array  #: theta(T) = integral of k dT from the curve's datum, W/m
    conduction_slope: Array  #: dtheta/dH = k dT/dH, m2/s (the effective diffusivity)


class ThermalCurve:
    """H <-> T <-> theta of one steel, from piecewise linear rho c(T) and k(T); exact to rounding.

    Between neighbouring knots rho c + latent is linear in T (H quadratic) and k is linear (theta
    quadratic); at a knot H may jump by an isothermal latent heat.  Outside the first and last knot
    rho c and k stay constant at their end values.

    Args:
        capacity_knots: T (n,) K increasing; rho c at the left and right end of each piece (n-1,),
            J/m3K; latent part (n-1,), J/m3K, constant on the piece; jump (n,), J/m3.
        conductivity_knots: T (m,) K increasing; k at the left and right end of each piece (m-1,),
            W/mK.
        datum: Temperature at which H and theta are zero, K; near the casting temperature, so that
            changes in a short step are not lost in the rounding of large numbers.

    Attributes:
        divided: Numbers of knots into which heat capacity and conductivity are divided.

    Raises:
        ValueError: A heat capacity or conductivity is not positive, or a jump is negative.
    """

    def __init__(
        self,
        capacity_knots: tuple[Array, Array, Array, Array, Array],
        conductivity_knots: tuple[Array, Array, Array],
        datum: float | None = None,
    ) -> None:
        t_c, c_left, c_right, latent, jump = (np.asarray(a, float) for a in capacity_knots)
        t_k, k_left, k_right = (np.asarray(a, float) for a in conductivity_knots)
        lower, upper = max(t_c[0], t_k[0]), min(t_c[-1], t_k[-1])
        self.divided = len(t_c), len(t_k)
        knots = np.union1d(t_c, t_k)
        knots = knots[(knots >= lower) & (knots <= upper)]
        cl, cr = _resample(knots, t_c, c_left, c_right)
        kl, kr = _resample(knots, t_k, k_left, k_right)
        piece = np.clip(np.searchsorted(t_c, knots[:-1], side="right") - 1, 0, len(latent) - 1)
        jumps = np.zeros_like(knots)
        jumps[np.searchsorted(knots, t_c[(t_c >= lower) & (t_c <= upper)])] = jump[
            (t_c >= lower) & (t_c <= upper)
        ]
        if min(cl.min(), cr.min()) <= 0 or min(kl.min(), kr.min()) <= 0 or jumps.min() < 0:
            raise ValueError(
                "heat capacity and conductivity must be positive, latent heat not negative"
            )
        self._build(knots, cl + latent[piece], cr + latent[piece], kl, kr, jumps)
        if datum is not None:
            self._move_zero(datum)

    def _move_zero(self, datum: float) -> None:
        """Set the zero of H and theta to `datum`."""
        origin = self.enthalpy(datum)
        self._theta -= self.at(origin).conduction
        self._h -= origin
        self._tabulate()

    def _build(
        self, knots: Array, cl: Array, cr: Array, kl: Array, kr: Array, jumps: Array
    ) -> None:
        """Combine ordinary and isothermal pieces, with one constant piece beyond either end."""
        width = np.diff(knots)
        gain = 0.5 * (cl + cr) * width
        rows = [(knots[0], 0.0, cl[0], 0.0, 0.0, kl[0], 0.0)]
        enthalpy, theta = 0.0, 0.0
        for i, t in enumerate(knots):
            if jumps[i] > 0:
                rows.append((t, enthalpy, np.inf, 0.0, theta, 0.0, 0.0))
                enthalpy += jumps[i]
            if i == len(knots) - 1:
                break
            slope_c, slope_k = (cr[i] - cl[i]) / width[i], (kr[i] - kl[i]) / width[i]
            rows.append((t, enthalpy, cl[i], slope_c, theta, kl[i], slope_k))
            enthalpy += gain[i]
            theta += 0.5 * (kl[i] + kr[i]) * width[i]
        rows.append((knots[-1], enthalpy, cr[-1], 0.0, theta, kr[-1], 0.0))
        # An isothermal piece has c = inf, so that s = dh / c = 0 without a special case.
        self._t, self._h, self._c, self._dc, self._theta, self._k, self._dk = np.array(
            rows
        ).T.copy()
        self._tabulate()
        self._quadratic = bool(self._dc.any() or self._dk.any())
        self.knots = knots
        capacity = np.concatenate([cl, cr])
        self.reference_capacity = float(np.median(capacity))
        self.reference_diffusivity = (
            float(np.median(np.concatenate([kl, kr]))) / self.reference_capacity
        )

    def _tabulate(self) -> None:
        """Tables for `at`: the pieces, and the first piece in each cell of an even grid.

        And T, theta, k and its slope where the pieces begin that are not isothermal.
        """
        t, h, c, theta, k = self._t, self._h, self._c, self._theta, self._k
        self._pieces = np.column_stack([t, h, theta, k, c, c * c, 2.0 * self._dc, self._dk])
        kept = np.isfinite(c)
        self._ordinary = t[kept], theta[kept], k[kept], self._dk[kept]
        # The last piece ends nowhere: not even an infinite enthalpy is beyond it.
        self._starts, self._ends = np.append(-np.inf, h[1:]), np.append(h[1:], np.nan)
        cells = CELLS * len(h)
        self._origin, self._per_enthalpy = float(h[1]), float(cells / (h[-1] - h[1]))
        # From slightly below a cell, since rounding may put a value into the next one.
        edges = np.arange(cells) - 1e-6
        places = self._origin + edges / self._per_enthalpy
        self._first = self._starts.searchsorted(places, side="right") - 1

    def at(self, enthalpy: Array) -> CurvePoint:
        """Temperature, conduction and their slopes at `enthalpy` (J/m3, any shape)."""
        given = np.ascontiguousarray(enthalpy, dtype=float)
        found = evaluate(
            given.ravel(), self._pieces, self._ends, self._first, self._origin, self._per_enthalpy
        )
        return CurvePoint(*found.reshape(4, *np.shape(enthalpy)))

    def lines(self) -> tuple[Array, Array, Array] | None:
        """T(H) and theta(H) as straight lines; None if rho c or k varies within a piece.

        Returns:
            Enthalpies at the starts of the pieces, the first unbounded (n,), J/m3; T (K) and theta
            (W/m) at H = 0 on the line of each piece (2, n); their slopes (2, n).
        """
        if self._quadratic:
            return None
        slopes = np.array([1.0 / self._c, self._k / self._c])
        return self._starts, np.array([self._t, self._theta]) - slopes * self._h, slopes

    def enthalpy(self, temperature: Array | float, side: Side = "right") -> Array:
        """H at `temperature` (K), J/m3; at an isothermal knot "right" selects the molten end."""
        t = np.asarray(temperature, float)
        i = np.clip(np.searchsorted(self._t, t, side=side) - 1, 0, len(self._t) - 1)
        ordinary = np.isfinite(self._c[i])
        s = np.where(ordinary, t - self._t[i], 0.0)
        c = np.where(ordinary, self._c[i], 0.0)
        return np.asarray(self._h[i] + s * (c + 0.5 * self._dc[i] * s))

    def conductivity(self, temperature: Array | float) -> Array:
        """Conductivity k at `temperature` (K), W/mK; at a jump the hotter side's value."""
        t = np.asarray(temperature, float)
        tt, _, k, dk = self._ordinary
        i = np.clip(np.searchsorted(tt, t, side="right") - 1, 0, len(tt) - 1)
        return np.asarray(k[i] + dk[i] * (t - tt[i]))

    @property
    def even(self) -> bool:
        """Whether the conductivity is constant."""
        k = self._k[np.isfinite(self._c)]
        return bool(np.ptp(k) == 0.0 and not self._dk.any())

    def conduction(self, temperature: Array | float) -> Array:
        """Theta at `temperature` (K), W/m."""
        t = np.asarray(temperature, float)
        tt, theta, k, dk = self._ordinary
        i = np.clip(np.searchsorted(tt, t, side="right") - 1, 0, len(tt) - 1)
        s = t - tt[i]
        return np.asarray(theta[i] + s * (k[i] + 0.5 * dk[i] * s))

    def temperature(self, conduction: Array | float) -> Array:
        """Temperature, K, at which theta equals `conduction`, W/m; the inverse of `conduction`."""
        given = np.asarray(conduction, float)
        tt, theta, k, dk = self._ordinary
        i = np.clip(np.searchsorted(theta, given, side="right") - 1, 0, len(tt) - 1)
        more = given - theta[i]
        root = np.sqrt(np.maximum(k[i] ** 2 + 2.0 * dk[i] * more, 0.0))
        return np.asarray(tt[i] + 2.0 * more / (k[i] + root))


def _resample(new: Array, old: Array, left: Array, right: Array) -> tuple[Array, Array]:
    """Left and right values on the pieces of `new`, a refinement of the pieces of `old`."""
    i = np.clip(np.searchsorted(old, new[:-1], side="right") - 1, 0, len(left) - 1)
    slope = (right - left) / np.diff(old)
    lo = left[i] + slope[i] * (new[:-1] - old[i])
    hi = left[i] + slope[i] * (new[1:] - old[i])
    return lo, hi
