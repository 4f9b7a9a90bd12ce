"""`castfem compare`: the table, the figures, and folders without a run."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_case import write_small
from synthetic_maps import write_maps

import castfem as package
from castfem.base.shown_quantity import Quantity
from castfem.post.compare.figures import figures
from castfem.post.compare.runs import Run
from castfem.post.compare.table import SHARE, csv_table, lines, remarks, table_of
from castfem.runs.output.history import History
from castfem.runs.output.summary_file import Comparison, Reference, Summary, Zone


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a folder with two finished runs."""
    root = tmp_path_factory.mktemp("runs")
    case = package.load(write_small(root))
    (root / "small.toml").unlink()
    for name, wall in (("cold", "100 degC"), ("warm", "300 degC")):
        theirs = [r | {"note": name} for r in case.document()["reference"]]
        package.run(case.with_(wall=wall, reference=theirs), root / name)
    return root


def test_reference_of_the_unchanged_case_is_left_out(castfem, runs, tmp_path):
    package.run(
        package.load(runs / "cold" / "case.toml").with_(wall="200 degC"), tmp_path / "other"
    )
    outcome = castfem(
        "compare", runs / "cold", tmp_path / "other", "--no-figures", "-o", tmp_path / "both"
    )
    assert "(reference)" in outcome.out
    message = "references of other are of the unchanged case: cooling.mould.surface.0.wall differs"
    assert message in " ".join(outcome.out.split())
    rows = list(csv.reader((tmp_path / "both" / "compare.csv").open()))
    assert rows[0] == ["quantity", "unit", "cold", "cold: reference", "other"]
    shown = castfem("show", tmp_path / "other").out
    assert "of the unchanged case" in shown and " %)" not in shown


def test_compare(castfem, runs):
    outcome = castfem("compare", runs / "cold", runs / "warm", "--base", "warm")
    assert outcome.status == 0, outcome.err
    assert "base: warm" in outcome.out
    assert "references: somebody" in outcome.out
    rows = list(csv.reader((runs / "compare" / "compare.csv").open()))
    assert rows[0] == ["quantity", "unit", "cold", "cold: reference", "warm", "warm: reference"]
    table = {(row[0], row[1]): row[2:] for row in rows[1:]}
    cold = package.Result(runs / "cold").summary.quantities
    warm = package.Result(runs / "warm").summary.quantities
    surface = table["surface, mid-face", "degC"]
    assert float(surface[0]) == pytest.approx(cold["surface_temperature_mid_face"].shown)
    assert (surface[1], surface[3]) == ("1400", "1400")
    share = table["heat removed per m", SHARE]
    assert float(share[2]) == 100.0
    ratio = cold["heat_removed"].value / warm["heat_removed"].value
    assert float(share[0]) == pytest.approx(100 * ratio)
    assert ratio > 1.05
    drawn = {path.stem for path in (runs / "compare").glob("*.png")}
    wanted = {"surface_temperature", "shell", "heat_flux", "heat_removed", "heat_share"}
    assert wanted | {"section_temperature"} <= drawn
    again = castfem("compare", runs / "cold", runs / "warm", "--no-figures", "--all")
    assert again.status == 0
    assert "metallurgical" in again.out or "time" in again.out


def test_invalid_input_is_rejected(castfem, runs, tmp_path):
    def problem(*words) -> str:
        outcome = castfem("compare", *words)
        assert outcome.status == 1
        return outcome.err

    assert "two runs are needed" in problem(runs / "cold", runs / "cold")
    assert "no such folder" in problem(runs / "cold", tmp_path / "nosuch")
    assert f"{__file__}: not a folder" in problem(runs / "cold", __file__)
    assert "holds no run" in problem(runs / "cold", tmp_path)
    assert "--base hot: " in problem(runs / "cold", runs / "warm", "--base", "hot")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    assert "holds other files" in problem(runs / "cold", runs / "warm", "-o", tmp_path / "mine")


