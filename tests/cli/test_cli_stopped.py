"""Commands that run many cases, stopped by a signal: a line, and the same command goes on."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_case import SMALL

from castfem.runs.output.run_record import RunRecord

pytestmark = pytest.mark.slow

TABLE = """
[optimise]
minimise = "surface_temperature_mid_face"

[[optimise.variable]]
key = "casting.speed"
range = ["2 m/min", "5 m/min"]
"""


@pytest.mark.parametrize(
    ("command", "number"), [("error", signal.SIGTERM), ("optimise", signal.SIGHUP)]
)
def test_a_signal_ends_the_command_with_a_line(
    tmp_path: Path, command: str, number: signal.Signals
) -> None:
    slow = SMALL.replace('"60 mm"', '"600 mm"').replace('"50 ms"', '"2 ms"')
    (tmp_path / "small.toml").write_text(slow + TABLE)
    words = [sys.executable, "-m", "castfem.cli", command, "small", "-j", "1", "-o", "out"]
    process = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60.0
    while not list(tmp_path.glob("out/*/history.csv")) and time.monotonic() < end:
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(number)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted; the same command" in err.splitlines()[-1]
    (folder,) = [path.parent for path in tmp_path.glob("out/*/history.csv")]
    record = RunRecord.load(folder)
    assert record.status == "interrupted"
    assert record.reason == "stopped with the command that had started it"


@pytest.mark.usefixtures("runs_here")
def test_an_error_that_goes_on_says_nothing_of_a_replaced_run(castfem, tmp_path: Path) -> None:
    """It takes up what was cut short by itself: it has no --resume."""
    (tmp_path / "small.toml").write_text(SMALL.replace('"60 mm"', '"6 mm"'))
    words = ("error", "small", "-j", 1, "-o", "out")
    assert castfem(*words, "-q").status == 0
    path = tmp_path / "out" / "base" / "run.json"
    record = json.loads(path.read_text())
    record |= {"status": "interrupted", "reached": {"position": 0.003}}
    path.write_text(json.dumps(record))
    again = castfem(*words)
    assert again.status == 0, again.err
    assert "replaced" not in again.err and "--resume" not in again.err
