"""Temperature-dependent Hooke's law over a step, from cold solid to liquid.

Trial stress of a step from A to B, thesis (82), (93), (94):

    deviator  (G_B/G_A) s_A  + 2 G_B de,        mean  (K_B/K_A) m_A + 3 K_B (de_m - dth),

that is, the elastic strain that belongs to the stress at A is kept while the moduli change.

Liquid is the limiting case: Poisson's ratio 0, a small fraction of the stiffness of the solid
(thesis V.1.6; the caller sets its thermal strain to 0). As this is a substitute for a liquid,

* the small stress of a point before it is coherent is an artefact of that stiffness. Keeping its
  *elastic strain* while the stiffness rises up to 1e6-fold on freezing would turn 1 kPa into 1 GPa.
  Fed liquid has no memory: a point that is not coherent solid at the start of a step starts without
  stress. If liquid is an elastic body (`memory`) its *stress* is kept (ratio 1); where the
  stiffness falls, the smaller of the two is kept (melting releases stress).
* a point that freezes within a step is strained only from then on. Its strain increment and its
  time are multiplied by the part of the step in which it is coherent (temperature linear over the
  step), so that the stress of new shell does not depend on where the steps end.

The crystals of the mushy zone touch above a solid fraction of about 0.75 and form a skeleton. With
`mushy_zone="skeleton"` it obeys the law of the solid at the solidus with Young's modulus, Poisson's
ratio and flow stress multiplied by

    w = (fs - fc) / (1 - fc),    fc the coherency,                                             (S)

(the flow stress by at least 0.01), and keeps its stress like solid, so that the stress does not
depend on the time step. Crystals are free of stress when they join: above the solidus the stress is
kept, not the elastic strain.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Protocol, get_args

import numpy as np

from castfem.base.errors import choices
from castfem.base.tables import Constant
from castfem.base.types import Array, MushyZone

Curve = Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class FreezingLimits:
    """Limits of the properties of steel that freezes."""

    # least flow stress of a skeleton over that of the solid: with none cells would fold
    strength: float = 0.01
    share: float = 1e-6  # least share of a step, for a point that freezes at the end of it
    poisson: float = 0.4999  # largest Poisson's ratio
    widest: float = 1000.0  # K: no steel freezes over a wider range
    halvings: int = 60  # bisections of that range, down to rounding
    melting: float = 1e-8  # K below a melting point within which steel is still at it


LIMITS = FreezingLimits()


class Freezing(Protocol):
    """Properties of a steel that the elastic law needs (see `castfem.physics.materials.Steel`)."""

    @property
    def solidus(self) -> float:
        """Solidus, K."""

    def solid_fraction(self, temperature: Array) -> Array:
        """Solid fraction, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Solidity:
    """Degree of solidity of a point: solid, mushy or liquid.

    Raises:
        ValueError: A number is out of range.
    """

    solidus: float = np.inf  #: temperature below which steel is coherent solid, K
    #: solid fraction over temperature in K; None if nothing is ever liquid
    fraction: Curve | None = None
    stiffness_ratio: float = 1e-5  #: Young's modulus of the liquid over that of the solid
    #: interpolation of Young's modulus in between: geometric or linear in the solid fraction;
    #: "none": the mushy zone is as soft as the liquid down to the solidus; "skeleton": Young's
    #: modulus, Poisson's ratio and flow stress are those of the solid times (S)
    mushy_zone: MushyZone = "geometric"
    coherency: float = 0.0  #: solid fraction below which the mushy zone is as soft as the liquid
    #: whether the strain of a step counts only from the moment of freezing
    from_freezing: bool = True
    #: whether material that is not solid keeps its stress from one step to the next
    memory: bool = True
    #: temperature below which steel always keeps its stress, K: the solidus, or that at which the
    #: crystals of a skeleton begin to touch
    coherent: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.stiffness_ratio <= 1.0:
            raise ValueError(f"stiffness_ratio ({self.stiffness_ratio}) must be within 0 ... 1")
        if not 0.0 <= self.coherency < 1.0:
            raise ValueError(f"coherency ({self.coherency}) must be at least 0 and below 1")
        if self.mushy_zone not in get_args(MushyZone):
            raise ValueError(
                f'mushy_zone ("{self.mushy_zone}") must be {choices(get_args(MushyZone))}'
            )
        object.__setattr__(self, "coherent", self._coherent())

    def _coherent(self) -> float:
        """The temperature `coherent`, from the solid fraction by bisection."""
        if not self.is_skeleton:
            return self.solidus
        low, high = self.solidus, self.solidus + LIMITS.widest
        for _ in range(LIMITS.halvings):
            middle = 0.5 * (low + high)
            if self.weight(np.array([middle]))[0] > 0.0:
                low = middle
            else:
                high = middle
        return low

    @classmethod
    def between(cls, solidus: float, liquidus: float, **options: object) -> Solidity:
        """Return a solid fraction linear from `solidus` to `liquidus`, K (12)."""
        width = max(liquidus - solidus, 1e-9)

        def fraction(temperature: Array) -> Array:
            return np.clip((liquidus - temperature) / width, 0.0, 1.0)

        return cls(solidus, fraction, **options)  # type: ignore[arg-type]

    @classmethod
    def of(cls, steel: Freezing, **options: object) -> Solidity:
        """Return solidus and solid fraction of a steel.

        Steel that freezes at one temperature stays there until its latent heat is gone: it is
        coherent below that temperature by more than rounding of interpolated values.
        """
        solidus = steel.solidus
        molten = float(np.asarray(steel.solid_fraction(np.array([solidus])))[0]) < 1.0
        return cls(solidus - LIMITS.melting * molten, steel.solid_fraction, **options)  # type: ignore[arg-type]

    def weight(self, temperature: Array) -> Array:
        """1 where coherent solid, 0 where liquid, interpolated by solid fraction in between."""
        if self.fraction is None:
            return np.ones_like(temperature)
        if self.mushy_zone == "none":
            return np.where(temperature <= self.solidus, 1.0, 0.0)
        solid = (self.fraction(temperature) - self.coherency) / (1.0 - self.coherency)
        return np.where(temperature <= self.solidus, 1.0, np.clip(solid, 0.0, 1.0))

    @property
    def is_skeleton(self) -> bool:
        """Whether the mushy zone flows like the solid, at a lower stress."""
        return self.mushy_zone == "skeleton" and self.fraction is not None

    def strength(self, temperature: Array) -> Array:
        """Flow stress over that of the solid at the solidus (n,), (S); 1 without a skeleton."""
        if not self.is_skeleton:
            return np.ones_like(temperature)
        return np.maximum(self.weight(temperature), LIMITS.strength)

    def stiffness(self, weight: Array) -> Array:
        """Young's modulus relative to that of the solid."""
        if self.mushy_zone == "skeleton":
            return np.maximum(weight, self.stiffness_ratio)
        if self.mushy_zone == "linear":
            return np.asarray(self.stiffness_ratio + (1.0 - self.stiffness_ratio) * weight)
        return np.asarray(self.stiffness_ratio ** (1.0 - weight))

    def share(self, temperature_old: Array, temperature: Array) -> Array:
        """Fraction of the step in which a freezing point is coherent; 1 for all others."""
        coherent = self.coherent
        freezes = (temperature_old > coherent) & (temperature <= coherent)
        if not self.from_freezing or not freezes.any():
            return np.ones_like(temperature)
        drop = np.where(freezes, temperature_old - temperature, 1.0)
        part = (coherent - temperature) / drop if np.isfinite(coherent) else 1.0
        return np.where(freezes, np.maximum(part, LIMITS.share), 1.0)


