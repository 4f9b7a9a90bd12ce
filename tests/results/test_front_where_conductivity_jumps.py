"""Where the conductivity jumps at the solidus, cells of any size find the same shell.

Between two vertices not the temperature is linear, but the conduction integral: read off a linear
temperature the front was half a cell off, and all cell sizes of a ladder by the same share.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.fem.probes import Profile
from castfem.physics.materials import load_steel


def jumping(liquid: float) -> dict[str, object]:
    return {
        "conductivity": {
            "temperature": ["1000 degC", "1452 degC", "1452.01 degC", "1600 degC"],
            "value": [f"{k} W/(m K)" for k in (30, 30, liquid, liquid)],
        }
    }


@pytest.mark.parametrize("liquid", [1.0, 210.0])
def test_conduction_and_temperature_are_each_others(liquid: float) -> None:
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
def test_a_front_between_two_vertices_lies_where_heat_flows_alike(
    liquid: float, share: float
) -> None:
    """By hand: 30 * 52 of the conduction integral in the solid, liquid * 90.5 beyond it."""
    curve = load_steel("carbon_042", overrides=jumping(liquid)).thermal_curve(900.0, 1900.0)
    ends = np.array([1400.0, 1542.5]) + 273.15
    profile = Profile(np.array([0.0, 1e-3]), ends, conducts=curve)
    by_hand = 30 * 52 / (30 * 52 + liquid * 90.5)
    assert by_hand == pytest.approx(share, abs=2e-3)
    assert profile.isotherm_depth(1452.0 + 273.15) == pytest.approx(1e-3 * by_hand, rel=2e-4)


def test_shells_by_coarse_and_fine_cells_agree(tmp_path: Path) -> None:
    """The usual liquid that is stirred, seven times as conductive as the solid."""
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
    print(shells)
    assert shells[0] == pytest.approx(shells[1], abs=0.03)
