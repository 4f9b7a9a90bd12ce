"""Laws with strain hardening: the modified Norton-Hoff law and the unified law of steel.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self

import numpy as np

from castfem.base.quantities import Kind
from castfem.base.types import Array
from castfem.physics.constitutive.base import Given, Parameter
from castfem.physics.constitutive.elasticity import Curve, Elasticity
from castfem.physics.constitutive.flow_curves import Austenite, DeltaFerrite, modified_norton_hoff
from castfem.physics.constitutive.flow_laws import STRAIN, FlowCurve, RadialReturn, require
from castfem.physics.constitutive.kernel import constants

RATE = "flow_curve_rate"
TENSOR = tuple(f"{STRAIN}_{component}" for component in ("xx", "yy", "xy"))  # xy times sqrt(2)
LEAST_RATE_EXPONENT = 1e-3

_SHARE = Kind("1", least=0.0, most=1.0, label="share", sample="0.1")
_RECOVERY = Parameter(
    Kind("s", "s", above=0.0, label="recovery time", sample="100 s"), logarithmic=True, word="none"
)


@dataclass(frozen=True, slots=True)
class Hardening(RadialReturn):
    """Base of laws with strain hardening: the hardening variable, and its recovery.

    Accumulated: by p, which decreases only by recovery; a reversed load meets the hardened curve.
    Signed: by the viscoplastic strain tensor E, with e = sqrt(2/3) E:n its part along the flow n.
    Where strain is a factor (Norton-Hoff, delta ferrite) a negative e counts as zero; where it adds
    (austenite) the hardening part is a back stress X along E, with the magnitude of Kozlowski's at
    the equivalent strain of E, and flow is along the deviator of stress minus X. In tension and
    compression this is Kozlowski's law with its signed strain.
    """

    #: hardening variable
    hardening: Literal["accumulated", "signed"] = field(default="accumulated", kw_only=True)
    #: tau over temperature in K, s, of dp = dp_vp - p/tau dt and dE = dE_vp - E/tau dt; None
    #: without recovery
    recovery_time: Curve | None = field(default=None, kw_only=True)

    parameters: ClassVar[Mapping[str, Parameter]] = {"recovery_time": _RECOVERY}
    words: ClassVar[Mapping[str, tuple[str, ...]]] = {"hardening": ("accumulated", "signed")}

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the viscoplastic strain: accumulated, or xx, yy and sqrt(2) xy of the tensor."""
        return TENSOR if self.signed else (STRAIN,)

    @property
    def signed(self) -> bool:
        """Whether the state begins with the viscoplastic strain tensor instead of p."""
        return self.hardening == "signed"

    def fading(self, temperature: Array) -> Array:
        """1/tau, 1/s."""
        if self.recovery_time is None:
            return np.zeros_like(temperature)
        time = self.recovery_time(temperature)
        require(np.all(time > 0.0), "the recovery time must be positive", time)
        return np.asarray(1.0 / time)


@dataclass(frozen=True, slots=True)
class NortonHoff(Hardening):
    """The modified Norton-Hoff law (163), with an automatic or a given yield limit.

        q = C(e, r; T) = K0 p2 sqrt3 exp(-p1 e) (sqrt3 r)^p3 e^p4,    e = p + q/E.

    e is the total equivalent strain: in uniaxial tension the axial mechanical strain, so that the
    curve is reached where the elastic line q = E e crosses it (207)-(212). The rate r depends on
    `yield_limit`:

    None (automatic). r is a state variable and follows the rate of e,

        p3 q dr/r = E (de - r dt)                                              (*)

    where a decreasing e counts as 0 while the point flows and as its magnitude while it is elastic;
    a point without stress takes r = |de/dt|. The point flows when q would exceed C(e, r), and then
    q = C(e, r). At constant rate r = de/dt from the first step on: elastic up to the crossing, on
    the curve after it, through softening and after unloading, exactly and for any step size. At
    constant e (*) is the relaxation of the viscous law dp/dt = r, at constant q its creep. The
    length of the memory, a strain of p3 q/E, just prevents a point from responding to a change of
    rate more stiffly than an elastic one.

    A yield stress over temperature. Elastic below it; above it the viscous law, r = dp/dt, but flow
    does not reduce q below the yield stress. 0 everywhere is the purely viscous law (170).
    """

    strength: Curve  #: K0 p2 over temperature in K, Pa (s^p3)
    p1: Curve  #: softening over temperature; any sign
    p3: Curve  #: exponent of the rate, over temperature, at least 0.001
    p4: Curve  #: exponent of the strain, over temperature
    #: yield limit over temperature, Pa; None to determine it automatically
    yield_limit: Curve | None = None
    largest_strain: float = 2.0  #: e beyond which the curve is constant

    name: ClassVar[str] = "norton_hoff"
    parameters: ClassVar[Mapping[str, Parameter]] = {
        **Hardening.parameters,
        "strength": Parameter(
            Kind("Pa", "MPa", above=0.0, label="strength K0 p2", sample="40 MPa"), logarithmic=True
        ),
        "p1": Parameter(Kind("1", label="softening", sample="0"), default=0.0),
        "p3": Parameter(
            Kind("1", least=LEAST_RATE_EXPONENT, most=1.0, label="rate exponent", sample="0.13")
        ),
        "p4": Parameter(Kind("1", most=0.99, label="strain exponent", sample="0.15"), default=0.0),
        "yield_limit": Parameter(
            Kind("Pa", "MPa", least=0.0, label="yield limit", sample="5 MPa"), word="automatic"
        ),
    }

    def flow_curve(self, temperature: float) -> FlowCurve | None:
        """See `RadialReturn.flow_curve`: (163), if the yield limit is found automatically."""
        if self.yield_limit is not None:
            return None
        t, most = np.full(1, temperature), self.largest_strain
        strength, p1, p3, p4 = (float(f(t)[0]) for f in (self.strength, self.p1, self.p3, self.p4))

        def curve(strain: Array, rate: float) -> Array:
            with np.errstate(divide="ignore"):
                return modified_norton_hoff(np.minimum(strain, most), rate, strength, p1, p3, p4)

        return curve

    @property
    def kind(self) -> int:  # type: ignore[override]
        """Number of the branch of the kernel."""
        return constants.CURVE_AUTOMATIC if self.yield_limit is None else constants.CURVE_GIVEN

    @property
    def state_names(self) -> tuple[str, ...]:
        """Viscoplastic strain, and with an automatic yield limit the rate variable in 1/s."""
        strain = TENSOR if self.signed else (STRAIN,)
        return (*strain, RATE) if self.yield_limit is None else strain

    def own_columns(self, temperature: Array) -> list[Array]:
        """See `RadialReturn.own_columns`."""
        strength, exponent = self.strength(temperature), self.p3(temperature)
        require(np.all(strength > 0.0), "the strength K0 p2 must be positive", strength)
        least = LEAST_RATE_EXPONENT
        require(np.all(exponent >= least), f"p3 must be at least {least}", exponent)
        limit = np.zeros_like(temperature)
        if self.yield_limit is not None:
            limit = self.yield_limit(temperature)
            require(np.all(limit >= 0.0), "the yield limit must not be negative", limit)
        return [
            np.log(strength) + constants.LN_SQRT3,
            self.p1(temperature),
            exponent,
            self.p4(temperature),
            limit,
            np.full_like(temperature, self.largest_strain),
        ]

    def weakened(self, columns: list[Array], strength: Array) -> list[Array]:
        """See `RadialReturn.weakened`."""
        ln_level, p1, p3, p4, limit, largest = columns
        return [ln_level + np.log(strength), p1, p3, p4, strength * limit, largest]


