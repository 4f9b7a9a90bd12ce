"""The shell to chosen solid fractions: between solidus and liquidus, and where the steel says."""

from __future__ import annotations

from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.base.result_registry import declared, find, unit_of
from castfem.fem.probes import Profile
from castfem.model.build.simulation import build, case_steel
from castfem.runs.results.headline import headline
from castfem.runs.results.registry import columns_of
from castfem.runs.results.thermal_quantities import temperature_at


@pytest.fixture(scope="module")
def result() -> castfem.Result:
    return castfem.run(small({"output.shell_at": [0.3, 0.7], "casting.length": "120 mm"}))


def test_they_lie_between_solidus_and_liquidus(result: castfem.Result) -> None:
    table = result.history
    depths = [table[f"{name}_mid_face"].to_numpy() for name in ("shell", "fs70", "fs30")]
    depths.append(table["liquidus_depth_mid_face"].to_numpy())
    for inner, outer in pairwise(depths):
        assert (inner <= outer).all() and inner[-1] < outer[-1]
    assert table.attrs["units"]["fs70_corner"] == "mm"


def test_they_are_results_with_words(result: castfem.Result) -> None:
    quantity = result.summary.quantities["fs70_mid_face"]
    assert quantity.label == "shell to fs = 0.7, mid-face"
    assert 1e3 * quantity.value == pytest.approx(result.history["fs70_mid_face"].iloc[-1])
    names = headline([result.summary.quantities])
    start = names.index("shell_corner") + 1
    assert names[start : start + 2] == ["fs30_mid_face", "fs70_mid_face"]
    found = find("fs70_mid_face")
    assert found is not None and found[0].name == "fs70" and found[1] == "mid_face"
    assert unit_of("fs70_mid_face") == "mm"


def test_the_depth_is_that_of_the_fraction_on_the_line() -> None:
    """On a straight profile it is where the temperature of the fraction is."""
    steel = case_steel(small())
    level = temperature_at(steel, 0.7)
    assert float(steel.solid_fraction(level)) == pytest.approx(0.7, abs=1e-9)
    depth = np.linspace(0.0, 0.01, 11)
    profile = Profile(depth, steel.solidus + (steel.liquidus - steel.solidus) * depth / 0.01)
    exact = 0.01 * (level - steel.solidus) / (steel.liquidus - steel.solidus)
    assert profile.isotherm_depth(level) == pytest.approx(exact, rel=1e-9)


def test_a_run_that_asks_for_none_has_none() -> None:
    assert not any(definition.name.startswith("fs") for definition in declared())
    simulation = build(small(), MPI.COMM_SELF)
    assert not any(d.name.startswith("fs") for d, _ in columns_of(simulation))
    simulation.destroy()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([0.333], "whole per cents are needed"),
        ([1.0], "must lie between 0 and 1"),
        ([0.7, 0.7], "a solid fraction twice"),
        (["7 mm"], "output.shell_at"),
    ],
)
def test_what_is_no_fraction(given: list[object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        small({"output.shell_at": given})
