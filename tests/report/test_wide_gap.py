"""A gap that conducts less than would radiate is told of, unless radiation is laid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from castfem.base.shown_quantity import Quantity
from castfem.model.shipped_cases import CASE_NAME, load
from castfem.post.report.cautions import radiated, wide_gap
from castfem.runs.output.summary import Summary


def folder(path: Path, *laws: dict[str, Any]) -> Path:
    """A run's, with its case alone: a billet through its mould, whose gap conducts 0.15 W/(m K)."""
    case = load("billet125/taper_1")
    document = case.document()
    document["cooling"][0]["surface"] += laws
    (path / CASE_NAME).write_text(case.with_({"cooling": document["cooling"]}).resolved_toml())
    return path


def summary(gap: float) -> Summary:
    """Of a run with this largest gap, m."""
    return Summary("x", "finished", {"mould_gap_max": Quantity(gap, "mm", "largest gap")})


def test_what_radiates() -> None:
    """0.8 sigma (T^2 + Ta^2) (T + Ta) of 1200 and 150 degC."""
    hot, cold = 1473.15, 423.15
    known = 0.8 * 5.670374419e-8 * (hot**2 + cold**2) * (hot + cold)
    assert radiated() == pytest.approx(known)


def test_a_wide_gap_is_told_with_the_mend(tmp_path: Path) -> None:
    told = wide_gap(folder(tmp_path), summary(2e-3))
    assert 'the largest gap, 2 mm, conducts 75 W/(m^2 K); radiation, which zone "mould"' in told
    assert f"would transfer about {radiated():.0f} more" in told and 'law = "radiation"' in told
    assert wide_gap(tmp_path, summary(0.5e-3)) == ""
    assert wide_gap(tmp_path, summary(0.0)) == ""


def test_of_several_contacts_the_best_conductor_counts(tmp_path: Path) -> None:
    worse = {
        "law": "contact", "coefficient": "1600 W/(m^2 K)", "wall": "160 degC",
        "gap_conductivity": "0.02 W/(m K)", "on": ["corner"],
    }  # fmt: skip
    assert "conducts 75 W/(m^2 K)" in wide_gap(folder(tmp_path, worse), summary(2e-3))
    assert wide_gap(tmp_path, summary(0.5e-3)) == ""


def test_not_where_radiation_is_laid(tmp_path: Path) -> None:
    law = {"law": "radiation", "ambient": "160 degC", "emissivity": 0.8}
    assert wide_gap(folder(tmp_path, law), summary(2e-3)) == ""


def test_not_of_a_run_without_a_mould(tmp_path: Path) -> None:
    assert wide_gap(tmp_path, Summary("x", "finished", {})) == ""
