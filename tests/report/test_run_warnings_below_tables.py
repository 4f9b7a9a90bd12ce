"""Runs whose results are doubtful are named below the table of several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from castfem.output.history import HISTORY_NAME
from castfem.report.run_warnings import lines, warnings_of


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
    assert warnings_of(folder) == []
    assert lines({"run": folder}) == []


def test_what_melts_again_and_what_flickers_is_named(tmp_path: Path) -> None:
    """The thickness that was lost, where, and how often contact was."""
    folder = history(tmp_path / "run", [1.0, 2.0, 0.5, *SOUND[:5]], [0.0, 0.2] * 4)
    melted, flickers = warnings_of(folder)
    assert melted.startswith("shell melted again, 1.5 mm: corner, from 200 mm to 300 mm, ")
    assert flickers == "contact lost 4 times, corner"
    assert lines({"taper 1 %/m": folder})[0] == f"look at taper 1 %/m: {melted}"


@pytest.mark.parametrize("count", [5, 6])
def test_a_table_of_many_doubtful_runs_stays_short(tmp_path: Path, count: int) -> None:
    """Ten lines, and how many more there are."""
    folder = history(tmp_path / "run", [1.0, 2.0, 0.5, *SOUND[:5]], [0.0, 0.2] * 4)
    found = lines({str(number): folder for number in range(count)})
    assert len(found) == (10 if count == 5 else 11)
    assert (found[-1] == "and 2 more of this kind; castfem show FOLDER has those of one run") is (
        count == 6
    )


def test_a_folder_without_history_has_nothing_to_tell(tmp_path: Path) -> None:
    """A run that failed before its first row."""
    assert warnings_of(tmp_path) == []
