"""A search with known functions: no run is made, and each gets results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from small_case import small

from castfem.studies.optimisation import Evaluation, Optimum, RunRequest, Study

SPEED = {"key": "casting.speed", "range": ["2 m/min", "5 m/min"]}
SUPERHEAT = {"key": "casting.superheat", "range": ["10 K", "50 K"]}
STRESS, HEAT = "von_mises_max", "heat_removed"
Given = Callable[[RunRequest], Mapping[str, float] | Evaluation]


def solve(one: Study, given: Given) -> Optimum:
    """Return the answer of a study whose results are those of a function."""

    def obtain(wanted: Sequence[RunRequest]) -> None:
        for run in wanted:
            one.tell(run, given(run))

    return one.solve(obtain=obtain)


def study(*variables: dict[str, Any], folder: Path | None = None, **table: Any) -> Study:
    request = {"minimise": STRESS, "variable": list(variables or (SPEED,)), **table}
    return Study(small({"casting.length": "6 mm", "optimise": request}), folder)


def bowl(wanted: RunRequest) -> dict[str, float]:
    speed = wanted.values[0]
    return {STRESS: 10.0 + 2.0 * (speed - 3.3) ** 2, HEAT: 1e6 * (speed - 2.2)}


def covered(optimum: Optimum, *truth: float) -> bool:
    ends = [(v.low, v.high) for v in optimum.values]
    return all(low <= x <= high for (low, high), x in zip(ends, truth, strict=True))
