"""The creeping strip over several unequal spans, with a missing or misaligned roll.

The moments at the rolls are unknown, the deflections there given. Far upstream and downstream all
pitches are equal: the strip enters with the stress, the state and the curvature of the periodic
pitch, and leaves with its moment. All moments and the slope at the first roll are solved together,
since an error of one of them would grow 3.7 times from roll to roll.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.physics.machine.bulging.creep import (
    CreepingStrip,
    Pitch,
    coarsest,
    extrapolated,
    nodes,
)
from castfem.physics.machine.bulging.layers import LayerHistory, Layers
from castfem.physics.machine.bulging.result import Bulge, Span
from castfem.physics.machine.bulging.shell import Shell


@dataclass(frozen=True, slots=True)
class Rolls:
    """The rolls under a strip.

    Raises:
        ValueError: There are fewer than four rolls, they do not increase, or offsets and positions
            differ in number.
    """

    positions: tuple[float, ...]  #: increasing, m, (j + 1,)
    offsets: tuple[float, ...]  #: outward displacement from the nominal position, m, (j + 1,)
    pressure: float  #: pressure of the liquid, Pa
    speed: float  #: casting speed, m/s

    def __post_init__(self) -> None:
        if len(self.positions) < 4:
            raise ValueError("a strip over several rolls needs four of them at least")
        if any(not b > a for a, b in itertools.pairwise(self.positions)):
            raise ValueError("positions of rolls must increase")
        if len(self.offsets) != len(self.positions):
            raise ValueError(f"{len(self.positions)} rolls, but {len(self.offsets)} offsets")

    @property
    def pitches(self) -> list[float]:
        """Lengths of the spans, m, (j,)."""
        return [b - a for a, b in itertools.pairwise(self.positions)]

    def span(self, index: int) -> Span:
        """Return one of the spans."""
        return Span(self.pitches[index], self.pressure, self.speed)


def over_rolls(strip: CreepingStrip, rolls: Rolls, shell: Shell) -> Bulge:
    """Return the bulge of a strip over unequal spans.

    A roll with a negative force, which would have to pull, does not touch the strand: leave it out.
    The first and the last span, which should equal those beyond them, close the problem.

    Raises:
        RunFailure: The shell cannot carry the pressure, or the moments cannot be found.
    """
    layers = Layers(strip.law, shell.points(strip.layers, shell.breaks(strip.law)))
    coarse, found = _Spans(strip, rolls, layers, strip.steps // 2).solved()
    finest = _Spans(strip, rolls, layers, strip.steps)
    fine, _ = finest.solved(found)
    coarser = coarsest(strip.steps, lambda n: _Spans(strip, rolls, layers, n).solved(found)[0])
    bulge = extrapolated(coarse, fine, layers, coarser)
    forces = _forces(rolls, bulge.moment[:: strip.steps // 2])
    return replace(bulge, roll_force=forces, error=bulge.error + finest.missing)


def _forces(rolls: Rolls, moments: Sequence[float] | Array) -> Array:
    """Force on each roll between two spans, N per metre of width, from the moments at the rolls."""
    pitch, moment = np.array(rolls.pitches), np.asarray(moments)
    rise, half = np.diff(moment) / pitch, 0.5 * rolls.pressure * pitch
    return np.asarray(rise[1:] + half[1:] - rise[:-1] + half[:-1])


class _Spans:
    """The strip with some number of steps per span, and the search for its moments."""

    def __init__(self, strip: CreepingStrip, rolls: Rolls, layers: Layers, steps: int) -> None:
        self._layers, self._rolls = layers, rolls
        closer = 0.2  # tighter tolerance than for a single pitch, since errors add up
        self._in, _ = strip.periodic(layers, rolls.span(0), steps, share=closer)
        self._out = self._in
        if not np.isclose(rolls.pitches[-1], rolls.pitches[0]):
            self._out, _ = strip.periodic(layers, rolls.span(-1), steps, share=closer)
        parts = [
            a + nodes(length, steps)[: steps + (k == len(rolls.pitches) - 1)]
            for k, (a, length) in enumerate(zip(rolls.positions, rolls.pitches, strict=False))
        ]
        self._z = z = np.concatenate(parts)
        self._dt = np.diff(z) / rolls.speed
        self._at = steps * np.arange(1, len(rolls.positions))
        places = np.asarray(rolls.positions)
        self._hats = np.array([np.interp(z, places, row) for row in np.eye(len(places))])
        j = np.clip(np.searchsorted(places, z, side="right") - 1, 0, len(places) - 2)
        self._parabola = 0.5 * rolls.pressure * (z - places[j]) * (places[j + 1] - z)
        self._yields, self._span_of = strip.compliance(layers), j

    @property
    def missing(self) -> float:
        """Error of the deflection that the passes through the outer pitches have left, m."""
        return max(self._in.missing, self._out.missing)

    def _sunk(self, curvature: Array) -> tuple[Array, Array]:
        """Changes of slope and deflection by curvatures (..., n) relative to a straight line."""
        dz = np.diff(self._z)
        zero = np.zeros((*curvature.shape[:-1], 1))
        now, then = curvature[..., 1:], curvature[..., :-1]
        turns = np.cumsum(0.5 * (now + then) * dz, axis=-1)
        turned = np.concatenate([zero, turns], axis=-1)
        area = 0.5 * (turned[..., 1:] + turned[..., :-1]) * dz - dz**2 / 12.0 * (now - then)
        return turned, np.concatenate([zero, np.cumsum(area, axis=-1)], axis=-1)

    def _sheared(self, moments: Array, moment: Array) -> Array:
        """Deflection and slope by shear (2, n); at a roll the slope is the mean of both sides."""
        if not self._yields:
            return np.zeros((2, len(moment)))
        rolls, j = self._rolls, self._span_of
        pitch, places = np.array(rolls.pitches), np.asarray(rolls.positions)
        half, rise = 0.5 * rolls.pressure * pitch, np.diff(moments) / pitch
        force = (rise + half)[j] - rolls.pressure * (self._z - places[j])
        inner = self._at[:-1]
        force[inner] = 0.5 * (rise[1:] + half[1:] + rise[:-1] - half[:-1])
        return self._yields * np.stack([moment - moment[0], force])

    def _advanced(self, unknown: Array) -> tuple[Pitch, Array]:
        """The strip for inner moments and a slope at the first roll, with its residuals."""
        rolls, z = self._rolls, self._z
        ends = float(self._in.moment[0]), float(self._out.moment[-1])
        moments = np.concatenate([[ends[0]], unknown[:-1], [ends[1]]])
        moment = moments @ self._hats + self._parabola
        history = self._layers.advance(self._in.start, moment[1:], self._dt)
        curvature = self._in.curvature[0] + history.curvature
        turned, sunk = self._sunk(curvature)
        w = rolls.offsets[0] + unknown[-1] * (z - z[0]) - sunk
        bent = np.stack([w, unknown[-1] - turned]) + self._sheared(moments, moment)
        found = Pitch(z, moment, history, self._in.start, bent, curvature)
        return found, bent[0, self._at] - np.asarray(rolls.offsets[1:])

    def _slopes(self, history: LayerHistory) -> Array:
        """Derivative of the residuals by the unknowns, from the compliance of each step."""
        elastic = 1.0 / self._layers.stiffness.bending
        hats = self._hats[1:-1]
        creep = np.cumsum((history.compliance - elastic) * hats[:, 1:], axis=1)
        by_moment = elastic * hats
        by_moment[:, 1:] += creep
        rows = (self._yields * hats - self._sunk(by_moment)[1])[:, self._at]
        return np.vstack([rows, self._z[self._at] - self._z[0]]).T

    def solved(self, guess: tuple[Array, Array] | None = None) -> tuple[Pitch, tuple[Array, Array]]:
        """Find moments and slope by Newton's method, with Broyden updates of its matrix.

        Args:
            guess: Result of a strip with other steps (unknowns and matrix); None to start from the
                moment of the periodic pitch.

        Returns:
            The strip, and unknowns and matrix.
        """
        count = len(self._at)
        if guess is None:
            unknown = np.append(np.full(count - 1, self._in.moment[0]), self._in.deflection[1, 0])
            found, missed = self._advanced(unknown)
            matrix = self._slopes(found.history)
        else:
            unknown, matrix = guess
            found, missed = self._advanced(unknown)
        for _ in range(60):
            size = max(found.size, 1e-9)  # m, for a strip without bulge
            if float(np.abs(missed).max()) <= 1e-4 * size:
                return found, (unknown, matrix)
            step = -np.linalg.solve(matrix, missed)
            before = missed
            found, missed = self._advanced(unknown + step)
            while float(np.abs(missed).max()) > 2.0 * float(np.abs(before).max()):
                step *= 0.5
                found, missed = self._advanced(unknown + step)
                if float(np.abs(step[:-1]).max()) < 1e-6 * float(np.abs(unknown[:-1]).max()):
                    break
            unknown = unknown + step
            scale = np.append(np.full(count - 1, np.abs(unknown[:-1]).max()), size)
            scaled = step / scale**2
            matrix = matrix + np.outer(missed - before - matrix @ step, scaled) / (step @ scaled)
        raise RunFailure(
            f"the moments of the shell over {count + 1} rolls cannot be found (it misses them by "
            f"{1e3 * float(np.abs(missed).max()):.2g} mm)"
        )
