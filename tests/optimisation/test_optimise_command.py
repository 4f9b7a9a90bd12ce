"""`castfem optimise`: the answer printed, written and drawn; interrupted searches continue."""

from __future__ import annotations

import csv
import json
import shutil

import pytest
from ranks import killed_on, mains, needs_mpirun, python_on
from small_case import SMALL

import castfem
from castfem.base.atomic_files import plain
from castfem.base.errors import InputError
from castfem.cli.app import app
from castfem.model.load import load
from castfem.post.compare.optimum_tables import mould_table

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("runs_here")]

TABLE = """
[optimise]
minimise = "surface_temperature_mid_face"
constraints = ["heat_removed >= 0.05 MJ/m", "heat_removed <= 9 MJ/m"]
fidelity = "coarse"

[[optimise.variable]]
key = "casting.speed"
range = ["2 m/min", "5 m/min"]
"""


SHORT = SMALL.replace('"60 mm"', '"6 mm"').replace("[output]", "[output]\ncheckpoint_every = 0")


@pytest.fixture
def case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SHORT + TABLE)
    return tmp_path


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    """Return the folder of a search in one process, and its answer."""
    folder = tmp_path_factory.mktemp("searched")
    (folder / "small.toml").write_text(SHORT + TABLE)
    return folder / "out", castfem.optimise(folder / "small.toml", folder / "out")


@pytest.fixture
def lost(case, searched):
    """Return runs of such a search, of all levels, that have to be repeated."""
    shutil.copytree(searched[0], case / "out")
    runs = sorted(path.parent for path in (case / "out").glob("*/run.json"))[::3]
    assert len(runs) > 5 and any("fidelity_coarse" in run.name for run in runs)
    for run in runs:
        shutil.rmtree(run)
    return runs


