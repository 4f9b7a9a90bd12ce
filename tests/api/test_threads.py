"""Two threads of one process do not run at once; successive runs leave nothing behind."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mpi4py import MPI

import psutil
import pytest
from runs.billet_runs import billet
from small_case import small, write_small

import castfem
from castfem.base.errors import InputError
from castfem.base.process import one_at_a_time
from castfem.model import Case


@contextmanager
def another_thread_at_work() -> Iterator[None]:
    begun, end = threading.Event(), threading.Event()

    def work() -> None:
        with one_at_a_time():
            begun.set()
            end.wait(60.0)

    thread = threading.Thread(target=work)
    thread.start()
    assert begun.wait(60.0)
    try:
        yield
    finally:
        end.set()
        thread.join()


def test_second_thread_is_refused_in_one_line(tmp_path: Path) -> None:
    with another_thread_at_work():
        for run in (
            lambda: castfem.run(small(), tmp_path / "run"),
            lambda: castfem.sensitivities(small(), "casting.superheat"),
        ):
            with pytest.raises(InputError, match="another thread of this process runs a case; run"):
                run()
    assert not (tmp_path / "run").exists()
    assert castfem.run(small(), tmp_path / "run").summary.status == "finished"


def test_runs_in_two_threads(tmp_path: Path) -> None:
    """One of them finishes, and the other may; if not, it is refused, and nothing breaks."""
    case, ends = small({"casting.length": "200 mm"}), dict[int, str]()

    def work(number: int) -> None:
        try:
            ends[number] = castfem.run(case, tmp_path / str(number)).summary.status
        except Exception as error:
            ends[number] = f"{type(error).__name__}: {error}"

    threads = [threading.Thread(target=work, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert "finished" in ends.values()
    refused = [end for end in ends.values() if end != "finished"]
    assert all(end.startswith("InputError: another thread of this process") for end in refused)


def test_run_may_contain_another_of_its_thread() -> None:
    with one_at_a_time(), one_at_a_time():
        pass


MOULDED = (
    "casting.length=30 mm", 'output.fields=["temperature", "stress"]',
    "mould.contact=nitsche", "mould.friction.law=coulomb", "mould.friction.coefficient=0.3",
)  # fmt: skip

needs_handles = pytest.mark.skipif(
    "Open MPI" not in MPI.Get_library_version(), reason="handles mean nothing"
)


def communicators() -> int:
    """Return the number of communicators, by the lowest free handle of Open MPI."""
    own = MPI.COMM_WORLD.Dup()
    handle = own.py2f()
    own.Free()
    return handle


def left_behind(case: Case, changes: list[dict[str, str]], warm: int) -> tuple[int, ...]:
    """Return communicators, open files and memory (bytes) left by runs after the first `warm`."""
    process = psutil.Process()

    def state() -> tuple[int, int, int]:
        gc.collect()
        return communicators(), process.num_fds(), process.memory_info().rss

    before = state()
    for number, change in enumerate(changes):
        if number == warm:
            before = state()
        with castfem.run(case.with_(**change)) as result:
            assert len(result.history) > 2
            result.fields()
        del result
    return tuple(now - then for now, then in zip(state(), before, strict=True))


@needs_handles
def test_runs_leak_nothing(tmp_path: Path) -> None:
    case = castfem.load(write_small(tmp_path)).with_(length="15 mm")
    changes = [{"superheat": f"{20 + number} K"} for number in range(16)]
    ranks, files, memory = left_behind(case, changes, warm=8)
    assert (ranks, files) == (0, 0)
    # The heap may change by a page or two; a mesh in memory would be 0.1 MB a run.
    assert memory < 2e6


@needs_handles
def test_tapers_leak_nothing() -> None:
    """With mechanics, contact and friction; a remaining window would be 0.3 MB."""
    changes = [{"taper": f"{0.5 + 0.1 * number:.1f} %/m"} for number in range(6)]
    ranks, files, memory = left_behind(billet("taper_1", *MOULDED), changes, warm=3)
    assert (ranks, files) == (0, 0)
    assert memory < 1.5e6


# Bare names of keys


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return castfem.load(write_small(tmp_path_factory.mktemp("case")))


def test_bare_and_dotted_keys_are_equivalent(case):
    assert case.with_(speed="3 m/min") == case.with_({"casting.speed": "3 m/min"})
    assert case.with_(wall="100 degC") == case.with_({"cooling.mould.surface.0.wall": "100 degC"})


def test_top_level_has_precedence(case):
    assert case.with_(title="other").title == "other"


def _problem(case, **changes) -> str:
    with pytest.raises(castfem.InputError) as caught:
        case.with_(**changes)
    (line,) = caught.value.problems
    return line


def test_ambiguous_name_lists_the_candidates(case):
    assert _problem(case, name="x") == (
        "with_: name: may stand for steel.name, cooling.mould.name; write one in full"
    )


def test_unknown_name_proposes_the_full_key(case):
    assert _problem(case, sped="3 m/min") == (
        "with_: sped: no table of the case has a key of this name; did you mean casting.speed?"
    )


def test_references_are_no_candidates(case):
    problem = _problem(case, source="x")
    assert "no table" in problem
    assert "reference" not in problem
