"""Runs that end early are resumed without a trace: counts, references, history, files."""

from __future__ import annotations

import errno
import itertools
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from interrupted import history_of, stopped
from ranks import needs_mpirun, python_on, started
from runs.billet_runs import SILENT, billet, cells, run

from castfem.base.errors import InputError, RunFailure
from castfem.model import Case, load_case
from castfem.physics.coupling.subcycling import ThermalSteps
from castfem.physics.thermal.problem import ThermalProblem
from castfem.runs.interrupt import Interrupt, Stopped
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.history import History, read_history
from castfem.runs.output.summary_file import Summary
from castfem.runs.recorder import Recorder

ROOT = Path(__file__).parents[2]
THERMAL = ROOT / "cases" / "billet125" / "thermal.toml"
HOME = Path(sys.prefix).parent  # of the environment, if tools/env.sh has made it
COARSE = (*cells(2, 6, 12), *SILENT)


def thermal(*overrides: str) -> Case:
    return load_case(THERMAL, (*COARSE, *overrides))


def record(folder: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((folder / "run.json").read_text())
    return found


def rows(folder: Path) -> int:
    path = folder / "history.csv"
    return path.read_text().count("\n") if path.is_file() else 0


def same_run(one: Path, other: Path) -> None:
    """Check that the histories of two folders have the same times and numbers."""
    ours, theirs = (read_history(folder / "history.csv") for folder in (one, other))
    assert ours.shape == theirs.shape
    assert np.allclose(ours.to_numpy(), theirs.to_numpy(), rtol=1e-6, atol=1e-9, equal_nan=True)


def failing(monkeypatch: pytest.MonkeyPatch, error: BaseException, time: float) -> None:
    """Let every thermal step from `time` (s) on raise an error."""
    take = ThermalSteps.one

    def one(self: ThermalSteps, state, *given):  # type: ignore[no-untyped-def]
        if state.time >= time:
            raise error
        return take(self, state, *given)

    monkeypatch.setattr(ThermalSteps, "one", one)


def test_run_that_failed_in_its_first_step_resumes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = thermal("casting.length=60 mm")
    with monkeypatch.context() as patch:
        failing(patch, RunFailure("stuck"), 0.0)
        with pytest.raises(RunFailure, match=r"^0 mm below the meniscus \(0 s\): stuck$"):
            run(case, tmp_path / "cut")
    assert run(case, tmp_path / "cut", resume=True).status == "finished"
    run(case, tmp_path / "whole")
    same_run(tmp_path / "cut", tmp_path / "whole")


def references(summary: Summary) -> dict[str, tuple[float | None, float]]:
    """Return the position and our value of each reference, by its quantity."""
    return {c.reference.quantity: (c.reference.at, c.ours) for c in summary.references}


def test_references_of_the_old_end_survive_a_longer_run(tmp_path: Path) -> None:
    short = references(run(thermal(), tmp_path / "parts"))
    parts = references(run(thermal("casting.length=700 mm"), tmp_path / "parts", resume=True))
    whole = references(run(thermal("casting.length=700 mm"), tmp_path / "whole"))
    assert len(short) == 5
    for name, (at, ours) in whole.items():
        assert short[name][0] is None and parts[name][0] == at == 0.6
        assert parts[name][1] == short[name][1] == pytest.approx(ours, rel=1e-9)
    assert parts.keys() == short.keys() == whole.keys()


def test_failed_run_is_not_compared_at_an_unreached_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = thermal('reference.0.at="300 mm"')
    failing(monkeypatch, RunFailure("stuck"), 6.0)
    with pytest.raises(RunFailure):
        run(case, tmp_path)
    summary = Summary.load(tmp_path)
    assert summary is not None
    assert list(references(summary)) == [case.reference[0].quantity]


def test_interrupted_run_resumes_from_its_last_step(tmp_path: Path) -> None:
    """Its counts, Newton iterations too, are those of an uninterrupted run."""
    case = billet("taper_1", "casting.length=90 mm")
    stopped(case, tmp_path / "cut", 4)
    found = record(tmp_path / "cut")
    assert (found["status"], found["reason"]) == ("interrupted", "stopped by the user")
    summary = Summary.load(tmp_path / "cut")
    assert summary is not None and summary.status == "interrupted"
    with pytest.raises(InputError, match=r"casting\.length: 0\.03 m .* has reached 0\.045 m"):
        run(billet("taper_1", "casting.length=30 mm"), tmp_path / "cut", resume=True)
    assert record(tmp_path / "cut") == found
    reached = read_history(tmp_path / "cut" / "history.csv")["time"].iloc[-1]
    assert load_checkpoint(tmp_path / "cut" / "checkpoint.h5")[0]["time"] == reached == 0.75
    resumed = run(case, tmp_path / "cut", resume=True)
    whole = run(case, tmp_path / "whole")
    same_run(tmp_path / "cut", tmp_path / "whole")
    assert resumed.steps == whole.steps
    assert min(whole.steps[n] for n in whole.steps if n.startswith("Newton")) > 10


def broken(self: Recorder, run: object) -> None:
    raise RunFailure("no space left on device")


@pytest.mark.parametrize("save", [Recorder.save, broken])
def test_any_error_keeps_the_last_good_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, save: Callable[..., None]
) -> None:
    case = thermal("casting.length=60 mm", "thermal.time.step=0.1 s")
    with monkeypatch.context() as patch:
        failing(patch, MemoryError("too much"), 0.45)
        patch.setattr(Recorder, "save", save)
        with pytest.raises(MemoryError, match="too much"):
            run(case, tmp_path / "cut")
    found = record(tmp_path / "cut")
    assert found["status"] == "failed" and "too much" in str(found["reason"])
    if save is broken:
        return
    assert found["reached"] == {"time": 0.5, "position": pytest.approx(0.03), "step": 5}
    run(case, tmp_path / "cut", resume=True)
    run(case, tmp_path / "whole")
    same_run(tmp_path / "cut", tmp_path / "whole")


