"""The end of the mechanics, and changes and end of the mould."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pandas
import pytest
from interrupted import history_of, stopped
from matplotlib import pyplot
from runs.billet_runs import Kept, billet, run, run_in_memory, simulated

from castfem.base.errors import InputError
from castfem.model import Case
from castfem.model.checks.unusual import warnings
from castfem.post.plots.deformation import draw_von_mises
from castfem.post.plots.section import Steel
from castfem.post.plots.shape import von_mises
from castfem.runs.loop import TimeLoop
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import read_history
from castfem.runs.results.needs import fault_of
from castfem.studies.sensitivity.run import refuse

EXIT = 0.05
MOULD = ("mould.length=50 mm", "cooling.mould.to=50 mm", "output.checkpoint_every=1")
LONG = (*MOULD, "casting.length=140 mm")
ENDED = "mechanics.until=mould_exit"
PLAIN = ("coupling.follow_shape=false", "coupling.dissipation=0")


def ended(*overrides: str) -> Case:
    """Return a billet whose mechanics end at the exit of a mould of 50 mm."""
    return billet("taper_1", *LONG, ENDED, *overrides)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of its run, with a probe and fields."""
    path = tmp_path_factory.mktemp("ended")
    run(probed(), path)
    return path


def probed() -> Case:
    """Return the case with a probe and fields."""
    return ended('output.fields=["displacement", "von_mises", "temperature"]').with_(
        {"output.probe": [{"name": "skin", "under": "mid_face", "depth": "2 mm"}]}
    )


@pytest.fixture(scope="module")
def table(folder: Path) -> pandas.DataFrame:
    """Return the history of the run."""
    return read_history(folder / "history.csv")


def test_run_is_the_same_in_the_mould(tmp_path: Path, table: pandas.DataFrame) -> None:
    """To the bit, in all columns; below it the run with mechanics is another one."""
    run(billet("taper_1", *LONG), tmp_path)
    full = read_history(tmp_path / "history.csv")
    rows = int((table["position"] <= EXIT * (1 + 1e-9)).sum())
    assert rows >= 4 and table["position"][rows - 1] == pytest.approx(EXIT)
    pandas.testing.assert_frame_equal(table[:rows], full[:rows], check_exact=True)
    assert table["axial_strain"][rows:].isna().all() and full["axial_strain"].notna().all()


def test_columns_of_mechanics_are_empty_below(folder: Path, table: pandas.DataFrame) -> None:
    below = table[table["position"] > EXIT * (1 + 1e-9)]
    assert len(below) >= 4 and below["position"].iloc[-1] == pytest.approx(0.14)
    for name in ("von_mises_max", "gap_corner", "contact_share", "size_mid_face", "force_error"):
        assert table[name][1] == table[name][1] and below[name].isna().all()
    for name in ("shell_corner", "heat_removed", "surface_temperature_corner", "newton"):
        assert below[name].notna().all()
    probe = read_history(folder / "probes" / "skin.csv")
    assert len(probe) == len(table) and probe["temperature"].notna().all()
    assert probe["von_mises"].isna().tolist() == table["von_mises_max"].isna().tolist()


def test_fields_keep_the_shape(folder: Path) -> None:
    """Heat flows through the section as it left the mould; its stress is not known."""
    with h5py.File(folder / "fields.h5") as file:
        steps = [file["steps"][name] for name in sorted(file["steps"])]
        moved, stress = ([np.asarray(s[n]) for s in steps] for n in ("displacement", "von_mises"))
    assert np.isfinite(stress[0]).all() and np.isnan(stress[-1]).all()
    assert np.array_equal(moved[-1], moved[-2]) and np.abs(moved[-1]).max() > 1e-6


def test_summary_keeps_results_of_the_mould(tmp_path: Path, folder: Path) -> None:
    """Maxima are those of a run that ends at the exit; the end itself has no stress."""
    at_mould_exit = run(billet("taper_1", *MOULD, "casting.length=50 mm", ENDED), tmp_path)
    found = json.loads((folder / "summary.json").read_text())["quantities"]
    assert not {"von_mises_max", "gap_corner", "axial_strain"} & found.keys()
    ways = [n for n in at_mould_exit.quantities if n.startswith(("mould_", "way_"))]
    assert {"mould_gap_max", "way_von_mises_max", "mould_heat_removed"} <= set(ways)
    for name in ways:
        assert found[name]["value"] == pytest.approx(
            at_mould_exit.quantities[name].shown, rel=1e-12
        ), name


def test_cooling_continues_as_without_mechanics() -> None:
    """From the enthalpy at the mould's exit, in a simulation without mechanics."""
    kept = run_in_memory(ended(*PLAIN))
    below = "casting.length=140 mm", "cooling.mould.to=50 mm", "mesh.order=2"
    with simulated(billet("thermal", *below)) as simulation:
        loop = TimeLoop(simulation)
        start = at_exit(kept)
        loop.run_state.state = replace(
            loop.run_state.state,
            thermal=simulation.stepper.state_from(
                start.time, start.enthalpy, start.rate, start.removed, next_rate=start.next_rate
            ),
        )
        loop.run()
        expected = loop.run_state.state.thermal
    ours = kept.states[-1].thermal
    assert ours.time == expected.time and np.allclose(ours.enthalpy, expected.enthalpy, rtol=1e-12)
    assert ours.removed == pytest.approx(expected.removed, rel=1e-12)


