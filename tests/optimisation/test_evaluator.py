"""Results of a case with some keys changed: each run once, failures with their position."""

from __future__ import annotations

import csv
import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ranks import needs_mpirun, python_on
from small_case import small, write_small

from castfem.base import atomic_files
from castfem.base.errors import InputError, RunFailure
from castfem.cli.sweeping import Options, sweep_case
from castfem.model.load import load, portable
from castfem.studies.optimisation import Evaluator, evaluator
from castfem.studies.optimisation.evaluator import lean
from castfem.studies.optimisation.fidelity import at_level, idealised
from castfem.studies.optimisation.store import key_of

SHORT = {"casting.length": "6 mm"}
# Colder than the data of the steel: the run ends early.
STOPS = {"cooling.mould.surface": [{"law": "flux", "value": "400 MW/m^2"}]}


def _rows(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "sweep.csv").open() as file:
        return {row["casting.speed [m/min]"]: row for row in csv.DictReader(file)}


def test_each_case_runs_once(tmp_path):
    with Evaluator(small(SHORT), tmp_path / "runs") as evaluate:
        first = evaluate({"speed": "3 m/min"})
        again = evaluate({"casting.speed": "0.05 m/s"})  # the same in other words
        both = evaluate.many([{"speed": "3 m/min"}, {"speed": "4 m/min"}])
    assert evaluate.runs == 2
    assert first == again == both[0]
    assert both[1]["heat_removed"] < first["heat_removed"]
    assert first.folder is not None
    assert not (first.folder / "fields.h5").exists()
    other = Evaluator(small({**SHORT, "title": "by another name", "output.every": "0.5 s"}),
                      tmp_path / "runs")  # fmt: skip
    assert other({"speed": "3 m/min"}).quantities == first.quantities
    assert other.runs == 0
    assert other({"speed": "3 m/min", "output.every": "0.01 s"}) != first  # it cuts windows
    assert other.runs == 1


def test_rows_are_those_of_a_sweep(tmp_path, monkeypatch):
    """The same numbers to the last digit; finished runs of a sweep are used."""
    monkeypatch.chdir(tmp_path)
    write_small(tmp_path)
    fixed = ("casting.length=6 mm",)
    options = Options(
        name="small", folder=Path("swept"), assignments=("speed=3 m/min,4 m/min", *fixed),
        table=None, processes=2, resume=False, overwrite=False, figures=False, quiet=True,
    )  # fmt: skip
    assert sweep_case(options) == 0
    speeds = [{"speed": "3 m/min"}, {"speed": "4 m/min"}]
    with Evaluator(small(SHORT), "swept") as evaluate:
        found = evaluate.many(speeds)
        assert evaluate.runs == 0
    with Evaluator(small(SHORT), "own", processes=2) as evaluate:
        own = evaluate.many([{"casting.speed": one["speed"]} for one in speeds])
        assert evaluate.runs == 2
    assert [one.quantities for one in found] == [one.quantities for one in own]
    swept, written = _rows(Path("swept")), _rows(Path("own"))
    for speed, row in swept.items():
        same = {k: v for k, v in written[speed].items() if k not in ("run", "wall_time [s]")}
        assert same == {k: v for k, v in row.items() if k in same}


def test_failed_run_has_its_position(tmp_path):
    with Evaluator(small({"casting.length": "6 mm"}), tmp_path) as evaluate:
        failed = evaluate(STOPS)
        assert failed.failed
        assert 0.0 <= failed.share < 1.0
        assert not failed.quantities
        assert evaluate(STOPS) == failed
        assert evaluate.runs == 1
    later = Evaluator(small({"casting.length": "6 mm"}), tmp_path)
    assert later(STOPS).message == failed.message
    assert later.runs == 0


