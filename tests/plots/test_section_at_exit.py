"""The section of a run that goes on below its mould is drawn where the mould ends."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_run import summary, write_run

from castfem.post.plots.figures import RunData, draw_figures
from castfem.post.plots.style import Style


@pytest.mark.parametrize(
    ("exit_", "at"), [(None, 0.6), (0.6, 0.6), (0.9, 0.6), (0.2, 0.2), (0.05, 0.05)]
)
def test_which_state_is_drawn(tmp_path: Path, exit_: float | None, at: float) -> None:
    folder = write_run(tmp_path / "run", steps=80)
    with ExitStack() as files:
        run = RunData(folder, replace(summary(), mould_exit=exit_), files)
        positions = np.asarray(run.fields.positions, float)
        assert abs(positions[run.at_exit] - at) == np.abs(positions - at).min()
        assert RunData(folder, None, files).at_exit == len(positions) - 1


def test_both_figures_are_drawn(tmp_path: Path) -> None:
    drawn = {path.stem for path in draw_figures(write_run(tmp_path / "run"))}
    assert {"temperature", "states"} <= drawn


def test_the_meniscus_is_no_state_to_look_at(tmp_path: Path) -> None:
    """With states far apart that after it is drawn, though it lies farther from the exit."""
    folder = write_run(tmp_path / "run", steps=80)
    with ExitStack() as files:
        assert RunData(folder, replace(summary(), mould_exit=1e-4), files).at_exit == 1


def test_a_stack_of_few_slices_is_not_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_run(tmp_path / "run", steps=80)
    with ExitStack() as files:
        count = len(RunData(folder, None, files).fields.positions)
    for least, there in ((count, True), (count + 1, False)):
        monkeypatch.setattr("castfem.post.plots.figures.STYLE", Style(slices=least))
        drawn = {path.stem for path in draw_figures(folder)}
        assert ("stack" in drawn) is there and "temperature" in drawn
