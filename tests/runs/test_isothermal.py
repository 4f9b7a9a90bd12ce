"""Steel that freezes at one temperature, in a mould: its shell is no matter of rounding."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.physics.constitutive.elasticity import Solidity
from castfem.physics.materials import load_steel
from castfem.runs.loop import TimeLoop

MELTING = 1775.65  # K


def faces(symmetry: str, solidus: str) -> tuple[list[float], float]:
    """Temperature in the middle of two faces, K, and the heat of the whole, J/m, after 1.5 s."""
    case = load_case(
        "cases/billet125/taper_1.toml",
        (
            f"steel.overrides={{solidus='{solidus}',liquidus='1502.5 degC'}}",
            f"section.symmetry='{symmetry}'",
            "casting.length='90 mm'",
            "coupling.interval='0.25 s'",
            "mesh.surface_size='3 mm'",
            "mesh.corner_size='3 mm'",
            "mesh.core_size='8 mm'",
            "mesh.face_size='8 mm'",
            "output.fields=[]",
        ),
    )
    simulation = build(case, MPI.COMM_SELF)
    try:
        time_loop = TimeLoop(simulation)
        time_loop.run()
        source = simulation.section.source
        assert source is not None
        places = source.points[simulation.section.node_of_owned]
        temperature = time_loop.run_state.state.thermal.point.temperature
        half = 0.0625
        found = [
            float(temperature[np.linalg.norm(places - place, axis=1).argmin()])
            for place in ((half, 0.0), (0.0, half))
        ]
        return found, time_loop.run_state.state.thermal.removed * simulation.section.multiplicity
    finally:
        simulation.destroy()


def test_isothermal_freezing_is_that_of_a_range_next_to_nothing() -> None:
    """Two faces agree, a quarter and a half, and a freezing range of 1e-8 K."""
    (wide, narrow), heat = faces("quarter", "1502.5 degC")
    assert wide < MELTING - 50.0
    assert narrow == pytest.approx(wide, abs=1e-3)
    for symmetry, solidus in (("half", "1502.5 degC"), ("quarter", "1502.49999999 degC")):
        others, other_heat = faces(symmetry, solidus)
        assert others == pytest.approx([wide, wide], abs=1e-3)
        assert other_heat == pytest.approx(heat, rel=1e-6)


def test_steel_at_its_melting_point_has_not_frozen() -> None:
    """Whatever the rounding of an interpolated temperature, down to what is cold for certain."""
    changes = {"solidus": "1502.5 degC", "liquidus": "1502.5 degC"}
    steel = load_steel("carbon_042", overrides=changes)
    rounding = np.array([0.0, 1e-12, -1e-12, 5e-10, -5e-10])
    solidity = Solidity.of(steel)
    assert solidity.weight(steel.solidus + rounding) == pytest.approx(0.0)
    assert solidity.weight(np.array([steel.solidus - 1e-6])) == pytest.approx(1.0)
    assert steel.solid_fraction(steel.solidus + rounding) == pytest.approx(0.0)
    assert steel.solid_fraction(steel.solidus - 1e-6) == 1.0
