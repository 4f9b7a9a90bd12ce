"""A steel: characteristic temperatures, and properties as vectorised functions of T, in SI.

A property that the set does not give (such as emissivity) raises InputError on use, so that a set
only needs the properties that its simulations need.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.materials import knots
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.materials.expansion import Expansion, without_transformation
from castfem.physics.materials.iron_carbon import Diagram, Side
from castfem.physics.materials.properties import Property
from castfem.physics.materials.solid_fraction import SolidFraction


@dataclass(frozen=True, slots=True)
class Origin:
    """Origin of a number."""

    law: str  #: form of the property: its value, "table", or the name of its formula
    source: str  #: reference
    status: str  #: F read in the source, M from memory of it, C computed, U the user's own


@dataclass(frozen=True, eq=False, slots=True)
class Steel:
    """One steel; made by `castfem.physics.materials.load_steel`.

    Temperatures are in K, of any shape; results have the same shape. Where a property jumps
    (isothermal freezing, peritectic) `side` selects the hotter ("above") or the colder ("below")
    state; "above" by default.
    """

    name: str  #: name of the set, or of its file
    description: str  #: description, one sentence
    solidus: float  #: solidus, K
    liquidus: float  #: liquidus, K
    #: heat of solidification, J/kg; for a steel defined by its enthalpy, the heat released from
    #: liquidus to solidus beyond the specific heat
    latent_heat: float
    #: density, specific_heat, conductivity, and optionally enthalpy, emissivity, youngs_modulus,
    #: poisson_ratio
    properties: Mapping[str, Property]
    fraction: SolidFraction  #: law of the solid fraction
    expansion: Expansion | None = None  #: law of the thermal contraction; None if there is none
    #: wt% by element; empty if not stated
    composition: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    diagram: Diagram | None = None  #: iron-carbon diagram; None without a composition
    #: source and status by property
    origins: Mapping[str, Origin] = field(default_factory=lambda: MappingProxyType({}))
    #: elements that were stated, but have no known effect
    left_out: tuple[str, ...] = ()

    def has(self, key: str) -> bool:
        """Whether the steel has the property `key` ("emissivity", "thermal_expansion" ...)."""
        return self.expansion is not None if key == "thermal_expansion" else key in self.properties

    def _missing(self, key: str) -> InputError:
        return InputError(
            f"{self.name}: {key}: this steel has none; add [{key}] to its file or override it"
        )

    def _law(self, key: str) -> Property:
        if key not in self.properties:
            raise self._missing(key)
        return self.properties[key]

    def _value(self, key: str, temperature: npt.ArrayLike, side: Side) -> Array:
        try:
            return self._law(key)(temperature, side)
        except ValueError as error:
            raise InputError(f"{self.name}: {key}: {error}") from None

    def density(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Density, kg/m3."""
        return self._value("density", temperature, side)

    def specific_heat(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Specific heat without latent heat, J/(kg K)."""
        return self._value("specific_heat", temperature, side)

    def conductivity(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Thermal conductivity, W/(m K)."""
        return self._value("conductivity", temperature, side)

    def emissivity(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Emissivity of the surface."""
        return self._value("emissivity", temperature, side)

    def youngs_modulus(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Young's modulus, Pa."""
        return self._value("youngs_modulus", temperature, side)

    def poisson_ratio(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Poisson's ratio of the solid."""
        return self._value("poisson_ratio", temperature, side)

    def solid_fraction(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Solid fraction, 1 below the solidus and 0 above the liquidus.

        With isothermal freezing, steel at its melting point within rounding of an interpolation
        counts as liquid.
        """
        if side == "above" and self.solidus == self.liquidus:
            temperature = np.asarray(temperature, float) + 1e-8
        return self.fraction(temperature, side)

    @property
    def liquid_density(self) -> float:
        """Density of the liquid slightly above the liquidus, for its pressure, kg/m3."""
        return float(self.density(self.liquidus + 1.0))

    def thermal_strain(self, temperature: npt.ArrayLike) -> Array:
        """Linear thermal strain since the solidus; 0 above it, negative in the shell."""
        if self.expansion is None:
            raise self._missing("thermal_expansion")
        t = np.asarray(temperature, float)
        solid = np.minimum(t, self.solidus)
        return np.where(t < self.solidus, self.expansion.strain(solid, self.solidus), 0.0)

    def transformation_strain(self, temperature: npt.ArrayLike) -> Array:
        """Part of `thermal_strain` from the transformation of delta ferrite to austenite.

        It is 0 above the solidus, and for a contraction that does not depend on the phases.
        """
        total = self.thermal_strain(temperature)
        assert self.expansion is not None
        solid = np.minimum(np.asarray(temperature, float), self.solidus)
        thermal = without_transformation(self.expansion, solid, self.solidus)
        return np.zeros_like(total) if thermal is None else total - thermal

    def thermal_expansion(self, temperature: npt.ArrayLike) -> Array:
        """Mean coefficient of thermal linear expansion since the solidus, 1/K.

        It is 0 in mushy zone and liquid. Within 1 mK of the solidus it is the limit there, to avoid
        0 over 0.
        """
        t = np.asarray(temperature, float)
        solid = np.minimum(t, self.solidus - 1e-3)
        return np.where(t < self.solidus, self.thermal_strain(solid) / (solid - self.solidus), 0.0)

    def breakpoints(self, lower: float, upper: float) -> Array:
        """Temperatures in [lower, upper] at which a property has a kink or a jump, increasing."""
        laws = (*self.properties.values(), self.fraction)
        kinks = [t for law in laws for t in law.kinks]
        kinks += [self.solidus, self.liquidus]
        if self.expansion is not None:
            kinks += self.expansion.kinks
        return knots.merged(kinks, self._jumps(), lower, upper)

    def _jumps(self) -> tuple[float, ...]:
        laws = (*self.properties.values(), self.fraction)
        return tuple(t for law in laws for t in law.jumps)

    def _transformation(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Enthalpy released beyond the specific heat, J/kg (simple sets)."""
        return self.latent_heat * (1.0 - self.fraction(temperature, side))

    def enthalpy_knots(
        self, lower: float, upper: float, poured: float | None = None
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Volumetric heat capacity in pieces, whose integral is the enthalpy density H (24).

        For a fixed section dH = rho(T) dh, with h the enthalpy per kilogram: rho is inside the
        integral. With a variable density a cell then does not keep its mass: H is the heat released
        by the volume, in each step with its present mass, and the mass drawn in by shrinkage brings
        no heat. By Harste's formulas the density of the solid changes by 1 % in 150 K.

        For a section that moves with its steel, H = rho(T) (h(T) - h(poured)) per volume at
        freezing: liquid and mushy zone are fed with steel as poured, solid keeps the mass at which
        it froze, that is the density at the solidus.

        Args:
            lower: First temperature, K.
            upper: Last temperature, K.
            poured: Temperature of the steel at the meniscus, K, if the section moves with its
                steel; otherwise None.

        Returns:
            T (n,), K; rho c at the left and the right end of each piece (n-1,), J/m3K; the part of
            the heat capacity that is constant on the piece (n-1,), J/m3K, which holds
            rho L (-dfs/dT) and what the linear rho c misses; heat absorbed at constant temperature
            at each knot (n,), J/m3.  The enthalpy is exact at every knot.

        Raises:
            InputError: A table does not cover the range and is refused beyond its ends.
        """
        self._check_span(("density", "specific_heat", "enthalpy"), lower, upper)
        density, heat = self._law("density"), self._law("specific_heat")
        law = self.properties.get("enthalpy")
        curved = not isinstance(density, Constant) or heat.curved or self.fraction.curved
        if isinstance(density, Constant):
            poured = None  # no difference between the two
        breaks = self._thermal_breakpoints(lower, upper)
        if poured is not None:
            breaks = knots.merged([poured], list(breaks), lower, upper)
        t = knots.grid(breaks, lower, upper, curved)
        points, width = knots.nodes(t), np.diff(t)
        rho = knots.one_sided(density, points)
        capacity = rho * knots.one_sided(heat, points)
        h = knots.one_sided(law or self._transformation, points)
        if poured is not None:
            per_mass = h if law else h + _integrated(knots.one_sided(heat, points), width)
            return self._of_mass(t, rho, per_mass, knots.one_sided(heat, points), poured)
        gain = knots.heat_of(rho, h - h[:, :1])
        if law is None:
            gain = gain + capacity @ knots.WEIGHTS * width
        rho_c_left, rho_c_right = capacity[:, 0], capacity[:, -1]
        latent = gain / width - 0.5 * (rho_c_left + rho_c_right)
        if not curved and law is None:
            latent = np.where(np.abs(latent) < 1e-12 * rho_c_left, 0.0, latent)
        return t, rho_c_left, rho_c_right, latent, self._isothermal(t)

    def _of_mass(
        self, t: Array, rho: Array, h: Array, heat: Array, poured: float
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Like `enthalpy_knots`, for steel that keeps its mass once it is solid.

        Args:
            t: Knots (n,), K.
            rho: Density at the points of the pieces (n-1, k), kg/m3.
            h: Enthalpy per mass there, with its own datum on each piece, J/kg.
            heat: Specific heat there, J/(kg K).
            poured: See `enthalpy_knots`, K.
        """
        rho = np.where(knots.nodes(t) > self.solidus, rho, self.density(self.solidus, "below"))
        law = self.properties.get("enthalpy", self._transformation)
        jump = np.where(np.isin(t, self._jumps()), law(t, "above") - law(t, "below"), 0.0)
        gain = h[:, -1] - h[:, 0]
        after = np.cumsum(jump) + np.concatenate([[0.0], np.cumsum(gain)])  # above each knot
        h0 = float(np.interp(poured, t, after))
        below, above = after - jump - h0, after - h0
        at_left, at_right = rho[:, 0] * above[:-1], rho[:, -1] * below[1:]
        left, right = rho[:, 0] * heat[:, 0], rho[:, -1] * heat[:, -1]
        constant = (at_right - at_left) / np.diff(t) - 0.5 * (left + right)
        from_above = np.concatenate([at_left, [rho[-1, -1] * above[-1]]])
        from_below = np.concatenate([[rho[0, 0] * below[0]], at_right])
        absorbed = from_above - from_below
        self._refuse_falling(t, at_right - at_left, absorbed, np.abs(from_above).max())
        return t, left, right, constant, np.maximum(absorbed, 0.0)

    def _refuse_falling(self, t: Array, on_pieces: Array, at_knots: Array, scale: float) -> None:
        """Refuse heat content (J/m3) that decreases with temperature, except for rounding."""
        least = -1e-9 * scale
        if on_pieces.min() >= least and at_knots.min() >= least:
            return
        piece, knot = int(np.argmin(on_pieces)), int(np.argmin(at_knots))
        first, last = (knot, knot) if at_knots[knot] < on_pieces[piece] else (piece, piece + 1)
        raise InputError(
            f"{self.name}: density: it rises so much from {t[first] - ZERO_CELSIUS:.6g} to "
            f"{t[last] - ZERO_CELSIUS:.6g} degC that warmer steel would contain less heat; "
            "correct the density, or set coupling.follow_shape = false"
        )

    def _isothermal(self, t: Array) -> Array:
        """Heat absorbed at each of the knots `t`, J/m3, with the mean of both densities there."""
        law = self.properties.get("enthalpy", self._transformation)
        rho = 0.5 * (self.density(t, "above") + self.density(t, "below"))
        return np.where(np.isin(t, self._jumps()), rho * (law(t, "above") - law(t, "below")), 0.0)

    def conductivity_knots(self, lower: float, upper: float) -> tuple[Array, Array, Array]:
        """Conductivity in linear pieces: T (n,), K, and k at both ends of each (n-1,), W/mK.

        Raises:
            InputError: As for `enthalpy_knots`.
        """
        self._check_span(("conductivity",), lower, upper)
        law = self._law("conductivity")
        t = knots.grid(knots.merged(law.kinks, law.jumps, lower, upper), lower, upper, law.curved)
        return t, law(t[:-1], "above"), law(t[1:], "below")

    def thermal_curve(
        self, lower: float, upper: float, datum: float | None = None, poured: float | None = None
    ) -> ThermalCurve:
        """Enthalpy, temperature and conduction as functions of each other, `lower` to `upper`.

        The enthalpy is zero at the temperature `datum` (K), see `ThermalCurve`; `poured` as for
        `enthalpy_knots`.
        """
        capacity = self.enthalpy_knots(lower, upper, poured)
        return ThermalCurve(capacity, self.conductivity_knots(lower, upper), datum)

    def _thermal_breakpoints(self, lower: float, upper: float) -> Array:
        """Breakpoints of the enthalpy alone."""
        laws = [self.properties[k] for k in ("density", "specific_heat", "enthalpy")
                if k in self.properties]  # fmt: skip
        kinks = [t for law in (*laws, self.fraction) for t in law.kinks]
        jumps = [t for law in (*laws, self.fraction) for t in law.jumps]
        return knots.merged(kinks, jumps, lower, upper)

    def _check_span(self, keys: tuple[str, ...], lower: float, upper: float) -> None:
        """Refuse a range of temperatures that a table does not cover."""
        if not lower < upper:
            raise ValueError(f"an interval of temperatures is needed, not {lower} to {upper} K")
        problems = []
        for key in keys:
            first, last = self.properties[key].span if key in self.properties else (0.0, np.inf)
            if lower < first or upper > last:
                problems.append(
                    f"{self.name}: {key}: the table covers {first - ZERO_CELSIUS:g} to "
                    f"{last - ZERO_CELSIUS:g} degC and refuses more; "
                    f"{lower - ZERO_CELSIUS:g} to {upper - ZERO_CELSIUS:g} degC is needed"
                )
        if problems:
            raise InputError(problems)


def _integrated(values: Array, width: Array) -> Array:
    """Integral of values at the points of pieces (n-1, k) over each piece, from start to end."""
    found = np.zeros_like(values)
    found[:, -1] = values @ knots.WEIGHTS * width
    return found
