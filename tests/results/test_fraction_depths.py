"""The shell at chosen solid fractions: between solidus and liquidus, and at their temperatures."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.base.result_registry import declared, find, unit_of
from castfem.fem.probes import Profile
from castfem.model.build.simulation import build, case_steel
from castfem.physics.materials import load_steel
from castfem.runs.results.headline import headline
from castfem.runs.results.registry import columns_of
from castfem.runs.results.thermal_quantities import temperature_at


@pytest.fixture(scope="module")
def result() -> castfem.Result:
    return castfem.run(small({"output.shell_at": [0.3, 0.7], "casting.length": "120 mm"}))


def test_depths_are_between_solidus_and_liquidus(result: castfem.Result) -> None:
    table = result.history
    depths = [table[f"{name}_mid_face"].to_numpy() for name in ("shell", "fs70", "fs30")]
    depths.append(table["liquidus_depth_mid_face"].to_numpy())
    for inner, outer in pairwise(depths):
        assert (inner <= outer).all() and inner[-1] < outer[-1]
    assert table.attrs["units"]["fs70_corner"] == "mm"


def test_depths_are_results_with_labels(result: castfem.Result) -> None:
    quantity = result.summary.quantities["fs70_mid_face"]
    assert quantity.label == "shell to fs = 0.7, mid-face"
    assert 1e3 * quantity.value == pytest.approx(result.history["fs70_mid_face"].iloc[-1])
    names = headline([result.summary.quantities])
    start = names.index("shell_corner") + 1
    assert names[start : start + 2] == ["fs30_mid_face", "fs70_mid_face"]
    found = find("fs70_mid_face")
    assert found is not None and found[0].name == "fs70" and found[1] == "mid_face"
    assert unit_of("fs70_mid_face") == "mm"


def test_depth_is_that_of_the_fraction_on_the_line() -> None:
    """On a linear profile it is the depth of the temperature of the fraction."""
    steel = case_steel(small())
    level = temperature_at(steel, 0.7)
    assert float(steel.solid_fraction(level)) == pytest.approx(0.7, abs=1e-9)
    depth = np.linspace(0.0, 0.01, 11)
    profile = Profile(depth, steel.solidus + (steel.liquidus - steel.solidus) * depth / 0.01)
    exact = 0.01 * (level - steel.solidus) / (steel.liquidus - steel.solidus)
    assert profile.isotherm_depth(level) == pytest.approx(exact, rel=1e-9)


def test_run_without_requested_fractions_has_none() -> None:
    assert not any(definition.name.startswith("fs") for definition in declared())
    simulation = build(small(), MPI.COMM_SELF)
    assert not any(d.name.startswith("fs") for d, _ in columns_of(simulation))
    simulation.destroy()


@pytest.mark.parametrize(
    ("fractions", "message"),
    [
        ([0.333], "whole per cents are needed"),
        ([1.0], "must lie between 0 and 1"),
        ([0.7, 0.7], "a solid fraction twice"),
        (["7 mm"], "output.shell_at"),
    ],
)
def test_invalid_fractions_are_refused(fractions: list[object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        small({"output.shell_at": fractions})


# Where the conductivity jumps at the solidus, the shell does not depend on the cell size.
#
# The conduction integral is linear between two vertices, not the temperature: with a linear
# temperature the front was half a cell off, and by the same share for all sizes of cells.


def jumping(liquid: float) -> dict[str, object]:
    return {
        "conductivity": {
            "temperature": ["1000 degC", "1452 degC", "1452.01 degC", "1600 degC"],
            "value": [f"{k} W/(m K)" for k in (30, 30, liquid, liquid)],
        }
    }


@pytest.mark.parametrize("liquid", [1.0, 210.0])
def test_conduction_and_temperature_are_inverse(liquid: float) -> None:
    curve = load_steel("carbon_042", overrides=jumping(liquid)).thermal_curve(900.0, 1900.0, 1800.0)
    t = np.linspace(950.0, 1850.0, 97)
    theta = curve.conduction(t)
    assert curve.temperature(theta) == pytest.approx(t, abs=1e-9)
    assert curve.at(curve.enthalpy(t)).conduction == pytest.approx(theta, abs=1e-6)
    assert not curve.even
    assert load_steel("carbon_042").thermal_curve(900.0, 1900.0).even
    melts = load_steel("carbon_042", overrides={"solidus": "1502.5 degC"} | jumping(liquid))
    isothermal = melts.thermal_curve(900.0, 1900.0)
    assert isothermal.temperature(isothermal.conduction(t)) == pytest.approx(t, abs=1e-9)


@pytest.mark.parametrize(("liquid", "share"), [(30.0, 52 / 142.5), (1.0, 0.945), (210.0, 0.076)])
def test_front_between_vertices_is_by_the_conduction(liquid: float, share: float) -> None:
    """By hand: 30 * 52 of the conduction integral in the solid, liquid * 90.5 beyond it."""
    curve = load_steel("carbon_042", overrides=jumping(liquid)).thermal_curve(900.0, 1900.0)
    ends = np.array([1400.0, 1542.5]) + 273.15
    profile = Profile(np.array([0.0, 1e-3]), ends, conducts=curve)
    by_hand = 30 * 52 / (30 * 52 + liquid * 90.5)
    assert by_hand == pytest.approx(share, abs=2e-3)
    assert profile.isotherm_depth(1452.0 + 273.15) == pytest.approx(1e-3 * by_hand, rel=2e-4)


def test_shells_of_coarse_and_fine_cells_agree(tmp_path: Path) -> None:
    """The usual stirred liquid, seven times as conductive as the solid."""
    shells = []
    for size in ("1 mm", "0.3 mm"):
        mesh = {f"mesh.{k}_size": size for k in ("surface", "corner")}
        case = small(
            {
                "casting.length": "600 mm",
                "steel.overrides": jumping(210.0),
                "output.fields": [],
                **mesh,
            }
        )
        found = castfem.run(case, tmp_path / size[:3]).summary
        shells.append(1e3 * found.quantities["shell_mid_face"].value)
    assert shells[0] == pytest.approx(shells[1], abs=0.03)
