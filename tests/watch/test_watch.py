"""`castfem watch`: active, ended and killed runs; as lines, as a picture, as a page."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import pytest
from rich.console import Console
from small_case import STRIP, strip
from synthetic_run import COLUMNS, LENGTH, rows, summary, write_run

from castfem.base.errors import InputError
from castfem.base.progress import Progress
from castfem.cli import execute
from castfem.post.watch.show import Page, Viewing, watch
from castfem.post.watch.status import PATIENCE, RunStatus, SweepWatcher, Watcher, unfinished
from castfem.runs.loop import run
from castfem.runs.output.folder import OutputFolder
from castfem.runs.output.history import History
from castfem.studies.sweep.record import Entry, Record

CASE = strip()


class Clock:
    """Clock that the test moves."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class ActiveRun:
    """A run that takes a step at each wait, and then ends as prescribed."""

    def __init__(self, path: Path, end: str = "finished", steps: int = 4) -> None:
        self.folder, self.end, self.left = OutputFolder(path), end, rows(steps)
        self.folder.begin(STRIP)
        self.history = History(path / "history.csv", COLUMNS)
        self.step()

    def step(self, seconds: float = 0.0) -> None:
        if self.left:
            self.history.append(self.left.pop(0))
            return
        self.history.close()
        if self.end == "finished":
            self.folder.write_summary(summary())
            self.folder.finish()
        elif self.end == "failed":
            self.folder.fail("the shell breaks out at 0.3 m")
        self.folder.close()  # a killed run releases its lock, too


@contextmanager
def lines(width: int = 100, terminal: bool = False) -> Iterator[tuple[Console, Callable[[], str]]]:
    text = io.StringIO()
    yield Console(file=text, width=width, height=30, force_terminal=terminal), text.getvalue


def test_active_run_is_read_from_its_files(tmp_path: Path) -> None:
    folder, seen = tmp_path / "run", list[RunStatus]()
    watcher = Watcher(folder)

    class Watched(Progress):
        def update(self, position: float, *step: object, **more: object) -> None:  # type: ignore[override]
            before = {path: path.stat().st_mtime_ns for path in folder.rglob("[!.]*")}
            seen.append(watcher.status())
            assert before == {path: path.stat().st_mtime_ns for path in folder.rglob("[!.]*")}
            assert seen[-1].position == pytest.approx(position)

    run(CASE, folder, progress=Watched(verbosity=-1, terminal=False))
    assert len(seen) > 3 and {look.state for look in seen} == {"running"}
    assert [look.share for look in seen] == sorted(look.share for look in seen)
    assert seen[-1].share == pytest.approx(1.0) and seen[0].title == CASE.title
    assert any("surface" in quantity.label for quantity in seen[-1].quantities.values())
    assert watcher.status().state == "finished"


def test_remaining_time_is_by_the_pace(tmp_path: Path) -> None:
    """At its present pace a strand reaches its end after remaining length over pace."""
    clock = Clock()
    work = ActiveRun(tmp_path / "run", steps=40)
    watcher = Watcher(tmp_path / "run", clock)
    assert math.isnan(watcher.status().left)
    for _ in range(30):
        clock.now += 2.0
        work.step()
        look = watcher.status()
    passed = rows(40)[30]["position"], rows(40)[0]["position"]
    assert look.position == pytest.approx(passed[0])
    watcher._length = LENGTH  # that of the synthetic rows
    left = watcher.status().left
    assert left == pytest.approx(60.0 * (LENGTH - passed[0]) / (passed[0] - passed[1]), rel=1e-6)
    clock.now += 5.0
    assert watcher.status().left == pytest.approx(left - 5.0)
    work.folder.close()


@pytest.mark.parametrize(
    ("end", "well", "message"),
    [
        ("finished", True, "castfem show"),
        ("failed", False, "the shell breaks out at 0.3 m"),
        ("killed", False, r"killed or aborted.*castfem run --resume"),
    ],
)
def test_watching_ends_with_the_run_and_its_reason(
    tmp_path: Path, end: str, well: bool, message: str
) -> None:
    folder, target, pages = tmp_path / "run", tmp_path / "page.html", list[str]()
    work = ActiveRun(folder, end)

    def sleep(seconds: float) -> None:
        pages.append(target.read_text(encoding="utf-8"))
        work.step()

    with lines() as (console, text):
        seen = Viewing(console, 0.5, Page(folder, target, 1e-9), sleep=sleep)
        assert watch(folder, seen) is well
    printed = text().splitlines()
    assert len(printed) == len(pages) + 2  # a line for each look, the end, and the reason
    assert re.search(message, printed[-1]) and printed[-2].startswith(f"run:  {end}")
    assert "shell" in printed[1] and "surface" in printed[1]
    assert all('http-equiv="refresh"' in page for page in pages)
    last = target.read_text(encoding="utf-8")
    assert 'http-equiv="refresh"' not in last
    for page in (*pages, last):
        ElementTree.fromstring(page.replace("<!DOCTYPE html>", ""))
    assert end in last and ('id="work"' in last) is not well


