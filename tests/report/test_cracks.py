"""Output of `castfem show` on the surface: worst places and the next, reheat, end of the pool."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from synthetic_maps import THICK, WIDE, rolls, write_maps
from synthetic_run import printed

from castfem.base.shown_quantity import Quantity
from castfem.fem.reductions import peak
from castfem.model.load import load
from castfem.model.shipped_cases import CASE_NAME
from castfem.physics.machine.stations import Stations
from castfem.post.compare.runs import Run
from castfem.post.compare.table import remarks
from castfem.post.report.cracks import CrackReport, crack_places, pool_end
from castfem.post.report.remarks import remarks_of
from castfem.runs.output.folder import OutputFolder
from castfem.runs.output.history import HISTORY_NAME
from castfem.runs.output.summary_file import Summary
from castfem.runs.output.surface_maps import SurfaceMaps
from castfem.runs.results.headline import derived
from castfem.runs.results.roll_load import RollLoads, heaviest_roll


@pytest.fixture
def report(tmp_path: Path) -> CrackReport:
    write_maps(tmp_path)
    return CrackReport.of(SurfaceMaps(tmp_path))


def test_worst_place_and_distance_of_the_next(report: CrackReport) -> None:
    first, second = report.maxima("I1")
    assert first.value == pytest.approx(30e6) and second.value == pytest.approx(24e6)
    assert (first.phase, first.face) == ("straightening", "intrados")
    assert (second.phase, second.face) == ("bending", "extrados")
    assert report.words(first) == "intrados, corner, 2.12 m (roll 8), 106.2 s, straightening"
    assert report.words(second) == "extrados, corner, 1.10 m (roll 4), 55 s, bending"
    rows = list(report.ranking())
    assert [row[0] for row in rows] == ["I1", "", "I2"]
    assert [row[1] for row in rows] == ["30 MPa", "24 MPa", "20e-5 1/s"]
    assert [row[2] for row in rows] == ["worst", "-20 %", "worst"]
    assert (
        rows[2][3]
        == f"intrados, {500 * WIDE:.0f} mm from the corner, 2.00 m (roll 7), 100 s, straightening"
    )


def test_place_near_a_worse_one_is_the_same(report: CrackReport) -> None:
    """28 MPa on the narrow face 10 mm from it, 29 MPa on the straight strand 75 mm below it."""
    places = [report.words(one) for one in report.maxima("I1")]
    assert not any("narrow" in place or "2.20 m" in place for place in places)


def test_misaligned_roll_does_not_hide_the_bender(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The strand is bent in the bender, and 1.7 m below it by a misaligned roll."""
    write_maps(tmp_path, kink=26e6)
    report = CrackReport.of(SurfaceMaps(tmp_path))
    phases = ["arc" if 1.3 < z < 2.6 else "bending" for z in report.maps.position.tolist()]
    monkeypatch.setitem(vars(report), "phases", phases)
    found = report.maxima("I1")
    assert [one.value for one in found] == pytest.approx([30e6, 26e6, 24e6])
    assert [one.phase for one in found] == ["arc", "bending", "bending"]


def test_places_are_described_or_reported_missing(tmp_path: Path) -> None:
    assert crack_places(tmp_path, None) is None
    for folder, scale in (("worst", 1.0), ("none", 0.0)):
        (tmp_path / folder).mkdir()
        write_maps(tmp_path / folder, scale=scale)
    found, none = (crack_places(tmp_path / name, None) for name in ("worst", "none"))
    first, second = found.worst
    assert first == "I1 30 MPa, intrados, corner, 2.12 m (roll 8), 106.2 s, straightening"
    assert second.startswith("I2 20e-5 1/s, intrados")
    assert not found.nowhere and found.title == "Rolls and reheat"
    assert not list(none.worst) and "low ductility is between 800 and 950 degC" in none.nowhere


def test_surface_never_in_the_band_is_reported(tmp_path: Path) -> None:
    write_maps(tmp_path, scale=0.0, band=(573.15, 673.15))
    found = crack_places(tmp_path, None)
    assert "the surface was never between 300 and 400 degC" in found.nowhere


