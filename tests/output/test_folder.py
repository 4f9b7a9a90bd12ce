"""The folder of a run: which files are changed, who may write, contents of run.json."""

from __future__ import annotations

import dataclasses
import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from synthetic_run import summary, write_run

from castfem.base import atomic_files
from castfem.base.errors import InputError, RunFailure
from castfem.runs.output import folder as folder_module
from castfem.runs.output.checkpoint import save_checkpoint
from castfem.runs.output.folder import OutputFolder
from castfem.runs.output.run_record import RunRecord

CASE = 'title = "a case"\n'


def begun(path: Path, **options: object) -> OutputFolder:
    folder = OutputFolder(path)
    folder.begin(CASE, **options)
    return folder


def test_new_folder_has_the_case_and_a_running_record(tmp_path):
    folder = begun(tmp_path / "deep" / "run", ranks=3)
    assert (folder / "case.toml").read_text() == CASE
    record = RunRecord.load(folder.path)
    assert (record.status, record.ranks, record.resumed) == ("running", 3, 0)
    assert record.versions["numpy"] == np.__version__
    assert record.started.endswith("+00:00")
    folder.close()


def test_run_json_is_plain_json_without_host_or_path(tmp_path):
    folder = begun(tmp_path / "run")
    folder.finish(wall_time={"time loop": np.float64(1.5), "mesh": np.nan}, memory_mb=float("inf"))
    folder.close()
    text = (tmp_path / "run" / "run.json").read_text()
    content = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert content["wall_time"] == {"time loop": 1.5, "mesh": None}
    assert content["memory_mb"] is None
    assert content["status"] == "finished"
    assert os.uname().nodename not in text
    assert str(tmp_path) not in text


def test_new_run_removes_only_files_of_the_old_one(tmp_path):
    run = write_run(tmp_path / "run", steps=8)
    (run / "figures").mkdir()
    for name in ("shell.png", "mine.png"):
        (run / "figures" / name).write_text("png")
    (run / "notes.txt").write_text("keep")
    (run / "fields.csv").write_text("keep")
    (run / ".fields.xdmf.tmp").write_text("of a killed run")
    (run / "fields").mkdir()
    for name in ("000012.h5", ".000013.h5.tmp", "mine.h5"):
        (run / "fields" / name).write_text("a field")
    begun(run).close()
    found = sorted(str(p.relative_to(run)) for p in run.rglob("*"))
    kept = ["figures", "figures/mine.png", "fields", "fields/mine.h5", "fields.csv", "notes.txt"]
    assert found == sorted([".castfem.lock", "case.toml", "run.json", *kept])


@pytest.mark.parametrize("name", ["case.toml", "fields/000012.h5", "figures/heat.png"])
def test_files_not_written_by_castfem_are_never_changed(tmp_path, name):
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text("of the user")
    with pytest.raises(InputError, match=f"holds {name}, not of a run of castfem; choose another"):
        begun(tmp_path)
    assert file.read_text() == "of the user"
    assert not (tmp_path / "run.json").exists()


def test_run_json_of_another_program_is_kept(tmp_path):
    (tmp_path / "run.json").write_text('{"status": "running"}')
    with pytest.raises(InputError, match=r"run\.json: not written by castfem"):
        begun(tmp_path)
    assert (tmp_path / "run.json").read_text() == '{"status": "running"}'


def test_second_run_at_once_is_refused(tmp_path):
    first = begun(tmp_path)
    with pytest.raises(InputError, match="another run is writing here"):
        begun(tmp_path)
    assert OutputFolder(tmp_path).is_running()
    first.close()
    assert not OutputFolder(tmp_path).is_running()
    begun(tmp_path).close()


HOLDER = """
import sys, time
from castfem.runs.output.folder import OutputFolder
folder = OutputFolder(sys.argv[1])
folder.begin("title = 'x'")
print("ready", flush=True)
time.sleep(20)
"""


def test_killed_run_releases_the_folder(tmp_path):
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        try:
            assert OutputFolder(tmp_path).is_running()
            with pytest.raises(InputError, match="another run"):
                begun(tmp_path)
        finally:
            process.send_signal(signal.SIGKILL)
    assert RunRecord.load(tmp_path).status == "running"
    assert not OutputFolder(tmp_path).is_running()
    begun(tmp_path).close()


