"""Runs of castfem, each killed in another call that changes a file, looked at and resumed.

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
ADVANCE = 2.5e-3  # m, of a slice in a step of the case
# Every step is an output time, every second one is followed by a checkpoint.
SHORT = {
    "thermal.time.step": "150 ms",
    "output.every": "150 ms",
    "output.checkpoint_every": 2,
    "quality": {"band": ["1400 degC", "1510 degC"]},
}
TABLES = ("history.csv", "fields.xdmf", "surface_maps.h5")

# Of the process that is killed: the steps that it has told of as done, and the calls it made.
told = mmap.mmap(-1, 16)
shim = ctypes.CDLL(None)


class Steps(progress.Progress):
    """Notes each step that is committed and written, where the parent process sees it."""

    def update(self, position: float, *rest: Any) -> None:
        """Note how many states there are, the one at the meniscus among them."""
        super().update(position, *rest)
        told[:8] = struct.pack("q", 1 + round(position / ADVANCE))


def stored(path: Path) -> tuple[list[float], list[np.ndarray], list[np.ndarray]]:
    """Times and two fields of a folder, as castfem reads them."""
    with Fields(path) as fields:
        numbers = range(len(fields.times))
        both = ([fields.values(n, k) for k in numbers] for n in ("temperature", "solid_fraction"))
        return (fields.times.tolist(), *both)


class Unbroken:
    """What a run that nobody kills leaves behind."""

    def __init__(self, case: castfem.Case, path: Path) -> None:
        self.case = case
        castfem.run(case, path)
        self.rows = read_history(path / "history.csv")
        self.times, self.temperature, self.fraction = stored(path)
        self.summary, self.files = self.whole(path)
        assert len(self.times) == len(self.rows) == STEPS + 1

    def whole(self, path: Path) -> tuple[dict[str, Any], tuple[Any, ...]]:
        """What must not depend on how often the run was killed."""
        names = sorted(str(p.relative_to(path)) for p in path.rglob("*"))
        found = json.loads((path / "summary.json").read_text())
        kept = {key: found[key] for key in ("status", "quantities", "balances", "steps")}
        return kept, (names, *((path / name).read_bytes() for name in TABLES))

    def look(self, path: Path, least: int) -> None:
        """All that is there can be read; no time and no row that was written is missing."""
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
        """Compare the fields with those of the unbroken run; how many times ParaView would find."""
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
    """A run killed at a call (0: at none): the calls it made, or None if it was killed."""
    process = os.fork()
    if process == 0:
        shim.kill_at(call)
        try:
            castfem.run(case, path, resume=resume)
            told[8:] = struct.pack("q", shim.calls())
        finally:
            os._exit(0)
    status = os.waitpid(process, 0)[1]
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return None
    number: int = struct.unpack("q", told[8:])[0]
    return number


def half_done(case: castfem.Case, path: Path) -> None:
    """Leave a run as it is when killed one step after a checkpoint: that step is to be cut.

    The later the call at which a run is killed, the more steps it has told of: the first of them.
    """

    def steps(call: int) -> int:
        shutil.rmtree(path, ignore_errors=True)
        told[:8] = bytes(8)
        forked(case, path, False, call)
        return int(struct.unpack("q", told[:8])[0])

    told[8:] = bytes(8)
    calls = forked(case, path, False, 0)
    assert calls is not None
    assert steps(1 + bisect_left(range(1, calls), STEPS, key=steps)) == STEPS


def main(base: Path, every: int) -> None:
    """Kill a run that begins and one that is resumed at one call in so many."""
    progress.Progress = Steps  # type: ignore[misc]
    case = strip(SHORT)
    unbroken = Unbroken(case, base / "unbroken")
    gc.freeze()  # what is imported is not looked through again after each of the runs
    half = base / "half"
    half_done(case, half)
    for resume in (False, True):
        told[8:] = bytes(8)
        if resume:
            shutil.copytree(half, base / "count")
        number = forked(case, base / "count", resume, 0)
        shutil.rmtree(base / "count")
        assert number is not None and number > 100, number
        for call in range(1, number + 1, every):
            path = base / f"{resume}{call}"
            if resume:
                shutil.copytree(half, path)
            told[:8] = struct.pack("q", STEPS - 1 if resume else 0)
            try:
                assert forked(case, path, resume, call) is None
                unbroken.look(path, struct.unpack("q", told[:8])[0])
                castfem.run(case, path, resume=True)
                unbroken.look(path, STEPS + 1)
                assert unbroken.whole(path) == (unbroken.summary, unbroken.files)
            except BaseException:
                kind = "resumed" if resume else "begun"
                print("killed at call", call, "of a run", kind, flush=True)
                raise
            shutil.rmtree(path)
        print(number, "calls")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