def test_picture_of_a_run(tmp_path: Path) -> None:
    write_run(tmp_path / "run", finish=False)
    log = "2026-11-22 18:52:19,497 WARNING the steps are short\n"
    (tmp_path / "run" / "run.log").write_text(log)
    with lines(terminal=True) as (console, text):
        assert not watch(tmp_path / "run", Viewing(console, 1.0))
    for part in ("killed", "shell, mid-face", "surface, corner", "warning: the steps are short"):
        assert part in text()


def test_lock_of_a_killed_run_is_left_free(tmp_path: Path) -> None:
    folder, tried = write_run(tmp_path / "run", finish=False), list[bool]()
    watcher = Watcher(folder)
    assert watcher.status().state == "killed"
    original = OutputFolder.is_running
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(OutputFolder, "is_running", lambda it: tried.append(original(it)))
        assert watcher.status().state == "killed" and not tried
    with OutputFolder(folder) as again:
        again.begin(STRIP)
        assert watcher.status().state == "running" and watcher.status().state == "running"


def test_sweep_has_a_line_for_each_run(tmp_path: Path) -> None:
    clock = Clock()
    record = Record(tmp_path)
    record.entries = {
        "slow": Entry({"casting.speed": "1 m/min"}, physics="x", seconds=8.0),
        "fast": Entry({"casting.speed": "3 m/min"}, message="it breaks out"),
        "middle": Entry({"casting.speed": "2 m/min"}),
        "later": Entry({"casting.speed": "4 m/min"}),
    }
    record.save()
    write_run(tmp_path / "slow")
    work = ActiveRun(tmp_path / "middle", steps=2)
    watcher = SweepWatcher(tmp_path, clock)
    found = watcher.status()
    states = {row.name: row.status.state for row in found.rows}
    assert states == {
        "slow": "finished", "fast": "failed", "middle": "running", "later": "waiting",
    }  # fmt: skip
    assert found.left == pytest.approx(16.0) and not found.ended  # two of 8 s, one at a time
    with lines(terminal=True) as (console, text), pytest.raises(KeyboardInterrupt):
        watch(tmp_path, Viewing(console, 1.0, sleep=_stop))
    assert "speed 3 m/min" in text() and "4 runs: 1 finished, 1 running, 1 waiting" in text()
    clock.now = PATIENCE + 1.0
    assert not watcher.status().ended
    while not work.folder.record.ended:
        work.step()
    assert watcher.status().count("finished") == 2
    clock.now *= 2.0
    last = watcher.status()
    assert last.ended and not last.complete
    reasons = "\n".join(unfinished(last))
    assert "1 waiting: later" in reasons and "no run has been running for 1:01" in reasons
    assert "--wait" in reasons and "fast: failed: it breaks out" in reasons
    assert not SweepWatcher(tmp_path, clock, math.inf).status().ended
    target = tmp_path / "page.html"
    Page(tmp_path, target, 1.0, clock).write_sweep(last)
    root = ElementTree.fromstring(target.read_text().replace("<!DOCTYPE html>", ""))
    html = "{http://www.w3.org/1999/xhtml}"
    (head,) = (part for part in root.iter(f"{html}section") if part.get("id") == "work")
    assert len(list(head.iter(f"{html}tr"))) == 4
    assert len(list(head.iter(f"{html}progress"))) == 1  # the length is known of one case only


def _stop(_: float) -> None:
    raise KeyboardInterrupt