@pytest.mark.usefixtures("runs_here")
@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("--set", "speed=3 m/min,4 m/min"), ("speed 3 m/min", "speed 4 m/min")),
        (("--table", "runs.csv"), ("slow & steady", "fast")),
    ],
)
def test_sweep_represents_its_runs(castfem, tmp_path, words, names):
    write_small(tmp_path)
    (tmp_path / "runs.csv").write_text("name,speed [m/min]\nslow & steady,3\nfast,4\n")
    swept = castfem("sweep", "small", *words, "--set", "length=20 mm", "-j", 1, "-o", "out")
    assert swept.status == 0, swept.err
    assert ("slow & steady" in swept.out) == ("fast" in names)
    outcome = castfem("compare", "out", "--no-figures")
    assert outcome.status == 0, outcome.err
    assert f"base: {names[0]}" in outcome.out
    head = (tmp_path / "out" / "compare" / "compare.csv").read_text().splitlines()[0]
    assert names[1] in head


def test_worst_places_and_defects_of_each_run(tmp_path):
    runs = []
    for name, defects in (("reference", []), ("locked_48", ["roll 48, locked"])):
        folder = tmp_path / name
        folder.mkdir()
        write_maps(folder)
        case = package.load(f"slab1200/{name}")
        (folder / "case.toml").write_text(case.resolved_toml(), encoding="utf-8")
        runs.append(Run(folder, name, Summary(name, "finished", {})))
        printed_lines = [one.partition(": ") for one in remarks(runs, runs[0], [])]
        assert [text for who, _, text in printed_lines if who == f"defects of {name}"] == defects
        worst = [text for who, _, text in printed_lines if who == f"worst of {name}"]
        assert worst[0] == "I1 30 MPa, intrados, corner, 2.12 m (roll 8), 106.2 s, straightening"
        assert len(worst) == 2 and worst[1].startswith("I2 20e-5 1/s, ")


def _in_the_mould(folder: Path, name: str, heat: float, reference: Reference, end: float) -> Run:
    """Write a run whose size falls by 1 mm in the 0.6 m of a mould, and continues to fall below."""
    (folder / name).mkdir()
    columns = [("time", "s"), ("position", "m"), ("size_corner", "mm")]
    with History(folder / name / "history.csv", columns) as history:
        for z in (0.0, 0.3, 0.6, end):
            history.append({"time": 10 * z, "position": z, "size_corner": 172.0 - z / 0.6})
    quantities = {
        "heat_removed_slice": Quantity(heat, "kJ", "heat"),
        "size_corner": Quantity(1e-3 * (172.0 - end / 0.6), "mm", "diagonal"),
    }
    found = (Comparison(reference, heat),)
    return Run(
        folder / name, name, Summary(name, "finished", quantities, found, zones=(Zone("m", 0, 1),))
    )


def test_bounds_are_marked_and_met_or_missed(tmp_path):
    def bound(value: float, kind: str, note: str = "") -> Reference:
        return Reference("heat_removed_slice", value, "kJ", "thesis", kind=kind, note=note)

    note = "99 %; our share: castfem compare"
    runs = [
        _in_the_mould(tmp_path, "idealised", 136e3, bound(142e3, "value"), 0.7),
        _in_the_mould(tmp_path, "taper", 135e3, bound(140.58e3, "at_least", note), 0.7),
        _in_the_mould(tmp_path, "straight", 124e3, bound(133.48e3, "at_most"), 0.7),
    ]
    table = lines(runs, runs[0])
    (heat,) = (line for line in table if line.unit == "kJ")
    (share,) = (line for line in table if line.unit == SHARE)
    assert [heat.verdict(i) for i in range(3)] == [None, False, True]
    assert [share.verdict(i) for i in range(3)] == [None, True, True]
    printed_lines = "\n".join(remarks(runs, runs[0], table))
    assert "bounds met: heat (straight); heat, % of base (taper, straight)\n" in printed_lines
    assert "bounds missed: heat (taper by 5.58 kJ)\n" in printed_lines
    assert "note (taper) heat: 99 %" in printed_lines.splitlines()
    (row,) = (row for row in table_of(runs, table).rows if row[0] == "heat" and row[1] == "kJ")
    assert list(row[2:]) == ["136 (142)", "135 (≥ 140.6)", "124 (≤ 133.5)"]
    rows = list(csv.reader(csv_table(runs, table).csv().splitlines()))
    assert rows[0][-3:] == ["straight", "straight: reference", "straight: bound"]
    (row,) = (row for row in rows if row[1] == "kJ")
    assert row[2:] == ["136", "142", "135", "140.58", "at_least", "124", "133.48", "at_most"]


