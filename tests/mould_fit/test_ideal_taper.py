"""Where a search for tapers begins: (302) and (303) of [Pascon2003], in the family asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from castfem.model.shipped_cases import load
from castfem.studies.mould_fit.ideal_taper import strand_sizes
from castfem.studies.optimisation import Evaluation
from castfem.studies.optimisation.problem import DesignProblem

WIDE, DIAGONAL = 125.0, 2.0**0.5 * 115.0 + 10.0  # mm


def strand(folder: Path) -> Path:
    """A strand that bulges to 125.4 mm; its diagonal is drawn in from 125 mm on, to 172.18 mm."""
    z = np.linspace(0.0, 0.6, 121)
    corner = DIAGONAL - (DIAGONAL - 172.18) * np.maximum(z - 0.125, 0.0) / 0.475
    history = pd.DataFrame({
        "time [s]": z / 0.06, "position [m]": z, "size_mid_face [mm]": WIDE + 0.4 * z / 0.6,
        "size_narrow_face [mm]": WIDE + 0.4 * z / 0.6, "size_corner [mm]": corner,
    })  # fmt: skip
    history.to_csv(folder / "history.csv", index=False)
    return folder


def start(taper: Any, keys: list[str], folder: Path) -> np.ndarray:
    variables = [{"key": f"mould.taper{key}", "range": ["-2 %/m", "2 %/m"]} for key in keys]
    case = load("billet125/taper_1").with_({
        "mould.taper": taper,
        "optimise": {"minimise": "von_mises_max", "variable": variables},
    })  # fmt: skip
    found = DesignProblem(case).start(Evaluation(folder=strand(folder)))
    return -2.0 + 4.0 * found


def test_mid_face_and_corner_of_the_thesis(tmp_path):
    taper = {"face": "0.1 %/m", "corner": [
        {"to": "125 mm", "taper": "0.1 %/m"}, {"taper": "0.1 %/m"},
    ]}  # fmt: skip
    found = start(taper, [".face", ".corner.0.taper", ".corner.1.taper"], tmp_path)
    second = 100.0 * (DIAGONAL - 172.18) / (172.18 * 0.475)
    assert found == pytest.approx([-100.0 * 0.4 / (125.4 * 0.6), 0.0, second], abs=0.01)


def test_one_taper_follows_the_corner(tmp_path):
    """The straight line that fits the diagonal; the face would open."""
    (found,) = start("1 %/m", [""], tmp_path)
    z = np.linspace(0.0, 0.6, 25)
    drawn = (DIAGONAL - 172.18) * np.maximum(z - 0.125, 0.0) / 0.475
    slope = float(z @ drawn / (z @ z)) / 172.18 * 100.0
    assert found == pytest.approx(slope, abs=0.01)


def test_a_parabola_begins_flat(tmp_path):
    top, end = start({"top": "1 %/m", "exit": "0.4 %/m"}, [".top", ".exit"], tmp_path)
    assert top < end


def test_beyond_a_range_its_end_is_taken(tmp_path):
    taper = {"face": "0 %/m", "corner": "0 %/m"}
    case = load("billet125/taper_1").with_({
        "mould.taper": taper,
        "optimise": {"minimise": "von_mises_max", "variable": [
            {"key": "mould.taper.face", "range": ["0 %/m", "1 %/m"]},
            {"key": "mould.taper.corner", "range": ["0 %/m", "1 %/m"], "start": "0.3 %/m"},
        ]},
    })  # fmt: skip
    found = DesignProblem(case).start(Evaluation(folder=strand(tmp_path)))
    assert found == pytest.approx([0.0, 0.3])


@pytest.mark.parametrize("name", ["single", "double", "parabolic", "corner", "double_corner"])
def test_shipped_questions(name: str, tmp_path: Path):
    """Each can be asked, and begins within its ranges, where the strand of the thesis is."""
    question = DesignProblem(load(f"billet125/optimum_{name}"))
    assert question.needs_ideal
    found = question.start(Evaluation(folder=strand(tmp_path)))
    assert np.all((found > 0.0) & (found < 1.0))
    best = question.case.with_(question.changes(question.request(found)))
    assert best.mould is not None
    assert best.optimise == question.case.optimise


def test_width_and_height_of_a_bloom(tmp_path: Path) -> None:
    """Each by its own face, the narrow one for the width; the corner by what it moves."""
    z = np.linspace(0.0, 0.6, 121)
    half = {"x": 0.1 * z / 0.6, "y": 0.3 * z / 0.6}  # mm that each side comes in
    pd.DataFrame({
        "time [s]": z / 0.06, "position [m]": z, "size_mid_face [mm]": 100.0 - 2.0 * half["y"],
        "size_narrow_face [mm]": 200.0 - 2.0 * half["x"],
        "displacement_corner [mm]": -0.6 / 0.6 * z,
    }).to_csv(tmp_path / "history.csv", index=False)  # fmt: skip

    def begun(taper: Any, *keys: str) -> np.ndarray:
        case = load("billet125/taper_1").with_({
            "section.width": "200 mm", "section.height": "100 mm", "mould.taper": taper,
            "optimise": {"minimise": "von_mises_max", "variable": [
                {"key": f"mould.taper{key}", "range": ["-2 %/m", "2 %/m"]} for key in keys
            ]},
        })  # fmt: skip
        return -2.0 + 4.0 * DesignProblem(case).start(Evaluation(folder=tmp_path))

    width, height = begun(
        {"narrow_face": "0 %/m", "wide_face": "0 %/m"}, ".narrow_face", ".wide_face"
    )
    assert width == pytest.approx(100.0 * 0.2 / (199.8 * 0.6), rel=1e-3)
    assert height == pytest.approx(100.0 * 0.6 / (99.4 * 0.6), rel=5e-3)
    (both,) = begun("1 %/m", "")
    long, moved = np.hypot(190.0, 90.0) + 10.0, 2.0 * 0.6 * np.hypot(200, 100) * 2.0**0.5 / 300.0
    assert both == pytest.approx(100.0 * moved / ((long - moved) * 0.6), rel=0.01)


def test_the_web_of_a_beam_blank_is_no_height(tmp_path: Path) -> None:
    z = np.linspace(0.0, 0.6, 13)
    history = pd.DataFrame(
        {"position": z, "size_mid_face": 90.0 + z, "size_narrow_face": 380.0 - z}
    )
    cavity = {"width": 0.38, "height": 0.26}
    ((name, width),) = strand_sizes(history, z, cavity).items()
    assert name == "width" and width == pytest.approx(0.38 - 1e-3 * z)
    ((name, _),) = strand_sizes(history, z, {"diameter": 0.09}).items()
    assert name == "diameter"
