"""Ends of the pool, mean flux of the mould, and what tables of many runs tell of contact."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from small_case import small
from strained_run import LOST, REGAINED, write_strained

import castfem
from castfem.post.report.show import show
from castfem.runs.output.summary import Summary
from castfem.runs.results.derived import derived
from castfem.runs.results.headline import headline

FLUX = [{"law": "flux", "value": "2 MW/m^2"}]
THIN = {
    "section.width": "20 mm", "section.height": "20 mm", "section.corner_radius": "2 mm",
    "mesh.face_size": "4 mm", "mesh.core_size": "4 mm", "thermal.time.step": "0.25 s",
}  # fmt: skip


def zones(mould: str) -> list[dict[str, object]]:
    air = {"law": "convection", "coefficient": "900 W/(m^2 K)", "ambient": "25 degC"}
    return [
        {"name": "mould", "to": mould, "surface": FLUX},
        {"name": "spray", "surface": [air]},
    ]


def text_of(folder: Path) -> str:
    stream = io.StringIO()
    show(folder, Console(file=stream, width=100), figures=False)
    return stream.getvalue()


def test_the_mean_flux_of_a_mould_with_one_flux_is_that_flux(tmp_path: Path) -> None:
    """Also below the mould, and over a run that is resumed there."""
    case = small({"cooling": zones("30 mm"), "casting.length": "45 mm"})
    first = castfem.run(case, tmp_path).quantities["mould_mean_flux"]
    assert first == pytest.approx(2e6, rel=1e-6)
    longer = small({"cooling": zones("30 mm"), "casting.length": "60 mm"})
    assert castfem.run(longer, tmp_path, resume=True).quantities["mould_mean_flux"] == first


def test_no_mean_without_a_mould() -> None:
    case = small({"cooling": zones("30 mm")[1:]})
    assert "mould_mean_flux" not in castfem.run(case).quantities


def test_the_liquid_core_ends_above_the_mushy_one(tmp_path: Path) -> None:
    case = small({**THIN, "cooling": zones("200 mm"), "casting.length": "1.5 m"})
    result = castfem.run(case, tmp_path)
    found = result.quantities
    assert 0.0 < found["liquid_end"] < found["metallurgical_length"] < 1.5
    # The hottest temperature passes the liquidus and the solidus there.
    for name, level in (("liquid_end", "liquidus"), ("metallurgical_length", "solidus")):
        hottest = result.at(found[name])["temperature_max"]
        assert hottest == pytest.approx(found[level], abs=1e-3)
    text = text_of(tmp_path)
    results = text[text.index("Results") :].splitlines()[3:5]
    assert [line.split("  ")[0] for line in results] == [
        "end of the liquid core, fs = 0",
        "metallurgical length",
    ]
    assert "is not solid" not in text


def test_a_strand_that_is_not_solid_says_so(tmp_path: Path) -> None:
    case = small({**THIN, "cooling": zones("100 mm"), "casting.length": "200 mm"})
    assert "metallurgical_length" not in castfem.run(case, tmp_path).quantities
    told = "at the end of the run, at 0.2 m, the strand is not solid: its core is"
    assert told in text_of(tmp_path)


def test_contact_and_thinnest_shell_for_tables_of_many_runs(tmp_path: Path) -> None:
    folder = write_strained(tmp_path)
    summary = Summary.load(folder)
    assert summary is not None
    found = derived(folder, summary)
    assert found["contact_lost"].value == pytest.approx(LOST, abs=1e-3)
    assert found["contact_regained"].value == pytest.approx(REGAINED, abs=1e-3)
    assert found["shell_least"].shown > 0.0 and "thinnest shell" in found["shell_least"].label
    assert set(found) == set(headline([found]))


def test_contact_that_is_not_regained_has_no_place(tmp_path: Path) -> None:
    folder = write_strained(tmp_path)
    lines = (folder / "history.csv").read_text().splitlines()
    kept = [line for line in lines[1:] if float(line.split(",")[1]) < 0.3]
    (folder / "history.csv").write_text("\n".join([lines[0], *kept, ""]))
    summary = Summary.load(folder)
    assert summary is not None
    assert np.isnan(derived(folder, summary)["contact_regained"].value)
