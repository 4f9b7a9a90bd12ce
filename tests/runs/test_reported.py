"""Numbers of a run that are neither a cell's nor a moment's, and one unit for each."""

from __future__ import annotations

import numpy as np
import pytest
from runs.billet_runs import billet, run, run_in_memory

from castfem.runs.output.history import read_history

RUBBED = 'mould.friction={law="coulomb", coefficient=0.3}'


@pytest.fixture(scope="module")
def with_friction(tmp_path_factory):
    """A billet with friction to below its mould: summary and history."""
    folder = tmp_path_factory.mktemp("rubbed")
    changes = ("mould.length=90 mm", "cooling.mould.to=90 mm", "casting.length=150 mm")
    return run(billet("taper_1", RUBBED, *changes), folder), read_history(folder / "history.csv")


def test_a_quantity_has_the_same_unit_in_the_history_and_in_the_summary(with_friction) -> None:
    """And the same value in the last row."""
    summary, table = with_friction
    units, both = table.attrs["units"], 0
    for name, quantity in summary.quantities.items():
        if name in units and name not in ("position", "time", "heat_removed"):
            assert units[name] == quantity.shown_unit, name
            last = float(table[name].iloc[-1])
            assert last == pytest.approx(quantity.shown, rel=1e-9, abs=1e-12, nan_ok=True), name
            both += 1
    assert both > 25
    assert {"contact_share", "contact_sticking", "mould_friction", "mould_pull"} <= set(units)


def test_the_largest_on_the_way_are_told_beside_those_of_the_end(with_friction) -> None:
    summary, table = with_friction
    value = {name: q.value for name, q in summary.quantities.items()}
    assert value["way_von_mises_max"] == pytest.approx(1e6 * table["von_mises_max"].max())
    row = table.iloc[table["von_mises_max"].argmax()]
    label = summary.quantities["way_von_mises_max"].label
    assert label.endswith(f"{1e3 * row.position:.6g} mm below the meniscus")
    for ours, column in (
        ("mould_mean_pressure_max", "mean_contact_pressure_max"),
        ("mould_pressure_max", "contact_pressure_max"),
    ):
        assert value[ours] == pytest.approx(1e6 * table[column].max())
    mean, point = table["mean_contact_pressure_max"], table["contact_pressure_max"]
    assert (mean <= point).all() and mean.max() > 0.0
    for probe in ("mid_face", "corner"):
        assert (table[f"contact_pressure_{probe}"] <= point).all()


def test_friction_of_the_whole_strand_is_that_of_its_parts(with_friction) -> None:
    _, table = with_friction
    assert table["mould_pull"].iloc[-1] > 0.0
    assert table["mould_pull"].to_numpy() == pytest.approx(4.0 * table["friction_pull"].to_numpy())
    force = -4.0 * table["friction_force"].to_numpy()
    assert table["mould_friction"].to_numpy() == pytest.approx(force)


def test_the_shell_is_told_with_the_cell_it_ends_in() -> None:
    """Cells of 2 mm at the surface, of 8 mm in the core: its steps are within a sixth of them."""
    changes = ("casting.length=1.2 m", "casting.speed=1.2 m/min")
    coarse, fine = (
        run_in_memory(billet("thermal", *changes, *more)).samples
        for more in (("mesh.core_size=8 mm",), ("mesh.core_size=1.5 mm", "mesh.surface_size=1 mm"))
    )
    finer = [r.shell["mid_face"] for r in fine]
    times = [r.time for r in fine]
    off = np.array([r.shell["mid_face"] - np.interp(r.time, times, finer) for r in coarse])
    cell = np.array([r.cell["mid_face"] for r in coarse])
    solid = np.array([r.shell["mid_face"] for r in coarse]) > 0.0
    assert np.isfinite(cell[solid]).all() and np.isnan(cell[~solid]).all()
    assert np.nanmax(cell) > 4e-3
    inside = np.abs(off[solid]) <= cell[solid] / 6.0 + 2e-4
    assert inside.mean() > 0.95
