"""Runs of castfem, each killed in another call that changes a file, checked and resumed.

Started by test_checkpoint.py with its library loaded before the C library:
`killed_runs.py FOLDER EVERY`.
"""

from __future__ import annotations

import ctypes
import gc
import json
import mmap
import os
import shutil
import signal
import struct
import sys
from bisect import bisect_left
from pathlib import Path
from typing import Any

import meshio
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from small_case import strip

import castfem
from castfem.base import progress
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import read_history
from castfem.runs.output.run_record import RunRecord

STEPS = 4
ADVANCE = 2.5e-3  # m, movement of a slice in a step of the case
# Every step is an output time, every second one is followed by a checkpoint.
SHORT = {
    "thermal.time.step": "150 ms",
    "output.every": "150 ms",
    "output.checkpoint_every": 2,
    "quality": {"band": ["1400 degC", "1510 degC"]},
}
TABLES = ("history.csv", "fields.xdmf", "surface_maps.h5")

# Of the process to be killed: the number of steps it has reported, and of its calls.
shared = mmap.mmap(-1, 16)
shim = ctypes.CDLL(None)


class Steps(progress.Progress):
    """Progress display that notes each committed step where the parent process sees it."""

    def update(self, position: float, *rest: Any) -> None:
        """Note the number of states, the one at the meniscus included."""
        super().update(position, *rest)
        shared[:8] = struct.pack("q", 1 + round(position / ADVANCE))


def stored(path: Path) -> tuple[list[float], list[np.ndarray], list[np.ndarray]]:
    """Return times and two fields of a folder, as castfem reads them."""
    with Fields(path) as fields:
        numbers = range(len(fields.times))
        both = ([fields.values(n, k) for k in numbers] for n in ("temperature", "solid_fraction"))
        return (fields.times.tolist(), *both)


class Uninterrupted:
    """The results of a run that is never killed."""

    def __init__(self, case: castfem.Case, path: Path) -> None:
        self.case = case
        castfem.run(case, path)
        self.rows = read_history(path / "history.csv")
        self.times, self.temperature, self.fraction = stored(path)
        self.summary, self.files = self.whole(path)
        assert len(self.times) == len(self.rows) == STEPS + 1

    def whole(self, path: Path) -> tuple[dict[str, Any], tuple[Any, ...]]:
        """Return the results that must not depend on the number of kills."""
        names = sorted(str(p.relative_to(path)) for p in path.rglob("*"))
        found = json.loads((path / "summary.json").read_text())
        kept = {key: found[key] for key in ("status", "quantities", "balances", "steps")}
        return kept, (names, *((path / name).read_bytes() for name in TABLES))

    def look(self, path: Path, least: int) -> None:
        """Check that all files can be read, and that no written time or row is missing."""
        if (path / "run.json").exists():
            RunRecord.load(path)
        if (path / "checkpoint.h5").exists():
            meta, arrays = load_checkpoint(
                path / "checkpoint.h5", physics=self.case.physics_hash(), case=self.case.physics()
            )
            assert meta["time"] in self.times and np.isfinite(arrays["enthalpy"]).all()
        found = 0
        if (path / "fields.xdmf").exists():
            found = self._look_at_fields(path)
        assert found >= least, f"{least} times were written, {found} are there"
        if (path / "history.csv").exists():
            rows = read_history(path / "history.csv")
            assert len(rows) >= least and rows.equals(self.rows.iloc[: len(rows)])

    def _look_at_fields(self, path: Path) -> int:
        """Compare the fields with those of the full run; return the count of times for ParaView."""
        with meshio.xdmf.TimeSeriesReader(path / "fields.xdmf") as reader:
            reader.read_points_cells()
            found = reader.num_steps
            for k in range(found):
                time, at_points, _ = reader.read_data(k)
                assert time == self.times[k]
                assert np.array_equal(at_points["temperature"], self.temperature[k])
        times, temperature, fraction = stored(path)
        assert times == self.times[: len(times)] and len(times) >= found
        for k in range(len(times)):
            assert np.array_equal(temperature[k], self.temperature[k])
            assert np.array_equal(fraction[k], self.fraction[k])
        return found


def forked(case: castfem.Case, path: Path, resume: bool, call: int) -> int | None:
    """Run a case and kill it at a call (0: none); return its calls, or None if it was killed."""
    process = os.fork()
    if process == 0:
        shim.kill_at(call)
        try:
            castfem.run(case, path, resume=resume)
            shared[8:] = struct.pack("q", shim.calls())
        finally:
            os._exit(0)
    status = os.waitpid(process, 0)[1]
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return None
    number: int = struct.unpack("q", shared[8:])[0]
    return number


def half_done(case: castfem.Case, path: Path) -> None:
    """Leave a run as if killed one step after a checkpoint: that step is to be cut.

    The later the call of the kill, the more steps are reported: the first call with all of them.
    """

    def reported(call: int) -> int:
        shutil.rmtree(path, ignore_errors=True)
        shared[:8] = bytes(8)
        forked(case, path, False, call)
        return int(struct.unpack("q", shared[:8])[0])

    shared[8:] = bytes(8)
    calls = forked(case, path, False, 0)
    assert calls is not None
    assert reported(1 + bisect_left(range(1, calls), STEPS, key=reported)) == STEPS


def main(base: Path, every: int) -> None:
    """Kill a run that begins and one that is resumed, at every n-th call."""
    progress.Progress = Steps  # type: ignore[misc]
    case = strip(SHORT)
    reference = Uninterrupted(case, base / "unbroken")
    gc.freeze()  # imported modules are not searched again after each of the runs
    half = base / "half"
    half_done(case, half)
    for resume in (False, True):
        shared[8:] = bytes(8)
        if resume:
            shutil.copytree(half, base / "count")
        number = forked(case, base / "count", resume, 0)
        shutil.rmtree(base / "count")
        assert number is not None and number > 100, number
        for call in range(1, number + 1, every):
            path = base / f"{resume}{call}"
            if resume:
                shutil.copytree(half, path)
            shared[:8] = struct.pack("q", STEPS - 1 if resume else 0)
            try:
                assert forked(case, path, resume, call) is None
                reference.look(path, struct.unpack("q", shared[:8])[0])
                castfem.run(case, path, resume=True)
                reference.look(path, STEPS + 1)
                assert reference.whole(path) == (reference.summary, reference.files)
            except BaseException:
                kind = "resumed" if resume else "begun"
                print("killed at call", call, "of a run", kind, flush=True)
                raise
            shutil.rmtree(path)
        print(number, "calls")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