@dataclass(frozen=True, slots=True)
class Elasticity:
    """Isotropic elasticity as a function of temperature."""

    young: Curve  #: Young's modulus of the solid over temperature in K, Pa
    poisson: Curve  #: Poisson's ratio of the solid over temperature
    #: where it is solid, and the stiffness elsewhere
    solidity: Solidity = field(default_factory=Solidity)

    @classmethod
    def constant(cls, young: float, poisson: float, solidity: Solidity | None = None) -> Elasticity:
        """Return constant moduli: Pa, dimensionless."""
        return cls(Constant(young), Constant(poisson), solidity or Solidity())

    def moduli(self, temperature: Array) -> tuple[Array, Array, Array]:
        """Shear, bulk and Young's modulus, Pa, each (n,), also in the liquid.

        Raises:
            ValueError: A modulus is not positive, or a Poisson's ratio not within (-1, 0.5).
        """
        weight = self.solidity.weight(temperature)
        # Above the solidus the modulus of the solid is taken as at the solidus.
        solid = np.minimum(temperature, self.solidity.solidus)
        young = self.young(solid) * self.solidity.stiffness(weight)
        poisson = np.minimum(self.poisson(solid), LIMITS.poisson) * weight
        if not (np.all(young > 0.0) and np.all(poisson > -1.0) and np.all(np.isfinite(young))):
            raise ValueError(
                f"Young's modulus must be positive (least: {np.min(young):g} Pa) and Poisson's "
                f"ratio within (-1, 0.5) (least: {np.min(poisson):g})"
            )
        return 0.5 * young / (1.0 + poisson), young / (3.0 * (1.0 - 2.0 * poisson)), young

    def coefficients(self, temperature_old: Array, temperature: Array) -> list[Array]:
        """Columns SHEAR ... FRESH of `kernel.constants` for a step, each (n,).

        A skeleton that stiffens is strained with its mean moduli over the time in which it is
        coherent, since it keeps the stress it had while it was softer; solid and softening material
        keeps its elastic strain.
        """
        shear_old, bulk_old, young_old = self.moduli(temperature_old)
        shear, bulk, young = self.moduli(temperature)
        carry_deviator, carry_mean = shear / shear_old, bulk / bulk_old
        forgets = (temperature_old > self.solidity.coherent) & (not self.solidity.memory)
        solid = temperature_old <= self.solidity.solidus
        most = np.where(solid, np.inf, np.where(forgets, 0.0, 1.0))
        carry_deviator = np.minimum(carry_deviator, most)
        carry_mean = np.minimum(carry_mean, most)
        share = self.solidity.share(temperature_old, temperature)
        unhardened = (temperature_old > self.solidity.solidus).astype(float)
        if self.solidity.is_skeleton:
            stiffens = np.flatnonzero(~solid & (young > young_old))
            mean = self._mean_moduli(temperature_old[stiffens], temperature[stiffens])
            for modulus, while_growing in zip((shear, bulk, young), mean, strict=True):
                modulus[stiffens] = while_growing
        return [shear, bulk, young, carry_deviator, carry_mean, share, unhardened]

    def _mean_moduli(self, temperature_old: Array, temperature: Array) -> Iterator[Array]:
        """Moduli, each (n,), averaged over the coherent part of a step of uniform cooling."""
        start = np.maximum(np.minimum(temperature_old, self.solidity.coherent), temperature)
        least = np.maximum(temperature, self.solidity.solidus)
        mushy = (start - least) / np.maximum(start - temperature, np.finfo(float).tiny)
        at = (self.moduli(one) for one in (start, least, temperature))
        for first, last, end in zip(*at, strict=True):
            yield mushy * 0.5 * (first + last) + (1.0 - mushy) * end
