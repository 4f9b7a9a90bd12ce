"""Ranks share the slices of a caster: whatever their number, the files are the same."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import pytest
from ranks import killed_on, needs_mpirun, python_on
from small_caster import STOP, STRAINED, caster

from castfem.model import Case
from castfem.runs.caster.files import read_table
from castfem.runs.caster.run import run_caster
from castfem.runs.output.run_record import RunRecord

FILES = "caster.csv", "strand.csv", "slices.csv"
PROGRAM = """
    import os, signal, sys, threading
    from mpi4py import MPI
    from castfem.base.progress import Progress
    from castfem.model import load_case
    from castfem.runs.caster.run import run_caster

    comm = MPI.COMM_WORLD
    case, folder, stopped = sys.argv[1:]
    class Signalled(Progress):
        told = 0
        def update(self, *given, **named):
            self.told += 1
            if self.told == 20:
                comm.send(True, int(stopped))
    def wait():
        comm.recv()
        os.kill(os.getpid(), signal.SIGTERM)
    if comm.rank == int(stopped):
        threading.Thread(target=wait, daemon=True).start()
    try:
        progress = Signalled(-1) if comm.rank == 0 and int(stopped) > 0 else None
        run_caster(load_case(case), folder, resume=True, save_every=0.0, progress=progress)
    except KeyboardInterrupt:
        sys.exit(130)
"""


def few() -> Case:
    """A caster of five slices, of which two at most are in the machine."""
    return caster({"caster.spacing": "160 mm", "caster.every": "3 s", "casting.length": "170 mm"})


def watched() -> Case:
    """A caster with a pyrometer and a moment."""
    return caster(
        {"caster.pyrometer": [{"name": "exit", "at": "150 mm"}], "caster.moments": ["4 s"]}
    )


MORE = "pyrometers.csv", "strand.pvd", "moments/strand_4s.vtu"


def strained() -> Case:
    """A caster with mechanics, through a stop."""
    return caster(STRAINED, STOP)


@pytest.mark.mpi
@pytest.mark.parametrize("made", [caster, few, watched, strained])
def test_many_ranks_write_what_one_writes(made: Callable[[], Case], tmp_path: Path) -> None:
    comm = MPI.COMM_WORLD
    folder = Path(comm.bcast(str(tmp_path)))
    run_caster(made(), tmp_path / "one", comm=MPI.COMM_SELF)
    run_caster(made(), folder / "many", comm=comm)
    if comm.rank == 0:
        for name in (*FILES, *(MORE if made is watched else ())):
            assert (folder / "many" / name).read_bytes() == (folder / "one" / name).read_bytes()
        assert RunRecord.load(folder / "many").ranks == comm.size


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the case, the program, and what one rank makes of them."""
    folder = tmp_path_factory.mktemp("whole")
    case = caster()
    (folder / "case.toml").write_text(case.resolved_toml())
    (folder / "program.py").write_text(textwrap.dedent(PROGRAM))
    run_caster(case, folder / "one")
    return folder


def _is_as_one(whole: Path, folder: Path) -> bool:
    return all((whole / "one" / n).read_bytes() == (folder / n).read_bytes() for n in FILES)


@needs_mpirun
@pytest.mark.parametrize(("ranks", "then"), [(2, 3), (1, 2)])
def test_what_was_killed_goes_on_on_other_ranks(
    ranks: int, then: int, whole: Path, tmp_path: Path
) -> None:
    words = [str(whole / "program.py"), str(whole / "case.toml"), str(tmp_path), "-1"]

    def half_way() -> bool:
        rows = tmp_path / "caster.csv"
        return (tmp_path / "checkpoint.h5").is_file() and len(rows.read_text().split()) > 8

    killed_on(ranks, *words, folder=tmp_path, when=half_way)
    assert RunRecord.load(tmp_path).status == "running"
    assert 0 < len(read_table(tmp_path / "caster.csv")[0]["time"]) < 19
    assert python_on(then, *words).returncode == 0
    assert _is_as_one(whole, tmp_path)


@needs_mpirun
def test_a_signal_to_one_rank_stops_all_and_loses_nothing(whole: Path, tmp_path: Path) -> None:
    words = [str(whole / "program.py"), str(whole / "case.toml"), str(tmp_path)]
    ended = python_on(2, *words, "1")
    assert ended.returncode == 130, ended.stderr
    assert RunRecord.load(tmp_path).status == "interrupted"
    assert python_on(1, *words, "-1").returncode == 0 and _is_as_one(whole, tmp_path)


@needs_mpirun
def test_the_command_on_two_ranks(whole: Path, tmp_path: Path) -> None:
    words = ["-m", "castfem.cli", "caster", str(whole / "case.toml"), "-o"]
    made = python_on(2, *words, str(tmp_path / "out"))
    assert made.returncode == 0, made.stderr
    assert _is_as_one(whole, tmp_path / "out") and made.stdout.count("the strand leaves") == 1
    refused = python_on(2, *words, str(tmp_path / "out"), "--set", "caster.spacing=9 m")
    assert refused.returncode == 1 and "Traceback" not in refused.stderr
    assert refused.stderr.count("leaves no slice within casting.length") == 1
