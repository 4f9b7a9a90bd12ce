"""`castfem run` with an engine that only records its calls."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from castfem.base.errors import CaseError, InputError, RunFailure


def test_run_passes_the_case_on(castfem, engine, case_file):
    outcome = castfem("run", case_file, "--set", "casting.speed=3 m/min", "-o", "out", "--profile")
    assert outcome.status == 0, outcome.err
    (call,) = engine.calls
    assert call.case.casting.speed == pytest.approx(0.05)
    assert (call.folder, call.comm, call.resume, call.profile) == (Path("out"), None, False, True)
    assert call.progress is not None
    assert outcome.out == "table of out, figures True\nresults in out\n"


NEW = {"run": ("-o", "other"), "check": ()}


@pytest.mark.parametrize("words", [("run", "-q"), ("check",)])
def test_unlikely_value_gives_a_warning(castfem, engine, case_file, words):
    outcome = castfem(*words, case_file, "--set", "casting.speed=360 m/min")
    assert outcome.status == 0
    (line,) = outcome.err.splitlines()
    assert line.startswith("castfem: warning: --set: casting.speed: ")
    assert castfem(*words, case_file, "--set", "casting.speed=6 m/min", *NEW[words[0]]).err == ""


def test_figures_are_left_out_by_the_case(castfem, engine, case_file):
    outcome = castfem("run", case_file, "-o", "out", "--set", "output.figures=false")
    assert "table of out, figures False" in outcome.out


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("billet125/thermal", "results/billet125/thermal"),
        ("mine/billet.toml", "results/mine/billet"),
        ("mine/billet", "results/mine/billet"),
        ("here.toml", "results/here"),
    ],
)
def test_default_folder(castfem, engine, case_file, name, folder):
    Path("here.toml").write_text(case_file.read_text())
    assert castfem("run", name).status == 0
    assert engine.calls[0].folder == Path(folder)


def test_quiet_prints_nothing(castfem, engine, case_file):
    outcome = castfem("run", case_file, "-q")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")


def test_same_physics_may_run_again(castfem, engine, case_file):
    assert castfem("run", case_file, "-o", "out").status == 0
    words = ("run", case_file, "-o", "out", "--set", "output.every=1 s")
    assert castfem(*words).status == 0
    assert len(engine.calls) == 2


def test_other_physics_is_refused(castfem, engine, case_file):
    assert castfem("run", case_file, "-o", "out").status == 0
    other = ("run", case_file, "-o", "out", "--set", "casting.speed=3 m/min")
    outcome = castfem(*other)
    assert outcome.status == 1
    assert "casting.speed: 3.6 m/min there, 3 m/min here" in outcome.err
    assert "--overwrite" in outcome.err
    assert castfem(*other, "--overwrite").status == 0


def test_resume(castfem, engine, case_file):
    assert castfem("run", case_file, "-o", "new", "--resume").status == 0  # killed at once
    assert castfem("run", case_file, "-o", "out").status == 0
    further = castfem("run", case_file, "-o", "out", "--resume", "--set", "casting.length=2 m")
    assert further.status == 0, further.err
    assert engine.calls[-1].resume
    other = castfem("run", case_file, "-o", "out", "--resume", "--set", "mesh.order=2")
    assert other.status == 1
    assert "mesh.order: 1 there, 2 here" in other.err


def _record_reached(folder: Path, position: float, status: str) -> None:
    """Record in a folder the position its run has reached, m."""
    record = {"format": "castfem run", "status": status, "reached": {"position": position}}
    (folder / "run.json").write_text(json.dumps(record))


def test_run_that_reached_further_is_not_replaced(castfem, engine, case_file):
    words = ("run", case_file, "-o", "out")
    assert castfem(*words).status == 0
    _record_reached(Path("out"), 0.6, "finished")
    shorter = castfem(*words, "--set", "casting.length=50 mm")
    assert (shorter.status, len(engine.calls)) == (1, 1)
    assert shorter.err == (
        "castfem: out: casting.length: 0.05 m is requested, but the run there has reached 0.6 m; "
        "choose another folder with -o, or --overwrite it\n"
    )
    resumed = castfem(*words, "--set", "casting.length=50 mm", "--resume")
    assert (resumed.status, len(engine.calls)) == (1, 1)
    assert "give at least 0.6 m" in resumed.err
    assert castfem(*words).status == 0
    assert castfem(*words, "--set", "casting.length=50 mm", "--overwrite").status == 0


def test_unfinished_run_is_replaced_with_a_warning(castfem, engine, case_file):
    words = ("run", case_file, "-o", "out")
    assert castfem(*words).err == ""
    _record_reached(Path("out"), 0.1, "interrupted")
    outcome = castfem(*words)
    assert outcome.status == 0
    assert "had reached 0.1 m" in outcome.err and "--resume" in outcome.err
    _record_reached(Path("out"), 0.1, "interrupted")
    assert castfem(*words, "--resume").err == ""


def test_folder_of_a_run_represents_its_case(castfem, engine, case_file):
    assert castfem("run", case_file, "-o", "out/mine").status == 0
    _record_reached(Path("out/mine"), 0.1, "interrupted")
    for named in ("out/mine", "out/mine/case.toml"):
        resumed = castfem("run", "--resume", named)
        assert resumed.status == 0, resumed.err
        assert (engine.calls[-1].folder, engine.calls[-1].resume) == (Path("out/mine"), True)
    again = castfem("run", "out/mine")
    assert (again.status, len(engine.calls)) == (1, 3)
    assert "castfem run --resume out/mine" in again.err and "-o FOLDER" in again.err
    assert castfem("run", "out/mine", "-o", "again").status == 0
    assert engine.calls[-1].folder == Path("again")
    assert castfem("check", "out/mine").status == 0
    empty = castfem("run", "--resume", "out")
    assert empty.status == 1
    assert "out: is not the folder of a run" in empty.err


def test_file_in_place_of_the_folder_is_refused(castfem, engine, case_file):
    Path("out").write_text("mine")
    outcome = castfem("run", case_file, "-o", "out")
    assert outcome.status == 1
    assert "is a file" in outcome.err


def test_case_of_another_version(castfem, engine, case_file):
    Path("out").mkdir()
    Path("out/case.toml").write_text("title = 1\n")
    outcome = castfem("run", case_file, "-o", "out")
    assert outcome.status == 1
    assert "not a case of this version" in outcome.err
    assert Path("out/case.toml").read_text() == "title = 1\n"


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (InputError("out: in the way"), 1, "castfem: out: in the way\n"),
        (CaseError("mesh: inverted"), 1, "mine/billet.toml: mesh: inverted\n"),
        (RunFailure("t = 1 s: step too small"), 2, "castfem: t = 1 s: step too small\n"),
        (ZeroDivisionError("oh"), 2, "unexpected ZeroDivisionError: oh"),
        (KeyboardInterrupt(), 130, "--resume"),
    ],
)
def test_exit_status(castfem, engine, case_file, error, status, message):
    engine.raises = error
    outcome = castfem("run", case_file)
    assert outcome.status == status
    assert message in outcome.err
    assert "Traceback" not in outcome.err


def test_verbose_shows_the_traceback_of_a_fault(castfem, engine, case_file):
    engine.raises = ZeroDivisionError("oh")
    assert "(repeat with -v" in castfem("run", case_file).err
    assert "Traceback" in castfem("run", case_file, "-v").err
    engine.raises = RunFailure("step too small")
    assert "Traceback" not in castfem("run", case_file, "-v").err
