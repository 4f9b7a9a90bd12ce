"""`castfem sweep`: parallel runs, one table, failures of one run; commands that are stopped."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from ranks import needs_mpirun, python_on
from small_case import SMALL, write_small

from castfem.model import load_case
from castfem.runs.output.run_record import RunRecord
from castfem.studies.sweep.plan import plan
from castfem.studies.sweep.record import Record, rows
from castfem.studies.sweep.work import Job
from castfem.studies.sweep.workers import Workers

pytestmark = pytest.mark.slow

SPEEDS = ("--set", "speed=3 m/min,4 m/min")
NEVER = 'thermal.solver={},{ pc_type = "nosuch" }'  # refused only by PETSc


def _table(folder: Path) -> list[dict[str, str]]:
    with (folder / "sweep.csv").open() as file:
        return list(csv.DictReader(file))


def test_sweep(castfem, tmp_path):
    write_small(tmp_path)
    outcome = castfem(
        "sweep", "small", *SPEEDS, "--set", "superheat=20 K,40 K", "-j", 2, "-o", "out"
    )
    assert outcome.status == 0, outcome.err
    rows = _table(Path("out"))
    assert [(r["casting.speed [m/min]"], r["casting.superheat [K]"]) for r in rows] == [
        ("3", "20"), ("3", "40"), ("4", "20"), ("4", "40"),
    ]  # fmt: skip
    assert {row["status"] for row in rows} == {"finished"}
    for row in rows:
        summary = json.loads((Path("out") / row["run"] / "summary.json").read_text())
        shown = summary["quantities"]["surface_temperature_mid_face"]["value"]
        assert float(row["surface_temperature_mid_face [degC]"]) == pytest.approx(shown)
    hot = [float(row["surface_temperature_mid_face [degC]"]) for row in rows]
    assert hot[0] < hot[1] < hot[3]
    assert hot[2] < hot[3]
    assert "superheat" in outcome.out
    assert "table in out/sweep.csv" in outcome.out
    assert "(4 of 4)" in outcome.err
    shown = castfem("show", "out")
    assert shown.status == 1
    assert "castfem compare out" in shown.err


@pytest.mark.usefixtures("runs_here")
def test_finished_runs_are_not_run_again(castfem, tmp_path):
    write_small(tmp_path)
    words = ("sweep", "small", "-j", 1, "-o", "out", "--set")
    assert castfem(*words, "speed=3 m/min").status == 0
    record = Path("out/speed_3_m_min/run.json")
    before = record.read_text()
    two = (*words, "speed=3 m/min,4 m/min")
    more = castfem(*two)
    assert more.status == 0
    assert "1 of 2 runs" in more.err
    assert record.read_text() == before
    assert [row["status"] for row in _table(Path("out"))] == ["finished", "finished"]
    other = castfem(*two, "--set", "order=2")
    assert other.status == 1
    assert "mesh.order: 1 there, 2 here" in other.err
    shorter = castfem(*two, "--set", "length=30 mm")
    assert shorter.status == 1
    assert "0.03 m is requested" in shorter.err
    assert castfem(*two, "--set", "length=30 mm", "--overwrite").status == 0
    assert [row["position [m]"] for row in _table(Path("out"))] == ["0.03", "0.03"]


def test_foreign_table_is_not_overwritten(castfem, tmp_path):
    write_small(tmp_path)
    (tmp_path / "out").mkdir()
    mine = tmp_path / "out" / "sweep.csv"
    mine.write_text("mine")
    refused = castfem("sweep", "small", *SPEEDS, "-j", 1, "-o", "out")
    assert refused.status == 1
    assert refused.err == (
        "castfem: out: sweep.csv was not written by castfem and would be overwritten; "
        "choose another folder, or move the file\n"
    )
    assert mine.read_text() == "mine" and len(list(mine.parent.iterdir())) == 1


@pytest.mark.usefixtures("runs_here")
def test_results_of_another_case_are_not_used(castfem, tmp_path):
    """--overwrite with a changed case, stopped before the end of its first run."""
    path = write_small(tmp_path)
    assert castfem("sweep", "small", *SPEEDS, "-j", 1, "-o", "out").status == 0
    base, values = load_case(path), [SPEEDS[1]]
    for length, status in (("60 mm", "finished"), ("50 mm", "waiting")):
        variants = plan(base.with_(length=length), values)
        record = Record(Path("out"))
        record.expect(variants)
        table = rows([one.name for one in variants], record)
        assert [row.status for row in table] == [status] * 2
        assert [bool(row.quantities) for row in table] == [status == "finished"] * 2


def test_one_failed_run_does_not_stop_the_rest(castfem, tmp_path):
    write_small(tmp_path)
    outcome = castfem("sweep", "small", "--set", NEVER, *SPEEDS, "-j", 1, "-o", "out")
    assert outcome.status == 2, outcome.err
    assert "castfem: 2 of 4 runs failed" in outcome.err
    rows = _table(Path("out"))
    assert sorted(row["status"] for row in rows) == ["failed", "failed", "finished", "finished"]
    failed = next(row for row in rows if row["status"] == "failed")
    assert failed["message"]
    assert failed["shell_mid_face [mm]"] == ""
    assert failed["message"] in (Path("out") / failed["run"] / "run.log").read_text()
    again = castfem("sweep", "small", "--set", NEVER, *SPEEDS, "-j", 1, "-o", "out", "-q")
    assert again.status == 2
    assert again.out == ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "speed=3 m/min,3"), "a speed needs its unit"),
        (("--set", "speed=3 m/min,4 m/min", "--set", "steel.name=nosuch"), "nosuch"),
        ((), "nothing to sweep"),
        (("--table", "nosuch.csv"), "nosuch.csv: file not found; correct the path"),
        ((*SPEEDS, "-j", "0"), "at least one process"),
        ((*SPEEDS, "--resume", "--overwrite"), "exclude each other"),
        ((*SPEEDS, "-o", "small.toml"), "is a file"),
        ((*SPEEDS, "-o", "lone"), "lone: holds a single run"),
        ((*SPEEDS, "--at", "9 m"), "--at 9 m: "),
    ],
)
def test_bad_input_runs_nothing(refused, words, message):
    assert message in refused("sweep", "small", *words)


def test_killed_process_loses_only_its_run(tmp_path):
    """The first process is killed after a step; another one does the remaining runs."""
    import castfem

    base = castfem.load(write_small(tmp_path)).with_(step="1 ms", length="200 mm")
    variants = plan(base, ["speed=3 m/min", "superheat=20 K,30 K"])
    short = variants[1].case.with_(length="10 mm")
    jobs = [
        Job("first", tmp_path / "first", variants[0].case),
        Job("second", tmp_path / "second", short),
    ]
    ended, seen = {}, set()

    def tick():
        if ended or not (tmp_path / "first" / "history.csv").is_file():
            return
        for child in psutil.Process().children():
            if child.pid in seen:  # since the last tick: it has received its run
                child.kill()
            elif "spawn_main" in " ".join(child.cmdline()):
                seen.add(child.pid)

    def note(job, outcome):
        ended[job.name] = outcome

    with Workers(tmp_path / "noise", processes=1) as workers:
        workers.run(jobs, ended=note, tick=tick)
    assert "SIGKILL" in ended["first"].message
    assert not ended["second"].failed
    assert (tmp_path / "second" / "summary.json").is_file()


def _wait_for(path: Path, lines: int) -> None:
    for _ in range(300):
        if path.is_file() and path.read_text().count("\n") > lines:
            return
        time.sleep(0.1)
    raise AssertionError(f"{path} has not grown")


def test_interrupted_sweep_resumes(tmp_path):
    """Each of three signals in turn, to the command and to those that resume it."""
    write_small(tmp_path)
    words = ("sweep", "small", *SPEEDS, "-j", "2", "-o", "out", "--set", "length=60 mm")
    words = (*words, "--set", "thermal.time.step=1 ms")
    command = started = [sys.executable, "-m", "castfem.cli", *words]
    histories = [tmp_path / "out" / f"speed_{speed}_m_min" / "history.csv" for speed in (3, 4)]
    lines = [0, 0]
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        process = subprocess.Popen(
            command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        for history, before in zip(histories, lines, strict=True):
            _wait_for(history, before + 30)
        children = psutil.Process(process.pid).children(recursive=True)
        assert len(children) >= 2
        os.killpg(process.pid, number)
        _, err = process.communicate(timeout=30)
        assert process.returncode == 130
        assert err.strip().endswith("castfem: interrupted; the same command continues")
        assert "replaced" not in err
        _, alive = psutil.wait_procs(children, timeout=5)
        assert not alive
        for history in histories:
            record = json.loads((history.parent / "run.json").read_text())
            assert record["reason"] == "stopped with the command that had started it"
            assert "no checkpoint" not in (history.parent / "run.log").read_text()
        lines = [history.read_text().count("\n") for history in histories]
        command = [*started, "--resume"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "replaced" not in done.stderr
    for history in histories:
        record = json.loads((history.parent / "run.json").read_text())
        assert (record["status"], record["resumed"]) == ("finished", 3)


@needs_mpirun
def test_over_ranks(tmp_path):
    write_small(tmp_path)
    words = ("-m", "castfem.cli", "sweep", "small", *SPEEDS, "--set", NEVER, "-o", "out")
    done = python_on(3, *words, folder=tmp_path, timeout=120.0)
    assert done.returncode == 2, done.stderr
    output = done.stdout + done.stderr  # a busy launcher mixes up the streams of a rank
    assert output.count("table in out/sweep.csv") == 1
    assert output.count("castfem: 2 of 4 runs failed") == 1
    rows = _table(tmp_path / "out")
    assert sorted(row["status"] for row in rows) == ["failed", "failed", "finished", "finished"]
    for row in rows:
        assert json.loads((tmp_path / "out" / row["run"] / "run.json").read_text())["ranks"] == 1


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
def test_signal_ends_the_command_with_a_message(
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
def test_continued_error_command_reports_no_replaced_run(castfem, tmp_path: Path) -> None:
    """It continues interrupted runs itself: it has no --resume."""
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