def test_resume_keeps_files_and_adds_wall_times(tmp_path):
    with OutputFolder(tmp_path) as folder:
        folder.begin(CASE)
        save_checkpoint(folder / "checkpoint.h5", {}, {})
        (folder / "history.csv").write_text("time [s]\n")
        folder.update(wall_time={"time loop": 2.0, "mesh": 1.0})
        started = folder.record.started
    with OutputFolder(tmp_path) as folder:
        folder.begin(CASE, resume=True)
        assert (folder / "history.csv").exists()
        folder.update(wall_time={"time loop": 0.5})
        folder.finish(wall_time={"time loop": 3.0, "output": 0.25})
    record = RunRecord.load(tmp_path)
    assert record.wall_time == {"time loop": 5.0, "mesh": 1.0, "output": 0.25}
    assert (record.status, record.resumed, record.started) == ("finished", 1, started)


def finished(path: Path) -> dict[str, str]:
    """Write a run that can be resumed; return the text of its files."""
    with OutputFolder(path) as folder:
        folder.begin(CASE)
        save_checkpoint(folder / "checkpoint.h5", {}, {})
        folder.finish(wall_time={"time loop": 2.0})
    return {name: (path / name).read_text() for name in ("run.json", "case.toml")}


def test_refused_resume_leaves_the_folder_unchanged(tmp_path):
    before = finished(tmp_path)
    with pytest.raises(InputError), OutputFolder(tmp_path) as folder:
        folder.begin('title = "another"\n', resume=True)
        raise InputError("belongs to another case")
    assert {name: (tmp_path / name).read_text() for name in before} == before


def test_resume_that_fails_later_is_a_failed_run(tmp_path):
    finished(tmp_path)
    with pytest.raises(InputError), OutputFolder(tmp_path) as folder:
        folder.begin('title = "another"\n', resume=True)
        folder.update(reached={"time": 1.0})
        raise InputError("no such zone")
    record = RunRecord.load(tmp_path)
    assert (record.status, record.reason, record.resumed) == ("failed", "no such zone", 1)
    assert "another" in (tmp_path / "case.toml").read_text()


def test_half_removed_run_is_not_resumed(tmp_path, monkeypatch):
    """A new run was killed while it removed the files of the one before."""
    finished(tmp_path)
    removed: list[str] = []
    unlink = Path.unlink

    def note(path: Path, missing_ok: bool = False) -> None:
        if path.exists():
            removed.append(path.name)
        unlink(path, missing_ok)

    (tmp_path / "history.csv").write_text("time [s]\n")
    monkeypatch.setattr(Path, "unlink", note)
    begun(tmp_path).close()
    assert removed[0] == "checkpoint.h5" and "history.csv" in removed


def test_run_without_checkpoint_begins_again(tmp_path):
    """Killed before the first one, or before its folder existed: nothing is to be kept."""
    for _ in range(2):
        with OutputFolder(tmp_path / "new") as folder:
            assert folder.begin(CASE, resume=True) is False
            assert folder.record.resumed == 0
            (folder / "history.csv").write_text("time [s]\n")
    assert folder.begin(CASE, resume=True) is False
    assert not (folder / "history.csv").exists()
    save_checkpoint(folder / "checkpoint.h5", {}, {})
    folder.close()
    assert folder.begin(CASE, resume=True) is True
    folder.close()


def test_finished_run_without_checkpoint_is_not_lost(tmp_path):
    finished(tmp_path)
    (tmp_path / "checkpoint.h5").unlink()
    (tmp_path / "history.csv").write_text("time [s]\n")
    with pytest.raises(InputError, match=r"checkpoint\.h5: no such file, nothing to resume"):
        begun(tmp_path, resume=True)
    assert (tmp_path / "history.csv").exists()
    begun(tmp_path).close()  # the lock has been released


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (RunFailure("no convergence at t = 3 s\nsecond line"), "no convergence at t = 3 s"),
        (KeyboardInterrupt(), "stopped by the user"),
        (ZeroDivisionError(), "ZeroDivisionError"),
    ],
)
def test_error_in_the_block_is_recorded_as_the_reason(tmp_path, error, reason):
    with pytest.raises(type(error)), OutputFolder(tmp_path) as folder:
        folder.begin(CASE)
        raise error
    record = RunRecord.load(tmp_path)
    status = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
    assert (record.status, record.reason) == (status, reason)
    assert record.ended


