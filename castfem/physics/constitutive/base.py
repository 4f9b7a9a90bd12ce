"""Interface of the constitutive laws: plain arrays with one row per quadrature point.

Symmetric tensors in generalized plane strain are Mandel vectors [xx, yy, zz, sqrt(2) xy]: the norm
of the tensor is that of the vector, and a tangent is an ordinary 4 x 4 matrix.  SI units: Pa, K, s.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.quantities import Kind
from castfem.base.types import Array, Flags, Indices

if TYPE_CHECKING:
    from castfem.physics.constitutive.elasticity import Elasticity


KINDS = ("colder", "hotter", "faster")


@dataclass(frozen=True, slots=True)
class DataRange:
    """Range of the data behind a law; outside it the law is an extrapolation."""

    temperature: tuple[float, float]  #: lowest and highest, K
    rate: tuple[float, float]  #: lowest and highest strain rate, 1/s

    def beyond(self, temperature: Array, rate: Array) -> dict[str, Flags]:
        """Flag points (n,) that are colder, hotter or strained faster than the data, by kind."""
        low, high = self.temperature
        return {
            "colder": temperature < low,
            "hotter": temperature > high,
            "faster": rate > self.rate[1],
        }

    def limit(self, kind: str) -> str:
        """Return the limit of the range for a kind, as text."""
        if kind == "faster":
            return f"{self.rate[1]:.3g} 1/s"
        return f"{self.temperature[kind == 'hotter'] - ZERO_CELSIUS:.4g} degC"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a law as a function of temperature, as given in a file."""

    kind: Kind  #: unit and bounds
    logarithmic: bool = False  #: whether its logarithm is linear between rows
    default: float | None = None  #: default; None if the parameter is required
    word: str = ""  #: word that may replace it, and is the default: the law then determines it


