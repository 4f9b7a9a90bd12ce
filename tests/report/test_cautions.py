"""A flux all round the section without a gap is told of in each report on a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from small_case import small

import castfem
from castfem.cli import execute
from castfem.model.shared_heat import even_zones
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.report.cautions import cautions
from castfem.runs.output.summary import Summary

FLUX = {"law": "contact", "flux": "2 MW/m^2", "wall": "160 degC"}
OVER = {"temperature": ["200 degC", "1400 degC"], "value": [1, 2], "unit": "MW/m^2"}
TOLD = "zone mould has the same flux everywhere round the section"


def zones(*laws: dict[str, Any], to: str = "30 mm") -> list[dict[str, Any]]:
    return [{"name": "mould", "to": to, "surface": list(laws)}, {"name": "below"}]


@pytest.mark.parametrize(
    ("laws", "even"),
    [
        ([FLUX], True),
        ([{"law": "flux", "value": "2 MW/m^2"}], True),
        ([FLUX | {"flux": OVER}], True),
        ([FLUX | {"on": ["wide_face", "narrow_face"]}, FLUX | {"on": ["corner"]}], False),
        ([FLUX | {"gap": "0.1 mm", "gap_conductivity": "0.15 W/(m K)"}], False),
        ([{"law": "contact", "coefficient": "1600 W/(m^2 K)", "wall": "160 degC"}], False),
    ],
)
def test_which_cases_are_even(laws: list[dict[str, Any]], even: bool) -> None:
    assert list(even_zones(small({"cooling": zones(*laws)}))) == (["mould"] if even else [])


def test_a_sharp_corner_is_cooled_from_both_faces(tmp_path: Path) -> None:
    case = small({"cooling": zones(FLUX), "section.corner_radius": "0 mm"})
    assert list(even_zones(case)) == ["mould"]
    (tmp_path / CASE_NAME).write_text(case.resolved_toml())
    (line,) = cautions(tmp_path, Summary("x", "finished", {}))
    assert "corner_radius" in line and '"corner"' not in line


def test_run_show_report_and_compare_say_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changes = {"cooling": zones(FLUX), "casting.length": "30 mm"}
    (tmp_path / "case.toml").write_text(small(changes).resolved_toml())
    runs = [str(tmp_path / name) for name in ("one", "other")]
    for run in runs:
        capsys.readouterr()
        assert execute(["run", str(tmp_path / "case.toml"), "-o", run]) == 0
        assert TOLD in capsys.readouterr().out
    assert execute(["show", runs[0]]) == 0
    assert TOLD in capsys.readouterr().out
    assert execute(["compare", *runs, "--no-figures"]) == 0
    out = capsys.readouterr().out
    assert f"all runs: {TOLD}" in out and out.count(TOLD) == 1
    for words in (runs[:1], runs):
        page = tmp_path / "page.html"
        assert execute(["report", *words, "-o", str(page)]) == 0
        assert page.read_text().count(TOLD) == 1


def test_nothing_is_said_where_a_gap_opens(tmp_path: Path) -> None:
    (tmp_path / CASE_NAME).write_text(castfem.load("billet180/peritectic").resolved_toml())
    assert cautions(tmp_path, Summary("x", "finished", {})) == []
