"""Benchmarks of the billets in their moulds: what is read on the way, and what the tables make."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks import billet_convergence, billet_sensitivity, billet_study
from benchmarks.billet_inputs import variants
from benchmarks.billet_run import CASES, COARSE, Found, Listener, every, mesh, run
from benchmarks.report import Output
from castfem.model import load_case

SMALL = (*mesh(3.0), every(0.25), "casting.length=150 mm")


def listener(**tracks: list[float]) -> Listener:
    return Listener(np.inf, tracks={name.replace("_", " ", 1): t for name, t in tracks.items()})


def test_places_are_found_between_two_windows() -> None:
    heard = listener(
        position=[0.0, 0.1, 0.2], surface_corner=[1800.0, 1700.0, 1600.0],
        gap_mid_face=[0.0, 0.0, 0.0], gap_corner=[0.0, 0.0, 0.004],
    )  # fmt: skip
    assert heard.cools_to("corner", 1725.0) == pytest.approx(75.0)
    assert np.isnan(heard.cools_to("corner", 1500.0))
    assert heard.lost() == pytest.approx(125.0)  # a quarter of 4 um is where contact is lost
    assert np.isnan(listener(position=[0.0, 0.1], gap_corner=[0.0, 0.0]).lost())


@pytest.mark.parametrize("mould", billet_sensitivity.STUDIED)
def test_every_input_that_is_varied_is_accepted_and_changes_its_mould(
    mould: str, tmp_path: Path
) -> None:
    shipped = load_case(CASES / f"{mould}.toml", COARSE).model_dump()
    known = {"as shipped": shipped}
    for one in variants(tmp_path):
        if not one.moulds or mould in one.moulds:
            varied = load_case(CASES / f"{mould}.toml", (*COARSE, *one.changes)).model_dump()
            same = [label for label, case in known.items() if case == varied]
            assert not same, f"{one.label}: the case is that of {same[0]}"
            known[one.label] = varied
    assert len(known) > 20


@pytest.fixture(scope="module")
def untapered() -> Iterator[dict[str, float]]:
    found = run("taper_0", SMALL)
    assert not found.failure
    yield dict(found.values)


def test_untapered_mould_loses_its_corner_after_it_has_frozen(untapered: dict[str, float]) -> None:
    assert untapered["first_mush"] < untapered["first_solid"] < untapered["closed_solid"] < 150.0
    assert 30.0 < untapered["lost"] < 130.0
    assert untapered["gap_max"] > 1e-3
    assert untapered["pressure_mean"] == pytest.approx(untapered["force"] / 62.5)


def test_shell_begins_later_with_less_cooling(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weak = "cooling.mould.surface.0.coefficient=1280 W/(m^2 K)"
    coarse = (*mesh(3.0), every(0.25))
    monkeypatch.setattr(billet_study, "STARTS", {"as here": coarse, "weak": (*coarse, weak)})
    output = Output(tmp_path, "billet.md")
    billet_study.beginnings(output, quick=False)
    billet_study.show_beginnings(output)
    with (tmp_path / "data" / "billet_start.csv").open(encoding="utf-8") as file:
        shipped, weaker, thesis = csv.DictReader(file)
    assert float(weaker["closed_solid"]) > 1.1 * float(shipped["closed_solid"])
    assert (thesis["first_solid"], thesis["closed_solid"]) == ("60", "85")
    assert "| weak | " in (tmp_path / "billet.md").read_text(encoding="utf-8")


def test_error_is_the_largest_difference_to_anything_finer(tmp_path: Path) -> None:
    def row(name: str, heat: float) -> dict[str, object]:
        numbers = dict.fromkeys(billet_study.SHOWN, 1.0) | {"heat_removed_slice": heat}
        work = dict.fromkeys(("gap_max", "penetration", "cells", "cut", "newton", "seconds"), 1.0)
        return {"refined": name, **numbers, **work, "failure": ""}

    heats = {1.2: 100.0, 0.8: 110.0, 0.5: 113.0, 0.35: 111.0}
    rows = [row(f"mesh [mm] = {size}", heat) for size, heat in heats.items()]
    for family, (values, _, _) in billet_convergence.CONVERGENCE.items():
        if family != "mesh [mm]":
            rows += [row(f"{family} = {value}", 110.0) for value in values]
    output = Output(tmp_path, "billet.md")
    billet_convergence.show_convergence(output, "taper_1", rows)
    text = output.page.read_text(encoding="utf-8")
    errors = text[text.index("<!-- begin billet error taper_1") :]
    assert "| mesh [mm] | 3 | 0 |" in errors  # 1.2 mm is coarser, 0.5 mm further off than 0.35
    assert "| together | 3 | 0 |" in errors


def test_short_version_has_what_is_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[tuple[str, ...]] = []

    def advance(mould: str, changes: tuple[str, ...]) -> Found:
        tried.append(changes)
        names = (*billet_study.SHOWN, "gap_max", "penetration")
        return Found(dict.fromkeys(names, float(len(tried))), 1.0, 10)

    monkeypatch.setattr(billet_convergence, "run", advance)
    billet_convergence.main(Output(tmp_path, "billet.md"), quick=True)
    assert len(tried) == 2 * 2 * len(billet_convergence.CONVERGENCE)
    text = (tmp_path / "billet.md").read_text(encoding="utf-8")
    errors = text[text.index("<!-- begin billet error taper_1") :]
    assert "| mesh [mm] | 1 | 1 |" in errors  # a run and the next


def test_ideal_mould_has_no_friction_among_the_peaks(tmp_path: Path) -> None:
    output = Output(tmp_path, "billet.md")
    for i, mould in enumerate(billet_sensitivity.PEAKED):
        rows = [
            {"input": label, "von_mises_max": 10.0 * i + j, "von_mises_mid_face": 0.5}
            for j, label in enumerate(billet_sensitivity.PEAKS)
            if mould != "idealised" or "friction" not in label
        ]
        output.csv(f"billet_inputs_{mould}", rows)
    billet_sensitivity.peaks(output)
    text = output.page.read_text(encoding="utf-8")
    assert "| friction 0.3 (Coulomb) | 0.0 | 17.0 | 27.0 | 0.5 | 0.5 |" in text
    assert "| flow stress 20 % higher and friction 0.3 | 5.0 | 18.0 | 28.0 | 0.5 | 0.5 |" in text
    assert "| thesis | 12.0 | 18.0 | 24.0 | 8 to 10 | 10 to 12 |" in text