@pytest.mark.parametrize("ended", [True, False])
def test_unfinished_pool_is_reported(ended: bool) -> None:
    found = {
        "position": Quantity(2.6, "m", "position"),
        "centre_solid_fraction": Quantity(0.0147, "-", "solid fraction, centre"),
        "pool_end_fs10": Quantity(2.1, "m", "solid fraction 0.1 on the centre line"),
    }
    if ended:
        found["pool_end_fs100"] = Quantity(2.5, "m", "solid fraction 1 on the centre line")
    printed_rows = dict(pool_end(Summary("slab", "finished", found), Stations(rolls(), THICK, 0.3)))
    assert ("end of the pool" in printed_rows) == (not ended)
    if not ended:
        assert printed_rows["end of the pool"] == (
            "not before the end of the run, 2.60 m: there the solid fraction is 0.015 on the "
            "centre line"
        )


def test_equal_values_have_the_place_of_the_summary(tmp_path: Path) -> None:
    """A uniformly strained face: the largest x, as in `reductions.peak`."""
    line = write_maps(tmp_path, alike=2.5e-4)
    found = CrackReport.of(SurfaceMaps(tmp_path)).maxima("I2")[0]
    assert line.words(found.vertex) == "extrados, corner"
    x, y = line.place[found.vertex]
    rows = np.full(len(line.nodes), 0.0)
    rows[line.face == line.faces.index("extrados")] = 2.5e-4
    assert (x, y) == peak(MPI.COMM_SELF, rows, line.place)[1:]


@pytest.mark.parametrize(
    ("forces", "place"),
    [
        ((5.0, 8.0, 8.0, 3.0), "0.65 m (roll 2), vertical"),  # in the pitch below it
        ((5.0, 6.0, 7.0, 9.0), "1.15 m (roll 4), bending"),
        ((0.0, 0.0, 0.0, 0.0), ""),
        (None, ""),
    ],
)
def test_roll_with_the_largest_force(
    tmp_path: Path, report: CrackReport, forces: tuple[float, ...] | None, place: str
) -> None:
    header = "time [s],position [m]" + (",roll_force [kN/m]" if forces else "")
    places = (0.65, 0.8, 0.9, 1.2)  # at roll 2, between 2 and 3, at 3, below 4
    lines = [
        f"{z / 0.02},{z}" + (f",{force}" if forces else "")
        for z, force in zip(places, (forces or places), strict=True)
    ]
    (tmp_path / HISTORY_NAME).write_text("\n".join([header, *lines, ""]))
    found = list(heaviest_roll(tmp_path, report.stations))
    assert [where for _, where in found] == ([place] if place else [])
    if place and forces:
        assert found[0][0] == f"largest force on a roll, {max(forces):g} kN/m of width"


def test_largest_reheat(report: CrackReport) -> None:
    found = report.reheat()
    assert found.rise == pytest.approx(80.0, abs=0.01)
    ((what, where),) = report.reheats()
    assert what == "largest reheat, 80 K"
    assert where == f"intrados, {500 * WIDE:.0f} mm from the corner, from 2.00 to 2.50 m"
    assert report.reheat(2.45) is not None and report.reheat(2.55) is None


@pytest.mark.parametrize(
    ("position", "words"),
    [
        (0.2, "0.20 m, mould"),
        (0.35, "0.35 m (roll 1), below the mould"),
        (0.5, "0.50 m (roll 1), vertical"),
        (0.9, "0.90 m (roll 3), bending"),
        (1.15, "1.15 m (roll 4), bending"),
        (1.3, "1.30 m (roll 5), arc"),
        (2.0, "2.00 m (roll 7), straightening"),
        (1.15 + 1e-12, "1.15 m (roll 4), bending"),  # a roll, up to rounding
        (2.5, "2.50 m (roll 9), straight"),
        (9.0, "9.00 m (roll 10), straight"),
    ],
)
def test_roll_and_phase_at_a_position(position: float, words: str) -> None:
    assert Stations(rolls(), THICK, 0.3).words(position) == words


