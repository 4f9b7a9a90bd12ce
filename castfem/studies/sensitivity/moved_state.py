"""Mechanical states as they would be with a parameter moved, and the derivatives that say so."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from castfem.base.types import Array
from castfem.physics.contact.state import CONTACT
from castfem.physics.mechanics.state import MechanicalState

RATES = ("rate", "scalar_rate")
CARRIED = ("displacement", "generalized_strains", "scalars", *RATES, "stress", "internal")
"""Parts of a mechanical state that depend on what was before."""

Slopes = dict[str, Array]
"""Derivatives of a state by its parts: `CARRIED`, and the numbers of contact."""


def none_of(state: MechanicalState) -> Slopes:
    """Derivatives of a state that depends on no parameter."""
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
    """A state with other numbers, by their names in `Slopes`."""
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
