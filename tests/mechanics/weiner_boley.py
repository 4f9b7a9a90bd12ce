"""Weiner and Boley's solidifying half-space: closed form, and the strip that is to reproduce it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, fsolve
from scipy.special import erf
from thermal.scenes import ThermalScene

from castfem import meshes
from castfem.laws.elasticity import Elasticity, Solidity
from castfem.laws.library import load_law
from castfem.materials import load_steel
from castfem.mechanics.planes import PlainPlanes
from castfem.mechanics.problem import MechanicalProblem
from castfem.mechanics.slice import Slice
from castfem.mechanics.state import MechanicalResult
from castfem.mechanics.stepper import MechanicalStepper
from castfem.mechanics.supports import Held
from castfem.thermal.laws import PrescribedTemperature

Array = npt.NDArray[np.float64]

SURFACE, MELTING, POURED = 1000.0, 1494.4, 1495.0  # degC
YOUNG, POISSON, ALPHA, YIELD = 40e9, 0.3, 2e-5, 20e6
CONDUCTIVITY, HEAT, DENSITY, LATENT = 33.0, 661.0, 7500.0, 272e3
DIFFUSIVITY = CONDUCTIVITY / (DENSITY * HEAT)
KELVIN = 273.15


class HalfSpace:
    """The closed form; all times are one curve over zeta = x / (2 sqrt(kappa t)).

    Attributes:
        front: zeta of the solid's front. compressed: zeta where compressive flow ends.
        stretched: zeta where tensile flow begins. rate: strain rate times 2 t.
    """

    def __init__(self) -> None:
        stefan = HEAT * (MELTING - SURFACE) / LATENT
        self.front = brentq(
            lambda z: z * np.exp(z * z) * erf(z) - stefan / np.sqrt(np.pi), 0.1, 2.0, xtol=1e-15
        )
        self.compressed, self.stretched = fsolve(self._conditions, [0.147, 0.264], xtol=1e-13)
        self.rate = self._smooth_exit(self.stretched)

    def temperature(self, zeta: npt.ArrayLike) -> Array:
        """Temperature, degC."""
        z = np.minimum(zeta, self.front)
        return np.asarray(SURFACE + (MELTING - SURFACE) * erf(z) / erf(self.front))

    def _slope(self, zeta: float) -> float:
        rise = (MELTING - SURFACE) * 2 / np.sqrt(np.pi) / erf(self.front)
        return float(rise * np.exp(-(zeta**2)))

    def _limit(self, zeta: npt.ArrayLike) -> Array:
        return YIELD * (MELTING - self.temperature(zeta)) / (MELTING - SURFACE)

    def _smooth_exit(self, zeta: float) -> float:
        stiff = YOUNG / (1 - POISSON)
        return -zeta * self._slope(zeta) * (ALPHA - YIELD / (stiff * (MELTING - SURFACE)))

    def _elastic(self, zeta: npt.ArrayLike, end: float) -> Array:
        """Stress in the elastic zone that flows in tension from `end` on."""
        z = np.asarray(zeta, float)
        drop = self.temperature(z) - self.temperature(end)
        strain = self._smooth_exit(end) * np.log(z / end) + ALPHA * drop
        return np.asarray(self._limit(end) - YOUNG / (1 - POISSON) * strain)

    def _conditions(self, zones: Array) -> list[float]:
        """Flow at the inner end of the elastic zone, and no resultant."""
        first, second = zones
        points, weights = np.polynomial.legendre.leggauss(60)

        def integral(low: float, high: float, stress: Any) -> float:
            z = low + 0.5 * (high - low) * (1 + points)
            return float(0.5 * (high - low) * weights @ stress(z))

        total = -integral(0.0, first, self._limit)
        total += integral(first, second, lambda z: self._elastic(z, second))
        total += integral(second, self.front, self._limit)
        return [float(self._elastic(first, second) + self._limit(first)) / YIELD, total / YIELD]

    def stress(self, x: Array, time: float) -> Array:
        """Sigma_yy = sigma_zz, Pa, at depth x, m."""
        z = np.maximum(x, 1e-12) / (2 * np.sqrt(DIFFUSIVITY * time))
        zones = [z < self.compressed, z < self.stretched, z < self.front]
        values = [-self._limit(z), self._elastic(z, self.stretched), self._limit(z)]
        return np.asarray(np.select(zones, values, 0.0))

    def shell(self, time: float) -> float:
        """Thickness of the shell, m."""
        return float(2 * self.front * np.sqrt(DIFFUSIVITY * time))


class Strip:
    """A strip one cell wide, thermal first; it may strain uniformly along y and z.

    Args:
        size: Of the cells, m. ratio: Stiffness of the liquid. cell: Kind. law: By name.
        given: Changes to the `Slice`.
    """

    def __init__(
        self,
        size: float,
        ratio: float = 1e-6,
        cell: str = "quadrilateral",
        law: str = "weiner_boley",
        options: dict[str, Any] | None = None,
        **given: Any,
    ) -> None:
        steel = load_steel("weiner_boley")
        mesh = meshes.build(
            "strip", length=0.03, width=size, surface_size=size, core_size=size, cell=cell
        )
        curve = steel.thermal_curve(1200.0, 1800.0, POURED + KELVIN)
        self.thermal = ThermalScene(mesh, curve, POURED + KELVIN)
        self.thermal.cool(("surface", PrescribedTemperature(SURFACE + KELVIN)))
        elasticity = Elasticity.constant(YOUNG, POISSON, Solidity.of(steel, stiffness_ratio=ratio))
        slice_ = Slice(
            load_law(law, elasticity, carbon=0.1),
            steel.thermal_strain,
            # Both long sides stay straight: what is uniform along y is a motion of its own.
            PlainPlanes(("a0", "across")),
            (Held(("side_low",), 1), Held(("side_high",), 1), Held(("surface",), 0)),
            pin=False,
            **given,
        )
        self.problem = MechanicalProblem(self.thermal.section, slice_, options)
        self.stepper = MechanicalStepper(self.problem)
        self.state = self.stepper.initial(0.0, self.thermal.state.point.temperature)
        self.results: list[MechanicalResult] = []

    def march(self, end: float, step: float) -> Strip:
        """Even steps to `end` (s)."""
        begin = self.state.time
        count = round((end - begin) / step)
        for i in range(count):
            time = begin + (end - begin) * (i + 1) / count
            self.thermal.march(time, time)
            result = self.stepper.step(self.state, time, self.thermal.state.point.temperature)
            assert result.converged, result.reason
            self.state = result.state
            self.results.append(result)
        return self

    @property
    def depth(self) -> Array:
        """Of the points, m."""
        return self.problem.points.deviator.position[:, 0]

    @property
    def stress(self) -> Array:
        """At the points (n, 4), Pa."""
        return self.problem.points.recovered(self.state.stress)

    def error(self, exact: HalfSpace) -> float:
        """Rms difference of sigma_zz in the shell over 20 MPa."""
        time = self.state.time
        inside = self.depth < exact.shell(time)
        difference = self.stress[inside, 2] - exact.stress(self.depth[inside], time)
        return float(np.sqrt(np.mean(difference**2)) / YIELD)
