"""Crack indexes along the strand: compared with the history, resumed, on ranks, with an own one."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path
from typing import Any

from mpi4py import MPI

import h5py
import numpy as np
import pytest
from bent_case import HALF, bent
from named_result import assert_named_everywhere
from small_case import small, write_small

from castfem.base import result_registry as quantities
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError, RunFailure
from castfem.base.types import Array
from castfem.model import Case, load_case
from castfem.runs import loop
from castfem.runs.output.folder import MAPS_NAME, ROWS_NAME
from castfem.runs.output.history import read_history
from castfem.runs.output.surface_maps import SurfaceMaps
from castfem.runs.results import crack_index as registry
from castfem.runs.results.crack_index import SliceStep, crack_index
from castfem.runs.results.crack_tracking import QualitySampler

ROOT = Path(__file__).parents[2]
WIDE = {"band": ["1000 degC", "1300 degC"]}  # contains the whole strand
CUT = {"band": ["1185 degC", "1190 degC"]}  # each place of the surface passes through


def judged(quality: dict[str, object], **changes: object) -> Case:
    """Return the bent billet with crack indexes and without fields."""
    return bent(quality=quality, **changes)


@pytest.fixture(scope="module")
def wide(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that is entirely in the band."""
    folder = tmp_path_factory.mktemp("wide")
    loop.run(judged(WIDE, output__checkpoint_every=4), folder, comm=MPI.COMM_SELF)
    return folder


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that passes through the band."""
    folder = tmp_path_factory.mktemp("cut")
    loop.run(judged(CUT), folder, comm=MPI.COMM_SELF)
    return folder


def thickness_at(table: Any, y: Array) -> Array:
    """Return the thickness of a slice over its initial one (rows, places), by its planes."""
    strain, curvature = (table[name].to_numpy()[:, None] for name in ("axial_strain", "curvature"))
    return (1.0 + strain) * (1.0 - curvature * y)


def test_second_index_is_the_motion_of_the_planes(wide: Path) -> None:
    """Exact over each step: (e - e_old)/dt with e = (1 + a0)(1 - k y), from the history."""
    table, maps = read_history(wide / "history.csv"), SurfaceMaps(wide)
    y = maps.heading.line.place[:, 1]
    thickness = thickness_at(table, y)
    rate = np.diff(thickness, axis=0) / np.diff(table["time"])[:, None]
    assert np.abs(rate).max() > 1e-3
    assert maps["I2"][1:] == pytest.approx(np.maximum(rate, 0.0), rel=2e-7, abs=1e-12)
    assert table["I2_max"].to_numpy()[1:] == pytest.approx(
        np.maximum(rate, 0).max(axis=1), abs=1e-12
    )


def test_thickness_of_the_slice_is_that_of_its_planes(wide: Path) -> None:
    table = read_history(wide / "history.csv")
    for place, y in (("intrados", HALF), ("centre", 0.0), ("extrados", -HALF)):
        thickness = (1.0 + table["axial_strain"]) * (1.0 - table["curvature"] * y)
        assert np.ptp(thickness) > (1e-3 if y else 1e-4)
        assert table[f"slice_thickness_{place}"].to_numpy() == pytest.approx(thickness, rel=1e-11)


def test_mean_over_a_pitch_is_that_of_the_strain(wide: Path) -> None:
    """The pitch is 250 mm, five windows: the strain five windows ago."""
    table, maps = read_history(wide / "history.csv"), SurfaceMaps(wide)
    y, time = maps.heading.line.place[:, 1], table["time"].to_numpy()
    thickness = thickness_at(table, y)
    mean = (thickness[5:] - thickness[:-5]) / (time[5:] - time[:-5])[:, None]
    assert maps["I2_pitch"][5:] == pytest.approx(np.maximum(mean, 0.0), rel=1e-6, abs=1e-11)


def test_mechanical_part_excludes_the_thermal_strain(wide: Path) -> None:
    from castfem.model.build.simulation import case_steel

    case, table, maps = judged(WIDE), read_history(wide / "history.csv"), SurfaceMaps(wide)
    y, time = maps.heading.line.place[:, 1], table["time"].to_numpy()
    thickness = thickness_at(table, y)
    free = case_steel(case).thermal_strain(maps["temperature"])
    rate = np.diff(thickness - free, axis=0) / np.diff(time)[:, None]
    # Temperatures of the maps are rounded to 6e-5 K: 1e-9 of strain over 0.8 s.
    assert maps["I2_mechanical"][1:] == pytest.approx(np.maximum(rate, 0.0), abs=5e-9)


def test_first_index_is_the_axial_stress(wide: Path) -> None:
    table, maps = read_history(wide / "history.csv"), SurfaceMaps(wide)
    line = maps.heading.line
    for probe, place in (
        ("mid_face_intrados", (0.0, HALF)),
        ("corner_extrados", (HALF, -HALF)),
        ("narrow_face", (HALF, 0.0)),
    ):
        stress = 1e6 * table[f"axial_stress_{probe}"].to_numpy()
        assert np.ptp(stress) > 1e6 or probe == "narrow_face"
        mine = maps["I1"][:, line.at(*place)]
        assert mine == pytest.approx(np.maximum(stress, 0.0), rel=1e-4, abs=20.0)
    assert 1e6 * table["I1_max"].to_numpy() == pytest.approx(maps["I1"].max(axis=1), rel=1e-6)


def test_indexes_are_zero_outside_the_band(cut: Path, wide: Path) -> None:
    """In the band they are as in a wide one, elsewhere zero."""
    narrow, whole = SurfaceMaps(cut), SurfaceMaps(wide)
    kelvin = narrow["temperature"]
    inside = (kelvin > 1185.0 + ZERO_CELSIUS) & (kelvin < 1190.0 + ZERO_CELSIUS)
    assert inside.any() and not inside.all()
    assert np.array_equal(narrow["in_band"], inside)
    for name in ("I1", "I2", "I2_mechanical", "I2_pitch"):
        assert np.array_equal(narrow[name], np.where(inside, whole[name], 0.0)), name
    with h5py.File(cut / MAPS_NAME) as file:
        assert np.array_equal(file["maps/in_band"][()], inside)
        assert file["maps/I2"].attrs["unit"] == "1/s"


def test_time_in_the_band_is_interpolated_linearly(cut: Path) -> None:
    maps = SurfaceMaps(cut)
    vertex = maps.heading.line.at(HALF, HALF)
    celsius = maps["temperature"][:, vertex] - ZERO_CELSIUS
    assert celsius[-1] < 1185.0 and (np.diff(celsius) < 0.0).all()
    enters, leaves = (np.interp(-level, -celsius, maps.time) for level in (1190.0, 1185.0))
    assert maps["band_time"][-1, vertex] == pytest.approx(leaves - enters, rel=1e-5)
    assert (np.diff(maps["band_time"], axis=0) >= 0.0).all()


def test_largest_index_is_reported_with_its_place(cut: Path) -> None:
    """Face, distance from the corner, roll, and action of the rolls on the strand."""
    maps = SurfaceMaps(cut)
    rate = maps["I2"]
    ties = np.argwhere(rate >= rate.max() * (1.0 - 1e-6))
    places = {f"{maps.heading.line.words(j)}, {maps.position[i]:.2f} m" for i, j in ties}
    found = json.loads((cut / "summary.json").read_text())["quantities"]["way_I2_max"]
    assert found["value"] == pytest.approx(rate.max(), rel=1e-6)
    what, _, where = found["label"].partition(" on the way, ")
    assert what == "largest I2, axial strain rate in the band"
    assert where.partition(" (roll 3), ")[0] in places and where.endswith(" s, bending")


def test_bending_and_straightening_have_their_maxima(wide: Path) -> None:
    """Bent to 0.6 m, straightened to 1.35 m: maxima of the maps between, with their faces."""
    maps = SurfaceMaps(wide)
    found = json.loads((wide / "summary.json").read_text())["quantities"]
    for phase, start, end, face in (
        ("bending", 0.1, 0.6, "extrados"),
        ("straightening", 0.6, 1.35, "intrados"),
    ):
        rows = (maps.position > start + 1e-9) & (maps.position < end + 1e-9)
        for index in ("I1", "I2", "I2_pitch"):
            one = found[f"{phase}_{index}_max"]
            factor = 1e6 if one["unit"] == "MPa" else 1.0
            assert factor * one["value"] == pytest.approx(maps[index][rows].max(), rel=1e-6)
        assert face in found[f"{phase}_I2_max"]["label"]
    assert found["way_I2_max"]["value"] == found["bending_I2_max"]["value"]


def break_off(patch: pytest.MonkeyPatch, window: int = 14) -> None:
    """Let a run fail in a window."""
    note, seen = QualitySampler.note, [0]

    def broken(self: QualitySampler, *given: object) -> object:
        seen[0] += 1
        if seen[0] == window + 1:
            raise RunFailure("out of power")
        return note(self, *given)  # type: ignore[arg-type]

    patch.setattr(QualitySampler, "note", broken)


@pytest.mark.parametrize("killed", [True, False])
def test_kill_loses_nothing_of_the_maps(tmp_path: Path, wide: Path, killed: bool) -> None:
    """Cut off within a row, with rows beyond the checkpoint: the end is the same byte for byte.

    So it is after a run that ended with an error, whose maps are already in their last file.
    """
    case, rows = judged(WIDE, output__checkpoint_every=4), tmp_path / ROWS_NAME
    with pytest.MonkeyPatch.context() as patch:
        break_off(patch)
        if killed:  # no end of the run, and rows beyond the checkpoint
            patch.setattr(loop, "_leave", lambda *given: None)
            patch.setattr("castfem.runs.output.surface_maps.MapWriter.close", lambda self: None)
        with pytest.raises(RunFailure, match="power"):
            loop.run(case, tmp_path, comm=MPI.COMM_SELF)
    assert len(SurfaceMaps(tmp_path).time) == 14
    assert rows.exists() == killed
    if killed:
        with open(rows, "ab") as file:
            file.write(b"half a row")
        assert len(SurfaceMaps(tmp_path).time) == 14
    loop.run(case, tmp_path, comm=MPI.COMM_SELF, resume=True)
    assert not rows.exists()
    for name in (MAPS_NAME, "history.csv"):
        assert (tmp_path / name).read_bytes() == (wide / name).read_bytes(), name
    ours, theirs = (
        json.loads((path / "summary.json").read_text())["quantities"] for path in (tmp_path, wide)
    )
    assert ours == theirs


def near_a_roll() -> Case:
    """Return a case whose zone ends 10 um below roll 3; a sudden pull acts in between."""
    air = {"law": "convection", "coefficient": "100 W/(m^2 K)", "ambient": "25 degC"}
    pull = {"position": [0, 0.6, 0.60001, 2], "position_unit": "m", "value": [0, 0, 50, 50]}
    return judged(
        WIDE,
        cooling=[
            {"name": "first", "to": "0.60001 m", "surface": [air]},
            {"name": "second", "surface": [air]},
        ],
        mechanics__planes={"force": pull | {"unit": "kN"}, "force_contains_bending": True},
        casting__length="0.7 m",
    )


def test_tiny_window_has_a_mean_rate(tmp_path: Path) -> None:
    """It is a mean with the window before; stored for a run that is resumed just above."""
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    loop.run(near_a_roll(), whole, comm=MPI.COMM_SELF)
    table, maps = read_history(whole / "history.csv"), SurfaceMaps(whole)
    (tiny,) = np.flatnonzero(np.diff(maps.position) < 1e-4) + 1
    y, time = maps.heading.line.place[:, 1], maps.time
    thickness = thickness_at(table, y)
    single, mean = (
        (thickness[tiny] - thickness[k]) / (time[tiny] - time[k]) for k in (tiny - 1, tiny - 2)
    )
    assert single.max() > 100.0 * mean.max() > 0.0
    assert maps["I2"][tiny] == pytest.approx(np.maximum(mean, 0.0), rel=1e-6, abs=1e-12)
    after = (thickness[tiny + 1] - thickness[tiny]) / (time[tiny + 1] - time[tiny])
    assert maps["I2"][tiny + 1] == pytest.approx(np.maximum(after, 0.0), rel=1e-6, abs=1e-12)
    with pytest.MonkeyPatch.context() as patch:
        break_off(patch, int(tiny))
        with pytest.raises(RunFailure, match="power"):
            loop.run(near_a_roll(), broken, comm=MPI.COMM_SELF)
    loop.run(near_a_roll(), broken, comm=MPI.COMM_SELF, resume=True)
    for name in (MAPS_NAME, "history.csv"):
        assert (broken / name).read_bytes() == (whole / name).read_bytes(), name


def test_rates_are_those_of_the_actual_windows(tmp_path: Path) -> None:
    """Windows end where the rolls bend, so an interval longer than all of them smears no rate."""
    rates = []
    for interval in ("0.8 m", "20 m"):
        folder = tmp_path / interval
        loop.run(judged(WIDE, coupling__interval=interval), folder, comm=MPI.COMM_SELF)
        rates.append(SurfaceMaps(folder)["I2"])
    assert rates[0].max() > 0.0 and (rates[0] == rates[1]).all()


def test_windows_grow_where_the_strain_is_steady(tmp_path: Path) -> None:
    """They grow after each kink of the curvature, less so with a smaller allowed error.

    A run that is cut off continues with its windows.
    """
    coupling: dict[str, Any] = {"interval": "25 mm", "growth": 6.0}
    whole, broken, strict = (tmp_path / name for name in ("whole", "broken", "strict"))
    case = judged(WIDE, coupling=coupling)
    loop.run(case, whole, comm=MPI.COMM_SELF)
    at = read_history(whole / "history.csv")["position"].to_numpy()
    kinks = [int(np.argmin(np.abs(at - place))) for place in (0.1, 0.6, 1.35)]
    assert at[kinks] == pytest.approx([0.1, 0.6, 1.35], abs=1e-9)
    assert np.diff(at)[kinks] == pytest.approx([0.025] * 3, abs=1e-9)
    assert np.diff(at).max() == pytest.approx(0.15, abs=1e-9)
    loop.run(judged(WIDE, coupling=coupling | {"strain_error": 1e-9}), strict, comm=MPI.COMM_SELF)
    uniform = len(read_history(strict / "history.csv"))
    assert len(at) < 0.6 * uniform
    with pytest.MonkeyPatch.context() as patch:
        break_off(patch, 8)
        with pytest.raises(RunFailure, match="power"):
            loop.run(case, broken, comm=MPI.COMM_SELF)
    loop.run(case, broken, comm=MPI.COMM_SELF, resume=True)
    for name in (MAPS_NAME, "history.csv"):
        assert (broken / name).read_bytes() == (whole / name).read_bytes(), name


def test_damaged_or_missing_maps_are_not_resumed(tmp_path: Path) -> None:
    case = small({"quality": {}})
    loop.run(case, tmp_path, comm=MPI.COMM_SELF)
    longer = case.with_({"casting.length": "70 mm"})
    with h5py.File(tmp_path / MAPS_NAME, "r+") as file:
        del file["maps/band_time"]
    with pytest.raises(InputError, match=r"surface_maps.h5: cannot be read"):
        loop.run(longer, tmp_path, comm=MPI.COMM_SELF, resume=True)
    (tmp_path / MAPS_NAME).unlink()
    with pytest.raises(InputError, match=r"surface_maps.h5: no such file"):
        loop.run(longer, tmp_path, comm=MPI.COMM_SELF, resume=True)


@pytest.mark.mpi
def test_ranks_agree_in_the_maps(shared_folder: Path) -> None:
    single, many = shared_folder / f"{MPI.COMM_WORLD.rank}", shared_folder / "many"
    loop.run(judged(CUT), single, comm=MPI.COMM_SELF)
    loop.run(judged(CUT), many, comm=MPI.COMM_WORLD)
    MPI.COMM_WORLD.Barrier()
    one, two = SurfaceMaps(single), SurfaceMaps(many)
    assert one.heading.text() == two.heading.text()
    for name in one.names():
        size = np.abs(one[name]).max()
        assert two[name] == pytest.approx(one[name], rel=1e-6, abs=1e-7 * size), name
    ours, theirs = (
        json.loads((path / "summary.json").read_text())["quantities"]["way_I2_max"]["label"]
        for path in (single, many)
    )
    assert ours == theirs


def declare_range() -> None:
    """Declare an index that castfem does not have; all of it is here."""

    @crack_index("swing", unit="K", label="largest swing of temperature", accumulates=True)
    def swing(step: SliceStep) -> Array:
        """Largest change of temperature in a step so far."""
        return np.maximum(step.value, np.abs(step.temperature - step.earlier))


def test_new_index_is_one_function(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Declared only here: in history, summary and maps, and continued after a resume."""
    quantities.declared()
    monkeypatch.setattr(quantities, "_declared", dict(quantities._declared))
    monkeypatch.setattr(registry, "_declared", dict(registry._declared))
    declare_range()
    assert len(inspect.getsource(declare_range).splitlines()) < 10
    case = small({"quality": {}})
    loop.run(case.with_({"casting.length": "30 mm"}), tmp_path, comm=MPI.COMM_SELF)
    summary = loop.run(case, tmp_path, comm=MPI.COMM_SELF, resume=True)
    maps, table = SurfaceMaps(tmp_path), read_history(tmp_path / "history.csv")
    assert maps.names() == ("temperature", "band_time", "swing")
    change = np.maximum.accumulate(np.abs(np.diff(maps["temperature"], axis=0)), axis=0)
    assert maps["swing"][1:] == pytest.approx(change, abs=1e-3)
    assert table.columns[-1] == "swing_max" and table.attrs["units"]["swing_max"] == "K"
    assert summary.quantities["way_swing_max"].value == pytest.approx(change.max(), abs=1e-3)
    assert "corner, 0.0" in summary.quantities["way_swing_max"].label
    assert_named_everywhere("way_swing_max", "2 K")


