"""Two columns that stand for face and corner of a billet (`benchmarks/corner_model.py`)."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.corner_model import CELLS, COEFFICIENT, COHERENT, RADIUS, WALL, Column, returns
from benchmarks.report import Output


@pytest.mark.parametrize("radius", [np.inf, RADIUS])
def test_a_column_loses_what_its_surface_gives_off(radius: float) -> None:
    """Enthalpy by the volume of the cells against the flux at the surface, to rounding."""
    column, step, out = Column.poured(0.5e-3, RADIUS, radius), 5e-3, 0.0
    volume = 0.5 * column.size * (column.areas[:-1] + column.areas[1:])
    before = column.enthalpy @ volume
    for _ in range(200):
        out += step * COEFFICIENT * (column.cool(step, 0.0, 1.0) - WALL)
    assert before - column.enthalpy @ volume == pytest.approx(out, rel=1e-12)
    assert column.temperature[0] < column.temperature[-1]


def test_without_a_skeleton_the_corner_comes_back_the_more_often_the_finer_its_cells() -> None:
    """The sign that there is no solution; with a skeleton there is one on fine cells."""
    counts = {
        name: [returns(size, 0.15, 0.002, coherent) for size in CELLS]
        for name, coherent in COHERENT.items()
    }
    assert counts["none"][0] < counts["none"][1] < counts["none"][2]
    assert counts["skeleton"][1:] == [0, 0]


def test_the_published_counts_are_those_of_the_program() -> None:
    """Of a row with and one without a solution."""
    rows = Output().rows("corner_model")
    some = [one for one in rows if (one["contraction"], one["gap"]) in ((0.1, 0.1), (0.3, 0.2))]
    assert len(some) == 2
    for row in some:
        for name, coherent in COHERENT.items():
            for size in CELLS[:2]:
                found = returns(size, row["gap"], row["contraction"] / 100.0, coherent)
                assert found == row[f"{name}_{1e3 * size:g}"]
