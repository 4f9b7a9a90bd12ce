"""With mpirun: messages once, one exit status, and no rank left waiting."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ranks import mains, needs_mpirun, python_on

from castfem.cli import execute, parallel
from castfem.cli.parallel import console

pytestmark = needs_mpirun

ENGINE = """
import sys, types
import castfem.fem.rank_zero as together
from castfem.base.errors import InputError, RunFailure
def run(case, folder, *, comm=None, resume=False, profile=False, progress=None):
    {body}
module = types.ModuleType("castfem.runs.loop")
module.run = run
sys.modules["castfem.runs.loop"] = module
shown = types.ModuleType("castfem.post.report.show")
shown.show = lambda folder, console, figures: console.print("the table", style="bold red")
sys.modules["castfem.post.report.show"] = shown
from castfem.cli import main
main(sys.argv[1:])
"""


def _mpirun(tmp_path: Path, body: str, *words: str, ranks: int = 2):
    script = tmp_path / "castfem_script.py"
    script.write_text(ENGINE.format(body=body))
    return python_on(ranks, str(script), *words, folder=tmp_path, timeout=120.0)


RUN = ("run", "billet125/thermal", "-o", "out")


def test_output_is_printed_once(tmp_path):
    # Written into files: output of two ranks may be mixed in the middle of a line.
    body = "open(f'rank{comm.rank}', 'w').write(str(progress is not None)); return None"
    done = _mpirun(tmp_path, body, *RUN)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("the table") == 1
    assert "\x1b" not in done.stdout  # although a rank's output is a terminal
    assert [(tmp_path / f"rank{rank}").read_text() for rank in (0, 1)] == ["True", "False"]


@pytest.mark.parametrize("launcher", ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"])
def test_ranks_print_without_colours(launcher, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"):
        monkeypatch.delenv(name, raising=False)
    assert console().is_terminal
    monkeypatch.setenv(launcher, "0")
    assert not console().is_terminal


def test_failure_on_all_ranks_is_reported_once(tmp_path):
    """It is reported at once: no rank waits for ranks that have all arrived."""
    body = "together.PATIENCE = 1e3; raise RunFailure('step too small')"
    done = _mpirun(tmp_path, body, *RUN)
    assert done.returncode == 2
    assert done.stderr.count("castfem: step too small") == 1


def test_failure_of_one_rank_ends_all(tmp_path):
    """The other rank waits forever in a collective call; the command ends with the right status."""
    body = (
        "together.PATIENCE = 0.5; comm.rank == 0 and comm.Barrier(); "
        "raise RunFailure('lost the mesh')"
    )
    done = _mpirun(tmp_path, body, *RUN)
    assert done.returncode == 2
    assert "castfem: on rank 1: lost the mesh" in done.stderr


REFUSED = (
    ((*RUN, "--set", "casting.speed=3"), "casting.speed: "),
    (("run", "--colour"), "No such option"),
    (("sensitivity", "billet125/thermal", "--to", "mould.width"), "has no number there"),
    (("section", "billet125/thermal"), "mechanics: the table is missing"),
    (("mould", "billet125/taper_1", "--hot"), "mould.tube: the table is missing"),
)


def test_commands_on_all_ranks_are_refused_once(tmp_path):
    """Otherwise rank 0 would wait forever for ranks that had ended; at last a serial command."""
    refused, check = [words for words, _ in REFUSED], ("check", "billet125/thermal")
    done = python_on(2, *mains(tmp_path, *refused, then=check), timeout=120.0)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("billet125/thermal: valid") == 1
    for words, message in REFUSED:
        assert done.stderr.count(message) == 1, (words, done.stderr)


def test_hot_mould_uses_all_ranks_with_either_option(monkeypatch):
    monkeypatch.setattr(parallel, "rank_and_size", lambda: (1, 2))
    monkeypatch.setattr(parallel, "check_launcher", lambda: None)
    for words, status in ((["--hot"], 1), (["--coupled"], 1), ([], 0)):
        assert execute(["mould", "no_such_case", *words]) == status


ENTERED = "from castfem.cli import main; main()"
STEP = {"SLURM_PROCID": "0", "SLURM_NTASKS": "2", "SLURM_STEP_NUM_TASKS": "2"}
BATCH = {"SLURM_PROCID": "0", "SLURM_NTASKS": "2"}
OTHER = {"PMI_RANK": "0", "PMI_SIZE": "2"}


def _started(words, folder, variables):
    """Start castfem like a launcher that sets up no MPI."""
    strange = ("OMPI_", "PMI", "PRTE_", "SLURM_")
    environment = {k: v for k, v in os.environ.items() if not k.startswith(strange)}
    return subprocess.run(
        [sys.executable, "-c", ENTERED, *words], cwd=folder, env=environment | variables,
        capture_output=True, text=True, timeout=120.0, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("variables", "cause", "fix"),
    [
        (STEP, "srun has started 2 tasks", "mpirun -n 2 in a batch script"),
        (OTHER, "the launcher has started 2 processes", "start castfem by the mpirun of"),
    ],
)
def test_tasks_without_mpi_are_refused(tmp_path, variables, cause, fix):
    """Each would do the full run in the same folder. The first reports it, and the others end."""
    for number in ("0", "1"):
        of_task = {k: number if k.endswith(("PROCID", "RANK")) else v for k, v in variables.items()}
        done = _started(RUN, tmp_path, of_task)
        assert done.returncode == 1
        lines = done.stderr.splitlines()
        assert len(lines) == (number == "0")
        assert all(cause in line and fix in line for line in lines)
    assert not (tmp_path / "out").exists()


def test_batch_script_is_no_rank(tmp_path):
    """It has the variables of a job of two tasks, and is a single process."""
    words = ("sweep", "billet125/thermal", "--set", "casting.length=1 mm,2 mm", "-o", "out")
    done = _started((*words, "--ranks", "2"), tmp_path, BATCH)
    assert done.returncode == 1
    assert "--ranks 2: " in done.stderr and "mpirun -n 2" in done.stderr
    short = ("--set", "casting.length=1 mm", "--set", "output.figures=false", "-q")
    done = _started((*RUN, *short), tmp_path, BATCH)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "finished"


def test_unreachable_ranks_end_with_a_message(tmp_path):
    """MPI may be set up and hang at the first message; here one rank never reaches it."""
    script = tmp_path / "castfem_script.py"
    script.write_text(
        "import sys, time\nfrom mpi4py import MPI\nfrom castfem.cli import main, parallel\n"
        "parallel._REACHED = 0.5\n"
        "time.sleep(60 * MPI.COMM_WORLD.rank)\nmain(sys.argv[1:])"
    )
    done = python_on(2, str(script), *RUN, folder=tmp_path, timeout=50.0)
    assert done.returncode == 1
    assert "castfem: rank 0 waited" in done.stderr
