"""The steady, travelling, creeping strip of one pitch.

The steel of the strip moves from roll to roll at the casting speed: at z = v t it carries the
moment M(z) = M0 + p L z/2 - p z^2/2, and its curvature follows from the law with all its memory. If
all pitches are equal the strip is periodic: the curvature is the same after a pitch, which gives
M0; the rolls keep it straight on average, which gives the curvature at the roll; and w = 0 there.

The periodic state is the fixed point of the map over a pitch, solved for stress, state and M0
together. Steps are implicit of first order; the result is extrapolated from two numbers of steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.flow_laws import STRAIN
from castfem.physics.constitutive.hardening_laws import Hardening
from castfem.physics.machine.bulging.layers import Condition, LayerHistory, Layers
from castfem.physics.machine.bulging.result import Bulge, Span, deflected
from castfem.physics.machine.bulging.shell import Shell


class Anderson:
    """Anderson acceleration: remembers the last iterations and proposes the next x.

    The memory is reset where the residual has doubled.
    """

    depth = 5  # number of remembered iterations

    def __init__(self) -> None:
        self._x: list[Array] = []
        self._rest: list[Array] = []

    def next(self, x: Array, image: Array) -> Array:
        """Return the next x, from x (n,) and its image g(x) (n,)."""
        rest = image - x
        if self._rest and np.linalg.norm(rest) > 2.0 * np.linalg.norm(self._rest[-1]):
            self._x, self._rest = [], []
        self._x = [*self._x[-self.depth :], x]
        self._rest = [*self._rest[-self.depth :], rest]
        if len(self._x) == 1:
            return image
        moves = np.diff(np.array(self._x), axis=0).T
        changes = np.diff(np.array(self._rest), axis=0).T
        share = np.linalg.lstsq(changes, self._rest[-1], rcond=1e-6)[0]
        return np.asarray(image - (moves + changes) @ share)


VIRGIN_PITCHES = 4  # for a law that cannot become periodic


def nodes(length: float, steps: int) -> Array:
    """Ends of the steps of a pitch, m, (steps + 1,), denser at the rolls.

    There, where the moment has its peaks, steps are 0.6 of the average.
    """
    s = np.linspace(0.0, 1.0, steps + 1)
    wave = np.sin(2.0 * np.pi * s)
    return np.asarray(length * (s - 0.6 / (2.0 * np.pi) * wave))


def accumulates(law: Law) -> bool:
    """Whether each pitch hardens the steel further, so that there is no periodic state."""
    return isinstance(law, Hardening) and not law.signed and law.recovery_time is None


@dataclass(frozen=True, slots=True)
class Pitch:
    """One pitch, computed with some number of steps."""

    z: Array  #: nodes, m, (m+1,)
    moment: Array  #: moment at the nodes, N per metre of width
    history: LayerHistory  #: history of its layers
    start: Condition  #: stress and state at the upstream roll
    deflection: Array  #: deflection and slope, (2, m+1), of the strip that is straight on average
    curvature: Array  #: its curvature, (m+1,)
    #: error of the deflection that the passes have left, m: its change in the last pass or, if
    #: larger, its size times the difference of the curvature at both ends over its range
    missing: float = np.inf

    def sheared(self, span: Span, yields: float) -> Pitch:
        """Return the pitch with shear deformation; `yields` is slope over shear force, m/N."""
        slope = yields * span.pressure * (0.5 * span.length - self.z)
        more = np.stack([yields * (self.moment - self.moment[0]), slope])
        return replace(self, deflection=self.deflection + more)

    @property
    def size(self) -> float:
        """Largest deflection to either side, m."""
        return max(float(np.abs(self.deflection[0]).max()), 1e-300)


@dataclass(frozen=True, slots=True)
class CreepingStrip:
    """A strip that creeps while it travels.

    A law that hardens by accumulated strain has no periodic state, since each pitch hardens it
    further: the strip is then that of `pitches` pitches of initially unstrained steel.

    It may also have elastic shear deformation: M' is the shear force, and its slope S M' is added
    to that of bending; only the latter is continuous at a roll.
    """

    law: Law  #: law of the steel
    steps: int = 160  #: steps per pitch; even
    layers: int = 24  #: points through the thickness; even
    #: pitches of initially unstrained steel with a law that cannot become periodic
    pitches: int = VIRGIN_PITCHES
    shear: bool = False  #: whether it has shear deformation
    passes: int = 30  #: largest number of passes through the pitch
    tolerance: float = 3e-4  #: relative change of the deflection from pass to pass
    gap: float = 5e-3  #: allowed deviation from periodicity, relative to the range of the curvature

    def compliance(self, layers: Layers) -> float:
        """Slope over shear force per metre of width, m/N; 0 without shear."""
        return layers.stiffness.shear if self.shear else 0.0

    def bulge(self, span: Span, shell: Shell) -> Bulge:
        """See `BulgingModel`."""
        if not span.pressure > 0.0:
            return Bulge.none(span, shell)
        layers = Layers(self.law, shell.points(self.layers, shell.breaks(self.law)))
        # Each begins where the one with half as many steps has ended; most passes are of the first.
        coarser = coarsest(self.steps, lambda n: self._at_rest(layers, span, n))
        grows = accumulates(self.law)
        coarse, _ = self.periodic(layers, span, self.steps // 2, None if grows else coarser)
        fine, periodic = self.periodic(layers, span, self.steps, None if grows else coarse)
        force = np.array([span.pressure * span.length])
        if yields := self.compliance(layers):
            coarse, fine = (one.sheared(span, yields) for one in (coarse, fine))
            coarser = None if coarser is None else coarser.sheared(span, yields)
        bulge = extrapolated(coarse, fine, layers, coarser)
        error = bulge.error + fine.missing
        return replace(bulge, roll_force=force, periodic=periodic, error=error)

    def _at_rest(self, layers: Layers, span: Span, steps: int) -> Pitch | None:
        """The periodic pitch; None if it is not yet periodic, so that it has no error estimate."""
        found, periodic = self.periodic(layers, span, steps)
        return found if periodic or accumulates(self.law) else None

    def periodic(
        self,
        layers: Layers,
        span: Span,
        steps: int,
        guess: Pitch | None = None,
        share: float = 1.0,
    ) -> tuple[Pitch, bool]:
        """Return the periodic pitch for some number of steps, and whether it has converged.

        Args:
            layers: Layers of the shell.
            span: The pitch.
            steps: Number of steps.
            guess: Initial pitch; None for unstrained steel and the moment of a clamped strip.
            share: Factor on the tolerances.

        Raises:
            RunFailure: The shell cannot carry the pressure.
        """
        grows, passes = accumulates(self.law), self.passes
        tolerance, gap = share * self.tolerance, share * self.gap
        search = _Search(layers, span, nodes(span.length, steps), guess)
        for k in range(self.pitches if grows else passes):
            search.advance()
            if not grows and search.change <= tolerance and abs(search.gap) <= gap:
                return search.pitch, True
            search.move(accelerated=k > 0 and not grows)
        return replace(search.pitch, missing=0.0) if grows else search.pitch, False


def coarsest(steps: int, strip: Callable[[int], Pitch | None]) -> Pitch | None:
    """The strip with a quarter of the steps, only for the error estimate.

    None if it fails, or if its nodes are not among those of the others.
    """
    if steps % 4:
        return None
    try:
        return strip(steps // 4)
    except RunFailure:
        return None


def extrapolated(coarse: Pitch, fine: Pitch, layers: Layers, coarser: Pitch | None) -> Bulge:
    """Return the bulge extrapolated from two strips, one with twice the steps (first order).

    It has no roll force yet. Its error is the difference to that of half as many steps, which is
    several times too large; without that, to the strip that is not extrapolated.
    """
    w, slope = 2.0 * fine.deflection[:, ::2] - coarse.deflection
    before, places = fine.deflection[0, ::2], slice(None)
    if coarser is not None:
        before = 2.0 * coarse.deflection[0, ::2] - coarser.deflection[0]
        places = slice(None, None, 2)
    return Bulge(
        z=coarse.z,
        deflection=w,
        slope=slope,
        moment=2.0 * fine.moment[::2] - coarse.moment,
        curvature=2.0 * fine.curvature[::2] - coarse.curvature,
        axial_strain=2.0 * fine.history.axial_strain[::2] - coarse.history.axial_strain,
        neutral=layers.stiffness.neutral,
        thickness=layers.points.thickness,
        roll_force=np.zeros(0),
        error=float(np.abs(w[places] - before).max()),
    )


class _Search:
    """Search for the periodic state.

    Attributes:
        change: Change of its deflection since the previous pass, over the deflection.
        gap: Difference of its last and first curvature, over the range of the curvature.
    """

    def __init__(self, layers: Layers, span: Span, z: Array, guess: Pitch | None) -> None:
        self._layers, self._z = layers, z
        self._parabola = 0.5 * span.pressure * z * (span.length - z)
        self._dt = np.diff(z) / span.speed
        self._clamped = span.pressure * span.length**2 / 12.0
        self._virgin, self._latest = guess is None, guess
        self._start = layers.virgin() if guess is None else guess.start
        self._first = -self._clamped if guess is None else float(guess.moment[0])
        self._anderson = Anderson()
        names = layers.law.state_names
        self._signed = [i for i, name in enumerate(names) if name.startswith(f"{STRAIN}_")]
        self.change, self.gap = np.inf, np.inf

    def advance(self) -> None:
        """Advance through one pitch from the present initial state and M0."""
        moment = self._first + self._parabola
        history = self._layers.advance(self._start, moment[1:], self._dt)
        kappa, z = history.curvature, self._z
        mean = float((0.5 * (kappa[1:] + kappa[:-1]) * np.diff(z)).sum() / z[-1])
        kappa = kappa - mean
        w = deflected(z, kappa)
        # In its first step unstrained steel takes up the moment elastically, which is not creep.
        self._gap = float(kappa[-1] - kappa[1 if self._virgin else 0])
        self.gap = self._gap / max(float(np.ptp(kappa)), 1e-300)
        new, before = Pitch(z, moment, history, self._start, w, kappa), self._latest
        if before is not None and len(before.z) == len(z):
            self.change = float(np.abs(w[0] - before.deflection[0]).max()) / new.size
        missing = max(self.change, abs(self.gap)) * new.size
        self._latest, self._virgin = replace(new, missing=missing), False

    @property
    def pitch(self) -> Pitch:
        """The last computed pitch."""
        assert self._latest is not None, "requested before the first pitch was computed"
        return self._latest

    def move(self, accelerated: bool) -> None:
        """Choose the initial state and M0 of the next pass."""
        history, first, stiff = self.pitch.history, self._first, self._layers.stiffness.bending
        end = history.end
        creep = float((history.compliance[1:] - 1.0 / stiff).sum())
        if creep * stiff > 1e-6:  # it creeps; the moment changes by at most 0.3 of it per pass
            most = 0.3 * max(abs(first), self._clamped)
            first -= float(np.clip(self._gap / creep, -most, most))
        if not accelerated:
            self._start, self._first = end, first
            return
        new = self._anderson.next(self._packed(self._start, self._first), self._packed(end, first))
        self._start, self._first = self._unpacked(new, end)

    def _scales(self) -> tuple[float, float, Array]:
        """Scales of stress and strain, and roots of the layers' weights, for a uniform vector."""
        shell, stiff = self._layers.points, self._layers.stiffness
        stress = 6.0 * self._clamped / shell.thickness**2
        strain = 0.5 * self._clamped / stiff.bending * shell.thickness
        return stress, strain, np.sqrt(shell.weight / shell.thickness)[:, None]

    def _packed(self, condition: Condition, first: float) -> Array:
        stress, strain, root = self._scales()
        parts = root * condition.stress / stress, root * condition.state[:, self._signed] / strain
        return np.concatenate([parts[0].ravel(), parts[1].ravel(), [first / self._clamped]])

    def _unpacked(self, x: Array, end: Condition) -> tuple[Condition, float]:
        """Stress, signed state and M0 from a vector; other state variables are those of `end`."""
        stress, strain, root = self._scales()
        n = len(root)
        state = end.state.copy()
        state[:, self._signed] = x[4 * n : -1].reshape(n, -1) * strain / root
        stresses = x[: 4 * n].reshape(n, 4) * stress / root
        return Condition(stresses, state), float(x[-1]) * self._clamped
