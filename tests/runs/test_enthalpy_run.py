"""A table of enthalpies in a run: the same strand as by specific heat and latent heat."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from small_case import small

from castfem.runs import loop
from castfem.runs.output.history import HISTORY_NAME, read_history

SOLIDUS, LIQUIDUS, HEAT, LATENT = 1452.0, 1502.5, 0.7, 270.0  # degC, kJ/(kg K), kJ/kg: carbon_042


def history(folder: Path, overrides: dict[str, Any]) -> pd.DataFrame:
    case = small({"casting.length": "400 mm", "steel.overrides": overrides})
    loop.run(case, folder, comm=MPI.COMM_SELF)
    return read_history(folder / HISTORY_NAME)


@pytest.fixture(scope="module")
def by_latent_heat(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return history(tmp_path_factory.mktemp("latent"), {})


def test_a_table_of_enthalpies_is_specific_and_latent_heat(
    tmp_path: Path, by_latent_heat: pd.DataFrame
) -> None:
    # Any datum; rows within the solid, the mushy zone and the liquid change nothing.
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


def test_a_peak_of_the_specific_heat_is_the_latent_heat_it_holds(
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
