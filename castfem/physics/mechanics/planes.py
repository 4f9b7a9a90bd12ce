"""Degrees of freedom of generalized plane strain: free, fixed or imposed (thesis III.1).

The slice lies between two planes whose distance is e = a0 + a1 x + a2 y (37), relative to an
undeformed thickness of 1.  What is carried here are the generalized strains
[a0 - 1, a1, a2, across], see `castfem.forms.mechanics`.  Whatever constrains the planes, they are

    generalized strains = offset(t) + directions(t) z

with free scalars z; to each belongs one equation of equilibrium out of (38), the work of stress and
load along its test direction.

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
"""A quantity over time, s."""


@dataclass(frozen=True, slots=True)
class Bending:
    """What the machine's curvature has done to the slice so far; part of its state.

    Moments and work are those of the modelled part of the section.
    """

    curvature: float = 0.0  #: k of the strand's middle, 1/m
    moment: float = 0.0  #: M = int sigma_zz y da, N m; positive where the intrados is pulled
    #: int M dk from the first instant on, J per m of strand; bending takes less than zero
    work: float = 0.0
    #: where the slice's thickness has not changed in the last step, m from the middle towards the
    #: intrados; None where the curvature stayed
    axis: float | None = None
    #: what rolls and drives have done, of the whole strand; None where no rolls resist
    withdrawal: Withdrawal | None = None


STRAIGHT = Bending()
"""Of a strand that goes straight down."""


@dataclass(frozen=True, slots=True)
class StepTaken:
    """What planes get to know of an accepted step."""

    time: float  #: at its end, s
    #: computes M at its end, N m (collective); called only for planes that are bent
    moment: Callable[[], float]
    change: Array  #: of the generalized strains over it (4,)
    temperature: Array  #: at its end, at the owned vertices (owned,), K
    #: to the forces of the next two pairs of rolls (`BearsRolls.added`), N/m
    added: tuple[float, float] = NOTHING_ADDED


class Planes(Protocol):
    """What constrains and loads the degrees of freedom of generalized plane strain.

    What only planes know that are bent is as in a strand that goes straight down.
    """

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free scalars."""

    @property
    def steady(self) -> bool:
        """Whether all this is the same at any time."""

    def at(self, time: float) -> tuple[Array, Array, Array]:
        """Offset (4,), directions (4, free) and test directions (4, free) at `time` (s).

        The work of the stress along each test direction must be that of the load.  They are the
        directions themselves but where a constraint couples two generalized strains.
        """

    def load(self, time: float) -> Array:
        """External axial force (N), moments of sigma_zz with x and y (N m), and force across."""

    def withdrawal_force(self, past: Bending, time: float) -> float:
        """Axial force, N, by rolls and drives, in a step from `past` to `time` (s)."""
        return 0.0

    def equilibrium(self, past: Bending, time: float) -> tuple[Array, Array]:
        """Test directions (4, free) of a step that ends at `time` (s), and the load (4,)."""

    def initial_bending(self, time: float) -> Bending:
        """The bending of a slice that is cast at `time` (s)."""
        return STRAIGHT

    def bending_after(self, past: Bending, step: StepTaken) -> Bending:
        """The bending after a step, from that before it."""
        return past

    def bending_force(self, now: Bending) -> float:
        """Axial force that bending has left in the slice, N: N - F where nothing else acts."""
        return 0.0


LOADS = ("force", "moment_x", "moment_y")
"""Names of the loads from outside, in the order of `Planes.load`."""


def loads_at(planes: Planes, past: Bending, time: float) -> dict[str, float]:
    """Return by name the loads (N, N m) that work along a test direction, in a step to `time`."""
    test, load = planes.at(time)[2], planes.load(time)
    load[0] += planes.withdrawal_force(past, time)
    works = np.abs(test).sum(axis=1) > 0.0
    return {name: float(load[i]) for i, name in enumerate(LOADS) if load[i] != 0.0 and works[i]}


@dataclass(frozen=True, slots=True)
class ScaledPlanes:
    """Free degrees of freedom of the planes at one instant, scaled to lengths."""

    offset: Array  #: generalized strains where the free scalars are zero (4,)
    directions: Array  #: generalized strains for each unknown (4, free), 1/m and 1/m2
    test_directions: Array  #: the work along them is balanced (4, free), scaled likewise
    load: Array  #: work of the external forces on them (free,), N/m
    scaling: Array  #: free scalar for each unknown, 1/m
    coupled: bool  #: whether `test_directions` differ from `directions`

    @classmethod
    def of(cls, planes: Planes, past: Bending, time: float, length: float) -> ScaledPlanes:
        """Those of a section of size `length` (m) in a step from `past` to `time` (s).

        An unknown of unit size moves the slice by about its own unit of length.
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
    """Generalized strains that the symmetry of a section leaves, by its boundary groups.

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
        InputError: Naming each.
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
    """No load, at any time."""
    return 0.0


@dataclass(frozen=True)
class PlainPlanes(Planes):
    """Each generalized strain free, or imposed over time (fixed at zero by default)."""

    free: tuple[str, ...] = ("a0",)  #: those that are free, of `GENERALIZED_STRAINS`
    #: value over time (s) of others: strain, 1/m, 1/m, strain
    imposed: Mapping[str, TimeHistory] = field(default_factory=dict)
    force: TimeHistory = zero  #: external axial force, N
    moment_x: TimeHistory = zero  #: external moment of sigma_zz with x, N m (thesis' M_y)
    moment_y: TimeHistory = zero  #: the same with y (M_x); each over time

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
