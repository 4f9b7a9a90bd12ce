"""Friction between strand and wall (thesis III.4.2-4.3): thresholds, viscous laws, return mapping.

Friction is a vector of two components, in the plane and along the strand. Below its threshold the
contact sticks, with an elastic slip tau / K_tau (240); above, it slides in the direction of the
friction, without opening (non-associated, (246)-(248)). Over a step this is a radial return, as in
plasticity: fully implicit, where the thesis integrates the rates (261)-(262).

Friction that a law has at p = 0 (Tresca's threshold, a cohesion, viscous friction) is limited to
`cap` times the pressure. Otherwise friction would jump where contact begins: a point that its own
friction lifts off the wall, and that returns without it, has no solution. Lightly pressed surfaces
touch on a few spots only, in proportion to the pressure, so that such laws hold only at pressures
near the yield stress (Wanheim and Bay, CIRP Annals 27 (1978) 189).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from castfem.base.types import Array, Flags

SQRT3 = 3.0**0.5
CAP = 1.0  # limit of friction over pressure, where the law itself has friction without pressure
FINITE = (1e-300, 1e300)


@dataclass(frozen=True, slots=True)
class ViscousLimits:
    """Limits of the search for the slip rate of viscous friction, in its logarithm."""

    iterations: int = 60  # largest number of iterations, enough for bisection alone
    furthest: float = 60.0  # slip rates smaller than the largest by this factor count as zero
    # tolerance of the logarithm of the rate and, relative, of that of the stress
    close: float = 1e-14


LIMITS = ViscousLimits()


class Friction(Protocol):
    """A law of friction."""

    @property
    def cap(self) -> float:
        """Largest friction over pressure beyond the threshold."""

    def threshold(self, pressure: Array) -> tuple[Array, Array]:
        """Sticking threshold tau_c (n,), Pa, and its derivative by the pressure."""

    def excess(self, rate: Array) -> tuple[Array, Array] | None:
        """Friction above the threshold (n,), Pa, at slip rates (n,), m/s, and its derivative.

        None for a law without viscosity.
        """


def _check(name: str, value: float, low: float = 0.0, high: float = np.inf) -> None:
    """Refuse a number outside low ... high, or NaN."""
    if not low <= value <= high:
        raise ValueError(f"friction: {name} ({value}) must be within {low:g} ... {high:g}")


@dataclass(frozen=True, slots=True)
class Coulomb:
    """tau_c = mu p + b (231), optionally limited by sqrt(p^2 + 3 tau^2) <= p0 (233)."""

    coefficient: float  #: coefficient of friction mu
    cohesion: float = 0.0  #: cohesion b, Pa
    yield_stress: float | None = None  #: p0 of the weaker material, Pa; None for no limit
    cap: float = CAP  #: largest cohesion over pressure

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check("coefficient", self.coefficient)
        _check("cohesion", self.cohesion)
        if self.yield_stress is not None:
            _check("yield_stress", self.yield_stress, 1e-300)
        _check("cap", self.cap, *FINITE)

    def threshold(self, pressure: Array) -> tuple[Array, Array]:
        """See `Friction`."""
        limit, slope = _faded_in(self.cohesion, self.cap, pressure)
        limit, slope = limit + self.coefficient * pressure, slope + self.coefficient
        if self.yield_stress is None:
            return limit, slope
        room = np.sqrt(np.maximum(self.yield_stress**2 - pressure**2, 0.0) / 3.0)
        over = limit > room
        fall = -pressure / np.maximum(3.0 * room, 1e-6 * self.yield_stress)
        return np.where(over, room, limit), np.where(over & (room > 0.0), fall, slope * ~over)

    def excess(self, rate: Array) -> tuple[Array, Array] | None:
        """See `Friction`."""
        return None


@dataclass(frozen=True, slots=True)
class Tresca:
    """tau_c = m p0 / sqrt(3) (234)-(235)."""

    share: float  #: friction factor m, 0 to 1
    yield_stress: float  #: yield stress p0, Pa
    cap: float = CAP  #: largest tau_c over pressure

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check("share", self.share, 0.0, 1.0)
        _check("yield_stress", self.yield_stress)
        _check("cap", self.cap, *FINITE)

    def threshold(self, pressure: Array) -> tuple[Array, Array]:
        """See `Friction`."""
        return _faded_in(self.share * self.yield_stress / SQRT3, self.cap, pressure)

    def excess(self, rate: Array) -> tuple[Array, Array] | None:
        """See `Friction`."""
        return None


@dataclass(frozen=True, slots=True)
class Viscous:
    """Beyond a threshold tau - tau_c = min(alpha p0/sqrt(3) (|v|/u)^n, p0/sqrt(3)) (236)."""

    base: Coulomb | Tresca  #: law of the threshold
    share: float  #: friction factor alpha
    yield_stress: float  #: yield stress p0, Pa
    speed: float  #: reference speed u, m/s
    exponent: float  #: exponent n
    cap: float = CAP  #: largest tau - tau_c over pressure

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("share", "yield_stress", "exponent"):
            _check(name, getattr(self, name))
        _check("speed", self.speed, 1e-300)
        _check("cap", self.cap, *FINITE)

    def threshold(self, pressure: Array) -> tuple[Array, Array]:
        """See `Friction`."""
        return self.base.threshold(pressure)

    def excess(self, rate: Array) -> tuple[Array, Array] | None:
        """See `Friction`."""
        top = self.yield_stress / SQRT3
        value, slope = _power(rate, self.share * top / self.speed**self.exponent, self.exponent)
        return np.minimum(value, top), np.where(value < top, slope, 0.0)


@dataclass(frozen=True, slots=True)
class Lubricant:
    """tau = beta |v|^n without threshold (237)."""

    coefficient: float  #: coefficient beta, Pa (s/m)^n
    exponent: float  #: exponent n
    cap: float = CAP  #: largest tau over pressure

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check("coefficient", self.coefficient)
        _check("exponent", self.exponent)
        _check("cap", self.cap, *FINITE)

    def threshold(self, pressure: Array) -> tuple[Array, Array]:
        """See `Friction`."""
        return np.zeros_like(pressure), np.zeros_like(pressure)

    def excess(self, rate: Array) -> tuple[Array, Array] | None:
        """See `Friction`."""
        return _power(rate, self.coefficient, self.exponent)


def _faded_in(friction: float, cap: float, pressure: Array) -> tuple[Array, Array]:
    """The smaller of friction and `cap` times the pressure, and its derivative by p."""
    steep = cap * pressure < friction
    return np.where(steep, cap * pressure, friction), np.where(steep, cap, 0.0)


def _power(rate: Array, coefficient: float, exponent: float) -> tuple[Array, Array]:
    """Coefficient times rate^exponent, and its derivative."""
    rate = np.maximum(rate, 1e-300)
    value = coefficient * rate**exponent
    return value, exponent * value / rate


@dataclass(frozen=True, slots=True)
class Sliding:
    """Friction at n points at the end of a step."""

    traction: Array  #: friction in the plane and along the strand (n, 2), Pa
    by_trial: Array  #: its derivative by the trial friction (n, 2, 2)
    by_pressure: Array  #: its derivative by p (n, 2)
    slides: Flags  #: whether the threshold was reached (n,)


def return_friction(
    law: Friction,
    trial: Array,
    pressure: Array,
    stiffness: Array,
    dt: float,
    held: tuple[Flags, Flags] | None = None,
) -> Sliding:
    """Return trial friction to the limit of the law, along its own direction.

    Args:
        law: The friction law.
        trial: Friction if all slip of the step were elastic (n, 2), Pa.
        pressure: Contact pressure (n,), Pa; no friction where it is 0.
        stiffness: Tangential stiffness K_tau (n,), Pa/m.
        dt: Length of the step, s.
        held: Points to be treated as touching, and as sliding, for any pressure and trial friction.
            Viscous friction slides where it does.
    """
    touches = pressure > 0.0 if held is None else held[0]
    size = np.hypot(*trial.T)
    limit, slope = law.threshold(pressure)
    limit, slope = limit * touches, slope * touches
    viscous = law.excess(np.zeros(0)) is not None
    slides = touches & (size > limit) if held is None or viscous else held[1]
    direction = trial / np.maximum(size, 1e-300)[:, None]
    new, by_pressure, by_size = limit, slope, np.zeros_like(size)
    if viscous:
        new, by_limit = limit.copy(), np.ones_like(size)
        damping = stiffness[slides] * dt
        new[slides], by_limit[slides] = _viscous(law, size[slides], limit[slides], damping)
        by_pressure, by_size = by_limit * slope, 1.0 - by_limit
        # Limited by the pressure the excess is the lower of two curves, and the root the lower of
        # two roots.
        most, rise = limit + law.cap * pressure, slope + law.cap
        steep = new > most
        new, by_size = np.where(steep, most, new), np.where(steep, 0.0, by_size)
        by_pressure = np.where(steep, rise, by_pressure)
    new, by_size = np.where(slides, new, size), np.where(slides, by_size, 1.0)
    along = np.einsum("ni,nj->nij", direction, direction)
    share = np.where(slides, new / np.maximum(size, 1e-300), 1.0)
    by_trial = share[:, None, None] * (np.eye(2) - along) + by_size[:, None, None] * along
    on = touches.astype(float)
    return Sliding(
        traction=(new * on)[:, None] * direction,
        by_trial=by_trial * on[:, None, None],
        by_pressure=np.where(slides, by_pressure, 0.0)[:, None] * direction,
        slides=slides,
    )


def _viscous(law: Friction, size: Array, limit: Array, damping: Array) -> tuple[Array, Array]:
    """Magnitude of friction above the threshold, and its derivative by that of the trial.

    It solves damping rate + excess(rate) = size - limit for the slip rate, by Newton's method on
    the logarithms of both: a power of the rate is a straight line there, and the root is found in
    about four iterations. A step out of the bracket is replaced by bisection, so that the method
    cannot fail.

    Args:
        law: Friction law with viscosity.
        size: Magnitude of the trial friction (n,), Pa, above the limit.
        limit: Threshold (n,), Pa.
        damping: Friction released per slip rate over the step (n,), Pa s/m.
    """

    def excess(log_rate: Array) -> tuple[Array, Array]:
        found = law.excess(np.exp(log_rate))
        assert found is not None
        return found

    over = np.log(size - limit)
    rounding = LIMITS.close * (1.0 + np.abs(over))
    high = over - np.log(damping)  # slip rate without friction
    low = high - LIMITS.furthest
    sticks = excess(low)[0] >= size - limit
    at = np.where(sticks, low, high - np.log1p(excess(high)[0] / (size - limit)))
    for _ in range(LIMITS.iterations):
        rate = np.exp(at)
        value, slope = excess(at)
        whole = damping * rate + value
        error = np.log(whole) - over
        low, high = np.where(error < 0.0, at, low), np.where(error > 0.0, at, high)
        step = error * whole / (rate * (damping + slope))
        new = at - step
        new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        found = sticks | (np.abs(error) <= rounding)
        done = found | (np.abs(new - at) <= LIMITS.close)
        at = np.where(found, at, new)
        if done.all():
            break
    value, slope = excess(at)
    slipped = damping * np.exp(at)
    # The smaller of the two is more accurate; for friction that jumps at rest only the latter is.
    tau = np.where(value < slipped, limit + value, size - slipped)
    return tau, np.asarray(1.0 / (1.0 + slope / damping))