def at_exit(kept: Kept):  # type: ignore[no-untyped-def]
    """Return the thermal state at the mould's exit."""
    return next(s for s in kept.states if s.time == pytest.approx(EXIT / 0.06)).thermal


def test_heat_is_conserved_in_the_kept_shape(folder: Path) -> None:
    found = json.loads((folder / "summary.json").read_text())["balances"]["heat"]
    assert abs(found["whole"]["value"]) < 1e-12 and abs(found["worst_step"]["value"]) < 1e-12


@pytest.mark.parametrize("steps", [3, 5, 7])
def test_run_resumes_byte_for_byte(tmp_path: Path, folder: Path, steps: int) -> None:
    """From before the exit, at it, and below it."""
    stopped(probed(), tmp_path, steps)
    run(probed(), tmp_path, resume=True)
    for name in ("history.csv", "probes/skin.csv"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_mechanics_end_at_a_length_or_with_the_run() -> None:
    """Without a mould any length is valid; a run that ends above it has mechanics to its end."""
    kept = run_in_memory(billet("idealised", "casting.length=60 mm", "mechanics.until=30 mm"))
    has = [sample.mechanics is not None for sample in kept.samples]
    assert has == sorted(has, reverse=True) and not all(has)
    assert kept.samples[sum(has) - 1].position == pytest.approx(0.03)
    whole = billet("idealised", "casting.length=30 mm", "mechanics.until=30 mm")
    assert whole.mechanics_end() is None and run_in_memory(whole).samples[-1].mechanics is not None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("mechanics.until=40 mm", "lies in the mould"),
        ("verification.closed_form=weiner_boley", "[verification] exclude each other"),
        ("mechanics.until=0 mm", "must be above"),
        ("mechanics.until=mould", 'or "mould_exit"'),
    ],
)
def test_invalid_input_is_rejected(change: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        ended(change)
    assert [p for p in caught.value.problems if "mechanics.until" in p and message in p]


def test_start_below_the_end_is_refused() -> None:
    start = "casting.start.at=mould_exit"
    with pytest.raises(InputError, match="where the mechanics begin"):
        billet("idealised", start, ENDED, "casting.length=900 mm")
    with pytest.raises(InputError, match="there is no mould; give a length"):
        air = 'cooling.0.surface=[{law="radiation", emissivity=0.8, ambient="25 degC"}]'
        billet("idealised", ENDED, "cooling.0.name=hall", air)


def test_results_of_the_end_are_refused_if_requested() -> None:
    assert "mechanics.until" in fault_of(ended(), "von_mises_max")
    for name in ("way_von_mises_max", "mould_gap_max", "shell_corner"):
        assert fault_of(ended(), name) == ""
    with pytest.raises(InputError, match=r"mechanics\.until"):
        refuse(ended())
    assert not [p for p in warnings(ended()) if "has no effect" in str(p)]


def test_figures_show_the_last_stress(folder: Path) -> None:
    """The stress at the exit, and the strand by its temperature, which is known all the way."""
    with Fields(folder) as fields:
        steel = Steel(1790.0, 1820.0)
        known = [von_mises(fields, i) is not None for i in range(len(fields.times))]
        assert known[0] and not known[-1]
        last = float(fields.positions[max(np.flatnonzero(known))])
        figure = draw_von_mises(fields, steel)
        assert figure is not None and f"{1e3 * last:.4g} mm" in figure.axes[0].get_title()
        pyplot.close(figure)


def test_thermal_quality_results_remain(tmp_path: Path, table: pandas.DataFrame) -> None:
    """End of the pool and time in the band, resumed as well; no index that needs the stress."""
    case = probed().with_({"quality": {"band": ["1100 degC", "1500 degC"]}})
    history_of(case, tmp_path, 6)
    found = read_history(tmp_path / "history.csv")
    assert {"band_time_max", "centre_solid_fraction"} <= set(found.columns)
    assert not {"I1_max", "I2_max", "brittle_strain_max"} & set(found.columns)
    shared = [name for name in found.columns if name in table.columns]
    pandas.testing.assert_frame_equal(found[shared], table[shared], check_exact=True)
    spent = found["band_time_max"].to_numpy()
    assert (np.diff(spent) >= 0.0).all() and spent[-1] > 1.0
    assert (
        "mechanics.until" in fault_of(case, "way_I1_max") and fault_of(case, "pool_end_fs100") == ""
    )


# A window ends where the mould changes or ends, and cooling continues below it


SHORT = ("casting.length=70 mm", "mould.length=50 mm")


def test_windows_end_with_the_mould() -> None:
    """A constant gap carries the heat below the mould, so that no zone ends with it."""
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
        assert (contact.pressure > 1e3) == (sample.position < 0.05 + 1e-12)


def test_heat_flows_below_the_mould() -> None:
    kept = run_in_memory(billet("taper_1", *SHORT, "cooling.mould.to=50 mm"))
    below = [r for r in kept.samples if r.position > 0.05 + 1e-12]
    assert len(below) >= 2 and min(r.flux["mid_face"] for r in below) > 1e5


def test_no_gap_below_the_mould(tmp_path: Path) -> None:
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


def test_results_of_the_mould_survive_below_it(tmp_path: Path) -> None:
    """Its heat, the worst of its contact: also in a run resumed from a checkpoint below it."""
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
