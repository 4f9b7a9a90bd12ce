"""Benchmarks of the coupled billet: its cost."""

from __future__ import annotations

import pytest

from benchmarks import billet_cost
from benchmarks.billet_run import every, mesh


def test_times_of_a_march_are_all_accounted_for() -> None:
    small = (*mesh(4.0), every(0.25), "casting.length=60 mm")
    walled = billet_cost.march("taper_1", small)
    numbers = billet_cost.numbers(walled)
    assert walled["watched"] == pytest.approx(walled["seconds"], rel=0.02)
    assert {"petsc", "assembly", "law", "contact"} <= set(walled["parts"])
    assert 0.0 < numbers["libraries_mechanics"] < 100.0
    assert 50.0 < numbers["mechanics"] < 100.0
    free = billet_cost.numbers(billet_cost.march("idealised", small))
    assert free["contact"] == 0.0 < numbers["contact"]


def test_growth_is_the_power_of_the_cells() -> None:
    rows = [{"cells": n, "seconds": 3.0 * n**1.2} for n in (400, 900, 3600)]
    assert billet_cost.exponent(rows, "seconds") == pytest.approx(1.2)
