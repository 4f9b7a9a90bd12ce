"""Where the mould changes and ends, a window ends, and heat is taken on below it."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from runs.billet_runs import billet, run, run_in_memory

from castfem.runs.output.history import read_history

SHORT = ("casting.length=70 mm", "mould.length=50 mm")


def test_intervals_end_where_the_mould_does() -> None:
    """A gap of its own carries the heat on below the mould, so that no zone ends with it."""
    kept = run_in_memory(
        billet(
            "taper_1",
            *SHORT,
            "mould.taper=[{ to = '20 mm', taper = '2 %/m' }, { taper = '1 %/m' }]",
            "cooling.mould.surface.0.gap=0 mm",
        )
    )
    positions = [sample.position for sample in kept.samples]
    for knot in (0.02, 0.05):
        assert min(abs(p - knot) for p in positions) < 1e-12
    for sample in kept.samples[1:]:
        contact = sample.mechanics and sample.mechanics.contact
        assert contact is not None
        assert (contact.pressure > 1e3) == (sample.position < 0.05 + 1e-12)


def test_heat_goes_on_below_the_mould() -> None:
    kept = run_in_memory(billet("taper_1", *SHORT, "cooling.mould.to=50 mm"))
    below = [r for r in kept.samples if r.position > 0.05 + 1e-12]
    assert len(below) >= 2 and min(r.flux["mid_face"] for r in below) > 1e5


def test_below_the_mould_there_is_no_gap(tmp_path: Path) -> None:
    """It is neither zero nor the distance to a wall that is not there."""
    case = billet("taper_1", *SHORT, "cooling.mould.to=50 mm", 'output.fields=["gap"]')
    summary = run(case.with_({"output.every": "0.25 s"}), tmp_path)
    assert np.isnan(summary.quantities["gap_corner"].value)
    table = read_history(tmp_path / "history.csv")
    below = table["position"] > 0.05 + 1e-12
    assert table.loc[below, "gap_corner"].isna().all() and below.sum() >= 2
    assert (table.loc[~below, "gap_corner"].abs() < 1.0).all()
    with h5py.File(tmp_path / "fields.h5") as file:
        gaps = [np.asarray(step["gap"]) for step in file["steps"].values()]
        points = np.asarray(file["mesh/points"])
    faces = np.isclose(points[:, :2], 0.0625, rtol=0.0, atol=1e-9).any(axis=1)
    assert np.isfinite(gaps[2][faces]).all()
    assert np.isnan(gaps[2][points[:, :2].max(axis=1) < 0.05]).all()
    assert 0 < np.isfinite(gaps[2]).sum() < len(points) / 4
    assert np.isnan(gaps[-1]).all()


def test_the_mould_is_remembered_below_it(tmp_path: Path) -> None:
    """Its heat, the worst of its contact: also where a run goes on from a checkpoint below it."""
    longer = ("casting.length=140 mm", "mould.length=100 mm", "cooling.mould.to=100 mm")
    kept = run_in_memory(billet("taper_0", *longer))
    inside = [r for r in kept.samples if 0.0 < r.position < 0.1 + 1e-12]
    contact = [r.mechanics.contact for r in inside if r.mechanics and r.mechanics.contact]
    assert kept.value("mould_heat_removed") == inside[-1].removed < kept.value("heat_removed")
    assert kept.value("mould_gap_max") == max(c.gap for c in contact) > 5e-6
    assert kept.value("mould_contact_least") == min(c.share for c in contact) > 0.0
    assert kept.value("mould_pressure_max") == max(c.pressure for c in contact) > 0.0
    deepest = max(c.penetration for c in contact)
    assert kept.value("mould_penetration_max") == deepest > kept.value("penetration") == 0.0
    run(billet("taper_0", *longer, "casting.length=120 mm"), tmp_path)
    summary = run(billet("taper_0", *longer), tmp_path, resume=True)
    for name in ("heat_removed", "gap_max", "contact_least", "pressure_max", "penetration_max"):
        found = summary.quantities[f"mould_{name}"].value
        assert abs(found / kept.value(f"mould_{name}") - 1.0) < 1e-9
