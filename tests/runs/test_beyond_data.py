"""Warnings about a law's data and about the run itself; cases without a solution are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from runs.billet_runs import CASES, Kept, billet, run, run_in_memory, simulated
from small_case import strip

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.physics import constitutive
from castfem.physics.constitutive import load_elasticity, load_law
from castfem.runs.loop import TimeLoop
from castfem.runs.output.history import read_history
from castfem.runs.results.mechanical import MechanicalSampler

SET = Path(str(constitutive.__file__)).parent / "data" / "norton_hoff_kozlowski_signed.toml"
LONG = "casting.length=300 mm"
KINDS = ("colder", "hotter", "faster")


def own_law(folder: Path, low: str, high: str, fast: str) -> str:
    """Return the override for a copy of the data set with other limits."""
    text = SET.read_text(encoding="utf-8")
    for old, new in (("950 degC", low), ("1400 degC", high), ("1e-3 1/s", fast)):
        assert text.count(f'"{old}"') == 1
        text = text.replace(f'"{old}"', f'"{new}"')
    (folder / "law.toml").write_text(text, encoding="utf-8")
    return f"mechanics.law={folder}/law.toml"


def test_summary_has_the_largest_shares(tmp_path: Path) -> None:
    words = own_law(tmp_path, "1390 degC", "1440 degC", "1e-4 1/s"), LONG
    case = billet("idealised", *words)
    kept = run_in_memory(case)
    reported = [sample.strained.beyond for sample in kept.samples]
    assert not reported[0] and reported[-1]  # no shell at the meniscus
    for kind in KINDS:
        shares = [beyond.get(kind, -1.0) for beyond in reported]
        most = int(np.argmax(shares))
        assert 0.0 < shares[most] <= 1.0
        found = kept.summary.quantities[f"{kind}_than_data"]
        assert found.value == shares[most]
        assert f"{1e3 * kept.samples[most].position:.6g} mm below the meniscus" in found.label
    assert "1390 degC" in kept.summary.quantities["colder_than_data"].label


def test_share_is_that_of_the_shell(tmp_path: Path) -> None:
    """All of it below a temperature that it has passed, none above, and a part in between."""
    shares = {}
    for low in ("1480 degC", "1390 degC", "500 degC"):
        words = own_law(tmp_path, low, "1500 degC", "1 1/s"), LONG
        shares[low] = run_in_memory(billet("idealised", *words)).samples[-1].strained.beyond
    one, some, none = (found["colder"] for found in shares.values())
    assert one == pytest.approx(1.0, rel=1e-12) and none == 0.0
    assert one > some > none
    assert all(found["hotter"] == found["faster"] == 0.0 for found in shares.values())


def test_rate_is_that_of_the_strain(tmp_path: Path) -> None:
    """From the rates of one state, as from the strains of two states."""
    with simulated(billet("idealised", "casting.length=150 mm")) as simulation:
        kept = Kept()
        TimeLoop(simulation, kept).run()  # type: ignore[arg-type]
        assert simulation.strained is not None
        sampler = MechanicalSampler(simulation.strained, simulation.probes, ("mid_face",))
        before, now = (state.mechanical for state in kept.states[-2:])
        change = sampler.strain(now) - sampler.strain(before)
        found = sampler.strain_rate(now)
        goal = change / (now.time - before.time)
        assert np.abs(found - goal).max() < 1e-6 * np.abs(goal).max()


def test_shares_survive_a_resume(tmp_path: Path) -> None:
    """A resumed run reports the same as an uninterrupted one."""
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


def test_law_without_data_range_has_no_share() -> None:
    assert load_law("weiner_boley", load_elasticity()).data is None
    for name in ("kozlowski_zhu_signed", "kozlowski_zhu_mixed"):
        data = load_law(name, load_elasticity(), carbon=0.1).data
        assert data.temperature == (950.0 + 273.15, 1400.0 + 273.15)
        assert data.rate == (1e-6, 1e-3)
    kept = run_in_memory(billet("idealised", "mechanics.law=weiner_boley", "casting.length=30 mm"))
    assert not any(name.endswith("than_data") for name in kept.summary.quantities)


# Results of a run that belong to no cell and no instant, and one unit for each


RUBBED = 'mould.friction={law="coulomb", coefficient=0.3}'


@pytest.fixture(scope="module")
def with_friction(tmp_path_factory):
    """Return summary and history of a billet with friction to below its mould."""
    folder = tmp_path_factory.mktemp("rubbed")
    changes = ("mould.length=90 mm", "cooling.mould.to=90 mm", "casting.length=150 mm")
    return run(billet("taper_1", RUBBED, *changes), folder), read_history(folder / "history.csv")


def test_units_agree_in_history_and_summary(with_friction) -> None:
    """The values agree with the last row, too."""
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


def test_largest_values_are_in_the_summary(with_friction) -> None:
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


def test_friction_of_the_strand_is_the_sum_of_parts(with_friction) -> None:
    _, table = with_friction
    assert table["mould_pull"].iloc[-1] > 0.0
    assert table["mould_pull"].to_numpy() == pytest.approx(4.0 * table["friction_pull"].to_numpy())
    force = -4.0 * table["friction_force"].to_numpy()
    assert table["mould_friction"].to_numpy() == pytest.approx(force)


def test_shell_is_given_with_its_cell() -> None:
    """Cells of 2 mm at the surface, 8 mm in the core: its steps are within a sixth of the cell."""
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


# The strip of Weiner and Boley, free to contract across.
FREEZING: dict[str, Any] = {
    "casting.length": "5 mm",
    "casting.temperature": "1495 degC",
    "steel.name": "weiner_boley",
    "section.width": "0.5 mm",
    "mesh": {"surface_size": "0.5 mm", "core_size": "0.5 mm"},
    "cooling.0.surface": [{"law": "temperature", "value": "1000 degC"}],
    "thermal.time.step": "50 ms",
    "mechanics": {
        "law": "weiner_boley",
        "ferrostatic": "off",
        "planes": {"a0": "free", "a1": "0 1/m", "a2": "0 1/m", "across": "free"},
    },
    "coupling": {"interval": "50 ms"},
    "output.fields": [],
}


@pytest.mark.parametrize("strain", ["small", "large"])
def test_free_strain_across_needs_sides_that_follow(strain: str) -> None:
    case = strip(FREEZING | {"mechanics.strain": strain})
    with pytest.raises(InputError, match=r"planes\.across: free along y.*side_low"):
        run_in_memory(case)
    held = {"mechanics.held": [{"on": ["side_low", "side_high"], "component": "y"}]}
    assert run_in_memory(case.with_(held)).value("axial_strain") < 0.0


def test_gap_of_nanometres_is_refused() -> None:
    law = "cooling.mould.surface.0.gap_conductivity"
    with pytest.raises(InputError, match=r"gap of 0\.625 nm would halve the heat"):
        billet("taper_1", f"{law}=1e-6 W/(m K)")
    billet("taper_1", f"{law}=8e-3 W/(m K)")


def test_liquid_too_soft_for_large_strain_is_refused() -> None:
    for liquid in ("1e-7", "1e-8"):
        with pytest.raises(InputError, match=r"liquid_stiffness: .*folds in a mould"):
            billet("taper_1", "mechanics.strain=large", f"mechanics.liquid_stiffness={liquid}")
        fed = ("mechanics.strain=large", "mechanics.liquid=fed", "mechanics.mush=none")
        billet("taper_1", *fed, f"mechanics.liquid_stiffness={liquid}")
        billet("taper_1", f"mechanics.liquid_stiffness={liquid}")
        billet("idealised", "mechanics.strain=large", f"mechanics.liquid_stiffness={liquid}")


@pytest.mark.parametrize("strain", ["-1", '{time=[0, 1], time_unit="s", value=[0, -1.5]}'])
def test_slice_without_thickness_is_refused(strain: str) -> None:
    with pytest.raises(InputError, match="leaves the slice no thickness"):
        billet("idealised", f"mechanics.planes.a0={strain}")


def test_zones_that_differ_by_rounding_are_refused(tmp_path: Path) -> None:
    zones = "".join(
        f'[[cooling]]\nname="{name}"\n{end}[[cooling.surface]]\nlaw="flux"\nvalue="1 MW/m^2"\n'
        for name, end in (
            ("one", 'to="300 mm"\n'),
            ("two", 'to="300.00000001 mm"\n'),
            ("three", ""),
        )
    )
    path = tmp_path / "case.toml"
    path.write_text(f'extends="{CASES / "thermal.toml"}"\n{zones}')
    with pytest.raises(InputError, match=r"cooling.1.to .*lies 0\.01 nm below"):
        load_case(path)


def test_cavity_with_wider_corners() -> None:
    """Round corners of 5 mm fit into wider ones where the cavity has room on both sides."""
    room = ("mould.width=128 mm", "mould.height=128 mm")
    for radius in ("5 mm", "8 mm", "10.1 mm"):
        billet("taper_1", *room, f"mould.corner_radius={radius}")
    with pytest.raises(InputError, match=r"at most 10\.12"):
        billet("taper_1", *room, "mould.corner_radius=10.2 mm")
    with pytest.raises(InputError, match=r"corner_radius.*at most that"):
        billet("taper_1", "mould.corner_radius=6 mm")


@pytest.mark.parametrize("choice", ["off", "none"])
def test_fed_liquid_in_a_mould_needs_its_pressure(choice: str) -> None:
    """Without it the equations have solutions, but not that of a strand.

    On cells of 2 mm "none" folds as the surface freezes, at 102 mm; "off" goes on, and +3 %/m ends
    1.1 mm off its wall with 24 % less heat after 200 mm, +1 %/m with 21 %.
    """
    pressure = f"mechanics.ferrostatic={choice}"
    with pytest.raises(InputError, match=r'mechanics\.ferrostatic: .*full.*liquid = "elastic"'):
        billet("taper_1", "mechanics.liquid=fed", pressure)
    billet("taper_1", pressure)