def status_of(*words: str) -> int:
    """Return the exit status of a command in this process."""
    try:
        app(list(words), standalone_mode=False)
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_command(case, capsys):
    def call(*words: str) -> int:
        return status_of("optimise", "small", *words)

    call("-j", "1", "-o", "out")
    first = capsys.readouterr()
    content = json.loads((case / "out" / "optimum.json").read_text())
    # The slower, the colder: the end of the range, without a binding constraint.
    assert content["status"] == "found"
    assert content["values"][0]["value"] == 2.0
    assert content["values"][0]["at_end"] == "lowest"
    assert content["checked"] == "fine"
    assert (case / "out" / "optimum.png").read_bytes().startswith(b"\x89PNG")
    assert "casting.speed at the lowest of its range" in first.out
    assert "[m/min]" in first.out
    messages = first.err.splitlines()
    search, error = (next(i for i, line in enumerate(messages) if line.startswith(w))
                     for w in ("search", "numerical error: "))  # fmt: skip
    assert messages[search + 1].startswith("run ") and not any(
        "fine" in one for one in messages[:error]
    )
    assert any("fine" in one for one in messages[error + 1 :])
    with (case / "out" / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == content["runs"]["all"]
    assert {row["fidelity"] for row in rows} == {"coarse", "", "fine"}
    # Again: no run, the same output.
    call("-j", "1", "-o", "out", "--no-figures")
    again = capsys.readouterr()
    assert "run 1, " not in again.err
    assert json.loads((case / "out" / "optimum.json").read_text()) == content
    call("-j", "1", "-o", "out", "--no-figures", "--units", "si")
    assert "[degC]" in again.out and "[degC]" not in capsys.readouterr().out
    assert json.loads((case / "out" / "optimum.json").read_text()) == content
    # Constraints that cannot be met, with an exit status other than zero.
    call("-j", "1", "-o", "out", "--no-figures", "--set",
         'optimise.constraints=["heat_removed >= 3 MJ/m"]')  # fmt: skip
    last = capsys.readouterr()
    assert "the constraints cannot be met; nearest, heat_removed >= 3 MJ/m is missed by" in last.out
    assert json.loads((case / "out" / "optimum.json").read_text())["status"] == "impossible"


@needs_mpirun
def test_search_over_ranks(case, lost, searched):
    """Two ranks do the runs requested by rank 0, until the answer is found; errors end all."""
    words = ("optimise", "small", "--no-figures")
    refused = {
        (*words, "-o", "small.toml"): "small.toml: is a file",
        (*words, "-o", "none", "--ranks", "2"): "castfem: --ranks 2: 3 ranks cannot be divided so",
        (*words, "-o", "none", "-j", "2"): "castfem: -j is for one machine",
    }
    done = python_on(3, *mains(case, *refused, then=(*words, "-o", "out")), folder=case)
    assert done.returncode == 0, done.stderr
    assert [done.stderr.count(message) for message in refused.values()] == [1, 1, 1]
    assert not (case / "none").exists()
    assert done.stdout.count("casting.speed at the lowest of its range") == 1
    answer = json.loads((case / "out" / "optimum.json").read_text())
    assert answer | {"seconds": 0.0} == plain(searched[1].to_json()) | {"seconds": 0.0}
    assert done.stderr.count(" finished in ") == len(lost) == sum(run.is_dir() for run in lost)


@needs_mpirun
def test_search_on_groups_of_ranks(case, lost):
    """Killed half-way it continues, and its answer is that of one process."""
    words = ("optimise", "small", "--no-figures")
    tight = ("--set", 'optimise.constraints=["heat_removed <= 0.12 MJ/m"]')
    assert status_of(*words, *tight, "-j", "1", "-o", "alone") == 0
    in_groups = ("-m", "castfem.cli", *words, *tight, "--ranks", "2", "-o", "out")
    before = set((case / "out").glob("*/summary.json"))

    def half_way() -> bool:
        return len(list((case / "out").glob("*/summary.json"))) >= len(before) + 4

    killed_on(2, *in_groups, folder=case, when=half_way)
    assert not (case / "out" / "optimum.json").exists()
    done = python_on(2, *in_groups, folder=case)
    assert done.returncode == 0, done.stderr
    single, out = (
        json.loads((case / name / "optimum.json").read_text()) for name in ("alone", "out")
    )
    made = set((case / "out").glob("*/summary.json")) - before
    assert 0 < done.stderr.count(" finished in ") <= len(made) - 4
    assert single["status"] == out["status"] == "found"
    assert single["runs"] == out["runs"]
    for key in ("value", "low", "high", "checked"):
        assert out["values"][0][key] == pytest.approx(single["values"][0][key], rel=1e-4), key
    assert out["objective"]["value"] == pytest.approx(single["objective"]["value"], rel=1e-9)
    records = [json.loads(path.with_name("run.json").read_text()) for path in made]
    assert {record["ranks"] for record in records} == {2}


@needs_mpirun
def test_search_from_python(case, lost):
    """On all ranks the answer of the command, and its errors."""
    (case / "script.py").write_text(
        "import castfem\nfrom mpi4py import MPI\n"
        "best = castfem.optimise('small', 'out', ranks=MPI.COMM_WORLD.size)\n"
        "said = best.status, best.changes()\n"
        "for asked in ('smal', 'none'):\n"
        "    try:\n        castfem.optimise(asked, 'out')\n"
        "    except castfem.InputError as error:\n        said += (error.problems[0],)\n"
        "said = MPI.COMM_WORLD.gather(said)\n"
        "if said:\n    print(len(set(map(str, said))), said[0])\n"
    )
    (case / "none.toml").write_text(SMALL)
    for ranks in (2, 1):  # the second one finds the runs of the first
        done = python_on(ranks, "script.py", folder=case)
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith("1 ('found', {'casting.speed': '2 m/min'}, 'smal: no such")
        assert "none: optimise: the table is missing" in done.stdout
    records = [json.loads((run / "run.json").read_text()) for run in lost]
    assert [record["ranks"] for record in records] == [2] * len(lost)


def test_groups_need_more_than_one_rank(case):
    with pytest.raises(InputError, match="--ranks 2: 1 rank cannot be divided so"):
        status_of("optimise", "small", "-o", "out", "--ranks", "2")
    assert not (case / "out").exists()


@pytest.mark.parametrize("name", ["sweep.csv", "optimum.json", "mould.csv", "front.csv"])
def test_file_of_the_user_is_kept(case, name):
    (case / "out").mkdir()
    mine = case / "out" / name
    mine.write_text("mine")
    with pytest.raises(InputError, match=f"out: {name} was not written by castfem and would"):
        status_of("optimise", "small", "-j", "1", "-o", "out")
    assert mine.read_text() == "mine"


def test_table_of_the_mould():
    case = load("billet125/taper_1").with_(
        {"mould.taper": [{"to": "125 mm", "taper": "2 %/m"}, {"taper": "0.5 %/m"}]}
    )
    head, rows = mould_table(case, every=0.1)
    assert head == ["distance [mm]", "width [mm]", "diagonal [mm]"]
    assert [round(row[0]) for row in rows] == [0, 100, 125, 200, 300, 400, 500, 600]
    width = 125.0 / 1.0025
    assert rows[2][1] == pytest.approx(width)
    assert rows[-1][1] == pytest.approx(width / (1.0 + 0.005 * 0.475))
    cold = case.with_({"mould.condition": "cold", "mould.wall_temperature": "160 degC"})
    head, rows = mould_table(cold)
    assert head[-2:] == ["cold width [mm]", "cold diagonal [mm]"]
    assert rows[0][1] == pytest.approx(rows[0][3] * (1.0 + 17e-6 * 135.0))
