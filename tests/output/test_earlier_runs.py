"""Runs that an earlier castfem left behind: interrupted after five steps, they open and go on.

`*.expected.csv` are the histories of the same cases that it ran through. What a later version
computes otherwise moves them by no more than `MOVED`.
"""

from __future__ import annotations

import io
import shutil
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

import castfem
from castfem.post.report.show import show
from castfem.runs.output.run_record import RunRecord

HERE = Path(__file__).parent / "earlier_runs"
# Of curved cells of 5 mm the volume that liquid fills is integrated by another rule now.
KEPT = ("time", "position", "surface", "shell", "liquidus", "heat", "temperature")
MOVED = {"thermal": 1e-9, "taper_1": 1e-3}


@pytest.fixture(params=sorted(MOVED))
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return Path(shutil.copytree(HERE / request.param, tmp_path / request.param))


def test_it_opens(run: Path) -> None:
    text = io.StringIO()
    show(run, Console(file=text, width=120))
    assert "stopped by the user" in text.getvalue() and "shell" in text.getvalue()
    assert "time loop" in RunRecord.load(run).wall_time
    result = castfem.Result(run)
    if run.name == "taper_1":
        assert result.summary.steps["coupling windows"] == 5
        assert result.summary.steps["coupling iterations"] == 5
    assert len(result.history) == (6 if run.name == "taper_1" else 3)


def test_it_goes_on(run: Path) -> None:
    """From its checkpoint to the end of its case, with the history it would have had."""
    before = pd.read_csv(run / "history.csv")
    with castfem.run(castfem.load(run / "case.toml"), run, resume=True):
        found = pd.read_csv(run / "history.csv")
    expected = pd.read_csv(HERE / f"{run.name}.expected.csv")
    assert list(found.columns) == list(expected.columns)
    pd.testing.assert_frame_equal(
        found.iloc[: len(before) - 1], before.iloc[:-1], check_dtype=False
    )
    names = [n for n in found.columns if n.startswith(KEPT)]
    for name in names:
        scale = expected[name].abs().max()
        assert found[name].to_numpy() == pytest.approx(
            expected[name].to_numpy(), rel=MOVED[run.name], abs=MOVED[run.name] * scale, nan_ok=True
        ), name