def test_folder_without_a_run_is_reported_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    for folder, message in (
        (tmp_path, "holds no run of castfem; --wait waits for one to begin"),
        (tmp_path / "none", "no such folder; --wait waits for one to begin"),
        (tmp_path / "file", "is not a folder"),
    ):
        assert execute(["watch", str(folder)]) == 1
        assert capsys.readouterr().err == f"castfem: {folder}: {message}\n"
        with pytest.raises(InputError):
            Watcher(folder).status()
    write_run(tmp_path / "run")
    for every in ("5 mm", "0 s", "soon"):
        assert execute(["watch", str(tmp_path / "run"), "--every", every]) == 1
        assert f"--every {every}: " in capsys.readouterr().err


def test_future_run_is_waited_for(tmp_path: Path) -> None:
    """It begins, is killed, is resumed and ends, all in one call with --wait."""
    folder, target, pages = tmp_path / "run", tmp_path / "page.html", list[str]()

    def happens() -> Iterator[None]:
        for end in ("killed", "finished"):
            work = ActiveRun(folder, end, steps=1)
            yield
            for _ in range(3):  # two rows, and its end
                pages.append(target.read_text(encoding="utf-8"))
                work.step()
                yield

    events = happens()
    with lines() as (console, text):
        page = Page(folder, target, 1e-9, wait=True)
        viewing = Viewing(console, 0.5, page, wait=True, sleep=lambda _: next(events))
        assert watch(folder, viewing)
    printed = text().splitlines()
    assert printed[0].startswith(f"{folder}: no run has begun")
    (stopped,) = (one for one in printed if "waiting for it to be resumed" in one)
    assert "killed or aborted" in stopped and printed[-1].startswith("finished")
    assert printed.index(stopped) < len(printed) - 2
    assert all('http-equiv="refresh"' in one for one in pages)
    assert 'http-equiv="refresh"' not in target.read_text(encoding="utf-8")


def test_future_sweep_is_waited_for(tmp_path: Path) -> None:
    folder = tmp_path / "sweep"

    def sleep(seconds: float) -> None:
        record = Record(folder)
        record.entries = {"slow": Entry({"casting.speed": "1 m/min"}, physics="x", seconds=8.0)}
        write_run(folder / "slow")
        record.save()

    with lines() as (console, text):
        assert watch(folder, Viewing(console, 0.5, wait=True, sleep=sleep))
    assert text().splitlines()[-1] == "sweep: 1 runs: 1 finished, 0 running, 0 waiting"


@pytest.mark.parametrize("by", ["case", "option"])
def test_chosen_units_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], by: str
) -> None:
    folder, page = write_run(tmp_path / "run"), tmp_path / "page.html"
    if by == "case":
        with (folder / "case.toml").open("a", encoding="utf-8") as case:
            case.write('[output]\nunits = "si"\n')
    more = ["--units", "length=inch", "--units", "temperature=degF"] if by == "option" else []
    assert execute(["watch", str(folder), "--html", str(page), *more]) == 0
    (line,) = (one for one in capsys.readouterr().out.splitlines() if one.startswith("run:"))
    found = re.search(r"shell (\S+) (\S+)  surface (\S+) (\S+)", line)
    last = rows(40)[-1]
    shell, surface = last["shell_mid_face"], last["surface_temperature_mid_face"]
    wanted = (1e-3 * shell, "m", surface + 273.15, "K")
    if by == "option":
        wanted = (shell / 25.4, "inch", 1.8 * surface + 32.0, "°F")
    assert (found[2], found[4]) == wanted[1::2] and f"{found[3]} {found[4]}" in page.read_text()
    assert (float(found[1]), float(found[3])) == pytest.approx(wanted[::2], rel=1e-3)


def test_command_ends_with_the_status_of_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    write_run(tmp_path / "run")
    assert execute(["watch", str(tmp_path / "run"), "--html", str(page)]) == 0
    assert page.is_file() and "finished" in capsys.readouterr().out
    write_run(tmp_path / "dead", finish=False)
    assert execute(["watch", str(tmp_path / "dead")]) == 2


def test_pages_take_a_tenth_of_the_time(tmp_path: Path) -> None:
    clock, folder = Clock(), tmp_path / "run"
    work, watcher = ActiveRun(folder), Watcher(folder, clock)
    page = Page(folder, tmp_path / "page.html", 1.0, clock)
    page._write = lambda *_: None  # type: ignore[method-assign]
    page._next, clock.now = 5.0, 4.0
    page.write_run(watcher.status())
    assert not page.target.exists()
    del page._write
    clock.now = 6.0
    page.write_run(watcher.status())
    assert page.target.is_file() and page._next == pytest.approx(7.0)
    work.folder.close()
