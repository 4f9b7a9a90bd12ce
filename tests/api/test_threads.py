"""Two threads of one process do not run at once; one after the other they do."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.base.process import one_at_a_time


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


def test_a_second_thread_is_refused_in_one_line(tmp_path: Path) -> None:
    with another_thread_at_work():
        for run in (
            lambda: castfem.run(small(), tmp_path / "run"),
            lambda: castfem.sensitivities(small(), "casting.superheat"),
        ):
            with pytest.raises(InputError, match="another thread of this process runs a case; run"):
                run()
    assert not (tmp_path / "run").exists()
    assert castfem.run(small(), tmp_path / "run").summary.status == "finished"


def test_real_runs_in_two_threads(tmp_path: Path) -> None:
    """One of them finishes, and so may the other; what does not is refused, and nothing breaks."""
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


def test_a_run_may_hold_another_of_its_own_thread() -> None:
    with one_at_a_time(), one_at_a_time():
        pass
