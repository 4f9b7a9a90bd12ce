"""The shipped copper: its numbers against what they must add up to, and its case."""

from __future__ import annotations

import numpy as np
import pytest

import castfem
from castfem.base.constants import ZERO_CELSIUS
from castfem.physics.materials import load_steel

MELTING = 1083.0 + ZERO_CELSIUS


def test_it_freezes_at_one_temperature() -> None:
    copper = load_steel("copper")
    assert copper.solidus == copper.liquidus == pytest.approx(MELTING)
    assert copper.diagram is None
    assert copper.latent_heat * 63.546e-3 == pytest.approx(13590.0, rel=1e-4)  # J/mol


def test_its_mean_specific_heats_are_those_of_the_handbook() -> None:
    """Fabian (1997): 0.411 J/(g K) from 0 to 300 degC, 0.437 to 1000 degC; not used in the set."""
    copper = load_steel("copper")
    for end, mean in ((300.0, 411.0), (1000.0, 437.0)):
        t = np.linspace(20.0, end, 2001) + ZERO_CELSIUS
        found = np.trapezoid(copper.specific_heat(t), t) / (t[-1] - t[0])
        assert found == pytest.approx(mean, rel=0.04)


def test_the_round_of_copper() -> None:
    """On a coarse mesh, through its mould: the flux of its curve, and one front."""
    case = castfem.load("copper200/round").with_(
        {
            "casting.length": "150 mm",
            "mesh.surface_size": "5 mm",
            "mesh.core_size": "12 mm",
            "output.fields": [],
            "output.figures": False,
        }
    )
    found = castfem.run(case)
    mean = (0.5 * (2.2 + 1.5) * 40.0 + 0.5 * (1.5 + 0.5) * 110.0) / 150.0
    assert found.quantities["mould_mean_flux"] == pytest.approx(1e6 * mean, rel=2e-3)
    assert found.summary.balances["heat"]["whole"].value < 1e-9
    shell, liquidus = (found.quantities[n] for n in ("shell_mid_face", "liquidus_depth_mid_face"))
    assert 0.03 < shell < 0.05 and abs(liquidus - shell) < 0.012  # one front, within a cell
