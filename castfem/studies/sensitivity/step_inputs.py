"""Input of a step of the slice, and derivatives of its states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from castfem.base.types import Array, Indices
from castfem.physics.contact.state import CONTACT
from castfem.physics.mechanics.material_points import FedPoints
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.state import MechanicalState

RATES = ("rate", "scalar_rate")
CARRIED = ("displacement", "generalized_strains", "scalars", *RATES, "stress", "internal")
"""Parts of a mechanical state that depend on its history."""

Slopes = dict[str, Array]
"""Derivatives of a state by its parts: `CARRIED`, and the arrays of contact."""


def none_of(state: MechanicalState) -> Slopes:
    """Zero derivatives of a state."""
    found = {name: np.zeros_like(getattr(state, name)) for name in CARRIED}
    if state.contact is not None:
        found |= {name: np.zeros_like(v) for name, v in state.contact.numbers().items()}
    return found


def moved(state: MechanicalState, slopes: Slopes, by: float) -> MechanicalState:
    """A state as it would be with a parameter moved by `by`, in its unit."""
    if not slopes:
        return state
    changed: Slopes = {name: getattr(state, name) + by * slopes[name] for name in CARRIED}
    if state.contact is not None:
        numbers = state.contact.numbers()
        changed |= {name: value + by * slopes[name] for name, value in numbers.items()}
    return with_numbers(state, changed)


def with_numbers(state: MechanicalState, numbers: Slopes) -> MechanicalState:
    """A state with other arrays, by their names in `Slopes`."""
    changed: dict[str, Any] = {name: numbers[name] for name in CARRIED}
    if state.contact is not None:
        touched: dict[str, Any] = {
            name.removeprefix(CONTACT): numbers[name] for name in state.contact.numbers()
        }
        contact = replace(state.contact, **touched)
        changed["interactions"] = tuple(
            contact if one is state.contact else one for one in state.interactions
        )
    return replace(state, **changed)


@dataclass(frozen=True, slots=True)
class Stressed:
    """The points of a step with stress: not those of deep cells of fed liquid."""

    kept: Indices  #: their indices among the active points (m,)
    rows: Indices  #: their indices among all points (m,)
    deviators: int  #: number of points of the deviator's rule; they come first
    stress: Array  #: stress at the start of the step (m, 4), Pa
    internal: Array  #: state of the law there (m, states)
    before: Array  #: temperatures at its start (m,), K
    after: Array  #: temperatures at its end
    now: Array  #: stress at its end (m, 4), Pa
    fed: FedPoints | None  #: the fed liquid among them; None for an elastic body

    @classmethod
    def of(
        cls,
        run: MechanicalProblem,
        old: MechanicalState,
        state: MechanicalState,
        points: tuple[Array, Array],
    ) -> Stressed:
        """Make those of a step of the run, from the temperatures at all points, K."""
        active, fed = run.active, run.fed
        kept = np.arange(active.count) if fed is None else np.flatnonzero(fed.carries)
        if fed is not None:
            fed = FedPoints(fed.carries[kept], fed.liquid[kept], fed.young)
        rows = np.arange(run.points.count)[active.rows][kept]
        return cls(
            kept=kept,
            rows=rows,
            deviators=int(np.searchsorted(kept, active.deviator_points)),
            stress=old.stress[rows],
            internal=old.internal[rows],
            before=points[0][rows],
            after=points[1][rows],
            now=state.stress[rows],
            fed=fed,
        )


@dataclass(frozen=True, slots=True)
class Beginning:
    """Data of the sides of a parameter at the start of a step."""

    old: MechanicalState  #: state at its start
    state: MechanicalState  #: state at its end
    start: Slopes  #: derivatives of the old state
    stressed: Stressed  #: points with stress, the same object for all parameters
    points: tuple[Array, Array]  #: temperatures at all points at its start and end (points,), K
    warming: tuple[Array, Array]  #: their derivatives by the parameter
    vertices: tuple[Array, Array]  #: temperatures at the owned vertices (owned,), K
    late: tuple[float, float]  #: derivatives of the times at its start and end, s

    def times(self, by: float) -> tuple[float, float]:
        """Start and end of the step with the parameter moved, s."""
        return self.old.time + by * self.late[0], self.state.time + by * self.late[1]