def test_shares_need_an_idealised_mould_of_equal_length(tmp_path):
    def bound(value: float, kind: str = "at_least") -> Reference:
        return Reference("heat_removed_slice", value, "kJ", "thesis", kind=kind)

    ideal = _in_the_mould(tmp_path, "idealised", 140e3, bound(140e3, "value"), 0.7)
    weak = _in_the_mould(tmp_path, "weak", 126e3, bound(138.6e3), 0.7)
    shorter = _in_the_mould(tmp_path, "shorter", 126e3, bound(138.6e3), 0.65)

    def share_of(*runs: Run):
        table = lines(runs, runs[0])
        (share,) = (line for line in table if line.unit == SHARE)
        printed_lines = "\n".join(remarks(runs, runs[0], table))
        return share, [share.verdict(i) for i in range(len(runs))], printed_lines

    share, verdicts, printed_lines = share_of(ideal, weak, shorter)
    assert verdicts == [None, False, None]
    assert "heat, % of base (weak by 9.0 points)" in printed_lines
    assert share.ours == pytest.approx((100.0, 90.0, 90.0))
    titled = replace(ideal, label="mine", summary=replace(ideal.summary, title="Idealised mould"))
    assert share_of(titled, weak)[1] == [None, False]
    other = replace(titled, summary=replace(ideal.summary, title="taper"))
    share, verdicts, printed_lines = share_of(other, weak)
    assert verdicts == [None, None]
    assert SHARE not in printed_lines
    assert share.ours == pytest.approx((100.0, 90.0))


@pytest.mark.parametrize(("end", "places"), [(0.6, (200, 400)), (0.9, (200, 400, 600))])
def test_sizes_are_shown_along_the_mould(tmp_path, end, places):
    reference = Reference("heat_removed_slice", 142e3, "kJ", "thesis")
    made = [_in_the_mould(tmp_path, name, 1e5, reference, end) for name in ("one", "two")]
    zones = (Zone("mould", 0.0, 0.6), Zone("spray", 0.6, 1.2, whole=False))
    made = [replace(run, summary=replace(run.summary, zones=zones, mould_exit=0.6)) for run in made]
    table = [line for line in lines(made, made[0]) if line.label.startswith("diagonal")]
    assert [line.label for line in table] == [*(f"diagonal, at {z} mm" for z in places), "diagonal"]
    for line, z in zip(table, (*places, 1e3 * end), strict=True):
        assert line.ours == pytest.approx([172.0 - z / 600] * 2)


def _synthetic(folder: Path, name: str, scale: float, columns: list[tuple[str, str]]) -> Run:
    (folder / name).mkdir()
    first = [("time", "s"), ("position", "m"), ("heat_removed", "J/m")]
    with History(folder / name / "history.csv", first + columns) as history:
        for step in range(6):
            row = {"time": step, "position": 0.1 * step, "heat_removed": scale * 1e6 * step}
            history.append(row | {c: scale * step * (i + 1) for i, (c, _) in enumerate(columns)})
    quantities = {"heat_removed": Quantity(scale * 5e6, "MJ/m", "heat removed")}
    return Run(folder / name, name, Summary(name, "finished", quantities, zones=(Zone("m", 0, 1),)))


