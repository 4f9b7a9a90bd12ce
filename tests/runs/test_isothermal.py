"""Heat in runs: isothermal freezing, surface flux, temperature of the wall, tables of enthalpy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from runs.billet_runs import billet, cells, run_in_memory, shipped, simulated
from small_case import small

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.physics.constitutive.elasticity import Solidity
from castfem.physics.materials import load_steel
from castfem.runs import loop
from castfem.runs.loop import TimeLoop
from castfem.runs.output.history import HISTORY_NAME, read_history

MELTING = 1775.65  # K


def faces(symmetry: str, solidus: str) -> tuple[list[float], float]:
    """Return the temperature in the middle of two faces, K, and all heat, J/m, after 1.5 s."""
    case = load_case(
        "cases/billet125/taper_1.toml",
        (
            f"steel.overrides={{solidus='{solidus}',liquidus='1502.5 degC'}}",
            f"section.symmetry='{symmetry}'",
            "casting.length='90 mm'",
            "coupling.interval='0.25 s'",
            *cells(3, 8, 8),
            "output.fields=[]",
        ),
    )
    with simulated(case) as simulation:
        time_loop = TimeLoop(simulation)
        time_loop.run()
        source = simulation.section.source
        places = source.points[simulation.section.node_of_owned]
        temperature = time_loop.run_state.state.thermal.point.temperature
        half = 0.0625
        found = [
            float(temperature[np.linalg.norm(places - place, axis=1).argmin()])
            for place in ((half, 0.0), (0.0, half))
        ]
        return found, time_loop.run_state.state.thermal.removed * simulation.section.multiplicity


def test_isothermal_freezing_is_a_vanishing_range() -> None:
    """Two faces agree, a quarter and a half, and a freezing range of 1e-8 K."""
    (wide, narrow), heat = faces("quarter", "1502.5 degC")
    assert wide < MELTING - 50.0
    assert narrow == pytest.approx(wide, abs=1e-3)
    for symmetry, solidus in (("half", "1502.5 degC"), ("quarter", "1502.49999999 degC")):
        others, other_heat = faces(symmetry, solidus)
        assert others == pytest.approx([wide, wide], abs=1e-3)
        assert other_heat == pytest.approx(heat, rel=1e-6)


def test_steel_at_its_melting_point_is_liquid() -> None:
    """For any rounding of an interpolated temperature, up to one that is certainly colder."""
    changes = {"solidus": "1502.5 degC", "liquidus": "1502.5 degC"}
    steel = load_steel("carbon_042", overrides=changes)
    rounding = np.array([0.0, 1e-12, -1e-12, 5e-10, -5e-10])
    solidity = Solidity.of(steel)
    assert solidity.weight(steel.solidus + rounding) == pytest.approx(0.0)
    assert solidity.weight(np.array([steel.solidus - 1e-6])) == pytest.approx(1.0)
    assert steel.solid_fraction(steel.solidus + rounding) == pytest.approx(0.0)
    assert steel.solid_fraction(steel.solidus - 1e-6) == 1.0


# The heat flux reported for a place of the surface is that of the place itself


@pytest.mark.parametrize(
    ("cooled", "other"), [("mid_face", "narrow_face"), ("narrow_face", "mid_face")]
)
def test_uncooled_face_has_no_flux(cooled: str, other: str) -> None:
    on = {"mid_face": "wide_face", "narrow_face": "narrow_face"}[cooled]
    case = billet(
        "thermal", "casting.length=30 mm", f"cooling.mould.surface.0.on=['{on}']", "mesh.order=1"
    )
    last = run_in_memory(case).samples[-1]
    assert last.flux[cooled] > 1e6
    assert last.flux[other] == 0.0


NO_HEAT = ", wall_emissivity=1e-6"
RADIATING = (
    'cooling.mould.surface=[{law="contact", coefficient="1600 W/(m^2 K)", wall="160 degC", '
    'gap_conductivity="0.15 W/(m K)"%s}, '
    '{law="radiation", emissivity=0.8, ambient="160 degC", absorption="200 1/m"%s}]'
)


def _heat(gap: str, of: str) -> float:
    summary = run_in_memory(
        billet("thermal", "casting.length=60 mm", RADIATING % (gap, of))
    ).summary
    return summary.quantities["heat_removed"].value


def test_radiation_counts_only_across_a_gap() -> None:
    """With a constant gap of the case; on the groups that both laws have."""
    touching = _heat(', gap="0 mm"', "")
    assert touching == _heat(', gap="0 mm"', ', on=["narrow"]')
    parts = ("", ', on=["narrow"]', ', on=["wide"]', NO_HEAT)
    all_round, one, other, none = (_heat(', gap="0.5 mm"', part) for part in parts)
    assert touching > all_round > one > none
    assert other == pytest.approx(one, rel=1e-9)  # a square


def test_radiation_crosses_the_gap_of_the_mould() -> None:
    """A mould that opens: the corner, which does not touch, loses more heat with radiation."""
    opens = ("taper_minus_1", "casting.length=90 mm")
    with_, without = (
        run_in_memory(billet(*opens, RADIATING % ("", of))).samples[-1] for of in ("", NO_HEAT)
    )
    gap = with_.mechanics.gap["corner"]
    assert gap > 20e-6
    assert with_.flux["corner"] > without.flux["corner"]


# Heat flows to the wall at its temperature along the mould


TABLE = '{position=[0, 30, 60], position_unit="mm", value=[100, 400, 200], unit="degC"}'


def test_heat_flows_to_the_local_wall_temperature() -> None:
    """Without a gap the flux is h (T - T_wall(z)) at every depth."""
    case = shipped(
        "taper_3",
        "casting.length=60 mm",
        "cooling.mould.surface.0.wall=mould",
        f"mould.wall_temperature={TABLE}",
    )
    samples = [r for r in run_in_memory(case).samples if r.position > 0.0]
    depth = np.array([r.position for r in samples])
    wall = 273.15 + np.interp(depth, [0.0, 0.03, 0.06], [100.0, 400.0, 200.0])
    surface = np.array([r.profiles["mid_face"].temperature[0] for r in samples])
    flux = np.array([r.flux["mid_face"] for r in samples])
    assert np.ptp(wall) > 150.0
    assert np.allclose(flux, 1600.0 * (surface - wall), rtol=1e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ("mould.wall_temperature=150 degC",),
            r"base.toml: cooling\.0\.surface\.0\.wall .*: 160 degC here, 150 degC as "
            r'mould\.wall_temperature; leave one of the two out, or set this to "mould"$',
        ),
        ((f"mould.wall_temperature={TABLE}",), "160 degC here, a table as mould"),
        (
            ("cooling.mould.surface.0.wall=mould",),
            r'wall = "mould" takes mould\.wall_temperature, which is not given; give wall = '
            r'"160 degC" here, or wall_temperature = "160 degC" in \[mould\]$',
        ),
    ],
)
def test_wall_has_one_temperature(changes: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        shipped("taper_1", *changes)


# A table of enthalpies gives the same strand as specific heat and latent heat


SOLIDUS, LIQUIDUS, HEAT, LATENT = 1452.0, 1502.5, 0.7, 270.0  # degC, kJ/(kg K), kJ/kg: carbon_042


def history(folder: Path, overrides: dict[str, Any]) -> pd.DataFrame:
    case = small({"casting.length": "400 mm", "steel.overrides": overrides})
    loop.run(case, folder, comm=MPI.COMM_SELF)
    return read_history(folder / HISTORY_NAME)


@pytest.fixture(scope="module")
def by_latent_heat(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return history(tmp_path_factory.mktemp("latent"), {})


def test_enthalpy_table_is_specific_and_latent_heat(
    tmp_path: Path, by_latent_heat: pd.DataFrame
) -> None:
    # The datum is arbitrary; rows within solid, mushy zone and liquid change nothing.
    t = np.array([20.0, 700.0, SOLIDUS, 1480.0, LIQUIDUS, 1520.0])
    frozen = np.interp(t, [SOLIDUS, LIQUIDUS], [1.0, 0.0])
    h = HEAT * t + (1.0 - frozen) * LATENT - 123.0
    table = {
        "temperature": t.tolist(),
        "temperature_unit": "degC",
        "value": h.tolist(),
        "unit": "kJ/kg",
    }
    found = history(tmp_path, {"enthalpy": table})
    assert found["shell_mid_face"].iloc[-1] > 1.0
    physical = found.columns.drop(["newton", "energy_error"])
    pd.testing.assert_frame_equal(found[physical], by_latent_heat[physical], rtol=1e-7, atol=1e-7)


def test_peak_of_specific_heat_is_its_latent_heat(
    tmp_path: Path, by_latent_heat: pd.DataFrame
) -> None:
    narrow = 1e-3  # K: the table is linear between its rows
    peak = HEAT + LATENT / (LIQUIDUS - SOLIDUS)
    table = {
        "temperature": [20, SOLIDUS - narrow, SOLIDUS, LIQUIDUS, LIQUIDUS + narrow],
        "temperature_unit": "degC",
        "value": [HEAT, HEAT, peak, peak, HEAT],
        "unit": "kJ/(kg K)",
    }
    found = history(tmp_path, {"specific_heat": table, "latent_heat": "0 kJ/kg"})
    for name in ("shell_mid_face", "surface_temperature_mid_face", "heat_removed"):
        assert found[name].iloc[-1] == pytest.approx(by_latent_heat[name].iloc[-1], rel=1e-4)
