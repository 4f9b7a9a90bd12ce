"""A search of known functions: no run is made, each is told its results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from castfem.design import Evaluation, Optimum, Study, Wanted

SPEED = {"key": "casting.speed", "range": ["2 m/min", "5 m/min"]}
STRESS, HEAT = "von_mises_max", "heat_removed"
Given = Callable[[Wanted], Mapping[str, float] | Evaluation]


def solve(one: Study, given: Given) -> Optimum:
    """The answer of a study whose runs give what the function does."""

    def obtain(wanted: Sequence[Wanted]) -> None:
        for run in wanted:
            one.tell(run, given(run))

    return one.solve(obtain=obtain)
