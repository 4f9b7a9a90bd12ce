"""Runs by any executor: the same results, lost runs repeated, messages of failed ones."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from pathlib import Path
from typing import Any, ClassVar

import pytest
from ranks import needs_mpirun, python_on
from small_case import small, write_small

import castfem
from castfem.base.errors import InputError
from castfem.studies.optimisation import Evaluator
from castfem.studies.sweep.work import Job, Outcome
from castfem.studies.sweep.workers import Workers

SPEEDS = {"casting.speed": ["3 m/min", "4 m/min"]}
SHORT = {"casting.length": "6 mm"}
# Colder than the data of the steel: the run ends early.
STOPS = {"cooling.mould.surface": [{"law": "flux", "value": "400 MW/m^2"}]}


class Fake(Executor):
    """Executor that answers each call at once, by a function of its number and its job."""

    def __init__(self, answer: Callable[[int, Job], Outcome]) -> None:
        self.calls: list[Job] = []
        self._answer = answer

    def submit(self, function: Any, /, *args: Any, **keywords: Any) -> Future[Any]:
        call: Future[Any] = Future()
        self.calls.append(args[0])
        try:
            call.set_result(self._answer(len(self.calls), args[0]))
        except Exception as error:
            call.set_exception(error)
        return call


class Call:
    """Call that is made when its result is requested."""

    def __init__(self, call: Callable[[], object]) -> None:
        self._call, self._looks = call, 0

    def done(self) -> bool:
        self._looks += 1
        return self._looks > 2

    def result(self) -> object:
        return self._call()

    def cancel(self) -> None: ...


class Batch:
    """Executor like that of submitit: neither it nor its calls are of concurrent.futures."""

    def submit(self, function: Any, /, *args: Any) -> Call:
        return Call(lambda: function(*args))


def run_jobs(jobs: list[Job], executor: Any, folder: Path) -> tuple[list[str], dict[str, Outcome]]:
    begun: list[str] = []
    ended: dict[str, Outcome] = {}
    with Workers(folder / "noise", executor=executor) as workers:
        workers.run(
            jobs, lambda job: begun.append(job.name), lambda j, o: ended.update({j.name: o})
        )
    return begun, ended


def jobs(folder: Path, *names: str) -> list[Job]:
    case = small(SHORT)
    return [Job(name, folder / name, case) for name in names]


def test_all_executors_give_the_same_table(tmp_path, monkeypatch):
    """A relative folder is that of this process; a thread waits for the run of another one."""
    monkeypatch.chdir(tmp_path)
    reference = castfem.sweep(small(SHORT), SPEEDS, "alone")
    assert list(reference["casting.speed"]) == ["3 m/min", "4 m/min"]
    assert list(reference["status"]) == ["finished"] * 2
    assert reference["heat_removed"].iloc[0] > reference["heat_removed"].iloc[1] > 0.0
    same = [name for name in reference if name != "seconds"]
    context = multiprocessing.get_context("spawn")
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2, context) as processes:
        for name, executor in (("t", threads), ("p", processes), ("b", Batch())):
            found = castfem.sweep(small(SHORT), SPEEDS, name, executor=executor)
            assert found[same].equals(reference[same]), name
    own = castfem.sweep(small(SHORT), SPEEDS, "own", processes=2)
    assert own[same].equals(reference[same])
    again = castfem.sweep(small(SHORT), SPEEDS, "own", executor=Fake(lambda n, job: Outcome("no")))
    assert again.equals(own)  # nothing is run
    # Nor if the sweep was killed before it recorded the finished runs.
    (tmp_path / "own" / "sweep.json").write_text('{"format": "castfem sweep", "runs": {}}')
    noted = castfem.sweep(small(SHORT), SPEEDS, "own", executor=Fake(lambda n, job: Outcome("no")))
    assert noted[same].equals(reference[same])


@needs_mpirun
def test_sweep_on_the_ranks_of_a_launcher(tmp_path):
    """With the executor of mpi4py; without one the message contains the fix."""
    write_small(tmp_path)
    (tmp_path / "script.py").write_text(
        "import castfem\nfrom mpi4py import MPI\n"
        "from mpi4py.futures import MPICommExecutor\n"
        "case = castfem.load('small').with_(length='6 mm')\n"
        f"values = {SPEEDS!r}\n"
        "with MPICommExecutor(MPI.COMM_WORLD, root=0) as executor:\n"
        "    if executor is not None:\n"
        "        print(list(castfem.sweep(case, values, 'out', executor=executor).heat_removed))\n"
        "        try:\n            castfem.sweep(case, values, 'out')\n"
        "        except castfem.InputError as error:\n            print(error)\n"
    )
    done = python_on(3, "script.py", folder=tmp_path, timeout=240.0)
    assert done.returncode == 0, done.stderr
    reference = castfem.sweep(small(SHORT), SPEEDS, tmp_path / "alone")
    assert done.stdout.splitlines() == [
        str(list(reference["heat_removed"])),
        "sweep: runs on one rank; under mpirun use castfem sweep",
    ]


def test_lost_run_is_submitted_again(tmp_path):
    """It is resumed from its checkpoint; after two further losses it counts as failed."""

    def answer(number: int, job: Job) -> Outcome:
        if job.name == "worst" or number == 1:
            raise MemoryError("the node is gone\nlong traceback")
        return Outcome()

    executor = Fake(answer)
    begun, ended = run_jobs(jobs(tmp_path, "one", "two", "worst"), executor, tmp_path)
    assert begun == ["one", "two", "worst"]
    assert ended["one"] == ended["two"] == Outcome()
    assert ended["worst"] == Outcome("MemoryError: the node is gone", obstacle="process")
    assert sorted((job.name, job.resume) for job in executor.calls) == [
        ("one", False), ("one", True), ("two", False),
        ("worst", False), ("worst", True), ("worst", True),
    ]  # fmt: skip


def test_broken_executor_leaves_no_run_waiting(tmp_path):
    class Broken(Fake):
        def submit(self, function: Any, /, *args: Any, **keywords: Any) -> Future[Any]:
            if len(self.calls) == 2:
                raise BrokenExecutor("no further calls")
            return super().submit(function, *args, **keywords)

    def answer(number: int, job: Job) -> Outcome:
        raise BrokenExecutor("a process was terminated abruptly")

    _, ended = run_jobs(jobs(tmp_path, "one", "two"), Broken(answer), tmp_path)
    assert {o.message for o in ended.values()} == {
        "BrokenExecutor: a process was terminated abruptly"
    }


def test_own_error_cancels_pending_runs(tmp_path):
    class Slow(Executor):
        calls: ClassVar[list[Future[Any]]] = []

        def submit(self, function: Any, /, *args: Any, **keywords: Any) -> Future[Any]:
            call: Future[Any] = Future()
            if not self.calls:
                call.set_result(Outcome())
            self.calls.append(call)
            return call

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    with Workers(tmp_path / "noise", executor=Slow()) as workers, pytest.raises(KeyboardInterrupt):
        workers.run(jobs(tmp_path, "one", "two"), ended=stopped)
    assert [call.cancelled() for call in Slow.calls] == [False, True]


def test_evaluator_runs_by_an_executor(tmp_path):
    """A failed run is a result; a lost one is none, and is not kept."""
    with ThreadPoolExecutor(1) as threads:
        evaluate = Evaluator(small(SHORT), tmp_path / "runs", executor=threads)
        good, failed = evaluate.many([{}, STOPS])
    reference = Evaluator(small(SHORT), tmp_path / "alone")
    assert good.quantities == reference().quantities
    assert failed.failed and failed.message == reference(STOPS).message

    def answer(number: int, job: Job) -> Outcome:
        raise MemoryError("the node is gone")

    lost = Evaluator(small(SHORT), tmp_path / "lost", executor=Fake(answer))
    with pytest.raises(castfem.RunFailure, match="the node is gone; the same command continues"):
        lost()
    assert Evaluator(small(SHORT), tmp_path / "lost")().quantities == good.quantities


def test_invalid_values_are_refused(tmp_path):
    for values, message in (
        (None, "nothing to sweep"),
        ({"casting.speed": "3 m/min"}, "keys with lists of values"),
        ({"casting.sped": ["3 m/min"]}, "casting.sped"),
        ({"casting.speed": ["3 m/min", "-1 m/min"]}, "casting.speed"),
    ):
        with pytest.raises(InputError, match=message):
            castfem.sweep(small(SHORT), values, tmp_path / "out")
        assert not (tmp_path / "out").exists()
