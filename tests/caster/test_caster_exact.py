"""A slice of a caster is the run of its case to the last digit, on any number of ranks."""

from __future__ import annotations

import itertools
import shutil
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from ranks import killed_on, needs_mpirun, python_on
from small_caster import STOP, STRAINED, caster

import castfem
from castfem.model import Case
from castfem.model.caster_slices import by_plant, slice_of
from castfem.runs import restart
from castfem.runs.caster import alike
from castfem.runs.caster.alike import Alike
from castfem.runs.caster.files import read_table
from castfem.runs.caster.run import run_caster
from castfem.runs.caster.strand import Strand
from castfem.runs.interrupt import Interrupt, Stopped
from castfem.runs.loop import TimeLoop
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.history import read_columns
from castfem.runs.output.run_record import RunRecord
from castfem.runs.results.registry import Columns

SPRAY = {
    "law": "spray", "correlation": "nozaki", "water_temperature": "25 degC", "flow": "2 L/min",
}  # fmt: skip
ZONES = {
    "cooling": [
        {"name": "mould", "to": "100 mm", "surface": [
            {"law": "contact", "coefficient": "1600 W/(m^2 K)", "wall": "160 degC"}]},
        {"name": "ring", "to": "300 mm", "surface": [SPRAY]},
    ],
}  # fmt: skip


def _advanced(case: Case) -> Any:
    """Return the strand of a caster, the rows of its slices by number, and their last states."""
    strand = Strand(case)
    rows: dict[int, list[dict[str, float]]] = {}
    ends: dict[int, Any] = {}
    for clock in strand.instants:
        for one in strand.waiting(clock):
            simulation, sample = one.loop.simulation, one.advance(clock)
            assert sample.time == one.age
            rows.setdefault(one.number, []).append(Columns(simulation).row(sample))
            if one.has_left:
                ends[one.number] = restart.arrays(one.run_state)
        strand.release(clock)
        assert len(strand.inside) <= 8  # of 14: memory is for those inside
    return strand, rows, ends


@pytest.fixture(scope="module")
def advanced() -> Any:
    """Return a caster with water."""
    found = _advanced(caster(ZONES, {"ring": ["2 L/min", "2 L/min", "1 L/min", "0 L/min"]}))
    yield found
    found[0].destroy()


@pytest.fixture(scope="module")
def strained() -> Any:
    """Return a caster with mechanics, through a stop."""
    found = _advanced(caster(STRAINED, STOP))
    yield found
    found[0].destroy()


