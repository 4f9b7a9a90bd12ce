"""Equilibrium of iron with carbon, manganese and silicon: the lever rule for every element.

Crystals contain less of each element than the liquid. During freezing both become richer, and the
freezing point falls: it depends on the liquid's content at the solid fraction f,

    X = X0/(1 - f (1 - k)),

with the partition k, which is the lever rule again; k of manganese falls with the silicon in the
liquid, and that of silicon with the manganese. A liquid with these contents freezes like one of
iron and carbon, at a temperature that is some kelvins lower; both elements also change the carbon
of the crystals a little. The parameters (`BESIDE`) for liquid with delta ferrite and for liquid
with austenite are fitted to equilibria of [PovodenKaradeniz2016]; docs/materials.md has the errors.

The peritectic reaction occurs where the liquid beside one solid would freeze to the other. In the
database liquid, delta ferrite and austenite coexist over 0 to 2 K, depending on the steel; here it
is one temperature, the lower end, which differs from steel to steel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.materials.iron_carbon import (
    MAX_CARBON,
    TRACE,
    Line,
    Lines,
    Phases,
    Side,
    root,
    solid_phases,
)

FRACTIONS: Array = np.asarray(np.linspace(1.0, 0.0, 401), float)
"""Solid fractions at which equilibria are computed, with linear interpolation."""
HALVINGS = 60  # bisections, to rounding
REACH = 150.0  # K beyond the points of a line within which it is extrapolated
GAMMA_REACH = 25.0  # K above the peritectic up to which the austenite line beside liquid is used


@dataclass(frozen=True, slots=True)
class Beside:
    """Effects of manganese and silicon in a liquid, wt%, on its equilibrium with a solid."""

    #: partition of each (content in the solid over that in the liquid), and its changes by carbon
    #: and by the other of the two in the liquid, per wt%
    partition: tuple[tuple[float, float, float], tuple[float, float, float]]
    drop: tuple[float, float]  #: drop of the freezing point, K per wt%
    together: float  #: drop by the product of both, K per wt%^2
    twice: float  #: drop by the square of silicon, K per wt%^2
    with_carbon: tuple[float, float]  #: drop by the product of each with carbon, K per wt%^2
    solid_carbon: tuple[float, float]  #: relative change of the carbon of the solid, per wt%

    def gathered(self, contents: tuple[float, float], solid: Array, carbon: Array) -> list[Array]:
        """Contents, wt%, of a liquid with carbon, wt%, at a solid fraction (any shape).

        They solve `x (p + q y) = X` and `y (r + s x) = Y`, the balances of manganese and silicon.
        """
        (p, q), (r, s) = (
            (1.0 - solid * (1.0 - alone - by_carbon * carbon), solid * by_other)
            for alone, by_carbon, by_other in self.partition
        )
        all_mn, all_si = contents
        half = 0.5 * (p * r + q * all_si - s * all_mn)
        mn = all_mn * r / (half + np.sqrt(half**2 + p * s * all_mn * r))
        return [mn, all_si / (r + s * mn)]

    def lowered(self, carbon: Array, gathered: list[Array]) -> Array:
        """Drop of the freezing point by these contents, wt%, from that of iron and carbon, K."""
        both = sum(
            (a + c * carbon) * x
            for a, c, x in zip(self.drop, self.with_carbon, gathered, strict=True)
        )
        mn, si = gathered
        return np.asarray(both + (self.together * mn + self.twice * si) * si)


# Delta ferrite and austenite; fitted to temperatures and fractions of 1341 equilibria of liquid
# with one of them, with C to 1.0, Mn to 2, Si to 0.6 wt%, and to the partitions of 370 others.
BESIDE = (
    Beside(
        ((0.746, -0.083, -0.102), (0.717, 0.038, -0.04)),
        (5.08, 9.55), 0.94, 1.05, (-0.21, 2.74), (-0.034, -0.045),
    ),
    Beside(
        ((0.738, -0.046, -0.009), (0.588, 0.075, 0.001)),
        (4.21, 10.24), 0.31, 0.23, (-0.29, 4.48), (-0.014, -0.046),
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Pair:
    """Liquid of a steel in equilibrium with one solid."""

    liquid: Line  #: liquidus of iron and carbon
    solid: Line
    beside: Beside
    contents: tuple[float, float]  #: manganese and silicon of the steel, wt%
    reach: tuple[float, float]  #: range of the lines, K

    def at(self, solid: npt.ArrayLike, carbon: float) -> tuple[Array, Array, Array]:
        """Temperature, K, and carbon of liquid and solid, wt%, at solid fractions (n,)."""
        f = np.asarray(solid, float)
        low, high = (np.full(f.shape, end) for end in self.reach)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            _, in_liquid, in_solid = self.on_lines(middle, f)
            held = f * in_solid + (1.0 - f) * in_liquid
            low, high = np.where(held > carbon, middle, low), np.where(held > carbon, high, middle)
        return self.on_lines(0.5 * (low + high), f)

    def on_lines(self, middle: Array | float, solid: Array) -> tuple[Array, Array, Array]:
        """Like `at`, at a temperature on the lines of iron and carbon, K."""
        in_liquid = self.liquid.carbon(middle)
        gathered = self.beside.gathered(self.contents, solid, in_liquid)
        share = 1.0 + sum(e * x for e, x in zip(self.beside.solid_carbon, gathered, strict=True))
        t = middle - self.beside.lowered(in_liquid, gathered)
        return t, in_liquid, share * self.solid.carbon(middle)

    def grows(self, other: Pair, place: tuple[Array, Array, Array], solid: Array) -> Array:
        """Carbon that the liquid beside another solid lacks to grow this one, wt%.

        Args:
            other: Liquid with the other solid.
            place: Its temperature and carbon, as returned by `at`.
            solid: Its solid fraction.
        """
        t, held, _ = place
        gathered = other.beside.gathered(self.contents, solid, held)
        return self.liquid.carbon(t + self.beside.lowered(held, gathered)) - held


@dataclass(frozen=True)
class AlloyedIron:
    """Equilibrium of a steel with manganese or silicon; same interface as `IronCarbon`.

    Raises:
        ValueError: The carbon content is out of range, or the points are out of order.
    """

    carbon: float  #: carbon content, wt%, from 0 to 2.11; below 1e-6 it counts as none
    lines: Lines  #: lines of iron and carbon, and the transformation of the steel without carbon
    contents: tuple[float, float]  #: manganese and silicon, wt%

    def __post_init__(self) -> None:
        if not 0.0 <= self.carbon <= MAX_CARBON:
            raise ValueError(f"carbon must lie in 0 ... {MAX_CARBON} wt%, not {self.carbon}")
        if self.carbon < TRACE:
            object.__setattr__(self, "carbon", 0.0)
        (t_delta, in_delta), (t_gamma, in_gamma) = self.solid_ends
        hot = self.transformation < min(t_delta, t_gamma)
        if not (hot and 0.0 < in_delta < in_gamma):
            raise ValueError(
                "the alloying elements put the iron-carbon diagram out of order: delta-gamma of "
                f"iron at {self.transformation:.1f} K, the ends of the peritectic at "
                f"{t_delta:.1f} K with {in_delta:.3f} and {t_gamma:.1f} K with {in_gamma:.3f} %C"
            )

    @property
    def transformation(self) -> float:
        """Temperature of delta -> gamma without carbon, K."""
        return self.lines.transformation

    @cached_property
    def pairs(self) -> tuple[Pair, Pair]:
        """Liquid with delta ferrite, and with austenite."""
        one, other = self.lines.liquid_delta, self.lines.liquid_gamma
        return (
            Pair(one, self.lines.delta, BESIDE[0], self.contents,
                 (one.last[0] - REACH, one.first[0])),
            Pair(other, self.lines.gamma, BESIDE[1], self.contents,
                 (other.last[0] - REACH, other.first[0] + REACH)),
        )  # fmt: skip

    @cached_property
    def solid_ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Temperature (K) and carbon (wt%) of delta and gamma that coexist with liquid."""
        near, melting = self.lines.liquid_gamma.first[0], self.lines.liquid_delta.first[0]
        one, found = np.ones(()), []
        for mine, other, start, end in (
            (*self.pairs, melting, near - REACH),
            (*self.pairs[::-1], near - REACH, near + GAMMA_REACH),
        ):

            def turns(t: float, mine: Pair = mine, other: Pair = other) -> bool:
                return bool(other.grows(mine, mine.on_lines(t, one), one) > 0.0)

            t, _, carbon = mine.on_lines(root(turns, start, end), one)
            found.append((float(t), float(carbon)))
        return found[0], found[1]

    @cached_property
    def paths(self) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
        """Temperatures of `FRACTIONS` for both pairs, rising, K, and the two carbons, wt%."""
        one, other = (pair.at(FRACTIONS, self.carbon) for pair in self.pairs)
        return (np.maximum.accumulate(one[0]), *one[1:]), (
            np.maximum.accumulate(other[0]), *other[1:]
        )  # fmt: skip

    @cached_property
    def _ferrite(self) -> Array:
        """Growth of delta ferrite from liquid beside austenite, at `FRACTIONS`."""
        one, other = self.pairs
        return one.grows(other, self.paths[1], FRACTIONS)

    @property
    def austenitic(self) -> bool:
        """Whether it freezes to austenite alone."""
        return bool(self._ferrite[-1] <= 0.0)

    @property
    def freezes_in_reaction(self) -> bool:
        """Whether no liquid is left below the peritectic."""
        return self.carbon < self.solid_ends[1][1]

    @cached_property
    def peritectic(self) -> float:
        """Temperature of the peritectic reaction, K; for steels without it the nearest one."""
        if self.austenitic:
            return self.liquidus
        (t_delta, in_delta), (t_gamma, in_gamma) = self.solid_ends
        if self.freezes_in_reaction:
            return float(np.interp(self.carbon, (in_delta, in_gamma), (t_delta, t_gamma)))
        last = int(np.argmax(self._ferrite > 0.0))
        if last == 0:  # at the end of austenite, up to rounding
            return t_gamma
        step = slice(last - 1, last + 1)
        return float(np.interp(0.0, self._ferrite[step], self.paths[1][0][step]))

    @property
    def liquidus(self) -> float:
        """Temperature at which the last solid melts on heating, K."""
        return float(self.paths[1 if self.austenitic else 0][0][-1])

    @property
    def solidus(self) -> float:
        """Temperature below which no liquid is left, K."""
        if self.freezes_in_reaction:
            return max(self.peritectic, float(self.paths[0][0][0]))
        return min(self.peritectic, float(self.paths[1][0][0]))

    @cached_property
    def _solid_lines(self) -> tuple[Line, Line]:
        """Delta ferrite and austenite in equilibrium, from pure iron to their end points."""
        start, bends = (self.transformation, 0.0), self.lines.bends
        one, other = self.solid_ends
        return Line(start, one, bends[0]), Line(start, other, bends[1])

    @property
    def gamma_start(self) -> float | None:
        """Temperature at which delta begins to turn to gamma on cooling, K; None without delta."""
        return self._turns(0)

    @property
    def gamma_end(self) -> float | None:
        """Temperature below which no delta is left, K; None if there never was any."""
        return self._turns(1)

    def _turns(self, solid: int) -> float | None:
        """Temperature at which a solid (0: delta, 1: gamma) has the carbon of the steel, K."""
        if self.austenitic:
            return None
        if self.carbon >= self.solid_ends[solid][1]:
            return self.peritectic
        return min(self._solid_lines[solid].temperature(self.carbon), self.peritectic)

    @property
    def reactions(self) -> tuple[float, ...]:
        """Temperatures at which the fractions jump, K: peritectic, or delta -> gamma of iron."""
        if self.carbon == 0.0:
            return (self.transformation,)
        inside = self.carbon > self.solid_ends[0][1] and not self.austenitic
        return (self.peritectic,) if inside else ()

    @property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures at which a fraction has a kink or a jump, K, increasing."""
        limits = (self.solidus, self.liquidus, self.gamma_start, self.gamma_end, *self.reactions)
        return tuple(sorted({t for t in limits if t is not None}))

    def phases(self, temperature: npt.ArrayLike, side: Side = "above") -> Phases:
        """See `IronCarbon`."""
        t = np.asarray(temperature, float)
        beyond = np.greater_equal if side == "above" else np.greater
        hot = beyond(t, self.peritectic) & (not self.austenitic)
        share, in_delta, in_gamma = self.solid(t, self.carbon, side)
        liquid, rest = self._mushy(0, t)
        if self.freezes_in_reaction:
            liquid = np.where(hot, liquid, 0.0)
        else:
            after, rest_cold = self._mushy(1, np.where(hot, self.peritectic, t))
            liquid = np.where(hot, np.maximum(liquid, after), after)
            rest = np.where(hot, rest, rest_cold)
        delta = np.where(hot, 1.0 - liquid, np.where(liquid > 0.0, 0.0, share))
        gamma = np.where(hot, 0.0, 1.0 - liquid - delta)
        in_liquid = self.carbon / (liquid + (1.0 - liquid) * rest)
        in_delta = np.where(hot, rest * in_liquid, in_delta)
        in_gamma = np.where(liquid > 0.0, rest * in_liquid, in_gamma)
        carbons = (
            np.where(part >= 1.0, self.carbon, np.where(part > 0.0, held, np.nan))
            for part, held in ((liquid, in_liquid), (delta, in_delta), (gamma, in_gamma))
        )
        return Phases(liquid, delta, gamma, *carbons)

    def _mushy(self, solid: int, t: Array) -> tuple[Array, Array]:
        """Fraction of liquid beside delta (0) or gamma (1), and their carbon over the liquid's."""
        path, in_liquid, in_solid = self.paths[solid]
        held = self.carbon > 0.0
        ratio = in_solid / in_liquid if held else np.ones_like(path)
        return 1.0 - np.interp(t, path, FRACTIONS), np.interp(t, path, ratio)

    def solid(
        self, t: Array, carbon: Array | float, side: Side = "above"
    ) -> tuple[Array, Array, Array]:
        """See `IronCarbon`."""
        return solid_phases(self._solid_lines, t, carbon, side)
