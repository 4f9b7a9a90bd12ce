"""A sweep in parts, on groups of ranks, with killed workers: the same folders."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import psutil
import pytest
from ranks import needs_mpirun, python_on
from small_case import write_small

import castfem as api
from castfem.base.errors import InputError
from castfem.cli import sweeping
from castfem.cli.sweeping import Share
from castfem.studies.accuracy.sizes import MESH, factors_of
from castfem.studies.sweep.plan import plan
from castfem.studies.sweep.work import Job
from castfem.studies.sweep.workers import Workers, check_groups

pytestmark = pytest.mark.slow

ROWS = ("--set", "length=10 mm", "--set", "speed=3 m/min,3.5 m/min,4 m/min")
NAMES = ("speed_3_m_min", "speed_3.5_m_min", "speed_4_m_min")
SAME = ("case.toml", "history.csv", "fields.xdmf")
"""Files of a run without a time of day (HDF5 has its own) and without a duration."""


def _results(folder: Path) -> dict[str, object]:
    content = json.loads((folder / "summary.json").read_text())
    return {key: value for key, value in content.items() if key != "wall_time"}


def _fields(folder: Path) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    with h5py.File(folder / "fields.h5", "r") as file:
        file.visititems(
            lambda name, item: (
                found.update({name: item[()].tobytes()}) if isinstance(item, h5py.Dataset) else None
            )
        )
    assert found
    return found


def _same(one: Path, other: Path) -> bool:
    files = all((one / name).read_bytes() == (other / name).read_bytes() for name in SAME)
    return files and _results(one) == _results(other) and _fields(one) == _fields(other)


@pytest.mark.usefixtures("runs_here")
def test_parts_of_a_script_make_the_full_sweep(castfem, tmp_path) -> None:
    """Two tasks at once, as a cluster would start them; then one table of all."""
    write_small(tmp_path)
    whole = castfem("sweep", "small", *ROWS, "-j", 1, "-o", "whole", "-q")
    assert whole.status == 0, whole.err
    written = castfem("sweep", "small", *ROWS, "-o", "parts", "--slurm", "job.sh", "--part", "1/2")
    assert written.status == 0, written.err
    assert "3 runs in 2 tasks" in written.out
    (tmp_path / "castfem").write_text(f'#!/bin/sh\nexec {sys.executable} -m castfem.cli "$@"\n')
    (tmp_path / "castfem").chmod(0o755)
    path = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    tasks = [
        subprocess.Popen(
            ["bash", "job.sh"],
            env=os.environ | path | {"SLURM_ARRAY_TASK_ID": str(i)},
            stderr=subprocess.PIPE,
            text=True,
        )
        for i in (1, 2)
    ]
    for task in tasks:
        assert task.wait(timeout=300) == 0, task.communicate()[1]
    assert not Path("parts/sweep.csv").exists()
    assert set(json.loads(Path("parts/sweep.json").read_text())["runs"]) == set(NAMES)
    collected = castfem("sweep", "small", *ROWS, "-o", "parts", "--collect")
    assert collected.status == 0, collected.err
    tables = [
        list(csv.DictReader(Path(f"{name}/sweep.csv").read_text().splitlines()))
        for name in ("whole", "parts")
    ]
    for one, other in zip(*tables, strict=True):
        assert {**one, "wall_time [s]": ""} == {**other, "wall_time [s]": ""}
    for name in NAMES:
        assert _same(Path("whole") / name, Path("parts") / name), name
    Path("parts/sweep.json").unlink()  # as if each had been run on another machine
    again = castfem("sweep", "small", *ROWS, "-o", "parts", "--collect", "-q")
    assert again.status == 0, again.err
    more = castfem("sweep", "small", *ROWS[:-1], f"{ROWS[-1]},5 m/min", "-o", "parts", "--collect")
    assert more.status == 2
    assert "1 of 4 runs" in more.err


def test_killed_workers_are_replaced(tmp_path) -> None:
    """Each of the first two runs loses its process once; both are resumed without a difference."""
    base = api.load(write_small(tmp_path)).with_(length="10 mm", step="2 ms")
    variants = plan(base, ["speed=3 m/min,3.5 m/min,4 m/min"])
    killed: set[str] = set()
    messages: dict[str, str] = {}
    begun: list[str] = []

    def kill() -> None:
        for name in NAMES[:2]:
            if name not in killed and (tmp_path / "hit" / name / "history.csv").is_file():
                killed.add(name)
                for child in psutil.Process().children():
                    if "spawn_main" in " ".join(child.cmdline()):
                        child.kill()

    for folder, tick in (("hit", kill), ("still", lambda: None)):
        jobs = [Job(v.name, tmp_path / folder / v.name, v.case) for v in variants]
        with Workers(tmp_path / "noise", processes=1) as workers:
            workers.run(
                jobs,
                lambda job: begun.append(job.name),
                lambda job, outcome: messages.__setitem__(job.name, outcome.message),
                tick,
            )
        assert messages == dict.fromkeys(NAMES, "")
    assert killed == set(NAMES[:2])
    assert begun == [*NAMES, *NAMES]
    for name in NAMES:
        assert _same(tmp_path / "hit" / name, tmp_path / "still" / name), name


@needs_mpirun
def test_groups_of_ranks(tmp_path) -> None:
    """Two groups of two: a row is the result of two ranks for its case."""
    write_small(tmp_path)
    words = ("-m", "castfem.cli", "sweep", "small", *ROWS, "--ranks", "2", "-o", "out")
    done = python_on(4, *words, folder=tmp_path, timeout=300.0)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("table in out/sweep.csv") == 1
    for name in NAMES:
        assert json.loads((tmp_path / "out" / name / "run.json").read_text())["ranks"] == 2
    case = str(tmp_path / "out" / NAMES[1] / "case.toml")
    single = ("-m", "castfem.cli", "run", case, "-q", "-o", "alone")
    assert python_on(2, *single, folder=tmp_path, timeout=300.0).returncode == 0
    histories = [tmp_path / where / "history.csv" for where in (f"out/{NAMES[1]}", "alone")]
    assert histories[0].read_bytes() == histories[1].read_bytes()


def test_shares() -> None:
    rows = list(range(7))
    parts = [list(Share(i, 3).of(rows)) for i in (1, 2, 3)]
    assert parts == [[0, 3, 6], [1, 4], [2, 5]]
    assert list(Share(9, 9).of(rows)) == []
    assert Share.read("3/20") == Share(3, 20)
    for text in ("3", "0/3", "4/3", "a/b", "-1/2", ""):
        with pytest.raises(InputError, match="--part"):
            Share.read(text)


def test_impossible_groups_are_refused() -> None:
    check_groups(2, 4)
    for ranks, size, message in ((2, 1, "mpirun -n 4"), (2, 3, "mpirun -n 4"), (0, 2, "at least")):
        with pytest.raises(InputError, match=message):
            check_groups(ranks, size)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--part", "4/3"), "the parts are 1/3 to 3/3"),
        (("--part", "third"), "write it as 3/20"),
        (("--collect",), "out: no such folder"),
        (("--collect", "--part", "1/2"), "--collect runs nothing"),
        (("--ranks", "2"), "mpirun -n 4"),
        (("--slurm", "small.toml"), "small.toml: exists already"),
        (("--slurm", "job.sh", "--overwrite"), "exclude each other"),
    ],
)
def test_bad_input_runs_nothing(refused, words, message) -> None:
    assert message in refused("sweep", "small", *ROWS, "-o", "out", *words)


def test_accuracy_applies_to_all_runs(castfem, tmp_path):
    """As for a single run; a script for SLURM passes it on."""
    path = write_small(tmp_path)
    options = (sweeping.Options(str(path), None, accuracy=word) for word in ("coarse", "default"))
    coarse, as_written = (one.case(path) for one in options)
    factor = factors_of("coarse")[MESH]
    assert factor > 1.0
    assert coarse.mesh.surface_size == pytest.approx(factor * as_written.mesh.surface_size)
    assert coarse.mould is None and coarse.section == as_written.section
    words = ("sweep", "small", *ROWS, "-o", "coarse", "--accuracy", "coarse")
    assert castfem(*words, "--slurm", "job.sh").status == 0
    assert "--accuracy coarse" in Path("job.sh").read_text()
    assert castfem(*words, "--slurm", "ranks.sh", "--ranks", "2").status == 0
    (started,) = [line for line in Path("ranks.sh").read_text().splitlines() if "--ranks" in line]
    assert started.startswith("exec mpirun -n 2 castfem sweep small ")
    assert "#SBATCH --signal=B:USR1@60\n" in Path("ranks.sh").read_text()
    refused = castfem("sweep", "small", *ROWS, "--accuracy", "rough")
    assert refused.status == 1 and "--accuracy rough: unknown" in refused.err