@dataclass(frozen=True, slots=True)
class UnifiedSteel(Hardening):
    """Kozlowski's model III for austenite and Zhu's power law for delta ferrite.

    Austenite: q = f1 p^f2 + (dp/dt / c)^(1/f3); delta ferrite: q = d (1 + 1000 p)^m (dp/dt)^(1/n).
    The fraction of delta ferrite in the solid selects the law: delta above `threshold`, austenite
    below. With a `blend` the two flow stresses are averaged (equal strain in both phases), and the
    weight of delta rises linearly from 0 to 1 between the fractions threshold - blend/2 and
    threshold + blend/2: a threshold of 0.5 with a blend of 1 mixes them by their fractions.

    With accumulated `hardening` p never decreases, and a reversed load meets the hardened curve;
    signed, f1 p^f2 is a back stress along the strain tensor, which assists a reversed load.
    """

    carbon: float  #: carbon content, wt%
    #: delta ferrite in the solid over temperature in K, 0 to 1
    delta_share: Callable[[Array], Array]
    threshold: float = 0.1  #: threshold of the fraction of delta ferrite
    blend: float = 0.0  #: width of the transition in the fraction; 0 for a switch
    #: temperature below which the coefficients are constant, K (the data end at 900 degC; the
    #: default keeps the extrapolation within the physical range)
    coldest: float = 973.15

    name: ClassVar[str] = "unified_steel"
    numbers: ClassVar[Mapping[str, Kind]] = {
        "threshold": _SHARE,
        "blend": _SHARE,
        "coldest": Kind("K", "degC"),
    }
    kind: ClassVar[int] = constants.STEEL

    @classmethod
    def from_parameters(cls, elasticity: Elasticity, given: Given) -> Self:
        """See `RadialReturn.from_parameters`; it depends on the carbon content of the steel."""
        carbon, delta_share = given.steel()
        more: dict[str, Any] = {**given.numbers(cls.numbers), **given.words(cls.words)}
        more |= given.curves(cls.parameters)
        return cls(elasticity, carbon=carbon, delta_share=delta_share, **more)

    def delta_weight(self, temperature: Array) -> Array:
        """Weight of the delta-ferrite law, 0 to 1."""
        share = self.delta_share(temperature)
        if self.blend <= 0.0:
            return np.where(share > self.threshold, 1.0, 0.0)
        return np.clip((share - self.threshold) / self.blend + 0.5, 0.0, 1.0)

    def own_columns(self, temperature: Array) -> list[Array]:
        """See `RadialReturn.own_columns`."""
        t = np.maximum(temperature, self.coldest)
        gamma = Austenite.at(t, self.carbon)
        delta = DeltaFerrite.at(t, self.carbon)
        return [
            gamma.hardening,
            gamma.hardening_exponent,
            gamma.ln_rate,
            gamma.stress_exponent,
            delta.ln_level,
            delta.hardening,
            delta.stress_exponent,
            self.delta_weight(temperature),
        ]

    def weakened(self, columns: list[Array], strength: Array) -> list[Array]:
        """See `RadialReturn.weakened`."""
        hardening, m, ln_rate, exponent, ln_level, *delta = columns
        ln_strength = np.log(strength)
        return [
            strength * hardening, m, ln_rate - exponent * ln_strength, exponent,
            ln_level + ln_strength, *delta,
        ]  # fmt: skip
