"""Whether a parameter changes what cools the surface: what it does not change is not evaluated."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from castfem.physics.thermal.boundary import Cooling


def same_laws(one: Cooling, other: Cooling) -> bool:
    """Whether two coolings are certain to take the same heat at the same temperature and time.

    Laws are compared by their numbers; one that holds what cannot be compared counts as another.
    Gaps that a window of the mechanics sets later are not looked at.
    """
    if len(one.laws) != len(other.laws):
        return False
    return all(
        _alike(its, law)
        and np.array_equal(here.dofs, there.dofs)
        and np.array_equal(here.weights, there.weights)
        for (here, its), (there, law) in zip(one.laws, other.laws, strict=True)
    )


def _alike(one: Any, other: Any) -> bool:
    if type(one) is not type(other):
        return False
    if isinstance(one, int | float | str):
        return bool(one == other)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if not is_dataclass(one):
        return one is other
    return all(_alike(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
