"""Under mpirun: one voice, one exit status, and no rank left behind."""

from __future__ import annotations

from pathlib import Path

import pytest
from ranks import needs_mpirun, python_on

from castfem.cli import execute, parallel
from castfem.cli.parallel import console

pytestmark = needs_mpirun

ENGINE = """
import sys, types
import castfem.fem.root as together
from castfem.errors import InputError, RunFailure
def run(case, folder, *, comm=None, resume=False, profile=False, progress=None):
    {body}
module = types.ModuleType("castfem.time_loop.loop")
module.run = run
sys.modules["castfem.time_loop.loop"] = module
shown = types.ModuleType("castfem.report.show")
shown.show = lambda folder, console, figures: console.print("the table", style="bold red")
sys.modules["castfem.report.show"] = shown
from castfem.cli import main
main(sys.argv[1:])
"""


def _mpirun(tmp_path: Path, body: str, *words: str, ranks: int = 2):
    script = tmp_path / "castfem_script.py"
    script.write_text(ENGINE.format(body=body))
    return python_on(ranks, str(script), *words, folder=tmp_path, timeout=120.0)


RUN = ("run", "billet125/thermal", "-o", "out")


def test_one_voice(tmp_path):
    # Into files: what two ranks print may be mixed in the middle of a line.
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


def test_input_error_is_told_once(tmp_path):
    done = _mpirun(tmp_path, "return ''", *RUN, "--set", "casting.speed=3")
    assert done.returncode == 1
    assert done.stderr.count("casting.speed: a speed needs its unit") == 1


def test_usage_error_is_told_once(tmp_path):
    done = _mpirun(tmp_path, "return ''", "run", "--colour")
    assert done.returncode == 1
    assert done.stderr.count("No such option") == 1


def test_failure_on_all_ranks_is_told_once(tmp_path):
    """And at once: nobody waits for ranks that have all come."""
    body = "together.PATIENCE = 1e3; raise RunFailure('step too small')"
    done = _mpirun(tmp_path, body, *RUN)
    assert done.returncode == 2
    assert done.stderr.count("castfem: step too small") == 1


def test_rank_that_fails_alone_ends_all(tmp_path):
    """The other rank waits for ever in a collective call; nobody hangs, the status is right."""
    body = (
        "together.PATIENCE = 0.5; comm.rank == 0 and comm.Barrier(); "
        "raise RunFailure('lost the mesh')"
    )
    done = _mpirun(tmp_path, body, *RUN)
    assert done.returncode == 2
    assert "castfem: on rank 1: lost the mesh" in done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("sensitivity", "billet125/thermal", "--to", "mould.width"), "has no number there"),
        (("section", "billet125/thermal"), "mechanics: the table is missing"),
        (("mould", "billet125/taper_1", "--hot"), "mould.tube: the table is missing"),
    ],
)
def test_commands_that_take_all_ranks_have_them(tmp_path, words, told):
    """Rank 0 would wait for the others for ever, which had gone."""
    script = tmp_path / "castfem_script.py"
    script.write_text("import sys; from castfem.cli import main; main(sys.argv[1:])")
    done = python_on(2, str(script), *words, folder=tmp_path, timeout=120.0)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count(told) == 1, done.stderr


def test_a_hot_mould_has_all_ranks_by_either_word(monkeypatch):
    monkeypatch.setattr(parallel, "launched", lambda: (1, 2))
    for words, status in ((["--hot"], 1), (["--coupled"], 1), ([], 0)):
        assert execute(["mould", "no_such_case", *words]) == status


def test_check_runs_on_one_rank(tmp_path):
    done = _mpirun(tmp_path, "return ''", "check", "billet125/thermal")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("billet125/thermal: sound") == 1
