"""A plain run prints no digit of a depth that its cells do not resolve."""

from __future__ import annotations

import math

import pytest

from castfem.base.shown_quantity import Quantity
from castfem.runs.output.summary import Summary
from castfem.runs.results.labels import last_quantities, resolved
from castfem.runs.results.numbers import cells, finely, shown


@pytest.mark.parametrize(
    ("value", "resolution", "printed"),
    [
        (39.123, 2.0, "39"),
        (39.123, 12.0, "40"),
        (39.123, 0.17, "39.1"),
        (4.8567, 0.05, "4.86"),
        (4.8567, 0.001, "4.86"),
        (4.8567, None, "4.86"),
        (0.4, 1.0, "0"),
    ],
)
def test_the_last_digit_is_at_the_place_of_the_first_of_what_is_resolved(
    value: float, resolution: float | None, printed: str
) -> None:
    assert shown(value, "mm", resolution) == printed
    assert finely(39.123, "mm", "shell_mid_face", 2.0) == "39 mm"


@pytest.mark.parametrize(
    ("value", "unit", "resolution", "printed"),
    [(1.5403, "in", 0.08, "1.54"), (1.5403, "in", 0.3, "1.5"), (0.15403, "in", None, "0.154")],
)
def test_other_units_have_no_more_digits(
    value: float, unit: str, resolution: float | None, printed: str
) -> None:
    assert shown(value, unit, resolution) == printed


def test_depths_have_a_sixth_of_the_cell_in_which_they_lie() -> None:
    found = resolved(
        {
            "shell_mid_face": Quantity(0.0391234, "mm", "shell"),
            "fs70_corner": Quantity(0.0201234, "mm", "shell to fs = 0.7"),
            "liquidus_depth_centre": Quantity(0.03, "mm", "liquidus"),
            "heat_removed": Quantity(1.0, "MJ/m", "heat"),
        },
        {"mid_face": 0.012, "corner": 0.0006, "centre": math.nan}.get,
    )
    assert found["shell_mid_face"].resolution == pytest.approx(2e-3)
    assert found["fs70_corner"].resolution == pytest.approx(1e-4)
    assert found["liquidus_depth_centre"].resolution is None  # no front: it is solid there
    assert found["heat_removed"].resolution is None
    assert cells("shell_mid_face", found["shell_mid_face"]) == ("39", "mm")
    assert cells("fs70_corner", found["fs70_corner"]) == ("20.1", "mm")


def test_an_error_stands_in_its_place() -> None:
    known = Quantity(0.0391234, "mm", "shell", error=2e-4, resolution=2e-3)
    assert cells("shell_mid_face", known) == ("39.12 ± 0.20", "mm")


def test_it_is_written_and_read_and_taken_from_the_history() -> None:
    units = {"shell_mid_face": "mm", "solidus_cell_mid_face": "mm", "position": "m"}
    row = {"shell_mid_face": 39.1234, "solidus_cell_mid_face": 12.0, "position": 4.11}
    found = last_quantities(row, units)
    assert found["shell_mid_face"].resolution == pytest.approx(2e-3)
    assert "solidus_cell_mid_face" not in found
    summary = Summary("slab", "finished", quantities=found)
    again = Summary.from_json(summary.to_json()).quantities["shell_mid_face"]
    assert again.resolution == pytest.approx(2e-3) and again.error is None