def test_position_without_rolls() -> None:
    assert Stations(None, THICK, 0.3).words(0.31) == "0.31 m, below the mould"
    assert Stations().between(1.0, 2.0) == "1.00 to 2.00 m"


@pytest.mark.parametrize("ended", [True, False])
def test_show_prints_places_of_ended_and_active_runs(tmp_path: Path, ended: bool) -> None:
    with OutputFolder(tmp_path) as folder:
        folder.begin("title = 'x'\n")
        write_maps(tmp_path, ended=ended)
        pool = {
            "pool_end_fs100": Quantity(2.1, "m", "solid fraction 1 on the centre line"),
            "soft_reduction_length": Quantity(0.6, "m", "window, 1.30 to 1.90 m, rolls 5 to 7"),
            "soft_reduction": Quantity(5e-4, "mm", "reduction by the rolls in that window"),
        }
        folder.write_summary(Summary("slab", "finished", pool))
        folder.finish()
    text = printed(tmp_path, 120, figures=False)
    assert "-20 %  extrados, corner, 1.10 m (roll 4), 55 s, bending" in text
    assert "solid fraction 1 on the centre line  2.10 m (roll 8), straightening" in text
    assert "0.60 m, 1.30 to 1.90 m, rolls 5 to 7; the rolls take 0.50 mm off there" in text


def write(folder: Path, force: dict[int, float], bulge: dict[int, float]) -> Path:
    """Write a run of the slab with force [kN/m] and bulge [mm] by pitch; 100 and 0.1 elsewhere."""
    case = load("slab1200/slab")
    rolls = case.machine.pairs()
    folder.mkdir()
    (folder / CASE_NAME).write_text(case.resolved_toml())
    rows = ["time [s],position [m],roll_force [kN/m],bulge_pitch [mm]"]
    for number, pair in enumerate(rolls.pairs, start=1):
        before = rolls.pairs[number - 2].position if number > 1 else 0.5
        for place in (0.5 * (before + pair.position), pair.position):  # in the pitch above it
            above = number - 1
            rows.append(f"{50 * place:.9g},{place:.9g},{force.get(above, 100.0)},"
                        f"{bulge.get(above, 0.1)}")  # fmt: skip
    (folder / HISTORY_NAME).write_text("\n".join(rows) + "\n")
    return folder


def test_largest_loads_have_their_place(tmp_path: Path) -> None:
    folder = write(tmp_path / "run", {69: 273.0}, {33: 1.7})
    loads = RollLoads.of(folder)
    assert loads.largest("roll_force") == (69, 273.0)
    assert loads.largest("bulge_pitch") == (33, 1.7)
    (bulge,) = [one for one in remarks_of(folder, None) if "bulge" in one.what]
    assert (bulge.value, bulge.unit) == (1.7, "mm") and "(roll 33), arc" in bulge.where
    found = derived(folder, Summary("slab", "finished", {}))
    assert found["bulge_largest"].value == pytest.approx(1.7e-3)
    assert found["roll_force_largest"].value == pytest.approx(273e3)


def test_roll_next_to_the_misaligned_one_is_named(tmp_path: Path) -> None:
    """Although the largest force of both runs is at roll 69, and equal."""
    one = write(tmp_path / "order", {69: 273.0, 33: 177.0}, {33: 0.3})
    other = write(tmp_path / "off", {69: 273.0, 33: 251.0}, {33: 0.8})
    runs = [Run(path, path.name, Summary("slab", "finished", {})) for path in (one, other)]
    messages = [line for line in remarks(runs, runs[0], []) if line.startswith("from order to off")]
    assert len(messages) == 2
    assert "force on roll 33, a metre of width: 177 kN/m -> 251 kN/m, at" in messages[0]
    assert "bulge below roll 33: 0.3 mm -> 0.8 mm, at" in messages[1]
    assert not [line for line in remarks(runs[:1] * 2, runs[0], []) if line.startswith("from ")]


def test_run_without_rolls_has_no_loads(tmp_path: Path) -> None:
    (tmp_path / CASE_NAME).write_text(load("billet125/taper_1").resolved_toml())
    assert RollLoads.of(tmp_path) is None
