"""Points that are followed: values, several ranks, resume, and runs without probes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas
import pytest
from interrupted import stopped
from runs.billet_runs import billet, run

import castfem
from castfem.base.errors import InputError
from castfem.cli.checking import check_case
from castfem.model import Case
from castfem.runs import loop
from castfem.runs.output.history import read_history

HALF = 62.5
PROBES: list[dict[str, Any]] = [
    {"name": "skin", "under": "mid_face", "depth": "0 mm"},
    {"name": "tc-8", "under": "mid_face", "depth": "8 mm"},
    {"name": "same", "x": "0 mm", "y": f"{HALF - 8:g} mm"},
    {"name": "inside", "x": "50.3 mm", "y": "31.7 mm"},
]


def probed(*overrides: str) -> Case:
    return billet("taper_1", "casting.length=60 mm", *overrides).with_({"output.probe": PROBES})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("probed")
    run(probed(), folder)
    return folder


def table(folder: Path, name: str) -> pandas.DataFrame:
    return read_history(folder / "probes" / f"{name}.csv")


def test_probe_at_the_surface_agrees_with_the_history(folder: Path) -> None:
    skin, history = table(folder, "skin"), read_history(folder / "history.csv")
    for column, name in (
        ("time", "time"),
        ("position", "position"),
        ("temperature", "surface_temperature_mid_face"),
        ("von_mises", "von_mises_mid_face"),
    ):
        ours, theirs = skin[column].to_numpy(), history[name].to_numpy()
        assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-9)
    outward = np.hypot(skin["displacement_x"], skin["displacement_y"])
    assert outward.to_numpy() == pytest.approx(history["displacement_mid_face"].abs(), abs=1e-9)


def test_depth_is_the_point_below_the_surface(folder: Path) -> None:
    one, other = table(folder, "tc-8"), table(folder, "same")
    assert one.to_numpy() == pytest.approx(other.to_numpy(), rel=1e-9, abs=1e-12)
    assert one["temperature"].iloc[-1] > table(folder, "skin")["temperature"].iloc[-1] + 50.0


def test_phases_and_strains(folder: Path) -> None:
    found = table(folder, "skin")
    units = found.attrs["units"]
    assert units["strain_rate_zz"] == "1/s" and units["stress_xy"] == "MPa"
    solid = found["solid_fraction"]
    assert solid.iloc[0] == 0.0 and 0.5 < solid.iloc[-1] < 1.0
    assert (found["delta_ferrite"] + found["austenite"]).to_numpy() == pytest.approx(solid)
    cold = found["temperature"] < 1494.0  # below the peritectic, of 0.42 %C
    assert cold.any() and not found["delta_ferrite"][cold].any()
    assert found["delta_ferrite"].max() > 0.0
    # The planes strain the section uniformly, and the rate is that of the last window.
    axial, times = found["strain_zz"].to_numpy(), found["time"].to_numpy()
    assert axial == pytest.approx(read_history(folder / "history.csv")["axial_strain"], abs=1e-9)
    rate = np.diff(axial) / np.diff(times)
    assert found["strain_rate_zz"].to_numpy()[1:] == pytest.approx(rate, rel=1e-6, abs=1e-10)


def test_resumed_run_has_the_same_files_to_the_byte(folder: Path, tmp_path: Path) -> None:
    stopped(probed(), tmp_path, 3)
    assert len(table(tmp_path, "skin")) < len(table(folder, "skin"))
    run(probed(), tmp_path, resume=True)
    for probe in PROBES:
        name = f"probes/{probe['name']}.csv"
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_added_probe_prevents_a_resume(tmp_path: Path) -> None:
    case = billet("thermal", "casting.length=60 mm")
    run(case, tmp_path)
    longer = case.with_({"output.probe": PROBES, "casting.length": "90 mm"})
    with pytest.raises(InputError, match=r"skin\.csv: no such file; run again without --resume"):
        run(longer, tmp_path, resume=True)


def test_run_without_probes_removes_old_files(tmp_path: Path) -> None:
    case = billet("thermal", "casting.length=12 mm")
    with castfem.run(case.with_({"output.probe": PROBES}), tmp_path) as result:
        assert list(result.probes) == [probe["name"] for probe in PROBES]
        assert list(result.probes["skin"])[-3:] == ["solid_fraction", "delta_ferrite", "austenite"]
    (tmp_path / "probes" / "mine.csv").write_text("a file of the user's")
    run(case, tmp_path)
    assert [path.name for path in (tmp_path / "probes").iterdir()] == ["mine.csv"]


def test_file_of_the_user_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "probes").mkdir()
    (tmp_path / "probes" / "skin.csv").write_text("mine")
    case = billet("thermal", "casting.length=12 mm").with_({"output.probe": PROBES})
    with pytest.raises(InputError, match=r"holds probes/skin\.csv, not of a run of castfem"):
        run(case, tmp_path)


@pytest.mark.mpi
def test_ranks_agree(shared_folder: Path) -> None:
    single, many = shared_folder / f"{MPI.COMM_WORLD.rank}", shared_folder / "many"
    run(probed(), single)
    loop.run(probed(), many, comm=MPI.COMM_WORLD)
    MPI.COMM_WORLD.Barrier()
    for probe in PROBES:
        one, two = (table(folder, probe["name"]) for folder in (single, many))
        size = one.abs().max().to_numpy()
        assert (np.abs(one - two).max().to_numpy() <= 1e-6 * np.maximum(size, 1e-9)).all()


@pytest.mark.parametrize(
    ("probe", "message"),
    [
        ({"name": "a"}, "one of x with y, or under with depth, is needed"),
        ({"name": "a" * 101, "x": "1 mm", "y": "0 mm"}, "takes at most 100 letters, digits, - and"),
        ({"name": "a", "under": "corner"}, "depth is missing; under and depth go together"),
        ({"name": "../a", "x": "1 mm", "y": "1 mm"}, r"output\.probe\.0\.name"),
        ({"name": "a", "x": "1 m", "y": "0 mm"}, r"probe\.0\.x: .*outside .* reaches to 62\.5 mm"),
        ({"name": "a", "x": "-30 mm", "y": "0 mm"}, r"probe\.0\.x: .* is a quarter; .* 30 mm"),
    ],
)
def test_probe_without_a_place_is_refused(probe: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        billet("thermal").with_({"output.probe": [probe]})


def test_duplicate_names_are_refused() -> None:
    one = {"name": "a", "x": "1 mm", "y": "1 mm"}
    with pytest.raises(InputError, match=r'probe\.1\.name: \("A"\) is used twice'):
        billet("thermal").with_({"output.probe": [one, one | {"name": "A"}]})


def test_check_finds_places_outside_the_section(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    places = (
        {"under": "midface", "depth": "1 mm"},
        {"under": "corner", "depth": "200 mm"},
        {"x": "62 mm", "y": "62 mm"},  # in the cut-off of the round corner
        {"x": "61 mm", "y": "61 mm"},
        {"x": "62.5 mm", "y": "0 mm"},
    )
    probes = [{"name": f"p{i}", **place} for i, place in enumerate(places)]
    path.write_text(billet("thermal").with_({"output.probe": probes}).resolved_toml())
    with pytest.raises(InputError) as error:
        check_case("billet", path, ())
    first, second, third = error.value.problems
    assert first.startswith(f'{path}: output.probe "p0": under: no place "midface"')
    assert "did you mean mid_face" in first
    assert second.startswith(f'{path}: output.probe "p1": depth (200 mm) is beyond')
    assert third.startswith(f'{path}: output.probe "p2": x = 62, y = 62 mm lies outside the sect')


def test_run_refuses_a_place_outside_the_section(tmp_path: Path) -> None:
    """As the check does, with the same message for a depth beyond the middle."""
    probe = {"name": "a", "under": "mid_face", "depth": "80 mm"}
    case = billet("thermal").with_({"output.probe": [probe]})
    with pytest.raises(InputError, match=r"depth \(80 mm\) is beyond .* at 62\.5 mm"):
        run(case, tmp_path)
