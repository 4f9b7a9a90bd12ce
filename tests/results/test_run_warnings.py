"""What a finished run says cannot be trusted in it."""

from __future__ import annotations

import pytest
from small_case import small

from castfem.base.shown_quantity import Quantity
from castfem.runs.output.summary import Summary
from castfem.runs.results.summary import run_warnings

OPEN = "does not close: its relative error is"


@pytest.mark.parametrize(
    ("heat", "force", "warmed", "told"),
    [
        (1e-12, 1e-10, 0.0, []),
        (0.18, 1e-10, 0.0, ["the heat balance does not close: 1.8e-01 of the heat"]),
        (float("nan"), 1e-10, 0.0, ["the heat balance does not close: nan of the heat"]),
        (1e-12, 1.8e-6, 0.0, [f"the balance of forces in the plane {OPEN} 1.8e-06 (allowed: 1"]),
        (
            1e-12,
            1e-10,
            3.5,
            ["the highest temperature of the strand has risen by 3.5 K above that of"],
        ),
    ],
)
def test_what_is_not_right_is_told(
    heat: float, force: float, warmed: float, told: list[str]
) -> None:
    balances = {
        "heat": {"whole": Quantity(heat, "-", "")},
        "forces in the plane": {"error": Quantity(force, "-", "")},
    }
    summary = Summary("", "finished", {}, {}, balances=balances)
    case = small({"mechanics": {}})
    found = list(run_warnings(summary, case, warmed))
    assert [line[: len(one)] for line, one in zip(found, told, strict=True)] == told
