"""The travelling creeping strip once more, by an ODE solver of scipy and a root finder of its own.

It shares the coefficients of austenite with castfem and nothing else: no implicit step, no
tangent, no acceleration.  The layers of the strip are one system of ordinary differential
equations in z = v t, which LSODA integrates to a given tolerance; the moments over the rolls are
found by MINPACK's hybrid method.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.optimize import fsolve

from castfem.base.types import Array
from castfem.physics.constitutive import Elasticity
from castfem.physics.constitutive.curves import Austenite

MEGA = 1e6
LEAST = 1e-14  # strain, of a back stress that has none yet


@dataclass(frozen=True)
class OdeStrip:
    """Layers of austenite with Kozlowski's signed strain, temperature linear over the depth.

    Attributes:
        elasticity: Of the steel.
        thickness: m.
        surface: K.
        front: At the inside, K.
        carbon: wt%.
        panels: Of four Gauss points each.
        points: Of a pitch, at which it is asked for.
        tolerance: Relative, of a step.
    """

    elasticity: Elasticity
    thickness: float
    surface: float
    front: float
    carbon: float = 0.1
    panels: int = 6
    points: int = 81
    tolerance: float = 1e-6

    @cached_property
    def layers(self) -> tuple[Array, Array, Array, Array, Austenite]:
        """Weights, arms, moduli E/(1 - nu^2) and that times nu (n,), and the coefficients."""
        x, w = np.polynomial.legendre.leggauss(4)
        half = 0.5 * self.thickness / self.panels
        depth = (half * (2 * np.arange(self.panels)[:, None] + 1 + x)).ravel()
        rise = (self.front - self.surface) / self.thickness
        heat = self.surface + rise * depth
        shear, bulk, young = self.elasticity.moduli(heat)
        poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
        stiff = young / (1.0 - poisson**2)
        arm = 0.5 * self.thickness - depth
        return (
            np.tile(half * w, self.panels), arm, stiff, stiff * poisson,
            Austenite.at(heat, self.carbon),
        )  # fmt: skip

    @cached_property
    def compliance(self) -> Array:
        """From forces across, along and the moment to strains across, along and curvature."""
        w, a, f, g, _ = self.layers
        return np.linalg.inv(
            [
                [w @ f, w @ g, w @ (g * a)],
                [w @ g, w @ f, w @ (f * a)],
                [w @ (g * a), w @ (f * a), w @ (f * a * a)],
            ]
        )

    @property
    def bending(self) -> float:
        """D, N m."""
        return float(1.0 / self.compliance[2, 2])

    def loaded(self, state: Array | None, moment: float) -> tuple[Array, float]:
        """Bring a state to a moment, elastically; None is virgin.  The jump of the curvature."""
        w, a, f, g, _ = self.layers
        n = len(w)
        state = np.zeros(4 * n) if state is None else state.copy()
        across, along = state[:n], state[n : 2 * n]
        out = [-(w @ across), -(w @ along), moment - w @ (a * along)]
        ex, ez, bent = self.compliance @ out
        state[:n] += f * ex + g * (ez + bent * a)
        state[n : 2 * n] += g * ex + f * (ez + bent * a)
        return state, float(bent)

    def _rate(self, state: Array, moment_rate: float) -> Array:
        """Rates of stress across and along, viscoplastic strain likewise, and of the curvature."""
        w, a, f, g, steel = self.layers
        sx, sz, ex, ez = state[:-1].reshape(4, -1)
        mean, en = (sx + sz) / 3.0, -(ex + ez)
        size = np.sqrt(2.0 / 3.0 * (ex**2 + ez**2 + en**2)) + LEAST
        back = 2.0 / 3.0 * steel.hardening * size ** (steel.hardening_exponent - 1.0)
        dx, dz, dn = sx - mean - back * ex, sz - mean - back * ez, -mean - back * en
        q = np.sqrt(1.5 * (dx**2 + dz**2 + dn**2)) + 1e-12 * MEGA
        flow = 1.5 * np.exp(steel.ln_rate + steel.stress_exponent * np.log(q)) / q
        vx, vz = flow * dx, flow * dz
        px, pz = f * vx + g * vz, g * vx + f * vz
        bx, bz, bent = self.compliance @ [w @ px, w @ pz, moment_rate + w @ (a * pz)]
        along = bz + bent * a - vz
        return np.concatenate(
            [f * (bx - vx) + g * along, g * (bx - vx) + f * along, vx, vz, [bent]]
        )

    def through(
        self, state: Array, ends: tuple[float, float], pressure: float, length: float, speed: float
    ) -> tuple[Array, Array, Array]:
        """Lead a state through a pitch: places, curvature since its start, and the state there."""
        time, slope = length / speed, (ends[1] - ends[0]) / length

        def rate(t: float, y: Array) -> Array:
            return self._rate(y, (slope + pressure * (0.5 * length - speed * t)) * speed)

        n = len(state) // 4
        least = np.concatenate([np.full(2 * n, 1e2), np.full(2 * n, 1e-9), [1e-8]])
        at = np.linspace(0.0, time, self.points)
        found = solve_ivp(
            rate, (0.0, time), np.append(state, 0.0), method="LSODA", t_eval=at,
            rtol=self.tolerance, atol=least,
        )  # fmt: skip
        assert found.success, found.message
        return speed * at, found.y[-1], found.y[:-1, -1]

    def periodic(
        self, pressure: float, length: float, speed: float, change: float = 5e-4, most: int = 40
    ) -> Periodic:
        """Pitch after pitch until it repeats itself; its moment closes the curvature.

        Steel that hardens and never recovers repeats itself under other moments too, see
        `kept_at`: that which is found hangs on the way to it, the deflection does not.
        """
        moment, before = -pressure * length**2 / 12.0, np.inf
        state, _ = self.loaded(None, moment)
        for _ in range(most):
            z, bent, end = self.through(state, (moment, moment), pressure, length, speed)
            mean = np.trapezoid(bent, z) / length
            w, slope = deflected(z, bent - mean)
            found = Periodic(z, w, moment, end, float(bent[-1] - mean), float(slope[0]))
            gap, more = float(bent[-1]), 1.01 * moment
            if abs(w.max() - before) < change * w.max() and abs(gap) < 5 * change * np.ptp(bent):
                return found
            other = self.through(
                self.loaded(state, more)[0], (more, more), pressure, length, speed
            )[1]
            slack = max((other[-1] - gap) / (more - moment), 1e-9 / self.bending)
            moment -= float(np.clip(gap / slack, -0.2 * abs(moment), 0.2 * abs(moment)))
            state, before = self.loaded(end, moment)[0], w.max()
        raise RuntimeError("no pitch that repeats itself")

    def kept_at(
        self, moment: float, pressure: float, length: float, speed: float, pitches: int
    ) -> tuple[float, float]:
        """Virgin steel led through some pitches with one and the same moment over each roll.

        Returns:
            The largest deflection in the last of them, m, and its mean curvature, 1/m.
        """
        state, bent = self.loaded(None, moment)
        for _ in range(pitches):
            z, more, state = self.through(state, (moment, moment), pressure, length, speed)
            curvature = bent + more
            bent = float(curvature[-1])
        mean = float(np.trapezoid(curvature, z) / length)
        return float(deflected(z, curvature - mean)[0].max()), mean

    def over(self, rolls: Array, pressure: float, speed: float) -> tuple[Array, Array, Array]:
        """The strip over rolls, m, first and last pitch as those beyond them.

        Returns:
            Places, deflections, m, and the moments over the rolls, N.
        """
        pitch = np.diff(rolls)
        sound = self.periodic(pressure, float(pitch[0]), speed)
        kept: dict[str, Array] = {}

        def missed(unknown: Array) -> Array:
            ends = [sound.moment, *(unknown[:-1] * sound.moment), sound.moment]
            state, bent, slope, w = sound.end, sound.curvature, unknown[-1] * sound.slope, 0.0
            places, heights, out = [], [], []
            for i, length in enumerate(pitch):
                state, jump = self.loaded(state, ends[i])
                bent += jump if i else 0.0
                z, more, state = self.through(
                    state, (ends[i], ends[i + 1]), pressure, float(length), speed
                )
                part, turned = deflected(z, bent + more, slope)
                places.append(rolls[i] + z)
                heights.append(w + part)
                w, slope, bent = float(heights[-1][-1]), float(turned[-1]), float(bent + more[-1])
                out.append(w)
            kept.update(z=np.concatenate(places), w=np.concatenate(heights), m=np.array(ends))
            return np.array(out) / 1e-3

        guess = np.append(beam(rolls, pressure)[1:-1] / sound.moment, 1.0)
        found, _, fine, text = fsolve(missed, guess, full_output=True, xtol=1e-6, epsfcn=1e-6)
        assert fine == 1, text
        missed(found)
        return kept["z"], kept["w"], kept["m"]


@dataclass(frozen=True, slots=True)
class Periodic:
    """A pitch that repeats itself: deflection over places, and what it begins and ends with."""

    z: Array
    w: Array
    moment: float
    end: Array
    curvature: float
    slope: float


def deflected(z: Array, bent: Array, slope: float | None = None) -> tuple[Array, Array]:
    """Deflection and slope of a strip of curvature -w''; without a slope, 0 at both ends."""
    turned = cumulative_simpson(bent, x=z, initial=0.0)
    sunk = cumulative_simpson(turned, x=z, initial=0.0)
    start = sunk[-1] / z[-1] if slope is None else slope
    return start * z - sunk, start - turned


def beam(rolls: Array, pressure: float) -> Array:
    """Moments of an elastic continuous beam over rolls, clamped ones at its ends."""
    pitch, n = np.diff(rolls), len(rolls)
    matrix, load = np.eye(n), np.full(n, -pressure * pitch[0] ** 2 / 12.0)
    load[-1] = -pressure * pitch[-1] ** 2 / 12.0
    for j in range(1, n - 1):
        a, b = pitch[j - 1], pitch[j]
        matrix[j, j - 1 : j + 2] = a, 2.0 * (a + b), b
        load[j] = -0.25 * pressure * (a**3 + b**3)
    return np.asarray(np.linalg.solve(matrix, load))
