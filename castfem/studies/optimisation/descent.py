"""Search by derivatives that runs carry along: SLSQP [Kraft1988] (docs/references.md) of scipy.

Worth while for three variables or more, and for results without kinks (docs/mould_design.md).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from castfem.base.types import Array

_EVEN = 1e-3  # of the scales: change of cost and of constraints that ends a search
_KINKED = 4  # runs for a step: where they lead nowhere, derivatives do not tell what comes


class _Stopped(Exception):
    """Steps have become shorter than the last one, or lead nowhere."""


def descend(
    begin: Array,
    given: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    first: float,
    last: float,
    most: int,
) -> None:
    """Search from a place (n,), shares of the ranges, for the least cost with no margin below 0.

    Args:
        begin: The place.
        given: Scaled cost and margins (1 + m,) at a place.
        slopes: Their derivatives (1 + m, n).
        first: Step that a cost of slope 1 over it is followed by.
        last: Step that ends the search.
        most: Iterations.
    """
    from scipy.optimize import minimize

    before, since = np.array(begin), 0

    def looked(x: Array) -> Array:
        nonlocal since
        since += 1
        if since > _KINKED:
            raise _Stopped
        return given(first * x)

    def stepped(x: Array) -> None:
        nonlocal before, since
        far, since = float(np.max(np.abs(first * x - before))), 0
        if far < last:
            raise _Stopped
        before = first * np.array(x)

    count = len(given(np.asarray(begin)))
    limits: list[dict[str, Any]] = []
    if count > 1:
        limits = [{
            "type": "ineq", "fun": lambda x: given(first * x)[1:],
            "jac": lambda x: first * slopes(first * x)[1:],
        }]  # fmt: skip
    try:
        minimize(
            lambda x: looked(x)[0],
            np.asarray(begin) / first,
            jac=lambda x: first * slopes(first * x)[0],
            method="SLSQP",
            bounds=[(0.0, 1.0 / first)] * len(begin),
            constraints=limits,
            callback=stepped,
            options={"ftol": _EVEN, "maxiter": most},
        )
    except _Stopped:
        return