def test_search_continues_after_a_kill(tmp_path):
    """A killed process loses only its current run, which is resumed."""
    write_small(tmp_path)
    script = tmp_path / "script.py"
    script.write_text(
        "import castfem\nfrom castfem.studies.optimisation import Evaluator\n"
        "with Evaluator(castfem.load('small'), 'runs') as evaluate:\n"
        "    for speed in (3.0, 3.2, 3.4, 3.6):\n"
        "        print(repr(evaluate({'speed': f'{speed} m/min'})['heat_removed']), flush=True)\n"
    )
    with subprocess.Popen(
        [sys.executable, script], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as process:
        first = process.stdout.readline()
        time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
        before = [first, *process.stdout]
    after = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout.splitlines(keepends=True)
    assert after[: len(before)] == before
    undisturbed = Evaluator(small(), tmp_path / "others")
    for speed, line in zip((3.0, 3.2, 3.4, 3.6), after, strict=True):
        assert undisturbed({"speed": f"{speed} m/min"})["heat_removed"] == float(line)
    Evaluator(small(), tmp_path / "runs")({"speed": "3.8 m/min"})
    assert len((tmp_path / "runs" / "sweep.csv").read_text().splitlines()) == 1 + 5  # all


def test_folder_in_use_is_no_failure_of_the_run(tmp_path, monkeypatch):
    """As that of a command just killed may be: it is waited for, then reported."""
    from filelock import FileLock

    monkeypatch.setattr(evaluator, "_PATIENCE", (0.0,))
    with Evaluator(small(SHORT), tmp_path) as evaluate:
        job = evaluate.store.job(evaluate.case, {})
        job.folder.mkdir()
        refused = pytest.raises(RunFailure, match=r"writing here.*the same command continues")
        with FileLock(job.folder / ".castfem.lock"), refused:
            evaluate()
        assert not evaluate().failed


def test_full_disk_is_no_failure_of_the_run(tmp_path, monkeypatch):
    """The run counts as interrupted, now and in later calls, although it recorded its end."""

    def full(path: Path) -> None:
        if "checkpoint" in path.name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    refused = pytest.raises(RunFailure, match=r"No space left on device.*same command continues")
    with monkeypatch.context() as patch, refused:
        patch.setattr(atomic_files, "_force_to_disk", full)
        Evaluator(small(SHORT), tmp_path / "full")()
    (run,) = (tmp_path / "full").glob("*/run.json")
    assert json.loads(run.read_text())["status"] == "failed"
    later = Evaluator(small(SHORT), tmp_path / "full")
    undisturbed = Evaluator(small(SHORT), tmp_path / "other")
    assert later()["heat_removed"] == undisturbed()["heat_removed"]


def test_levels(tmp_path):
    case = small(SHORT)
    coarse, fine = at_level(case, "coarse"), at_level(case, "fine")
    assert coarse.mesh.surface_size == pytest.approx(1.5 * case.mesh.surface_size)
    assert fine.mesh.core_size == pytest.approx(0.625 * case.mesh.core_size)
    assert at_level(case, "default") is case
    with pytest.raises(InputError, match=r"must be one of .*, got 'corse'; did you mean coarse"):
        at_level(case, "corse")


def test_smooth_twin_is_computed_if_named():
    """In the runs of the search; a case that does not name it has none, and another key."""
    case = load("billet125/optimum_single")
    named = lean(case.with_({"optimise.minimise": "von_mises_smooth"}))
    assert named.output.smooth
    assert idealised(named).output.smooth
    plain = lean(case)
    assert plain.output.smooth is None
    keys = {key_of(*portable(one, "properties")) for one in (named, plain)}
    assert len(keys) == 2


def test_idealised_mould():
    case = load("billet125/taper_1")
    ideal = idealised(case.with_({"output.fields": ["gap"], "mechanics.strain": "large"}))
    assert ideal.mould is None
    assert ideal.mechanics is not None
    assert ideal.physics_hash() == load("billet125/idealised").physics_hash()
    assert at_level(case, "coarse").coupling.interval == pytest.approx(0.4)
    along = at_level(case.with_({"coupling.interval": "6 mm"}), "fine")
    assert along.document()["coupling"]["interval"] == "3 mm"
    thermal = at_level(case, "thermal")
    assert thermal.mechanics is None
    assert thermal.mould is None


def test_wall_temperature_is_kept_without_the_mould():
    """The wall temperature along the mould becomes that of the contact law, over time."""
    table = {"position": [0, 300, 600], "position_unit": "mm", "value": [120, 220, 140],
             "unit": "degC"}  # fmt: skip
    case = load("billet125/taper_1").with_(
        {"mould.wall_temperature": table, "cooling.mould.surface.0.wall": "mould"}
    )
    wall = idealised(case).cooling[0].surface[0].wall
    assert wall(5.0) == pytest.approx(220.0 + 273.15)
    assert wall(7.5) == pytest.approx(180.0 + 273.15)


@needs_mpirun
def test_ranks_do_the_runs(tmp_path):
    write_small(tmp_path)
    script = tmp_path / "script.py"
    script.write_text(
        "import castfem\nfrom mpi4py import MPI\n"
        "from castfem.studies.optimisation import Evaluator, serve\n"
        "comm = MPI.COMM_WORLD\n"
        "if comm.rank:\n    serve(comm)\nelse:\n"
        "    case = castfem.load('small').with_(length='6 mm')\n"
        "    with Evaluator(case, 'runs', comm=comm) as evaluate:\n"
        "        one = evaluate.many([{'speed': '3 m/min'}, {'speed': '4 m/min'}])\n"
        "        two = evaluate({'speed': '5 m/min'})\n"
        "        print([e['heat_removed'] for e in (*one, two)], evaluate.runs)\n"
    )
    done = python_on(3, str(script), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    single = Evaluator(small(SHORT), tmp_path / "alone")
    heat = [single({"speed": f"{v} m/min"})["heat_removed"] for v in (3, 4, 5)]
    assert done.stdout.strip() == f"{heat} 3"


@needs_mpirun
def test_groups_of_ranks_continue_after_a_full_disk(tmp_path):
    """No rank is left waiting if rank 0 cannot write the record of the runs, and reports it.

    One run fails, in any group: the others continue, and later calls find the ranks ready.
    """
    write_small(tmp_path)
    script = tmp_path / "script.py"
    script.write_text(
        "import castfem\nfrom mpi4py import MPI\n"
        "from castfem.studies.optimisation import Evaluator, serve\n"
        "from castfem.base.errors import RunFailure\n"
        "def full(*_):\n    raise RunFailure('no space')\n"
        "comm = MPI.COMM_WORLD\n"
        "if comm.rank:\n    serve(comm)\n    serve(comm)\nelse:\n"
        "    case = castfem.load('small').with_(length='6 mm')\n"
        "    with Evaluator(case, 'full', comm=comm, ranks=2) as evaluate:\n"
        "        evaluate.store.record.note = full\n"
        "        try:\n"
        "            evaluate.many([{'speed': f'{v} m/min'} for v in (3, 4, 5)])\n"
        "        except RunFailure as error:\n            print(error)\n"
        "    with Evaluator(case, 'runs', comm=comm, ranks=2) as evaluate:\n"
        "        one = evaluate.many([{'speed': '3 m/min'}, {'speed': '4 m/min'}, "
        f"{STOPS!r}, {{'speed': '5 m/min'}}])\n"
        "        two = evaluate({'speed': '6 m/min'})\n"
        "        every = (*one, two)\n"
        "        print([e.failed or e['heat_removed'] for e in every], evaluate.runs)\n"
    )
    done = python_on(4, str(script), folder=tmp_path, timeout=180.0)
    assert done.returncode == 0, done.stderr
    single = Evaluator(small(SHORT), tmp_path / "alone")
    heat = [single({"speed": f"{v} m/min"})["heat_removed"] for v in (3, 4, 5, 6)]
    message, _, answer = done.stdout.strip().partition("\n")
    assert message == "no space"
    found, _, count = answer.rpartition(" ")
    assert count == "5"
    values = json.loads(found.replace("True", "true"))
    assert values.pop(2) is True
    assert values == pytest.approx(heat, rel=1e-9)
    records = [json.loads(path.read_text()) for path in (tmp_path / "runs").glob("*/run.json")]
    assert [record["ranks"] for record in records] == [2] * 5


def test_impossible_groups_of_ranks_are_refused(tmp_path):
    for ranks, message in (
        (2, r"ranks=2: 1 rank cannot .* mpirun -n 2 for one"),
        (0, "ranks must be an integer >= 1"),
    ):
        with pytest.raises(InputError, match=message):
            Evaluator(small(SHORT), tmp_path, ranks=ranks)
