"""Microsegregation: freezing of steel with limited diffusion in the solid [Won2001].

Rejected solutes accumulate in the last liquid and lower its freezing point by tens of kelvin below
the equilibrium solidus. Their content in the liquid is

    C = C0 [1 + f (b k - 1)]^((1 - k)/(b k - 1)),  b = 2 a (1 - exp(-1/a)) - exp(-1/(2 a)),
    a = 2 (4 D t/l2^2 + 0.1)

with the partition k, the diffusion coefficient D at the end of freezing, its time t, and the
secondary arm spacing l2. Delta ferrite freezes until the surface of the crystals would transform to
austenite; from there on its fraction of the solid falls, and the liquid is the average of those
beside both phases.

The numbers were compared with the public code [Microsegregation], which has those of C, Si, Mn and
S (its diffusion is too slow by a factor of 1e4, since a unit is converted twice, and that of C in
austenite lacks a sign); those of P are quoted from memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.physics.materials.alloyed_iron import HALVINGS, AlloyedIron
from castfem.physics.materials.alloying import TRANSFORMATION_RISE, alloyed
from castfem.physics.materials.hot_tearing import secondary_arm_spacing
from castfem.physics.materials.iron_carbon import IronCarbon, Phases, Side, root

CALORIE = 4.184  # J
GAS = 1.987 * CALORIE  # J/(mol K), used with the activation energies
COARSENING = 0.1  # contribution of arm coarsening to 4 D t/l2^2
TRANSFORMATION = 1392.0 + ZERO_CELSIUS  # K: delta -> gamma of pure iron
FALL = 2.0  # exponent of the fraction of delta ferrite over the temperature
COOLING_RATE = 10.0
"""Cooling rate during freezing, K/s; a tenth of it raises the end of freezing by 2 K, at 0.42 % C
by 5."""
MOST_CARBON = 1.0  # wt%
FRACTIONS: Array = np.asarray(np.linspace(0.0, 1.0, 401), float)
"""Solid fractions at which the path is computed."""
ROUNDS, NEAR = 100, 1e-6  # iterations for the end of freezing, and their tolerance, K


@dataclass(frozen=True, slots=True)
class Solute:
    """A solute between liquid and crystals; pairs are for delta ferrite and austenite."""

    partition: tuple[float, float]  #: content of the solid over that of the liquid
    diffusion: tuple[float, float]  #: pre-exponential diffusion coefficient in the solid, cm2/s
    activation: tuple[float, float]  #: activation energy of diffusion, cal/mol
    liquidus: float  #: drop of the freezing point, K per wt% in the liquid
    transformation: float  #: rise of delta -> gamma, K per wt% in the ferrite

    def diffusivity(self, solid: int, temperature: float) -> float:
        """Diffusion coefficient in delta ferrite (0) or austenite (1) at a temperature, K, m2/s."""
        slowed = np.exp(-self.activation[solid] * CALORIE / (GAS * temperature))
        return float(1e-4 * self.diffusion[solid] * slowed)


SOLUTES: Mapping[str, Solute] = {
    "C": Solute((0.19, 0.34), (0.0127, 0.0761), (19450.0, 32160.0), 78.0, 1122.0),
    "Si": Solute((0.77, 0.52), (8.0, 0.3), (59500.0, 60100.0), 7.6, TRANSFORMATION_RISE["Si"]),
    "Mn": Solute((0.76, 0.78), (0.76, 0.055), (53640.0, 59600.0), 4.9, TRANSFORMATION_RISE["Mn"]),
    "P": Solute((0.23, 0.13), (2.9, 0.01), (55000.0, 43700.0), 34.4, TRANSFORMATION_RISE["P"]),
    "S": Solute((0.05, 0.035), (4.56, 2.4), (51300.0, 53400.0), 38.0, TRANSFORMATION_RISE["S"]),
}


def back_diffusion(fourier: float) -> float:
    """Back-diffusion parameter b of a solute: 0 without diffusion in the solid, 1 with complete.

    Args:
        fourier: 4 D t/l2^2; arm coarsening is added to it.
    """
    a = 2.0 * (fourier + COARSENING)
    return float(2.0 * a * (1.0 - np.exp(-1.0 / a)) - np.exp(-0.5 / a))


def enriched(content: float, fraction: Array, partition: float, back: float) -> Array:
    """Content of the liquid at solid fractions (n,), wt%."""
    left = back * partition - 1.0
    return np.asarray(content * (1.0 + fraction * left) ** ((1.0 - partition) / left))


@dataclass(frozen=True)
class Segregation:
    """Freezing of a steel; elements other than `SOLUTES` only lower its liquidus."""

    composition: Mapping[str, float]  #: wt%, including carbon
    cooling_rate: float  #: cooling rate during freezing, K/s
    liquidus: float  #: liquidus of the steel, K, from which the path starts

    def temperature(self, fraction: float) -> float:
        """Temperature at a solid fraction, K."""
        return float(np.interp(fraction, FRACTIONS, self.path))

    def solid_fraction(self, temperature: Array) -> Array:
        """Solid fraction at temperatures (n,), K."""
        return np.interp(-np.asarray(temperature), -self.path, FRACTIONS)

    def carbon(self, temperature: Array) -> Array:
        """Carbon of the liquid at temperatures (n,), K, wt%."""
        return np.interp(-np.asarray(temperature), -self.path, self._found[1])

    @property
    def path(self) -> Array:
        """Temperatures at `FRACTIONS`, not rising (m,), K."""
        return self._found[0]

    @cached_property
    def _found(self) -> tuple[Array, Array]:
        """The path, and the carbon of the liquid along it, wt%."""
        end = self.liquidus
        path, carbon = self._path(NEAR / self.cooling_rate, end)
        for _ in range(ROUNDS):
            last, end = end, 0.5 * (end + float(path[-1]))
            if abs(end - last) < NEAR:
                break
            path, carbon = self._path((self.liquidus - end) / self.cooling_rate, end)
        return path, carbon

    @cached_property
    def _contents(self) -> dict[str, float]:
        given = self.composition
        return {name: given[name] for name in SOLUTES if given.get(name, 0.0) > 0.0}

    def _freezing_point(self, liquid: Mapping[str, Array]) -> Array:
        """Freezing point of a liquid with these contents, K; the liquidus is that of the steel."""
        gathered = [
            SOLUTES[name].liquidus * (content - self._contents[name])
            for name, content in liquid.items()
        ]
        return np.asarray(self.liquidus - sum(gathered))

    def _liquid(self, solid: int, time: float, end: float) -> dict[str, Array]:
        """Contents of the liquid along the path beside delta ferrite (0) or austenite (1), wt%."""
        rate = np.array([self.cooling_rate])
        spacing = float(secondary_arm_spacing(rate, self._contents["C"])[0])
        found = {}
        for name, content in self._contents.items():
            solute = SOLUTES[name]
            moved = 4.0 * solute.diffusivity(solid, end) * time / spacing**2
            found[name] = enriched(
                content, FRACTIONS, solute.partition[solid], back_diffusion(moved)
            )
        return found

    def _path(self, time: float, end: float) -> tuple[Array, Array]:
        """Like `_found`, for a given freezing time, s, and end temperature, K."""
        beside_delta, beside_gamma = (self._liquid(solid, time, end) for solid in (0, 1))
        delta, gamma = self._freezing_point(beside_delta), self._freezing_point(beside_gamma)
        raised = [
            SOLUTES[name].transformation * SOLUTES[name].partition[0] * content
            for name, content in beside_delta.items()
        ]
        turns = np.asarray(TRANSFORMATION + sum(raised))
        first = int(np.argmax(delta <= turns))
        if not delta[first] <= turns[first]:  # it freezes completely to delta ferrite
            return delta, beside_delta["C"]
        start, stop = delta[first], min(turns[0], delta[first] - NEAR)
        turning = np.arange(len(delta)) >= first
        low, high = np.minimum(delta, gamma), np.maximum(delta, gamma)
        # the fraction of ferrite must agree with the temperature it gives
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            share = np.clip((middle - stop) / (start - stop), 0.0, 1.0) ** FALL
            share = np.where(turning, share, 1.0)
            colder = share * delta + (1.0 - share) * gamma < middle
            low, high = np.where(colder, low, middle), np.where(colder, middle, high)
        path = np.minimum.accumulate(0.5 * (low + high))
        return path, share * beside_delta["C"] + (1.0 - share) * beside_gamma["C"]


@dataclass(frozen=True)
class SegregatedDiagram:
    """Same interface as `IronCarbon`, for a steel that freezes with microsegregation.

    The solid is in equilibrium, with the carbon that is not in the liquid.
    """

    equilibrium: IronCarbon | AlloyedIron  #: equilibrium of the solid
    freezing: Segregation  #: freezing of the liquid

    @property
    def carbon(self) -> float:
        """Carbon content, wt%."""
        return self.equilibrium.carbon

    @property
    def liquidus(self) -> float:
        """Temperature at which the last solid melts on heating, K."""
        return self.freezing.liquidus

    @property
    def solidus(self) -> float:
        """Temperature below which no liquid is left, K."""
        return float(self.freezing.path[-1])

    @cached_property
    def gamma_start(self) -> float | None:
        """Temperature at which delta begins to turn to gamma on cooling, K; None without delta."""
        peritectic = self.equilibrium.peritectic
        if self.liquidus <= peritectic:
            return None
        if float(self.phases(peritectic, "below").gamma) > 0.0:
            return peritectic
        end = self.equilibrium.transformation
        return root(lambda t: float(self.phases(t).gamma) > 0.0, peritectic, end)

    @cached_property
    def gamma_end(self) -> float | None:
        """Temperature below which no delta is left, K; None if there never was any."""
        if self.gamma_start is None or not float(self.phases(self.gamma_start, "below").delta):
            return self.gamma_start
        end = self.equilibrium.transformation
        return root(lambda t: not float(self.phases(t).delta), self.gamma_start, end)

    @property
    def reactions(self) -> tuple[float, ...]:
        """Temperature of the peritectic, K, if the solid has enough carbon there."""
        return () if self.gamma_start != self.equilibrium.peritectic else (self.gamma_start,)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures at which a fraction has a kink or a jump, K, increasing."""
        limits = (self.solidus, self.liquidus, self.gamma_start, self.gamma_end)
        return tuple(sorted({t for t in limits if t is not None}))

    def phases(self, temperature: npt.ArrayLike, side: Side = "above") -> Phases:
        """See `IronCarbon`."""
        t, steel = np.asarray(temperature, float), self.equilibrium
        solid = self.freezing.solid_fraction(t)
        liquid, in_liquid = 1.0 - solid, self.freezing.carbon(t)
        left = np.where(solid > 0.0, solid, 1.0)
        in_solid = np.maximum((self.carbon - liquid * in_liquid) / left, 0.0)
        share, in_delta, in_gamma = steel.solid(t, in_solid, side)
        hot = t >= steel.peritectic if side == "above" else t > steel.peritectic
        share = np.where(hot, 1.0, share)
        delta = share * solid
        return Phases(
            liquid,
            delta,
            solid - delta,
            np.where(liquid > 0.0, in_liquid, np.nan),
            np.where(delta > 0.0, np.where(share < 1.0, in_delta, in_solid), np.nan),
            np.where(solid > delta, np.where(share > 0.0, in_gamma, in_solid), np.nan),
        )


def segregated(composition: Mapping[str, float]) -> SegregatedDiagram:
    """Return the diagram of a composition in wt%, assessed in the solid, with microsegregation.

    Raises:
        ValueError: An element, or their sum, is out of range.
    """
    if not 0.0 < composition.get("C", 0.0) <= MOST_CARBON:
        raise ValueError(
            f'C: diagram = "segregated" needs carbon above 0 and up to {MOST_CARBON:g} wt%'
        )
    diagram = alloyed(composition)
    return SegregatedDiagram(diagram, Segregation(composition, COOLING_RATE, diagram.liquidus))