def test_figures_follow_the_columns(tmp_path):
    """Columns of both runs are drawn, a panel for each place, known or not; others are left out."""
    both = [
        ("surface_temperature_corner", "degC"),
        ("gap_corner", "mm"),
        ("gap_mid_face", "mm"),
        ("wall_shear_corner", "MPa"),
        ("newton_mechanics", "-"),
        ("force_error", "-"),
    ]
    one = _synthetic(tmp_path, "one", 1.0, both)
    other = _synthetic(tmp_path, "other", 2.0, [*both, ("size_corner", "mm")])
    found = {d.quantity: (d, panels) for d, panels in figures([one, other], one)}
    assert list(found) == [
        "surface_temperature", "heat_rate", "heat_removed", "heat_share", "gap", "wall_shear",
    ]  # fmt: skip
    assert [panel.place for panel in found["gap"][1]] == ["corner", "mid_face"]
    assert found["wall_shear"][0].title == "Wall shear"
    shares = [curve.values[1:] for curve in found["heat_share"][1][0].curves]
    assert shares[0] == pytest.approx(100.0)
    assert shares[1] == pytest.approx(200.0)
    rate = found["heat_rate"][1][0].curves[1].values
    assert rate == pytest.approx(np.full(6, 2e6))


def test_constant_columns_are_not_drawn(tmp_path):
    """A core that stays liquid, and forces that are rounding of the solver; zeros are drawn."""
    names = {"temperature_core": "degC", "temperature_max": "degC", "axial_force": "kN"}
    names |= {"shell_corner": "mm", "gap_max": "mm", "gap_corner": "mm"}
    columns = [("time", "s"), ("position", "m"), *names.items()]
    made = []
    for name, scale in (("one", 1.0), ("two", 2.0)):
        (tmp_path / name).mkdir()
        with History(tmp_path / name / "history.csv", columns) as history:
            for step in range(6):
                row = {
                    "time": step,
                    "position": 0.1 * step,
                    "temperature_core": 1542.5 - 1e-7 * step,
                }
                row |= {"temperature_max": 1500.0 - step, "axial_force": 1e-9 * step * scale}
                row |= {"shell_corner": 0.0, "gap_max": 2.0 * scale * step, "gap_corner": step}
                history.append(row)
        made.append(Run(tmp_path / name, name, Summary(name, "finished")))
    found = {d.quantity: [panel.place for panel in panels] for d, panels in figures(made, made[0])}
    assert found == {"temperature": ["max"], "shell": ["corner"], "gap": ["corner", "max"]}


def test_references_at_their_own_place():
    """Thesis values within the strand have their own lines; ratios of them, too."""

    def run(name: str, heat: float, expected: float) -> Run:
        quantities = {"heat_removed": Quantity(heat, "kJ/m", "heat removed")}
        inner = Comparison(
            Reference("heat_removed", expected, "kJ/m", "thesis", at=0.6), 0.5 * heat
        )
        return Run(Path(name), name, Summary(name, "finished", quantities, (inner,)))

    made = [run("ideal", 2e6, 1.0e6), run("loose", 1e6, 0.8e6)]
    table = {(line.label, line.unit): line for line in lines(made, made[0])}
    assert table["heat removed", "kJ/m"].ours == pytest.approx((2e3, 1e3))
    assert all(math.isnan(value) for value in table["heat removed", "kJ/m"].theirs)
    inner = table["heat removed, at 600 mm", "kJ/m"]
    assert inner.ours == pytest.approx((1e3, 500.0))
    assert inner.theirs == pytest.approx((1e3, 800.0))
    share = table["heat removed, at 600 mm", SHARE]
    assert share.ours == pytest.approx((100.0, 50.0))
    assert share.theirs == pytest.approx((100.0, 80.0))
