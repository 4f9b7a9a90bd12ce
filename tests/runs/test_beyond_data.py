"""What a run tells of its law's data, and of itself."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from runs.billet_runs import Kept, billet, run, run_in_memory

from castfem.model.build.simulation import build
from castfem.physics import constitutive
from castfem.physics.constitutive import load_elasticity, load_law
from castfem.runs.loop import TimeLoop
from castfem.runs.output.history import read_history
from castfem.runs.results.mechanical import MechanicalSampler

SET = Path(str(constitutive.__file__)).parent / "data" / "norton_hoff_kozlowski_signed.toml"
LONG = "casting.length=300 mm"
KINDS = ("colder", "hotter", "faster")


def own_law(folder: Path, low: str, high: str, fast: str) -> str:
    """A copy of the set with other data."""
    text = SET.read_text(encoding="utf-8")
    for old, new in (("950 degC", low), ("1400 degC", high), ("1e-3 1/s", fast)):
        assert text.count(f'"{old}"') == 1
        text = text.replace(f'"{old}"', f'"{new}"')
    (folder / "law.toml").write_text(text, encoding="utf-8")
    return f"mechanics.law={folder}/law.toml"


def test_the_summary_has_the_largest_shares(tmp_path: Path) -> None:
    words = own_law(tmp_path, "1390 degC", "1440 degC", "1e-4 1/s"), LONG
    case = billet("idealised", *words)
    kept = run_in_memory(case)
    told = [sample.strained.beyond for sample in kept.samples]
    assert not told[0] and told[-1]  # no shell at the meniscus
    assert kept.summary is not None
    for kind in KINDS:
        shares = [beyond.get(kind, -1.0) for beyond in told]
        most = int(np.argmax(shares))
        assert 0.0 < shares[most] <= 1.0
        found = kept.summary.quantities[f"{kind}_than_data"]
        assert found.value == shares[most]
        assert f"{1e3 * kept.samples[most].position:.6g} mm below the meniscus" in found.label
    assert "1390 degC" in kept.summary.quantities["colder_than_data"].label


def test_the_share_is_that_of_the_shell(tmp_path: Path) -> None:
    """All of it below a temperature that it has passed, none of it above, and what is between."""
    shares = {}
    for low in ("1480 degC", "1390 degC", "500 degC"):
        words = own_law(tmp_path, low, "1500 degC", "1 1/s"), LONG
        shares[low] = run_in_memory(billet("idealised", *words)).samples[-1].strained.beyond
    one, some, none = (found["colder"] for found in shares.values())
    assert one == pytest.approx(1.0, rel=1e-12) and none == 0.0
    assert one > some > none
    assert all(found["hotter"] == found["faster"] == 0.0 for found in shares.values())


def test_the_rate_is_that_of_the_strain(tmp_path: Path) -> None:
    """From the rates that a state has, as from the strains of two states."""
    simulation = build(billet("idealised", "casting.length=150 mm"), MPI.COMM_SELF)
    try:
        kept = Kept()
        TimeLoop(simulation, kept).run()  # type: ignore[arg-type]
        assert simulation.strained is not None
        sampler = MechanicalSampler(simulation.strained, simulation.probes, ("mid_face",))
        before, now = (state.mechanical for state in kept.states[-2:])
        assert before is not None and now is not None
        change = sampler.strain(now) - sampler.strain(before)
        found = sampler.strain_rate(now)
        goal = change / (now.time - before.time)
        assert np.abs(found - goal).max() < 1e-6 * np.abs(goal).max()
    finally:
        simulation.destroy()


def test_it_is_remembered(tmp_path: Path) -> None:
    """A run that is resumed tells what one without a pause tells."""
    law = own_law(tmp_path, "1390 degC", "1440 degC", "1e-4 1/s")
    whole = run(billet("idealised", law, LONG), tmp_path / "whole")
    run(billet("idealised", law, "casting.length=270 mm"), tmp_path / "parts")
    longer = billet("idealised", law, LONG)
    parts = run(longer, tmp_path / "parts", resume=True)
    assert whole.quantities["colder_than_data"].value > 0.1
    for kind in KINDS:
        one, other = (s.quantities[f"{kind}_than_data"] for s in (whole, parts))
        assert other.value == pytest.approx(one.value, rel=1e-6)
        assert other.label == one.label


def test_a_law_that_does_not_say_has_no_share() -> None:
    assert load_law("weiner_boley", load_elasticity()).data is None
    for name in ("kozlowski_zhu_signed", "kozlowski_zhu_mixed"):
        data = load_law(name, load_elasticity(), carbon=0.1).data
        assert data is not None
        assert data.temperature == (950.0 + 273.15, 1400.0 + 273.15)
        assert data.rate == (1e-6, 1e-3)
    kept = run_in_memory(billet("idealised", "mechanics.law=weiner_boley", "casting.length=30 mm"))
    assert kept.summary is not None
    assert not any(name.endswith("than_data") for name in kept.summary.quantities)


# Numbers of a run that are neither a cell's nor a moment's, and one unit for each


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
