"""Cautions about runs before their numbers are used: even fluxes, wide gaps; once for several."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.shown_quantity import Quantity
from castfem.cli import execute
from castfem.model.checks.shared_heat import even_zones
from castfem.model.load import load
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.report.cautions import cautions, cautions_of_all, radiated, wide_gap
from castfem.runs.output.history import HISTORY_NAME
from castfem.runs.output.summary_file import Summary

FLUX = {"law": "contact", "flux": "2 MW/m^2", "wall": "160 degC"}
OVER = {"temperature": ["200 degC", "1400 degC"], "value": [1, 2], "unit": "MW/m^2"}
CAUTION = "zone mould has the same flux everywhere round the section"


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
def test_even_fluxes_are_found(laws: list[dict[str, Any]], even: bool) -> None:
    assert list(even_zones(small({"cooling": zones(*laws)}))) == (["mould"] if even else [])


def test_sharp_corner_is_cooled_from_both_faces(tmp_path: Path) -> None:
    case = small({"cooling": zones(FLUX), "section.corner_radius": "0 mm"})
    assert list(even_zones(case)) == ["mould"]
    (tmp_path / CASE_NAME).write_text(case.resolved_toml())
    (line,) = cautions(tmp_path, Summary("x", "finished", {}))
    assert "corner_radius" in line and '"corner"' not in line


def test_all_commands_print_the_caution(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changes = {"cooling": zones(FLUX), "casting.length": "30 mm"}
    (tmp_path / "case.toml").write_text(small(changes).resolved_toml())
    runs = [str(tmp_path / name) for name in ("one", "other")]
    for run in runs:
        capsys.readouterr()
        assert execute(["run", str(tmp_path / "case.toml"), "-o", run]) == 0
        assert CAUTION in capsys.readouterr().out
    assert execute(["show", runs[0]]) == 0
    assert CAUTION in capsys.readouterr().out
    assert execute(["compare", *runs, "--no-figures"]) == 0
    out = capsys.readouterr().out
    assert f"all runs: {CAUTION}" in out and out.count(CAUTION) == 1
    for words in (runs[:1], runs):
        page = tmp_path / "page.html"
        assert execute(["report", *words, "-o", str(page)]) == 0
        assert page.read_text().count(CAUTION) == 1


def test_opening_gap_has_no_caution(tmp_path: Path) -> None:
    (tmp_path / CASE_NAME).write_text(castfem.load("billet180/peritectic").resolved_toml())
    assert cautions(tmp_path, Summary("x", "finished", {})) == []


def history(folder: Path, shell: list[float], gap: list[float]) -> Path:
    """Write the history of a run into a folder: shell and gap of the corner at even distances."""
    folder.mkdir(exist_ok=True)
    positions = np.linspace(0.1, 0.8, len(shell))
    rows = [
        f"{x / 0.02:.6g},{x:.6g},{s},{g}" for x, s, g in zip(positions, shell, gap, strict=True)
    ]
    head = "time [s],position [m],shell_corner [mm],gap_corner [mm]"
    (folder / HISTORY_NAME).write_text("\n".join([head, *rows]) + "\n")
    return folder


SOUND = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]


def test_sound_run_is_not_named(tmp_path: Path) -> None:
    """Contact lost once, regained, and finally lost is normal for an ordinary taper."""
    folder = history(tmp_path / "run", SOUND, [0.0, 0.1, 0.0, 0.0, 0.2, 0.3, 0.3, 0.3])
    assert cautions_of_all({"run": (folder, None)}) == []


def test_remelting_and_flickering_contact_are_named(tmp_path: Path) -> None:
    """With the lost thickness, the place, and the number of contacts."""
    folder = history(tmp_path / "run", [1.0, 2.0, 0.5, *SOUND[:5]], [0.0, 0.2] * 4)
    melted, flickers = cautions_of_all({"taper 1 %/m": (folder, None)})
    message = "shell melted again, 1.5 mm: corner, from 200 mm to 300 mm, "
    assert melted.startswith(f"taper 1 %/m: {message}")
    assert flickers == "taper 1 %/m: contact lost 4 times, corner"
    both = cautions_of_all({"one": (folder, None), "other": (folder, None)})
    assert [line.partition(": ")[0] for line in both] == ["all runs", "all runs"]


@pytest.mark.parametrize("count", [9, 10])
def test_table_of_many_doubtful_runs_stays_short(tmp_path: Path, count: int) -> None:
    """Ten lines, and the number of further ones."""
    shells = [[1.0, 2.0, 0.5 - 0.01 * k, *SOUND[:5]] for k in range(count)]
    folders = [history(tmp_path / str(k), one, [0.0, 0.2] * 4) for k, one in enumerate(shells)]
    runs = {folder.name: (folder, None) for folder in folders}
    found = cautions_of_all(runs)
    assert len(found) == (10 if count == 9 else 11)
    assert found[-1].startswith("and 1 further ones") is (count == 10)


def test_folder_without_history_has_no_cautions(tmp_path: Path) -> None:
    """A run that failed before its first row."""
    assert cautions_of_all({"run": (tmp_path, None)}) == []


def folder(path: Path, *laws: dict[str, Any]) -> Path:
    """Write only the case of a run: a billet in its mould, whose gap conducts 0.15 W/(m K)."""
    case = load("billet125/taper_1")
    document = case.document()
    document["cooling"][0]["surface"] += laws
    (path / CASE_NAME).write_text(case.with_({"cooling": document["cooling"]}).resolved_toml())
    return path


def summary(gap: float) -> Summary:
    """Return the summary of a run with this largest gap, m."""
    return Summary("x", "finished", {"mould_gap_max": Quantity(gap, "mm", "largest gap")})


def test_radiated_heat_is_by_the_law() -> None:
    """0.8 sigma (T^2 + Ta^2) (T + Ta) for 1200 and 150 degC."""
    hot, cold = 1473.15, 423.15
    known = 0.8 * 5.670374419e-8 * (hot**2 + cold**2) * (hot + cold)
    assert radiated() == pytest.approx(known)


def test_wide_gap_is_reported_with_the_fix(tmp_path: Path) -> None:
    message = wide_gap(folder(tmp_path), summary(2e-3))
    assert 'the largest gap, 2 mm, conducts 75 W/(m^2 K); radiation, which zone "mould"' in message
    assert (
        f"would transfer about {radiated():.0f} more" in message and 'law = "radiation"' in message
    )
    assert wide_gap(tmp_path, summary(0.5e-3)) == ""
    assert wide_gap(tmp_path, summary(0.0)) == ""


def test_best_conductor_of_several_contacts_counts(tmp_path: Path) -> None:
    worse = {
        "law": "contact", "coefficient": "1600 W/(m^2 K)", "wall": "160 degC",
        "gap_conductivity": "0.02 W/(m K)", "on": ["corner"],
    }  # fmt: skip
    assert "conducts 75 W/(m^2 K)" in wide_gap(folder(tmp_path, worse), summary(2e-3))
    assert wide_gap(tmp_path, summary(0.5e-3)) == ""


def test_case_with_radiation_has_no_caution(tmp_path: Path) -> None:
    law = {"law": "radiation", "ambient": "160 degC", "emissivity": 0.8}
    assert wide_gap(folder(tmp_path, law), summary(2e-3)) == ""


def test_run_without_a_mould_has_no_caution(tmp_path: Path) -> None:
    assert wide_gap(tmp_path, Summary("x", "finished", {})) == ""
