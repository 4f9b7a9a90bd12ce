"""Degrees of freedom of generalized plane strain: free, fixed or imposed (thesis III.1).

The slice lies between two planes whose distance is e = a0 + a1 x + a2 y (37), relative to an
undeformed thickness of 1. The unknowns here are the generalized strains [a0 - 1, a1, a2, across],
see `castfem.forms.mechanics`. For any constraints of the planes they are

    generalized strains = offset(t) + directions(t) z

with free scalars z; each has one equation of equilibrium out of (38), the work of stress and load
along its test direction.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.forms.mechanics import GENERALIZED_STRAINS
from castfem.physics.contact.interaction import NOTHING_ADDED

if TYPE_CHECKING:
    from castfem.physics.machine.extraction.effort import Withdrawal

TimeHistory = Callable[[float], float]
"""A function of time, s."""


@dataclass(frozen=True, slots=True)
class Bending:
    """Bending of the slice by the curvature of the machine so far; part of its state.

    Moments and work are those of the modelled part of the section.
    """

    curvature: float = 0.0  #: curvature k of the strand's middle, 1/m
    moment: float = 0.0  #: M = int sigma_zz y da, N m; positive for tension at the intrados
    #: int M dk since the start, J per m of strand; negative in bending
    work: float = 0.0
    #: position where the slice's thickness has not changed in the last step, m from the middle
    #: towards the intrados; None while the curvature is constant
    axis: float | None = None
    #: forces of rolls and drives on the whole strand; None without resistance of rolls
    withdrawal: Withdrawal | None = None


STRAIGHT = Bending()
"""Bending of a straight strand."""


@dataclass(frozen=True, slots=True)
class StepTaken:
    """Data of an accepted step for the planes."""

    time: float  #: time at its end, s
    #: returns M at its end, N m (collective); only called for bent planes
    moment: Callable[[], float]
    change: Array  #: change of the generalized strains (4,)
    temperature: Array  #: temperatures at its end, at the owned vertices (owned,), K
    #: extra loads of the next two pairs of rolls (`BearsRolls.added`), N/m
    added: tuple[float, float] = NOTHING_ADDED


class Planes(Protocol):
    """Constraints and loads of the generalized strains.

    Methods for bent planes have defaults for a straight strand.
    """

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free scalars."""

    @property
    def steady(self) -> bool:
        """Whether the constraints are constant in time."""

    def at(self, time: float) -> tuple[Array, Array, Array]:
        """Offset (4,), directions (4, free) and test directions (4, free) at `time` (s).

        The work of the stress along each test direction must equal that of the load. Test
        directions are the directions themselves unless a constraint couples two generalized
        strains.
        """

    def load(self, time: float) -> Array:
        """External axial force (N), moments of sigma_zz with x and y (N m), and force across."""

    def withdrawal_force(self, past: Bending, time: float) -> float:
        """Axial force, N, of rolls and drives in a step from `past` to `time` (s)."""
        return 0.0

    def equilibrium(self, past: Bending, time: float) -> tuple[Array, Array]:
        """Test directions (4, free) of a step that ends at `time` (s), and the load (4,)."""

    def initial_bending(self, time: float) -> Bending:
        """Bending of a slice that is cast at `time` (s)."""
        return STRAIGHT

    def bending_after(self, past: Bending, step: StepTaken) -> Bending:
        """Bending after a step."""
        return past

    def bending_force(self, now: Bending) -> float:
        """Axial force from bending in the slice, N: N - F without other forces."""
        return 0.0


LOADS = ("force", "moment_x", "moment_y")
"""Names of the external loads, in the order of `Planes.load`."""


def loads_at(planes: Planes, past: Bending, time: float) -> dict[str, float]:
    """Return the loads (N, N m) with work in a test direction, by name, in a step to `time`."""
    test, load = planes.at(time)[2], planes.load(time)
    load[0] += planes.withdrawal_force(past, time)
    works = np.abs(test).sum(axis=1) > 0.0
    return {name: float(load[i]) for i, name in enumerate(LOADS) if load[i] != 0.0 and works[i]}