@pytest.mark.parametrize(
    ("which", "number"),
    [*(("advanced", number) for number in (3, 6, 9)), ("strained", 2), ("strained", 4)],
)
def test_slice_is_the_run_of_its_case(
    which: str, number: int, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    strand, rows, ends = request.getfixturevalue(which)
    case = slice_of(strand.base, strand.starts[number - 1])
    assert castfem.run(case, tmp_path).case == case  # the file of a slice has all its digits
    history = read_columns(tmp_path / "history.csv")
    assert len(rows[number]) >= 3
    for row in rows[number]:
        (line,) = np.flatnonzero(np.abs(history["time"] - row["time"]) < 1e-9)
        written = {name: float(f"{value:.12g}") for name, value in row.items()}
        assert set(written) == set(history.columns)
        single = {name: float(history[name][line]) for name in history}
        np.testing.assert_equal(single, written)
    _, arrays = load_checkpoint(tmp_path / "checkpoint.h5")
    ended = {name: values for name, values in ends[number].items() if values is not None}
    assert set(arrays) == set(ended)
    assert ("stress_deviator" in ended) == (which == "strained")
    for name, values in ended.items():
        assert np.array_equal(arrays[name], values, equal_nan=True), name


def test_speed_jumps_and_water_stops(tmp_path: Path) -> None:
    """Positions by hand, and a slice through all of it agrees with its own run."""
    rough = {
        "time": ["0 s", "6 s", "6.01 s", "7 s", "7.01 s", "9 s", "9.01 s", "10 s"],
        "speed": [f"{v} m/min" for v in (0.3, 0.3, 3, 3, 3, 3, 3, 3)],
        "ring": [f"{w} L/min" for w in (2, 2, 2, 2, 0, 0, 2, 2)],
        "superheat": None, "mould_heat": None, "event": None,
    }  # fmt: skip
    strand, rows, _ = _advanced(caster({**ZONES, "caster.every": "1 s"}, rough))
    number = strand.starts.index(0.0) + 1
    found = {round(row["time"], 6): row for row in rows[number]}
    for at, row in found.items():
        later = max(at - 6.01, 0.0)
        fast = 0.05 * later + 0.5 * (0.005 + 0.05) * 0.01 * (later > 0.0)
        assert row["position"] == pytest.approx(0.005 * min(at, 6.0) + fast, abs=1e-6)
    strand.destroy()
    castfem.run(slice_of(strand.base, 0.0), tmp_path)
    history = read_columns(tmp_path / "history.csv")
    for row in rows[number]:
        (line,) = np.flatnonzero(np.abs(history["time"] - row["time"]) < 1e-9)
        for name in ("position", "heat_removed", "surface_temperature_corner"):
            assert float(history[name][line]) == float(f"{row[name]:.12g}")
    flux = [row["heat_flux_mid_face"] for row in (found[8.0], rows[number][-1])]
    assert rows[number][-1]["time"] > 9.1  # water is on again; it is off from 7 to 9 s
    assert abs(flux[0]) < 1e-9 * flux[1]  # nothing else cools it there


def test_conditions_of_a_slice_are_those_of_its_time(advanced: Any) -> None:
    strand, rows, _ = advanced
    young = slice_of(strand.base, strand.starts[12]).casting
    assert young.poured_superheat == 20.0 and young.travel.speed(0.0) < 3.0 / 60.0
    old = slice_of(strand.base, strand.starts[0]).casting
    assert old.poured_superheat == 40.0 and old.clock == pytest.approx(-200 / 60, abs=1e-6)
    assert old.travel.speed(-old.clock) == pytest.approx(0.06)
    heat = {number: found[-1]["heat_removed"] for number, found in rows.items()}
    assert heat[8] > heat[2]  # the slow-down cools it longer


def test_steady_casting_is_one_slice_at_every_instant() -> None:
    same = {"speed": ["3.6 m/min"] * 4, "superheat": None, "mould_heat": None}
    strand = Strand(caster({}, same))
    by_position: dict[float, float] = {}
    for clock in strand.instants:
        for one in strand.waiting(clock):
            row = Columns(one.loop.simulation).row(one.advance(clock))
            known = by_position.setdefault(round(row["position"], 9), row["heat_removed"])
            assert row["heat_removed"] == pytest.approx(known, rel=2e-4)
        strand.release(clock)
    strand.destroy()
    assert len(by_position) > 8


LOOKED_AT = {
    "caster.spacing": "0.5 s",
    "caster.moments": ["1 s", "3 s", "8 s"],
    "caster.pyrometer": [{"name": "hot", "at": "55 mm", "on": "mid_face"}],
}


def test_slices_under_equal_conditions_are_computed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All files agree byte for byte with those of separately computed slices."""
    taken: list[int] = []
    step = TimeLoop.advance
    monkeypatch.setattr(TimeLoop, "advance", lambda loop: (taken.append(1), step(loop))[1])
    counts = []
    for folder, most in (("shared", alike.MOST), ("alone", 0.0)):
        monkeypatch.setattr(Alike.__init__, "__defaults__", (most,))
        before = len(taken)
        run_caster(caster(LOOKED_AT), tmp_path / folder)
        counts.append(len(taken) - before)
    names = [*FILES, "pyrometers.csv", *(f"moments/strand_{t}s.vtu" for t in (1, 3, 8))]
    for name in names:
        whole = (tmp_path / "alone" / name).read_bytes()
        assert (tmp_path / "shared" / name).read_bytes() == whole, name
    assert len((tmp_path / "shared" / "pyrometers.csv").read_text().splitlines()) > 10
    assert 3 * counts[0] < 2 * counts[1]


def _by_clock(*values: Any) -> dict[str, Any]:
    return {"time": ["0 s", "4 s", "6 s"], "value": list(values)}


MOULD = {"name": "mould", "to": "100 mm"}
CONTACT = {"law": "contact", "wall": "160 degC"}
POWER = {"speed": ["1 m/min", "4 m/min"], "value": ["200 kW", "400 kW"]}


@pytest.mark.parametrize(
    ("cooling", "superheat", "speed"),
    [
        ([{}, {"flow": _by_clock("2 L/min", "2 L/min", "0.5 L/min")}], "40 K", 3.6),
        ([{"coefficient": "1600 W/(m^2 K)", "factor": _by_clock(1, 1, 0.7)}, {}], "40 K", 3.6),
        ([{}, {}], _by_clock("40 K", "40 K", "20 K"), 3.6),
        ([{"flux": "2 MW/m^2", "power": POWER}, {}], "40 K", 1.2),
    ],
    ids=["water", "factor", "superheat", "heat by the mean speed"],
)
def test_tables_of_the_case_are_included(
    cooling: list[Any],
    superheat: Any,
    speed: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Tables of the case itself depend on the clock; a scaled flux uses the future mean speed."""
    contact = cooling[0] or {"coefficient": "1600 W/(m^2 K)"}
    changes = {
        "cooling": [
            {**MOULD, "surface": [{**CONTACT, **contact}]},
            {"name": "ring", "to": "300 mm", "surface": [{**SPRAY, **cooling[1]}]},
        ],
        "casting.superheat": superheat, "caster.spacing": "0.5 s",
    }  # fmt: skip
    speeds = ["3.6 m/min", "3.6 m/min", f"{speed} m/min", f"{speed} m/min"]
    plant = {"speed": speeds, "superheat": None, "mould_heat": None}
    for folder, most in (("shared", alike.MOST), ("alone", 0.0)):
        monkeypatch.setattr(Alike.__init__, "__defaults__", (most,))
        run_caster(caster(changes, plant), tmp_path / folder)
    for name in FILES:
        whole = (tmp_path / "alone" / name).read_bytes()
        assert (tmp_path / "shared" / name).read_bytes() == whole, name


def test_stop_between_any_steps_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slice resumed between two instants also returns the earlier records of pyrometers."""
    places = [{"name": f"{at}", "at": f"{at} mm", "on": "corner"} for at in (2, 33, 61, 97)]
    changes = {"caster.pyrometer": places, "caster.end": "1 s", "caster.spacing": "0.5 s"}
    case = caster({**changes, "casting.length": "100 mm"})
    run_caster(case, tmp_path / "whole")
    stop, calls = 0, itertools.count(1)

    def stopping(_: Interrupt) -> None:
        if next(calls) == stop:
            raise Stopped("as by a signal")

    monkeypatch.setattr(Interrupt, "check", stopping)
    run_caster(case, tmp_path / "counted")
    for stop in range(2, next(calls), 2):
        calls = itertools.count(1)
        with pytest.raises(Stopped):
            run_caster(case, tmp_path / "stopped")
        run_caster(case, tmp_path / "stopped", resume=True)
        for name in (*FILES, "pyrometers.csv"):
            whole = (tmp_path / "whole" / name).read_bytes()
            assert (tmp_path / "stopped" / name).read_bytes() == whole, (stop, name)
        shutil.rmtree(tmp_path / "stopped")


def test_keys_of_equal_conditions() -> None:
    """For a speed that is constant, falls from 4 s, and is constant again from 5 s."""
    speeds = {"speed": ["3.6 m/min", "3.6 m/min", "1.2 m/min", "1.2 m/min"], "mould_heat": None}
    case = by_plant(caster({}, {**speeds, "superheat": ["40 K", "40 K", "40 K", "30 K"]}))
    starts = np.array([-2.5, -1.0, 0.25, 4.5, 5.0, 5.5, 20.0, 21.0])
    keys, until = alike.met(case, starts)
    assert until.tolist() == [4.0, 4.0, 4.0, 4.5, np.inf, np.inf, np.inf, np.inf]
    assert keys[0] == keys[1] and keys[6] == keys[7]
    assert keys[2] != keys[1]  # it is recorded at other ages
    assert keys[4] != keys[5] and keys[5] != keys[6]  # poured with another superheat
    assert len(set(keys)) == 6


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
    """Return a caster of five slices, at most two of which are in the machine."""
    return caster({"caster.spacing": "160 mm", "caster.every": "3 s", "casting.length": "170 mm"})


def watched() -> Case:
    """Return a caster with a pyrometer and a moment."""
    return caster(
        {"caster.pyrometer": [{"name": "exit", "at": "150 mm"}], "caster.moments": ["4 s"]}
    )


MORE = "pyrometers.csv", "strand.pvd", "moments/strand_4s.vtu"


def strained_caster() -> Case:
    """Return a caster with mechanics, through a stop."""
    return caster(STRAINED, STOP)


@pytest.mark.mpi
@pytest.mark.parametrize("made", [caster, few, watched, strained_caster])
def test_ranks_agree(made: Callable[[], Case], tmp_path: Path) -> None:
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
    """Return a folder with the case, the program, and the result of one rank."""
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
def test_killed_caster_resumes_on_other_ranks(
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
def test_signal_to_one_rank_stops_all(whole: Path, tmp_path: Path) -> None:
    words = [str(whole / "program.py"), str(whole / "case.toml"), str(tmp_path)]
    ended = python_on(2, *words, "1")
    assert ended.returncode == 130, ended.stderr
    assert RunRecord.load(tmp_path).status == "interrupted"
    assert python_on(1, *words, "-1").returncode == 0 and _is_as_one(whole, tmp_path)


@needs_mpirun
def test_three_ranks_with_two_slices(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "few.toml").write_text(few().resolved_toml())
    words = [str(whole / "program.py"), str(tmp_path / "few.toml"), str(tmp_path / "three"), "-1"]
    assert python_on(3, *words).returncode == 0
    run_caster(few(), tmp_path / "one")
    numbers, _, _ = read_table(tmp_path / "one" / "caster.csv")
    assert numbers["slices"].max() == 2
    for name in FILES:
        assert (tmp_path / "three" / name).read_bytes() == (tmp_path / "one" / name).read_bytes()


@needs_mpirun
def test_command_on_two_ranks(whole: Path, tmp_path: Path) -> None:
    words = ["-m", "castfem.cli", "caster", str(whole / "case.toml"), "-o"]
    made = python_on(2, *words, str(tmp_path / "out"))
    assert made.returncode == 0, made.stderr
    assert _is_as_one(whole, tmp_path / "out") and made.stdout.count("the strand leaves") == 1
    refused = python_on(2, *words, str(tmp_path / "out"), "--set", "caster.spacing=9 m")
    assert refused.returncode == 1 and "Traceback" not in refused.stderr
    assert refused.stderr.count("leaves no slice within casting.length") == 1