def test_older_record_of_a_stopped_run_is_interrupted(tmp_path):
    with begun(tmp_path) as folder:
        folder.fail("stopped by the user")
    assert RunRecord.load(tmp_path).status == "interrupted"


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (
            "wall_time",
            {"time loop": "long"},
            r"wall_time\.time loop: input should be a valid number",
        ),
        ("reached", [1.0], r"reached: input should be a valid dictionary"),
        ("status", 1, r"status: input should be a valid string"),
    ],
)
def test_wrong_type_in_a_record_is_reported_with_its_key(tmp_path, key, value, message):
    begun(tmp_path).close()
    path = tmp_path / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(InputError, match=rf"run\.json: {message}, .*correct it"):
        RunRecord.load(tmp_path)
    for resume in (False, True):
        with pytest.raises(InputError, match="correct it"):
            begun(tmp_path, resume=resume)


def test_values_that_are_not_finite_are_left_out(tmp_path):
    with begun(tmp_path) as folder:
        folder.finish(wall_time={"time loop": 1.5, "mesh": np.nan})
    assert RunRecord.load(tmp_path).wall_time == {"time loop": 1.5}


def test_reason_does_not_contain_the_folder(tmp_path):
    folder = begun(tmp_path)
    folder.fail(f"{tmp_path}/fields.h5: cannot be written")
    folder.close()
    assert RunRecord.load(tmp_path).reason == "fields.h5: cannot be written"


def test_refused_folder_is_not_marked_as_failed(tmp_path):
    run = write_run(tmp_path, steps=2)
    holder = begun(run)
    with pytest.raises(InputError), OutputFolder(run) as folder:
        folder.begin(CASE)
    assert RunRecord.load(run).status == "running"
    holder.close()


def test_impossible_folder_is_an_input_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError) as error:
        begun(tmp_path / "file" / "run")
    (line,) = error.value.problems
    assert line.endswith(
        "cannot be used as output folder (Not a directory); choose another with -o"
    )


@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSPC])
def test_folder_that_cannot_be_written_is_an_input_error(tmp_path, monkeypatch, number):
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(atomic_files.os, "replace", refuse)
    with pytest.raises(InputError, match=rf"\({os.strerror(number)}\); choose another with -o"):
        begun(tmp_path)
    monkeypatch.undo()
    begun(tmp_path).close()


def test_disk_that_fills_during_the_run_is_a_run_failure(tmp_path, monkeypatch):
    folder = begun(tmp_path)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(atomic_files.os, "fsync", full)
    with pytest.raises(
        RunFailure, match=r"No space left on device\); free some space, and give the c"
    ):
        folder.update(memory_mb=1.0)
    assert RunRecord.load(tmp_path).status == "running"
    folder.close()


def test_unknown_entries_are_refused_or_skipped(tmp_path):
    folder = begun(tmp_path)
    with pytest.raises(TypeError):
        folder.update(walltime={})
    folder.close()
    content = json.loads((tmp_path / "run.json").read_text()) | {"of a later castfem": 1}
    (tmp_path / "run.json").write_text(json.dumps(content))
    assert RunRecord.load(tmp_path).status == "running"


def test_readers_of_results_are_light_to_import():
    code = """
import importlib, pkgutil, sys
import castfem.runs.output, castfem.post.plots, castfem.post.report
for package in (castfem.runs.output, castfem.post.plots, castfem.post.report):
    for module in pkgutil.iter_modules(package.__path__):
        if module.name != "chosen_units":  # derives from matplotlib: to be imported to draw alone
            importlib.import_module(f"{package.__name__}.{module.name}")
heavy = {"h5py", "matplotlib", "pandas", "meshio", "rich", "pint", "mpi4py", "dolfinx", "vtk"}
print(*(heavy & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_documentation_names_every_file_and_entry():
    text = (Path(__file__).parents[2] / "docs" / "output.md").read_text()
    names = [*folder_module.ARTEFACTS, *(f"{name}.png" for name in folder_module.FIGURES)]
    entries = [field.name for field in dataclasses.fields(RunRecord)]
    keys = [*summary().to_json(), *summary().to_json()["references"][0]]
    for name in [*entries, *keys, *(name.removeprefix("figures/") for name in names)]:
        assert f"`{name}`" in text, name
