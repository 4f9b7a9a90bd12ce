"""Runs with mechanics: what they write, and what they leave out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from billet_runs import run

from castfem.model import Case, load_case
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import read_history

CASES = Path(__file__).parents[2] / "cases"
COARSE = (
    'mesh.surface_size="2 mm"',
    'mesh.corner_size="2 mm"',
    'mesh.face_size="10 mm"',
    'mesh.core_size="15 mm"',
    'coupling.interval="0.25 s"',
    'casting.length="120 mm"',
)


def billet(*overrides: str) -> Case:
    return load_case(CASES / "billet125" / "idealised.toml", (*COARSE, *overrides))


def test_fields_history_and_balances(tmp_path: Path) -> None:
    summary = run(billet("output.every=0.5 s"), tmp_path)
    with Fields(tmp_path) as fields:
        assert {"displacement", "stress", "von_mises", "viscoplastic_strain"} < set(fields.names)
        last = len(fields.times) - 1
        stress, mises = fields.values("stress", last), fields.values("von_mises", last)
        moved = fields.values("displacement", last)
    assert stress.shape[1] == 9 and moved.shape[1] == 3
    assert not moved[:, 2].any()
    # Averages of the same points: near each other, the measure of the mean below the mean measure.
    tensor = stress.reshape(-1, 3, 3)
    deviator = tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    of_mean = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
    assert (of_mean <= mises * (1 + 1e-5) + 10.0).all()
    history = read_history(tmp_path / "history.csv")
    last_row = history.iloc[-1]
    assert last_row["von_mises_max"] == pytest.approx(
        1e-6 * summary.quantities["von_mises_max"].value, rel=1e-9
    )
    assert summary.quantities["size_mid_face"].value == pytest.approx(
        0.125 + 2e-3 * last_row["displacement_mid_face"], rel=1e-12
    )
    assert history["force_error"].max() < 1e-6
    assert summary.balances["axial force"]["error"].value < 1e-6
    assert summary.balances["heat"]["whole"].value < 1e-9
    assert summary.steps["coupling windows"] == 8


def test_dissipation_heats(tmp_path: Path) -> None:
    """The work that flow dissipates is in the heat balance, and can be left out."""
    with_, without = (
        run(billet(f"coupling.dissipation={share}"), tmp_path / str(share)) for share in (1, 0)
    )
    generated = [s.balances["heat"]["generated"].value for s in (with_, without)]
    assert generated[0] > 0.0 == generated[1]
    assert with_.balances["heat"]["whole"].value < 1e-9