def test_index_of_the_manual_is_available_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """`tension` of docs/output.md, by the code on that page."""
    quantities.declared()
    monkeypatch.setattr(quantities, "_declared", dict(quantities._declared))
    monkeypatch.setattr(registry, "_declared", dict(registry._declared))
    page = (ROOT / "docs" / "output.md").read_text(encoding="utf-8")
    exec(page.partition("### An index of your own")[2].split("```")[1].removeprefix("python\n"), {})
    for name in ("way_tension_max", "bending_tension_max", "straightening_tension_max"):
        assert_named_everywhere(name, "2 MPa")


def test_manual_has_each_map_of_the_surface() -> None:
    page = (ROOT / "docs" / "output.md").read_text(encoding="utf-8")
    rows = page.partition("| map | description |")[2].partition("\n\n")[0].splitlines()
    listed = {name for row in rows for name in re.findall(r"`(\w+)`", row.split(" | ")[0])}
    maps = {one.name for one in registry.declared_indexes() if one.on == "surface"}
    assert not listed ^ maps, f"table of maps in docs/output.md, by hand: {sorted(listed ^ maps)}"


def test_case_without_indexes_writes_no_maps(tmp_path: Path) -> None:
    loop.run(small(), tmp_path / "out", comm=MPI.COMM_SELF)
    assert not {MAPS_NAME, ROWS_NAME} & {path.name for path in (tmp_path / "out").iterdir()}
    assert "quality" not in (tmp_path / "out" / "case.toml").read_text()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("band", '["950 degC", "800 degC"]', "lower end comes first"),
        (
            "band",
            '"900 degC"',
            'lower and its upper end, such as ["800 degC", "950 degC"] ("900 degC")',
        ),
        ("band", '["800 degC", "950"]', "unit"),
        ("critical_strain", "-0.1", "must be above 0"),
        ("bend", "1", "band"),
    ],
)
def test_invalid_input_is_rejected_with_its_key(
    tmp_path: Path, key: str, value: str, message: str
) -> None:
    with pytest.raises(InputError) as error:
        load_case(write_small(tmp_path), [f"quality.{key}={value}"])
    assert f"quality.{key}" in str(error.value) and message in str(error.value)