def test_no_checkpoint_is_ahead_of_the_history(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row that could not be written is missing from no resumed run."""
    case = thermal("casting.length=60 mm", "thermal.time.step=0.1 s")
    append = History.append

    def full(self: History, row: dict[str, float]) -> None:
        if row["time"] > 0.35:
            raise RunFailure("history.csv: no space left on device")
        append(self, row)

    with monkeypatch.context() as patch:
        patch.setattr(History, "append", full)
        with pytest.raises(RunFailure, match="no space"):
            run(case, tmp_path / "cut")
    assert load_checkpoint(tmp_path / "cut" / "checkpoint.h5")[0]["time"] == pytest.approx(0.3)
    assert record(tmp_path / "cut")["reached"] == {
        "time": pytest.approx(0.3), "position": pytest.approx(0.018), "step": 3,
    }  # fmt: skip
    resumed = run(case, tmp_path / "cut", resume=True)
    whole = run(case, tmp_path / "whole")
    same_run(tmp_path / "cut", tmp_path / "whole")
    assert resumed.steps == whole.steps


def test_history_with_missing_rows_is_not_resumed(tmp_path: Path) -> None:
    """The gaps would remain without a message."""
    run(billet("taper_1", "casting.length=60 mm"), tmp_path)
    path, longer = tmp_path / "history.csv", billet("taper_1", "casting.length=75 mm")
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    path.write_text("".join(lines[:2] + lines[4:]))
    with pytest.raises(InputError, match=r"history\.csv: has 3 rows to 1 s, of 5 .* restore the"):
        run(longer, tmp_path, resume=True)
    assert (record(tmp_path)["status"], len(lines)) == ("finished", 6)
    path.write_text(text)
    assert run(longer, tmp_path, resume=True).status == "finished"


def test_ctrl_c_within_petsc_stops_after_the_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An exception raised inside PETSc would be reported as an error of PETSc."""
    case = thermal("casting.length=60 mm", "thermal.time.step=0.1 s")
    residual, calls = ThermalProblem.residual, itertools.count()

    def pressed(self: ThermalProblem, *arguments: Any) -> None:
        if next(calls) == 10:
            signal.raise_signal(signal.SIGINT)
        residual(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(ThermalProblem, "residual", pressed)
        with pytest.raises(KeyboardInterrupt):
            run(case, tmp_path / "cut")
    assert record(tmp_path / "cut")["reason"] == "stopped by the user"
    time = read_history(tmp_path / "cut" / "history.csv")["time"].iloc[-1]
    assert 0.0 < time < 1.0
    assert load_checkpoint(tmp_path / "cut" / "checkpoint.h5")[0]["time"] == pytest.approx(time)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    run(case, tmp_path / "cut", resume=True)
    run(case, tmp_path / "whole")
    same_run(tmp_path / "cut", tmp_path / "whole")


def test_later_signal_stops_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    with Interrupt(MPI.COMM_SELF) as interrupt:
        interrupt.check()
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)  # the same request, received twice
        with pytest.raises(Stopped, match="stopped by the user") as stop:
            interrupt.check()
        assert "resume=True continues" in stop.value.__notes__[0]
        monkeypatch.setattr("castfem.runs.interrupt.ONE", 0.0)
        signal.raise_signal(signal.SIGUSR1)  # a rank may get it twice, seconds apart
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_signal_received_twice_stops_one_run() -> None:
    """From a batch system and through mpirun; the next run of a script is stopped as well."""
    before = signal.getsignal(signal.SIGUSR1)
    try:
        for _ in range(2):
            with Interrupt(MPI.COMM_SELF) as interrupt:
                signal.raise_signal(signal.SIGUSR1)
                with pytest.raises(Stopped, match="SIGUSR1"):
                    interrupt.check()
            signal.raise_signal(signal.SIGUSR1)
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_signals_with_other_handlers_are_left_alone() -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _: seen.append(number))
    try:
        with Interrupt(MPI.COMM_SELF) as interrupt:
            signal.raise_signal(signal.SIGTERM)
            interrupt.check()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert seen == [signal.SIGTERM]


