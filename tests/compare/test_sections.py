"""Sections of runs side by side, and sizes along the mould."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from strained_run import write_strained
from synthetic_run import write_run

from castfem.base.shown_quantity import Quantity
from castfem.post.compare.runs import Run, read_runs
from castfem.post.compare.sections import draw_sections
from castfem.post.compare.table import _way
from castfem.runs.output.summary_file import Summary


@pytest.mark.parametrize("names", [("thermal", "strained"), ("strained", "thermal")])
def test_run_without_mechanics_is_compared_with_one_with_it(tmp_path, names):
    write_run(tmp_path / "thermal", steps=16)
    (tmp_path / "strained").mkdir()
    write_strained(tmp_path / "strained")
    found = draw_sections(read_runs([tmp_path / name for name in names]), str)
    assert list(found) == ["temperature", "states", "von_mises", "shape"]
    first, second, scale = found["von_mises"].axes
    titles = {"strained": "strained", "thermal": "thermal: no stress"}
    assert [axes.get_title() for axes in (first, second)] == [titles[name] for name in names]
    has_stress = [name == "strained" for name in names]
    assert [bool(axes.collections) for axes in (first, second)] == has_stress
    assert scale.get_ylim() == pytest.approx((0.0, 2.0))


def test_gap_of_a_shape_has_a_suitable_unit(tmp_path):
    runs = []
    for name, gap in (("shut", 5e-7), ("tight", 4.87e-6), ("loose", 5.5e-4)):
        (tmp_path / name).mkdir()
        write_strained(tmp_path / name)
        summary = Summary.load(tmp_path / name)
        quantities = {**summary.quantities, "gap_max": Quantity(gap, "mm", "largest gap")}
        runs.append(Run(tmp_path / name, name, replace(summary, quantities=quantities)))
    titles = [axes.get_title() for axes in draw_sections(runs, str)["shape"].axes[:3]]
    assert titles == ["shut: no gap", "tight: gap up to 4.9 µm", "loose: gap up to 0.55 mm"]
    end = {"position": Quantity(0.8, "m", "position")}
    below = [
        replace(run, summary=replace(run.summary, mould_exit=0.6,
                quantities={**run.summary.quantities, **end}))
        for run in runs
    ]  # fmt: skip
    titles = [axes.get_title() for axes in draw_sections(below, str)["shape"].axes[:3]]
    assert titles == ["shut", "tight", "loose"]  # there is no gap below the mould


@pytest.mark.parametrize(
    ("start", "places"), [(0.0, (0.2, 0.4, 0.6)), (0.3, (0.4, 0.6)), (0.6, (0.6,))]
)
def test_no_place_above_the_start_of_a_run(start: float, places: tuple[float, ...]) -> None:
    base: Any = SimpleNamespace(summary=SimpleNamespace(mould_exit=0.6))
    history = pd.DataFrame({"position": np.linspace(start, 2.0, 9)})
    assert _way([history], base, [base]) == pytest.approx(places)
