"""`castfem identify`: a law from tensile curves, its files, and its refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np

CURVES = ((1000.0, 55.2e6, 0.13, 0.15), (1200.0, 30.1e6, 0.14, 0.16))


def tensile_file(folder: Path) -> Path:
    rows = ["temperature [degC],strain rate [1/s],strain [percent],stress [MPa]"]
    for temperature, strength, p3, p4 in CURVES:
        for rate in (1e-4, 1e-3):
            for strain in np.linspace(0.003, 0.05, 12):
                stress = strength * np.sqrt(3) * (np.sqrt(3) * rate) ** p3 * strain**p4
                rows.append(f"{temperature},{rate},{100 * strain},{1e-6 * stress}")
    path = folder / "gleeble.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_identify_writes_the_law_it_finds(castfem, tmp_path):
    target = tmp_path / "law.toml"
    outcome = castfem("identify", tensile_file(tmp_path), "-o", target, "--softening", "none")
    assert outcome.status == 0
    assert "1200" in outcome.out
    assert target.with_suffix(".png").is_file()
    from castfem.physics.constitutive import load_elasticity, load_law

    law = load_law(str(target), load_elasticity())
    found = law.p3(np.array([1273.15, 1473.15]))
    np.testing.assert_allclose(found, [0.13, 0.14], atol=1e-3)


def test_identify_replaces_no_file_unasked(castfem, tmp_path):
    target = tmp_path / "law.toml"
    target.write_text("mine")
    outcome = castfem("identify", tensile_file(tmp_path), "-o", target, "--softening", "none")
    assert outcome.status == 1
    assert "law.toml: is there" in outcome.err and "--overwrite" in outcome.err
    assert target.read_text() == "mine"
    outcome = castfem("identify", tensile_file(tmp_path), "-o", target, "--overwrite")
    assert outcome.status == 0 and "norton_hoff" in target.read_text()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["gleeble.csv", "law.png", "law.toml"]


def test_identify_refuses_what_it_cannot_read(castfem, tmp_path):
    outcome = castfem("identify", tmp_path / "none.csv")
    assert outcome.status == 1
    assert "none.csv" in outcome.err
    outcome = castfem("identify", tensile_file(tmp_path), "--softening", "some")
    assert outcome.status == 1
    assert "positive, free, none" in outcome.err