@pytest.mark.parametrize("again", [True, False])
def test_full_disk_is_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: pytest.LogCaptureFixture, again: bool
) -> None:
    """By the error that ends the run; a state not saved for another reason gets a warning."""
    full = OSError(errno.ENOSPC, "No space left on device", "checkpoint.h5")

    def save(recorder: Recorder, state: object) -> None:
        raise full if again else OSError(errno.EIO, "Input/output error", "checkpoint.h5")

    failing(monkeypatch, full, 0.3)
    monkeypatch.setattr(Recorder, "save", save)
    with pytest.raises(OSError, match="No space left"):
        run(thermal("casting.length=60 mm", "thermal.time.step=0.1 s"), tmp_path / "full")
    warned = [line for line in told.messages if "could not be saved" in line]
    assert len(warned) == (0 if again else 1)


SIGNALLED = """
import os, signal, sys
from castfem.cli import main
from castfem.cli.parallel import communicator
from castfem.physics.coupling.subcycling import ThermalSteps
take, comm = ThermalSteps.one, communicator()
def one(self, state, *given):
    if comm.rank == 1 and state.time > 0.45:
        os.kill(os.getpid(), signal.SIGHUP)
    return take(self, state, *given)
ThermalSteps.one = one
main(sys.argv[1:])
"""


@needs_mpirun
def test_signal_to_one_rank_stops_all_after_the_step(tmp_path: Path) -> None:
    """As from a closing terminal: the state is saved, and the resumed run has the same numbers."""
    options = (*COARSE, "casting.length=60 mm", "thermal.time.step=0.1 s")
    words = ["run", str(THERMAL), "-q", *(w for o in options for w in ("--set", o))]
    folder = tmp_path / "cut"
    done = python_on(2, "-c", SIGNALLED, *words, "-o", str(folder), timeout=180.0)
    assert done.returncode == 130, done.stderr
    assert done.stderr.count("castfem: interrupted; `castfem run ... --resume` continues") == 1
    assert record(folder)["reason"].startswith("stopped by SIGHUP")  # which MPI's UCX would swallow
    assert load_checkpoint(folder / "checkpoint.h5")[0]["time"] == pytest.approx(0.6)
    case = load_case(THERMAL, options)
    run(case, folder, resume=True)
    run(case, tmp_path / "whole")
    same_run(folder, tmp_path / "whole")


@needs_mpirun
@pytest.mark.skipif(not (HOME / "env.conf").is_file(), reason="needs the environment of make env")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signal_to_mpirun_saves_the_step(tmp_path: Path, number: signal.Signals) -> None:
    """Its wrapper stops the ranks before mpirun would kill them, a quarter of a second later."""
    options = (*COARSE, "casting.length=600 mm", "thermal.time.step=5 ms")
    words = ["castfem", "run", str(THERMAL), "-q", *(w for o in options for w in ("--set", o))]
    folder = tmp_path / "cut"
    launcher = [str(ROOT / "tools/enter.sh"), str(HOME), "mpirun", "-n", "2"]
    _, environment = started(2, [])
    with subprocess.Popen(
        [*launcher, *words, "-o", str(folder)], env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        end = time.monotonic() + 120.0
        while not rows(folder) > 20:
            assert process.poll() is None and time.monotonic() < end
            time.sleep(0.05)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "castfem: interrupted; `castfem run ... --resume` continues" in err
    found = record(folder)
    assert found["status"] == "interrupted" and "SIGUSR1" in str(found["reason"])
    last = read_history(folder / "history.csv")["time"].iloc[-1]
    assert 0.0 < last < 10.0
    assert load_checkpoint(folder / "checkpoint.h5")[0]["time"] == pytest.approx(last)


# A billet with fed liquid resumes from a checkpoint as if it had never been stopped


CASES = Path(__file__).parents[2] / "cases" / "billet125"
FED_COARSE = (*cells(2, 10, 10), "coupling.interval=0.4 s", "casting.length=240 mm", *SILENT)


@pytest.fixture(scope="module")
def whole_fed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the history of an uninterrupted run."""
    return history_of(
        load_case(CASES / "taper_1.toml", FED_COARSE), tmp_path_factory.mktemp("whole")
    )


@pytest.mark.parametrize("steps", [3, 6])
def test_fed_run_resumes_byte_for_byte(tmp_path: Path, whole_fed: bytes, steps: int) -> None:
    """With the checkpoint before or after another layer of cells begins to freeze."""
    assert history_of(load_case(CASES / "taper_1.toml", FED_COARSE), tmp_path, steps) == whole_fed
