"""Studies of several runs, from Python: the results of the commands, in SI."""

from __future__ import annotations

import csv
import math
import shutil
from pathlib import Path

import pandas
import pytest
from small_case import write_small

import castfem
from castfem.cli import execute
from castfem.model import Case
from castfem.studies.accuracy.table import ErrorTable

CELLS = {
    "mesh.surface_size": "3 mm",
    "mesh.corner_size": "3 mm",
    "mesh.face_size": "12 mm",
    "mesh.core_size": "16 mm",
    "coupling.interval": "0.5 s",
    "output.figures": False,
}


def billet(name: str, **changes: str) -> Case:
    return castfem.load(f"billet125/{name}").with_({**CELLS, "casting.length": "90 mm"} | changes)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return castfem.load(write_small(tmp_path_factory.mktemp("case")))


@pytest.fixture(scope="module")
def runs(case: Case, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("runs")
    for name, speed in (("slow", "3 m/min"), ("fast", "4 m/min")):
        castfem.run(case.with_(speed=speed), folder / name)
    return [folder / "slow", folder / "fast"]


def test_help_names_the_studies() -> None:
    named = (castfem.__doc__ or "").partition("Packages, upstream first")[0]
    for name in castfem.__all__:
        assert name in named and callable(getattr(castfem, name))


def test_comparison_has_the_numbers_of_the_runs(runs: list[Path]) -> None:
    table = castfem.comparison(runs, "fast")
    shell = table.loc["shell_mid_face"]
    for folder in runs:
        assert shell[folder.name] == pytest.approx(castfem.Result(folder).quantities[shell.name])
    assert shell.unit == "m" and math.isnan(shell["at"])
    heat, share = table.loc["heat_removed"], table.loc["heat_removed_share"]
    assert share.fast == pytest.approx(1.0)
    assert share.slow == pytest.approx(heat.slow / heat.fast) and share.unit == "-"
    surface = table.loc["surface_temperature_mid_face"]
    assert 1000.0 < surface.slow < 1800.0 and surface.unit == "K"


def test_comparison_at_places_is_that_of_the_results(runs: list[Path]) -> None:
    table = castfem.comparison(runs, at=["30 mm", 0.05], everything=True)
    heat = table.loc["heat_removed"]
    assert list(heat["at"]) == [0.03, 0.05]
    expected = castfem.Result(runs[0]).at("30 mm")["heat_removed"]
    assert heat["slow"].iloc[0] == pytest.approx(expected)
    single = castfem.comparison(runs, at="30 mm", everything=True).loc["heat_removed"]
    assert single["slow"] == pytest.approx(expected)
    with pytest.raises(castfem.InputError, match="two runs are needed"):
        castfem.comparison(runs[0])
    with pytest.raises(castfem.InputError, match=r"^at 5\.0: no run has reached this position"):
        castfem.comparison(runs, at=5.0)
    with pytest.raises(castfem.InputError, match=r"^at 3 kg: 'kg' is"):
        castfem.comparison(runs, at=["3 kg"])


def test_comparison_has_the_references_of_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = "verification/neumann", "--accuracy", "coarse", "--set", "casting.length=10 mm"
    assert execute(["run", *words, "-q", "-o", "one"]) == 0
    shutil.copytree("one", "two")
    assert execute(["compare", "one", "two", "--no-figures"]) == 0
    with (tmp_path / "compare" / "compare.csv").open() as file:
        head, *rows = list(csv.reader(file))
    table = castfem.comparison(["one", "two"])
    assert len(rows) == len(table) and "one: reference" in head
    assert [name for name in head if name.startswith("one")] == [
        name for name in table.columns if name.startswith("one")
    ]


def test_errors_are_those_of_the_written_table(case: Case, tmp_path: Path) -> None:
    found = castfem.error_table(case, tmp_path / "runs")
    written = ErrorTable.load(tmp_path / "runs" / "error.json").quantities
    heat, entry = found.loc["heat_removed"], written["heat_removed"]
    assert entry.unit == "MJ/m" and heat.unit == "J/m"
    assert heat.value == pytest.approx(1e6 * entry.value)
    assert heat.error == pytest.approx(1e6 * entry.error())
    assert heat.error == pytest.approx(heat.mesh + heat.step)
    surface = found.loc["surface_temperature_mid_face"]
    assert surface.unit == "K" and 0.0 < surface.error < 100.0 < surface.value
    base = castfem.Result(tmp_path / "runs" / "base")
    assert base.summary.quantities["heat_removed"].error == pytest.approx(heat.error)
    before = (tmp_path / "runs" / "base" / "history.csv").stat().st_mtime_ns
    again = castfem.error_table(case, tmp_path / "runs")  # nothing is run again
    assert (tmp_path / "runs" / "base" / "history.csv").stat().st_mtime_ns == before
    pandas.testing.assert_frame_equal(again, found)


def test_failed_runs_are_reported(case: Case) -> None:
    long = {"mesh.surface_size": "40 mm", "mesh.core_size": "40 mm", "mesh.face_size": "40 mm"}
    found = castfem.error_table(case.with_(long), processes=1)
    assert "mesh_x2" in found.attrs["not run"]


def test_folder_of_a_single_run_is_refused(case: Case, runs: list[Path]) -> None:
    with pytest.raises(castfem.InputError, match="holds a single run"):
        castfem.error_table(case, runs[0])


@pytest.mark.parametrize("name", ["error_table", "find_section", "mould_at_work", "optimise"])
def test_missing_case_is_reported(name: str) -> None:
    with pytest.raises(castfem.InputError, match=f"^{name}: a case is needed"):
        getattr(castfem, name)(None)


def test_section_reaches_its_target() -> None:
    case = billet("idealised")
    found = castfem.find_section(case, "60 mm")
    assert found.attempts[-1].worst < 10e-6 < found.attempts[0].worst
    both = found.changes(wall=True)
    assert set(both) == {"section.bulge", "mould.displacement"}
    with pytest.raises(castfem.InputError, match=r"^find_section: mould: "):
        castfem.find_section(billet("taper_1"))


def test_hot_mould_is_valid_for_a_run() -> None:
    tube = {"mould.length": "90 mm", "mould.tube.cell_size": "40 mm", "mould.tube.cells_across": 1}
    case = billet("hot", **tube)
    found = castfem.mould_at_work(case, coupled=True)
    assert len(found.iterations) > 1
    assert found.hot.dimensions(0.0)["width"] == pytest.approx(0.125)
    assert found.cold.dimensions(0.0)["width"] < 0.12495
    hot = case.with_(found.changes())
    assert hot.mould is not None and hot.mould.displacement is not None
    assert castfem.mould_at_work(case).iterations[-1].wall.heated.hottest > 320.0
    with pytest.raises(castfem.InputError, match=r"^mould_at_work: mould.tube: the table"):
        castfem.mould_at_work(billet("taper_1"))


def test_run_named_as_a_column_is_refused(runs: list[Path], tmp_path: Path) -> None:
    taken = shutil.copytree(runs[0], tmp_path / "label")
    with pytest.raises(castfem.InputError, match="label: a column of the table has that name"):
        castfem.comparison([taken, runs[1]])
    assert len(castfem.comparison(runs, at=None)) == len(castfem.comparison(runs))


def test_invalid_folders_are_reported_in_one_line(runs: list[Path]) -> None:
    for given in (5, [None], [*runs, 3]):
        with pytest.raises(castfem.InputError, match="comparison: folders of runs are needed"):
            castfem.comparison(given)  # type: ignore[arg-type]
    with pytest.raises(castfem.InputError, match="comparison: base must be the label"):
        castfem.comparison(runs, 3)  # type: ignore[arg-type]
