"""What every constitutive law takes and gives: plain arrays, one row a quadrature point.

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
    """The conditions that the data behind a law cover; beyond them it is an extrapolation."""

    temperature: tuple[float, float]  #: lowest and highest, K
    rate: tuple[float, float]  #: lowest and highest strain rate, 1/s

    def beyond(self, temperature: Array, rate: Array) -> dict[str, Flags]:
        """Which points (n,) are colder, hotter or strained faster than the data, by kind."""
        low, high = self.temperature
        return {
            "colder": temperature < low,
            "hotter": temperature > high,
            "faster": rate > self.rate[1],
        }

    def limit(self, kind: str) -> str:
        """Return the end of the range that a kind is beyond, in words."""
        if kind == "faster":
            return f"{self.rate[1]:.3g} 1/s"
        return f"{self.temperature[kind == 'hotter'] - ZERO_CELSIUS:.4g} degC"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a law over temperature, as a file gives it."""

    kind: Kind  #: unit and bounds
    logarithmic: bool = False  #: between rows its logarithm is linear
    default: float | None = None  #: without it the parameter is needed
    word: str = ""  #: what may stand in its place, and does by default: the law finds it by itself


class Given(Protocol):
    """What a file gives to a law; what is wrong in it is noted, and stood in for."""

    def curves(self, known: Mapping[str, Parameter]) -> dict[str, Any]:
        """Return the parameters over temperature; None for one the law finds by itself."""

    def numbers(self, known: Mapping[str, Kind]) -> dict[str, Any]:
        """Return the single numbers that are given."""

    def words(self, known: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
        """Return the words that are given, of those that each may be."""

    def steel(self) -> tuple[float, Callable[[Array], Array]]:
        """Return carbon, wt%, and delta ferrite in the solid over temperature, of file or case."""


@dataclass(frozen=True, slots=True)
class MaterialStep:
    """What happens to n points over one time step."""

    strain_increment: Array  #: total strain, Mandel, (n, 4)
    #: isotropic thermal strain, (n,); already 0 for what happens in the mushy zone and the liquid
    thermal_increment: Array
    temperature_old: Array  #: at the start, K, (n,)
    temperature: Array  #: at the end, K, (n,)
    dt: float  #: length of the step, s


@dataclass(frozen=True, slots=True)
class Response:
    """What a law answers; its arrays may be used again for the next call."""

    stress: Array  #: at the end of the step, Mandel, Pa, (n, 4)
    tangent: Array  #: d stress / d strain increment, consistent with the step, Pa, (n, 4, 4)
    state: Array  #: at the end, (n, states)
    #: viscoplastic work over the step, J/m3, (n,), less what a back stress stores; how much of it
    #: turns to heat is the caller's affair
    dissipation: Array
    flows: Flags  #: whether the point has flowed in this step, (n,)

    @classmethod
    def empty(cls, points: int, states: int) -> Response:
        """Return a response whose arrays are still to be filled."""
        return cls(
            np.empty((points, 4)),
            np.empty((points, 4, 4)),
            np.empty((points, states)),
            np.empty(points),
            np.empty(points, dtype=np.bool_),
        )

    def part(self, rows: slice | Indices) -> Response:
        """The response at some of the points; of a slice of them it shares the memory."""
        return Response(
            self.stress[rows],
            self.tangent[rows],
            self.state[rows],
            self.dissipation[rows],
            self.flows[rows],
        )


@dataclass(frozen=True, slots=True)
class StepChange:
    """What a step is given, as it changes with k parameters, per unit of each."""

    coefficients: Array  #: of the law (k, n, columns)
    strain: Array  #: total strain increment (k, n, 4)
    thermal: Array  #: thermal strain increment (k, n)
    stress_old: Array  #: stress at the start (k, n, 4), Pa
    state_old: Array  #: state at the start (k, n, states)
    dt: Array  #: length of the step (k,), s


@dataclass(frozen=True, slots=True)
class ResponseChange:
    """Derivatives of what a law answers, per unit of k parameters."""

    stress: Array  #: (k, n, 4), Pa
    state: Array  #: (k, n, states)
    dissipation: Array  #: (k, n), J/m3

    @classmethod
    def empty(cls, ways: int, points: int, states: int) -> ResponseChange:
        """Return one whose arrays are still to be filled."""
        many = ways, points
        return cls(np.empty((*many, 4)), np.empty((*many, states)), np.empty(many))

    def some(self, numbers: list[int] | slice) -> ResponseChange:
        """Those by some of the parameters."""
        return ResponseChange(self.stress[numbers], self.state[numbers], self.dissipation[numbers])


class Law(Protocol):
    """A constitutive law of an isotropic material."""

    @property
    def elasticity(self) -> Elasticity:
        """Elastic part; flow leaves the volume unchanged, so the mean stress is its alone."""

    @property
    def data(self) -> DataRange | None:
        """What the numbers of the law rest on; None if that is not said."""

    @property
    def state_names(self) -> tuple[str, ...]:
        """What a point remembers, in the order of the columns of its state."""

    @property
    def kind(self) -> int:
        """Which flow the compiled loop computes, see `kernel.constants`."""

    @property
    def signed(self) -> bool:
        """Whether hardening goes by the viscoplastic strain tensor."""

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric."""

    def strain(self, state: Array) -> Array:
        """Return the equivalent viscoplastic strain (n,) that states (n, states) stand for."""

    def turned(self, state: Array, angle: Array) -> Array:
        """Return the state of material that is turned by angles (n,), rad, like its stress."""

    def initial_state(self, points: int) -> Array:
        """Return the state of material that has never been strained, (n, states)."""

    def coefficients(self, temperature_old: Array, temperature: Array) -> Array:
        """Return what the law needs of the temperatures of a step, (n, columns).

        They stay the same over the Newton iterations of a step: computed once, handed to
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
            step: Strain, temperature and time.
            stress_old: At the start of the step, (n, 4), Pa.
            state_old: At the start of the step, (n, states).
            coefficients: From `coefficients`, for the temperatures of this step.
            out: Arrays to write to; new ones are made if left out.  It must not share memory with
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
        """Return how the answer to a step changes with what it is given.

        What flows goes on flowing, and what is elastic stays so.  The step is that of `integrate`,
        `change` that of all it is given; new arrays are made if `out` is left out.
        """


def rotation(angle: float) -> Array:
    """Matrix (4, 4) that turns a Mandel vector by `angle` [rad] about the casting direction."""
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
    """Mandel vectors (n, 4) turned by angles (n,) about the casting direction."""
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