class Given(Protocol):
    """Content of a parameter file; errors are recorded, and faulty values replaced."""

    def curves(self, known: Mapping[str, Parameter]) -> dict[str, Any]:
        """Return the parameters over temperature; None for one that the law determines."""

    def numbers(self, known: Mapping[str, Kind]) -> dict[str, Any]:
        """Return the given single numbers."""

    def words(self, known: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
        """Return the given words, each from its allowed values."""

    def steel(self) -> tuple[float, Callable[[Array], Array]]:
        """Return carbon, wt%, and delta ferrite in the solid over temperature, of file or case."""


@dataclass(frozen=True, slots=True)
class MaterialStep:
    """Input of n points over one time step."""

    strain_increment: Array  #: total strain, Mandel, (n, 4)
    #: isotropic thermal strain, (n,); already 0 in the mushy zone and the liquid
    thermal_increment: Array
    temperature_old: Array  #: temperature at the start of the step, K, (n,)
    temperature: Array  #: temperature at the end of the step, K, (n,)
    dt: float  #: length of the step, s


@dataclass(frozen=True, slots=True)
class Response:
    """Response of a law; its arrays may be reused in the next call."""

    stress: Array  #: stress at the end of the step, Mandel, Pa, (n, 4)
    tangent: Array  #: d stress / d strain increment, consistent with the step, Pa, (n, 4, 4)
    state: Array  #: state variables at the end, (n, states)
    #: viscoplastic work over the step, J/m3, (n,), without the energy stored by a back stress; the
    #: caller decides how much of it becomes heat
    dissipation: Array
    flows: Flags  #: whether the point has flowed in this step, (n,)

    @classmethod
    def empty(cls, points: int, states: int) -> Response:
        """Return a response with uninitialised arrays."""
        return cls(
            np.empty((points, 4)),
            np.empty((points, 4, 4)),
            np.empty((points, states)),
            np.empty(points),
            np.empty(points, dtype=np.bool_),
        )

    def part(self, rows: slice | Indices) -> Response:
        """Return the response of some points; for a slice it shares the memory."""
        return Response(
            self.stress[rows],
            self.tangent[rows],
            self.state[rows],
            self.dissipation[rows],
            self.flows[rows],
        )


@dataclass(frozen=True, slots=True)
class StepChange:
    """Derivatives of the input of a step with respect to k parameters."""

    coefficients: Array  #: coefficients of the law (k, n, columns)
    strain: Array  #: total strain increment (k, n, 4)
    thermal: Array  #: thermal strain increment (k, n)
    stress_old: Array  #: stress at the start (k, n, 4), Pa
    state_old: Array  #: state at the start (k, n, states)
    dt: Array  #: length of the step (k,), s


@dataclass(frozen=True, slots=True)
class ResponseChange:
    """Derivatives of the response of a law with respect to k parameters."""

    stress: Array  #: (k, n, 4), Pa
    state: Array  #: (k, n, states)
    dissipation: Array  #: (k, n), J/m3

    @classmethod
    def empty(cls, ways: int, points: int, states: int) -> ResponseChange:
        """Return derivatives with uninitialised arrays."""
        many = ways, points
        return cls(np.empty((*many, 4)), np.empty((*many, states)), np.empty(many))

    def some(self, numbers: list[int] | slice) -> ResponseChange:
        """Return the derivatives with respect to some of the parameters."""
        return ResponseChange(self.stress[numbers], self.state[numbers], self.dissipation[numbers])


class Law(Protocol):
    """A constitutive law of an isotropic material."""

    @property
    def elasticity(self) -> Elasticity:
        """Elastic part; it alone gives the mean stress, since flow keeps the volume."""

    @property
    def data(self) -> DataRange | None:
        """Range of the data behind the law; None if unknown."""

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the state variables of a point, in the order of the columns."""

    @property
    def kind(self) -> int:
        """Number of the flow law in the compiled loop, see `kernel.constants`."""

    @property
    def signed(self) -> bool:
        """Whether hardening depends on the viscoplastic strain tensor."""

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric."""

    def strain(self, state: Array) -> Array:
        """Return the equivalent viscoplastic strain (n,) of states (n, states)."""

    def turned(self, state: Array, angle: Array) -> Array:
        """Return the state of material rotated by angles (n,), rad, like its stress."""

    def initial_state(self, points: int) -> Array:
        """Return the state of unstrained material, (n, states)."""

    def coefficients(self, temperature_old: Array, temperature: Array) -> Array:
        """Return the coefficients of the law for the temperatures of a step, (n, columns).

        They are constant over the Newton iterations of a step: computed once and passed to
        `integrate` each time.
        """

    def integrate(
        self,
        step: MaterialStep,
        stress_old: Array,
        state_old: Array,
        *,
        coefficients: Array | None = None,
        out: Response | None = None,
    ) -> Response:
        """Integrate the law over a step, fully implicitly.

        Args:
            step: Strain, temperature and time step.
            stress_old: Stress at the start of the step, (n, 4), Pa.
            state_old: State at the start of the step, (n, states).
            coefficients: From `coefficients`, for the temperatures of this step.
            out: Arrays to write to; new ones if left out. They must not share memory with
                `stress_old` and `state_old`.
        """

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
        """Return the derivatives of the response with respect to parameters of its input.

        Points keep flowing or stay elastic as in the step. The step is that of `integrate`,
        `change` the derivatives of all its input; new arrays are made if `out` is left out.
        """


def rotation(angle: float) -> Array:
    """Matrix (4, 4) that rotates a Mandel vector by `angle` [rad] about the casting direction."""
    c, s = np.cos(angle), np.sin(angle)
    r2 = np.sqrt(2.0)
    return np.array(
        [
            [c * c, s * s, 0.0, -r2 * s * c],
            [s * s, c * c, 0.0, r2 * s * c],
            [0.0, 0.0, 1.0, 0.0],
            [r2 * s * c, -r2 * s * c, 0.0, c * c - s * s],
        ]
    )


def turned(stress: Array, angle: Array) -> Array:
    """Mandel vectors (n, 4) rotated by angles (n,) about the casting direction."""
    c, s, r2 = np.cos(2.0 * angle), np.sin(2.0 * angle), np.sqrt(2.0)
    centre = 0.5 * (stress[:, 0] + stress[:, 1])
    half, shear = 0.5 * (stress[:, 0] - stress[:, 1]), stress[:, 3] / r2
    new, slant = c * half - s * shear, s * half + c * shear
    return np.column_stack([centre + new, centre - new, stress[:, 2], r2 * slant])


def equivalent_stress(stress: Array) -> Array:
    """Von Mises stress (120) of Mandel vectors (..., 4)."""
    mean = stress[..., :3].mean(axis=-1)
    deviator = stress.copy()
    deviator[..., :3] -= mean[..., None]
    return np.asarray(np.sqrt(1.5 * np.square(deviator).sum(axis=-1)))


def equivalent_strain(strain: Array) -> Array:
    """Von Mises strain sqrt(2/3 e:e) of the deviators of Mandel vectors (..., 4)."""
    return equivalent_stress(strain) * (2.0 / 3.0)
