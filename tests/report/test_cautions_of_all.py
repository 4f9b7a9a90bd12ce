"""Runs whose results are doubtful are named below the table of several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from castfem.post.report.cautions import cautions_of_all
from castfem.runs.output.history import HISTORY_NAME


def history(folder: Path, shell: list[float], gap: list[float]) -> Path:
    """A folder with the history of a run: shell and gap of the corner at even distances."""
    folder.mkdir(exist_ok=True)
    positions = np.linspace(0.1, 0.8, len(shell))
    rows = [
        f"{x / 0.02:.6g},{x:.6g},{s},{g}" for x, s, g in zip(positions, shell, gap, strict=True)
    ]
    head = "time [s],position [m],shell_corner [mm],gap_corner [mm]"
    (folder / HISTORY_NAME).write_text("\n".join([head, *rows]) + "\n")
    return folder


SOUND = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]


def test_a_sound_run_is_not_named(tmp_path: Path) -> None:
    """Contact that is lost once, found again and lost for good is that of an ordinary taper."""
    folder = history(tmp_path / "run", SOUND, [0.0, 0.1, 0.0, 0.0, 0.2, 0.3, 0.3, 0.3])
    assert cautions_of_all({"run": (folder, None)}) == []


def test_what_melts_again_and_what_flickers_is_named(tmp_path: Path) -> None:
    """The thickness that was lost, where, and how often contact was."""
    folder = history(tmp_path / "run", [1.0, 2.0, 0.5, *SOUND[:5]], [0.0, 0.2] * 4)
    melted, flickers = cautions_of_all({"taper 1 %/m": (folder, None)})
    said = "shell melted again, 1.5 mm: corner, from 200 mm to 300 mm, "
    assert melted.startswith(f"taper 1 %/m: {said}")
    assert flickers == "taper 1 %/m: contact lost 4 times, corner"
    both = cautions_of_all({"one": (folder, None), "other": (folder, None)})
    assert [line.partition(": ")[0] for line in both] == ["all runs", "all runs"]


@pytest.mark.parametrize("count", [9, 10])
def test_a_table_of_many_doubtful_runs_stays_short(tmp_path: Path, count: int) -> None:
    """Ten lines, and how many more there are."""
    shells = [[1.0, 2.0, 0.5 - 0.01 * k, *SOUND[:5]] for k in range(count)]
    folders = [history(tmp_path / str(k), one, [0.0, 0.2] * 4) for k, one in enumerate(shells)]
    runs = {folder.name: (folder, None) for folder in folders}
    found = cautions_of_all(runs)
    assert len(found) == (10 if count == 9 else 11)
    assert found[-1].startswith("and 1 more of this kind") is (count == 10)


def test_a_folder_without_history_has_nothing_to_tell(tmp_path: Path) -> None:
    """A run that failed before its first row."""
    assert cautions_of_all({"run": (tmp_path, None)}) == []
