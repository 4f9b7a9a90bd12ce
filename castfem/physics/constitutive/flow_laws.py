"""Base of all flow laws, and the laws without hardening, as input of the compiled kernel.

All flow is incompressible and along the stress deviator (von Mises), relative to a back stress if
there is one. p is the equivalent viscoplastic strain, q the equivalent stress; each class gives its
flow stress.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from castfem.base.quantities import Kind
from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.constitutive.base import (
    DataRange,
    Given,
    MaterialStep,
    Parameter,
    Response,
    ResponseChange,
    StepChange,
    turned,
)
from castfem.physics.constitutive.elasticity import Curve, Elasticity
from castfem.physics.constitutive.kernel import constants
from castfem.physics.constitutive.kernel.calling import integrate_points

STRAIN = "viscoplastic_strain"


FlowCurve = Callable[[Array, float], Array]
"""Stress, Pa, over total strain and strain rate, 1/s."""

_STRESS = Kind("Pa", "MPa", above=0.0, label="stress", sample="20 MPa")


@dataclass(frozen=True, slots=True)
class RadialReturn:
    """Base of the laws; `elasticity` is the first argument of each.

    Parameter files select a law by its `name`. It has `parameters` over temperature, single
    `numbers`, and `words` with their allowed values; each is an argument of the class with the same
    name.
    """

    elasticity: Elasticity
    data: DataRange | None = field(default=None, kw_only=True)
    """Range of the data behind the law; None if unknown."""

    laws: ClassVar[dict[str, type[RadialReturn]]] = {}
    """All laws by their names in parameter files."""
    name: ClassVar[str] = ""
    parameters: ClassVar[Mapping[str, Parameter]] = {}
    numbers: ClassVar[Mapping[str, Kind]] = {}
    words: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    kind: ClassVar[int] = constants.ELASTIC

    def __init_subclass__(cls) -> None:
        """Register a law under its name."""
        if "name" in vars(cls):
            RadialReturn.laws[cls.name] = cls

    @classmethod
    def from_parameters(cls, elasticity: Elasticity, given: Given) -> Self:
        """Return the law of a parameter file."""
        return cls(
            elasticity, **given.curves(cls.parameters), **given.numbers(cls.numbers),
            **given.words(cls.words),
        )  # fmt: skip

    def given_curve(self, name: str) -> Curve | None:
        """Return the curve of one of its `parameters`; None if it has no such curve."""
        found = getattr(self, name, None) if name in self.parameters else None
        return found if callable(found) else None

    def with_curve(self, name: str, curve: Curve) -> Self:
        """Return the law with one of its `parameters` replaced by another curve."""
        changed: dict[str, Any] = {name: curve}
        return replace(self, **changed)

    def flow_curve(self, temperature: float) -> FlowCurve | None:
        """Return the stress curve of flow at a constant rate and a temperature, K.

        None for a law without a closed form of it.
        """
        return None

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the state variables."""
        return (STRAIN,)

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric."""
        return not self.signed

    @property
    def signed(self) -> bool:
        """Whether the state begins with the viscoplastic strain tensor instead of p."""
        return False

    def strain(self, state: Array) -> Array:
        """Equivalent viscoplastic strain (n,) of states (n, states), reduced by recovery."""
        if not self.state_names:
            return np.zeros(len(state))
        if not self.signed:
            return np.asarray(state[:, 0])
        xx, yy, xy = state[:, :3].T
        square = xx * xx + yy * yy + (xx + yy) ** 2 + xy * xy
        return np.asarray(np.sqrt(2.0 / 3.0 * square))

    def turned(self, state: Array, angle: Array) -> Array:
        """The state of material rotated by angles (n,) about the casting direction."""
        if not self.signed:
            return state
        xx, yy, xy = state[:, :3].T
        new = state.copy()
        new[:, :3] = turned(np.column_stack([xx, yy, -(xx + yy), xy]), angle)[:, (0, 1, 3)]
        return new

    def fading(self, temperature: Array) -> Array:
        """Rate of recovery of the strain, 1/s."""
        return np.zeros_like(temperature)

    def initial_state(self, points: int) -> Array:
        """Return the state of unstrained material, (n, states)."""
        return np.zeros((points, len(self.state_names)))

    def own_columns(self, temperature: Array) -> list[Array]:
        """Return the columns (n,) that `kind` needs, at temperatures up to the solidus."""
        return []

    def weakened(self, columns: list[Array], strength: Array) -> list[Array]:
        """Return `own_columns` of a material with its flow stress multiplied by `strength` (n,)."""
        return columns

    def coefficients(self, temperature_old: Array, temperature: Array) -> Array:
        """Return the table of coefficients of a step, (n, columns), see `base.Law`.

        Flow is evaluated at the temperature at the end of the step, as in the thesis; for a
        skeleton at the mean of both ends. This makes the deformation of the shell under the
        pressure of the liquid second-order accurate: steel that has cooled, and changed from delta
        ferrite to austenite, within the step flows an order of magnitude more slowly at its end.
        Only a yield stress limits the stress at the end of the step.
        """
        columns = self.elasticity.coefficients(temperature_old, temperature)
        solidus = self.elasticity.solidity.solidus
        solid = np.minimum(temperature, solidus)
        if self.elasticity.solidity.is_skeleton and self.kind != constants.PLASTIC:
            solid = 0.5 * (solid + np.minimum(temperature_old, solidus))
        own = self.own_columns(solid)
        needed = constants.LAST[self.kind] + 1 - constants.OWN
        if len(own) != needed:  # the compiled kernel would read out of bounds
            raise TypeError(
                f"{type(self).__name__}.own_columns returns {len(own)} columns, its kind of flow "
                f"takes {needed}"
            )
        if self.elasticity.solidity.is_skeleton:
            own = self.weakened(own, self.elasticity.solidity.strength(temperature))
        columns += [self.fading(solid), *own]
        table = np.empty((len(temperature), len(columns)))
        for column, values in enumerate(columns):
            table[:, column] = values
        return table

    def integrate(
        self,
        step: MaterialStep,
        stress_old: Array,
        state_old: Array,
        *,
        coefficients: Array | None = None,
        out: Response | None = None,
    ) -> Response:
        """Integrate over a step, see `castfem.physics.constitutive.base.Law`."""
        if not step.dt > 0.0:
            raise ValueError(f"a time step must be positive, not {step.dt} s")
        if coefficients is None:
            coefficients = self.coefficients(step.temperature_old, step.temperature)
        if out is None:
            out = Response.empty(len(stress_old), len(self.state_names))
        integrate_points(
            self.kind, self.signed, coefficients,
            step.strain_increment, step.thermal_increment, stress_old, state_old, float(step.dt),
            out.stress, out.tangent, out.state, out.dissipation, out.flows,
        )  # fmt: skip
        return out

    def differentiate(
        self,
        step: MaterialStep,
        stress_old: Array,
        state_old: Array,
        change: StepChange,
        *,
        coefficients: Array | None = None,
        out: ResponseChange | None = None,
    ) -> ResponseChange:
        """Return how the answer changes, see `castfem.physics.constitutive.base.Law`."""
        from castfem.physics.constitutive.kernel.loop import differentiate_points

        if coefficients is None:
            coefficients = self.coefficients(step.temperature_old, step.temperature)
        if out is None:
            out = ResponseChange.empty(len(change.dt), len(stress_old), len(self.state_names))
        differentiate_points(
            self.kind, self.signed, coefficients,
            step.strain_increment, step.thermal_increment, stress_old, state_old, float(step.dt),
            change.coefficients, change.strain, change.thermal, change.stress_old,
            change.state_old, change.dt, out.stress, out.state, out.dissipation,
        )  # fmt: skip
        return out


@dataclass(frozen=True, slots=True)
class ThermoElastic(RadialReturn):
    """Hooke's law with temperature-dependent moduli (94)."""

    name: ClassVar[str] = "thermo_elastic"

    def flow_curve(self, temperature: float) -> FlowCurve | None:
        """See `RadialReturn.flow_curve`: it never flows."""
        return lambda strain, rate: np.full_like(strain, np.inf)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the state variables: none."""
        return ()


@dataclass(frozen=True, slots=True)
class PerfectlyPlastic(RadialReturn):
    """Perfectly plastic: q <= yield stress(T) at any rate."""

    yield_stress: Curve  #: yield stress over temperature in K, Pa

    name: ClassVar[str] = "perfectly_plastic"
    parameters: ClassVar[Mapping[str, Parameter]] = {"yield_stress": Parameter(_STRESS)}
    kind: ClassVar[int] = constants.PLASTIC

    def flow_curve(self, temperature: float) -> FlowCurve | None:
        """See `RadialReturn.flow_curve`."""
        limit = float(self.yield_stress(np.full(1, temperature))[0])
        return lambda strain, rate: np.full_like(strain, limit)

    def own_columns(self, temperature: Array) -> list[Array]:
        """See `RadialReturn.own_columns`."""
        limit = self.yield_stress(temperature)
        require(np.all(limit > 0.0), "the yield stress must be positive", limit)
        return [limit]

    def weakened(self, columns: list[Array], strength: Array) -> list[Array]:
        """See `RadialReturn.weakened`."""
        (limit,) = columns
        return [strength * limit]


@dataclass(frozen=True, slots=True)
class _LnFactor:
    """ln A from the creep rate at a stress."""

    stress: Curve
    rate: Curve
    exponent: Curve

    def __call__(self, temperature: Array) -> Array:
        ln_stress = np.log(self.stress(temperature))
        return np.asarray(np.log(self.rate(temperature)) - self.exponent(temperature) * ln_stress)


@dataclass(frozen=True, slots=True)
class NortonCreep(RadialReturn):
    """dp/dt = A q^n."""

    ln_factor: Curve  #: ln A over temperature in K, with A the creep rate [1/s] at q = 1 Pa
    exponent: Curve  #: n over temperature

    name: ClassVar[str] = "norton_creep"
    parameters: ClassVar[Mapping[str, Parameter]] = {
        "stress": Parameter(_STRESS, logarithmic=True),
        "rate": Parameter(Kind("1/s", "1/s", above=0.0), logarithmic=True),
        "exponent": Parameter(Kind("1", above=0.0, label="creep exponent", sample="5")),
    }
    kind: ClassVar[int] = constants.CREEP

    @classmethod
    def from_parameters(cls, elasticity: Elasticity, given: Given) -> Self:
        """See `RadialReturn.from_parameters`; a file gives the creep rate at a stress."""
        return cls.at_stress(elasticity, **given.curves(cls.parameters))

    @classmethod
    def constant(cls, elasticity: Elasticity, rate: float, stress: float, exponent: float) -> Self:
        """Return a law with creep rate `rate` [1/s] at `stress` [Pa], at all temperatures."""
        return cls.at_stress(elasticity, Constant(stress), Constant(rate), Constant(exponent))

    @classmethod
    def at_stress(cls, elasticity: Elasticity, stress: Curve, rate: Curve, exponent: Curve) -> Self:
        """Return a law with creep rate `rate` [1/s] at `stress` [Pa], each over temperature, K."""
        return cls(elasticity, _LnFactor(stress, rate, exponent), exponent)

    def given_curve(self, name: str) -> Curve | None:
        """See `RadialReturn.given_curve`; also rate and stress, if the law was made from them."""
        holder = self if name == "exponent" else self.ln_factor
        found = getattr(holder, name, None) if name in self.parameters else None
        return found if callable(found) else None

    def with_curve(self, name: str, curve: Curve) -> Self:
        """See `RadialReturn.with_curve`; another exponent keeps the creep rate at its stress."""
        changed: dict[str, Any] = {name: curve}
        if not isinstance(self.ln_factor, _LnFactor):
            return replace(self, **changed)
        factor = replace(self.ln_factor, **changed)
        return replace(self, ln_factor=factor, exponent=factor.exponent)

    def own_columns(self, temperature: Array) -> list[Array]:
        """See `RadialReturn.own_columns`."""
        n = self.exponent(temperature)
        require(np.all(n > 0.0), "the creep exponent must be positive", n)
        return [self.ln_factor(temperature), n]

    def weakened(self, columns: list[Array], strength: Array) -> list[Array]:
        """See `RadialReturn.weakened`."""
        ln_factor, n = columns
        return [ln_factor - n * np.log(strength), n]


def require(fine: np.bool_ | bool, text: str, values: Array) -> None:
    """Refuse invalid values of a parameter over temperature.

    Raises:
        ValueError: Some values are not fine.
    """
    if not fine:
        raise ValueError(f"{text} at every temperature (found {np.min(values):g})")