@dataclass(frozen=True, slots=True)
class ScaledPlanes:
    """Free generalized strains at one time, scaled to lengths."""

    offset: Array  #: generalized strains where the free scalars are zero (4,)
    directions: Array  #: generalized strains for each unknown (4, free), 1/m and 1/m2
    test_directions: Array  #: test directions (4, free), 1/m and 1/m2
    load: Array  #: work of the external forces in them (free,), N/m
    scaling: Array  #: free scalar for each unknown, 1/m
    coupled: bool  #: whether `test_directions` differ from `directions`

    @classmethod
    def of(cls, planes: Planes, past: Bending, time: float, length: float) -> ScaledPlanes:
        """Return those of a section of size `length` (m) in a step from `past` to `time` (s).

        A unit of an unknown moves the slice by about one unit of length.
        """
        offset, directions, _ = planes.at(time)
        test, forces = planes.equilibrium(past, time)
        size = np.array([[1.0], [length], [length], [1.0]])
        scaling = 1.0 / (np.abs(directions * size).max(axis=0) * length)
        load = (test * scaling).T @ forces
        coupled = not np.array_equal(test, directions)
        return cls(offset, directions * scaling, test * scaling, load, scaling, coupled)

    def generalized_strains(self, unknowns: Array) -> Array:
        """Generalized strains (4,)."""
        return np.asarray(self.offset + self.directions @ unknowns)


def allowed_strains(groups: tuple[str, ...]) -> tuple[str, ...]:
    """Generalized strains that the symmetry of a section allows, from its boundary groups.

    A section mirrored at x = 0 (group symmetry_x) has no a1, one mirrored at y = 0 no a2.
    """
    barred = {"a1": "symmetry_x", "a2": "symmetry_y"}
    return tuple(
        name
        for name in GENERALIZED_STRAINS[:3]
        if not any(g.startswith(barred.get(name, "?")) for g in groups)
    )


def check_strains(names: tuple[str, ...], groups: tuple[str, ...]) -> None:
    """Refuse generalized strains that the symmetry of the section excludes.

    Raises:
        InputError: Names each of them.
    """
    allowed = (*allowed_strains(groups), "across")
    wrong = [n for n in names if n not in allowed]
    if wrong:
        raise InputError(
            [
                f"{n}: the symmetry of this section keeps it at zero; it can have "
                f"{', '.join(allowed[:-1])}"
                for n in wrong
            ]
        )


def zero(time: float) -> float:
    """Return 0: no load at any time."""
    return 0.0


@dataclass(frozen=True)
class PlainPlanes(Planes):
    """Each generalized strain free, or imposed over time (fixed at zero by default)."""

    free: tuple[str, ...] = ("a0",)  #: names of the free ones, from `GENERALIZED_STRAINS`
    #: values over time (s) of the others: strain, 1/m, 1/m, strain
    imposed: Mapping[str, TimeHistory] = field(default_factory=dict)
    force: TimeHistory = zero  #: external axial force, N
    #: external moment of sigma_zz with x, N m (thesis' M_y), over time
    moment_x: TimeHistory = zero
    moment_y: TimeHistory = zero  #: external moment with y, N m (M_x), over time

    def __post_init__(self) -> None:
        """Check the names."""
        for name in (*self.free, *self.imposed):
            if name not in GENERALIZED_STRAINS:
                raise InputError(
                    f"{name}: not a generalized strain; one of {', '.join(GENERALIZED_STRAINS)}"
                )
        both = [n for n in self.free if n in self.imposed]
        if both or len(set(self.free)) < len(self.free):
            named = ", ".join(both or self.free)
            raise InputError(f"{named}: must be either free or imposed, and given once")

    @property
    def steady(self) -> bool:
        """See `Planes`."""
        loads = self.force, self.moment_x, self.moment_y
        return not self.imposed and all(load is zero for load in loads)

    def at(self, time: float) -> tuple[Array, Array, Array]:
        """See `Planes`."""
        offset = np.zeros(4)
        for name, history in self.imposed.items():
            offset[GENERALIZED_STRAINS.index(name)] = history(time)
        directions = np.eye(4)[:, [GENERALIZED_STRAINS.index(n) for n in self.free]]
        return offset, directions, directions

    def load(self, time: float) -> Array:
        """See `Planes`."""
        return np.array([self.force(time), self.moment_x(time), self.moment_y(time), 0.0])

    def equilibrium(self, past: Bending, time: float) -> tuple[Array, Array]:
        """See `Planes`."""
        return self.at(time)[2], self.load(time)
