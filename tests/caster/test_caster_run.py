"""Runs of a caster: files, end of the pool, refused input, and resume."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from ranks import python_on
from small_case import strip
from small_caster import STOP, STRAINED, caster

import castfem
from castfem.base.errors import CannotWrite, CaseError, InputError
from castfem.base.progress import Progress
from castfem.cli import execute
from castfem.model.build.simulation import build_mesh
from castfem.model.caster_slices import by_plant, cast_of
from castfem.model.load import read_case
from castfem.runs.caster.demand import demand
from castfem.runs.caster.files import GrowingTable, read_table
from castfem.runs.caster.run import run_caster
from castfem.runs.interrupt import Stopped
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.run_record import RunRecord

FILES = "caster.csv", "strand.csv", "slices.csv"
STEP = {"time": ["0 s", "20 s", "21 s", "60 s"],
        "speed": ["1 m/min", "1 m/min", "2 m/min", "2 m/min"],
        "event": ["", "faster", "", ""]}  # fmt: skip
COOL = {"law": "convection", "coefficient": "1500 W/(m^2 K)", "ambient": "25 degC"}


def dwelling(length: str, **changes: Any) -> Any:
    """Return a thin strip that is cooled uniformly: its state depends only on its age."""
    cooled = {"name": "all along", "surface": [COOL]}
    table = {"plant": STEP, "spacing": "40 mm", "every": "1 s", **changes}
    return strip({"casting.length": length, "cooling": [cooled], "caster": table})


@pytest.fixture(scope="module")
def stepped(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return a caster of the strip through a step in speed, and its folder."""
    case, folder = dwelling("0.7 m"), tmp_path_factory.mktemp("stepped")
    run_caster(case, folder)
    return case, folder


def test_pool_ends_at_the_position_of_the_solid_age(stepped: Any) -> None:
    case, folder = stepped
    single = castfem.run(case.with_({"casting.speed": "1 m/min", "output.every": "1 s"}))
    solid_after = single.quantities["metallurgical_length"] / (1.0 / 60.0)
    numbers, units, words = read_table(folder / "caster.csv")
    assert units["metallurgical_length"] == "m" and 12.0 < solid_after < 40.0
    time, pool = numbers["time"], numbers["metallurgical_length"]

    def cast(until: np.ndarray) -> np.ndarray:  # the integral of the speed, by hand
        ramp = np.clip(until - 20.0, 0.0, 1.0)
        later = np.maximum(until - 21.0, 0.0)
        before = np.minimum(until, 20.0)
        return (before + ramp + 0.5 * ramp**2 + 2.0 * later) / 60.0

    # Steps are right to 1 K each: slices become solid within one per cent of each other.
    expected = cast(time) - cast(time - solid_after)
    assert np.isfinite(pool).all() and pool.max() > 1.9 * pool.min()
    assert pool == pytest.approx(expected, rel=1e-2)
    assert pool[0] == pytest.approx(single.quantities["metallurgical_length"], rel=1e-2)
    assert words["event"][20] == "faster" and not any(words["event"][21:])


def test_slices_have_the_place_where_they_became_solid(stepped: Any) -> None:
    case, folder = stepped
    slices, _, _ = read_table(folder / "slices.csv")
    cast = cast_of(case)
    start, length = slices["start"], slices["metallurgical_length"]
    ages = [cast.when(cast.length(s) + z) - s for s, z in zip(start, length, strict=True)]
    assert len(ages) > 30 and np.ptp(ages) < 1.5e-2 * np.mean(ages)
    assert slices["position"] == pytest.approx(np.full(len(ages), 0.7), rel=1e-9)


def test_heat_of_the_strand_is_balanced(stepped: Any) -> None:
    _, folder = stepped
    numbers, _, _ = read_table(folder / "caster.csv")
    assert np.abs(numbers["energy_error"]).max() < 1e-12
    # In steady casting the strand loses what one slice loses on its way, at the casting speed.
    strand, _, _ = read_table(folder / "strand.csv")
    steady = numbers["time"] <= 20.0
    last = strand["position"][strand["clock"] == 20.0].argmax()
    assert np.diff(strand["clock"]).min() == 0.0
    given = strand["cooling_power"][strand["clock"] == 20.0][last]  # to just above the end
    power = numbers["cooling_power"][steady][2:]
    assert power.mean() == pytest.approx(given, rel=0.02)


def test_liquid_that_leaves_the_machine_is_reported(tmp_path: Path) -> None:
    from castfem.post.report.caster import answers

    case = dwelling("0.5 m", end="34 s")
    run_caster(case, tmp_path)
    numbers, _, _ = read_table(tmp_path / "caster.csv")
    pool = numbers["metallurgical_length"]
    assert np.isfinite(pool[0]) and np.isnan(pool[-1])
    text = "\n".join(answers(tmp_path, case))
    assert "leaves the machine (500 mm) with liquid" in text and "pool is longest" in text
    assert "pool is longest within the machine at" in text  # it was longer where it left
    assert "faster" in text


class Halted(Progress):
    """Progress display that raises an error at a given call."""

    def __init__(self, after: int, error: type[BaseException]) -> None:
        super().__init__(-1)
        self._after, self._error = after, error

    def update(self, *args: Any, **kwargs: Any) -> None:
        self._after -= 1
        if not self._after:
            raise self._error


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an uninterrupted caster."""
    folder = tmp_path_factory.mktemp("whole")
    run_caster(caster(), folder)
    return folder


@pytest.mark.parametrize("error", [RuntimeError, Stopped])
@pytest.mark.parametrize("after", [3, 8, 40])
def test_interrupted_caster_resumes_to_the_same_files(
    after: int, error: type[BaseException], whole: Path, tmp_path: Path
) -> None:
    with pytest.raises(error):
        run_caster(
            caster(), tmp_path / "cut", progress=Halted(after, error),
            save_every=0.0 if error is RuntimeError else 1e9,
        )  # fmt: skip
    if error is Stopped:  # saved within an instant
        assert RunRecord.load(tmp_path / "cut").status == "interrupted"
        assert (tmp_path / "cut" / "checkpoint.h5").is_file()
    run_caster(caster(), tmp_path / "cut", resume=True)
    for name in FILES:
        assert (whole / name).read_bytes() == (tmp_path / "cut" / name).read_bytes(), name
    assert RunRecord.load(tmp_path / "cut").status == "finished"


@pytest.mark.parametrize("name", FILES)
def test_disk_that_fills_between_two_tables(
    name: str, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The instant is removed from all tables, and the balance is not counted twice."""
    append, left = GrowingTable.append, [9]

    def full(table: GrowingTable, rows: Any) -> None:
        left[0] -= table._path.name == name
        if left[0] == 0:
            raise CannotWrite(f"{name}: cannot be written")
        append(table, rows)

    with monkeypatch.context() as patch:
        patch.setattr(GrowingTable, "append", full)
        with pytest.raises(CannotWrite):
            run_caster(caster(), tmp_path / "cut")
    assert RunRecord.load(tmp_path / "cut").status == "failed"
    run_caster(caster(), tmp_path / "cut", resume=True)
    for one in FILES:
        assert (whole / one).read_bytes() == (tmp_path / "cut" / one).read_bytes(), one


def test_full_disk_keeps_the_last_checkpoint(whole: Path, tmp_path: Path) -> None:
    path, size = _written(caster(), tmp_path), (whole / "checkpoint.h5").stat().st_size
    with pytest.raises(Stopped):
        run_caster(caster(), tmp_path / "out", progress=Halted(20, Stopped))
    kept = (tmp_path / "out" / "checkpoint.h5").read_bytes()
    words = ["caster", str(path), "-o", str(tmp_path / "out"), "--no-figures", "-q", "--resume"]
    program = (
        "import resource, sys; from mpi4py import MPI; from castfem.cli import execute;"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({3 * size // 4}, -1));"
        f"sys.exit(execute({words}))"
    )
    ended = python_on(1, "-c", program)
    assert ended.returncode == 2 and ended.stderr.count("\n") == 1, ended.stderr
    assert "/out/checkpoint.h5: cannot be written" in ended.stderr
    assert "free some space, and give the command again" in ended.stderr
    assert RunRecord.load(tmp_path / "out").status == "failed"
    assert (tmp_path / "out" / "checkpoint.h5").read_bytes() == kept
    assert execute(words) == 0
    for one in FILES:
        assert (whole / one).read_bytes() == (tmp_path / "out" / one).read_bytes(), one


def test_mechanics_resume_to_the_same_files(tmp_path: Path) -> None:
    case = caster(STRAINED, STOP)
    run_caster(case, tmp_path / "whole")
    strand, units, _ = read_table(tmp_path / "whole" / "strand.csv")
    assert units["von_mises_max"] == "MPa" and strand["von_mises_max"].max() > 1.0
    numbers, _, _ = read_table(tmp_path / "whole" / "caster.csv")
    assert np.abs(numbers["energy_error"]).max() < 1e-9  # fed liquid brings heat
    with pytest.raises(Stopped):
        run_caster(case, tmp_path / "cut", progress=Halted(12, Stopped))
    assert 1.0 < RunRecord.load(tmp_path / "cut").reached["time"] < 2.1  # the strand is at rest
    run_caster(case, tmp_path / "cut", resume=True)
    for name in FILES:
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "cut" / name).read_bytes()


def test_checkpoint_of_another_caster_is_refused(tmp_path: Path) -> None:
    run_caster(caster(), tmp_path)
    other = caster(plant={"speed": ["3.6 m/min", "3.6 m/min", "1.3 m/min", "2 m/min"]})
    with pytest.raises(InputError, match=r"belongs to another case .caster.plant.speed"):
        run_caster(other, tmp_path, resume=True)


def test_checkpoint_of_an_earlier_castfem_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_caster(caster(), tmp_path)

    def without_looks(path: Path, **physics: str) -> Any:
        meta, arrays = load_checkpoint(path, **physics)
        return {name: value for name, value in meta.items() if name != "looks"}, arrays

    monkeypatch.setattr("castfem.runs.caster.run.load_checkpoint", without_looks)
    with pytest.raises(InputError, match=r"checkpoint\.h5: was written by an earlier castfem"):
        run_caster(caster(), tmp_path, resume=True)


def test_stop_is_followed(tmp_path: Path) -> None:
    plant = {"time": ["0 s", "1 s", "1.1 s", "3 s", "3.1 s", "9 s"],
             "speed": ["3.6 m/min", "3.6 m/min", "0 m/min", "0 m/min", "3.6 m/min", "3.6 m/min"],
             "superheat": None, "mould_heat": None, "event": None}  # fmt: skip
    run_caster(caster(plant=plant), tmp_path)
    strand, _, _ = read_table(tmp_path / "strand.csv")
    before, after = (strand["position"][strand["clock"] == at] for at in (1.5, 3.0))
    assert before == pytest.approx(after, abs=1e-9) and len(before) > 3
    early, late = (strand["shell_mid_face"][strand["clock"] == at] for at in (1.5, 3.0))
    assert (late[1:] > early[1:]).all()


@pytest.mark.parametrize("spacing", ["150 mm", "0.5 s"])
def test_spacings(spacing: str, tmp_path: Path) -> None:
    case = caster({"caster.spacing": spacing, "caster.every": "3 s"})
    found = castfem.caster(case, tmp_path)
    ages = found.strand["time"] if spacing == "0.5 s" else found.strand["position"]
    apart = np.diff(ages[found.strand["clock"] == 0.0])
    assert apart == pytest.approx(
        np.full(len(apart), 0.5 if spacing == "0.5 s" else 0.15), abs=1e-5
    )
    assert found.strand.attrs["units"]["shell_mid_face"] == "mm"


REFUSED: list[tuple[Mapping[str, Any], Mapping[str, Any], str]] = [
    ({}, {"superheat": ["40 K", "-1 K", "20 K", "20 K"]}, r"row 2: superheat \(-1 K\): must not"),
    ({}, {"speed": ["1 m/min", "-1 m/min", "1 m/min", "1 m/min"]}, r"row 2: speed.*must not be"),
    ({}, {"speed": ["0 m/min", "1 m/min", "1 m/min", "1 m/min"]}, "begins with the strand at rest"),
    ({}, {"speed": ["1 m/min", "1 m/min", "1 m/min", "0 m/min"]}, "ends with the strand at rest"),
    ({}, {"time": ["0 s", "5 s", "4 s", "9 s"]}, r"row 3: time \(4 s\) does not exceed"),
    ({}, {"ring 7": ["1 L/min"] * 4}, "column 'ring 7' is not a circuit, or a zone with one spray"),
    ({}, {"speed": None}, "needs the column 'speed'"),
    ({}, {"speed": ["1 m/min", "", "1 m/min", "1 m/min"]}, "row 2: speed is empty"),
    ({"caster.end": "20 s"}, {}, r"caster.end: \(20 s\): the plant's history goes from 0 s to 9 s"),
    ({"caster.longest_gap": "2 s"}, {}, "has no row between 0 s and 4 s"),
    ({"caster.spacing": "10 m"}, {}, "caster.spacing: .*leaves no slice within casting.length"),
    ({"casting.start": {"time": "3 s"}}, {}, "casting.start.time.*has its own"),
    ({"casting.start": {"at": "mould_exit"}}, {}, "begin at the meniscus"),
]


@pytest.mark.parametrize(("changes", "plant", "message"), REFUSED)
def test_invalid_input_is_rejected(
    changes: Mapping[str, Any], plant: Mapping[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message) as error:
        caster(changes, plant)
    assert all("\n" not in line for line in error.value.problems)


def test_water_that_is_off_gives_a_warning(tmp_path: Path) -> None:
    spray = {"law": "spray", "correlation": "nozaki", "water_temperature": "25 degC"}
    ring = {"name": "ring", "to": "300 mm", "surface": [{**spray, "flow": "2 L/min"}]}
    warning = "caster.plant: 'ring' has no water at 4 s, and the strand moves"
    for last, speed, found in (("0 L/min", "1 m/min", [warning]), ("0 L/min", "0 m/min", [])):
        speeds = ["1 m/min", speed, "1 m/min", "1 m/min"]
        plant = {"ring": ["2 L/min", last, "2 L/min", "2 L/min"], "speed": speeds}
        plant["mould_heat"] = []  # left out
        path = _written(caster({"cooling": [ring]}, plant), tmp_path)
        warnings = read_case(path, []).warnings
        assert [one for one in warnings if "caster.plant" in one] == [
            f"{path}: {text}" for text in found
        ]


def test_demand_of_a_run_is_estimated() -> None:
    mesh = build_mesh(caster()).vertices
    with pytest.raises(CaseError, match=r"caster: the table is missing; add \[caster\] with"):
        demand(caster().model_copy(update={"caster": None}), mesh)
    with pytest.raises(
        InputError, match=r"caster.spacing: 2000001 slices at once take about .* GB"
    ):
        demand(caster({"caster.spacing": "0.1 um", "caster.every": "9 s"}), mesh)
    line = demand(caster({"caster.spacing": "1 mm", "caster.every": "9 s"}), mesh)
    own = build_mesh(caster(STRAINED, STOP)).vertices
    strained = demand(caster({**STRAINED, "caster.spacing": "2 mm"}, STOP), own)
    assert 820 < int(strained.rpartition("about ")[2].split()[0]) < 850  # MB: 51 of 10.9, and 280
    found = re.fullmatch(r"(\d+) slices, 201 at once, 2 instants; about (\d+) MB", line)
    assert found is not None and int(found[1]) == 587 and int(found[2]) > 300


def test_history_in_a_file(tmp_path: Path) -> None:
    lines = ["time [min],speed [m/min],superheat [K],event", "0,3.6,40,", "0.15,3.6,20,new, ladle"]
    (tmp_path / "plant.csv").write_text("\n".join(lines).replace("new, ladle", '"new, ladle"'))
    columns = {"file": str(tmp_path / "plant.csv")}
    read = caster({"caster.plant": columns}).caster
    assert read is not None and read.plant.times == (0.0, 9.0)
    assert read.plant.values["speed"] == pytest.approx((0.06, 0.06))
    assert read.plant.events == ("", "new, ladle")
    even = caster(plant={"speed": ["3 m/min"] * 4}).caster
    assert even is not None and even.plant.table("speed").arguments == (0.0,)
    assert by_plant(caster(plant={"speed": ["3 m/min"] * 4})).casting.speed == 0.05
    case = caster({"caster.plant": columns})
    again = castfem.load(_written(case, tmp_path))
    assert again.caster == case.caster  # without the file
    (tmp_path / "plant.csv").write_text(lines[0] + "\n0,3.6,40,\n1,,40,\n")
    with pytest.raises(InputError, match=r"plant.csv' line 3: speed is empty"):
        caster({"caster.plant": columns})


def _written(case: Any, folder: Path) -> Path:
    path = folder / "case.toml"
    path.write_text(case.resolved_toml())
    return path


def test_command_prints_and_writes_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, folder = _written(caster(), tmp_path), tmp_path / "out"
    assert execute(["caster", str(path), "-o", str(folder), "--units", "si"]) == 0
    printed = capsys.readouterr()
    assert "15 slices, 6 at once, 19 instants; about 1" in printed.err
    assert "leaves the machine (0.2 m) with liquid at 19 of 19 instants" in printed.out
    assert "4 s: ladle change" in printed.out and f"in {folder}" in printed.out
    assert (folder / "figures" / "strand_over_time.png").read_bytes().startswith(b"\x89PNG")
    assert execute(["show", str(folder)]) == 0 and "200 mm" in capsys.readouterr().out
    for words in (["compare"], ["report"]):
        assert execute([*words, str(folder), str(folder)]) == 1
        assert "is a caster of many slices" in capsys.readouterr().err
    assert execute(["strand", str(folder)]) == 1
    assert "many slices; caster.moments writes them" in capsys.readouterr().err
    (tmp_path / "none.toml").write_text(
        caster().model_copy(update={"caster": None}).resolved_toml()
    )
    assert execute(["caster", str(tmp_path / "none.toml")]) == 1
    assert f"{tmp_path}/none.toml: caster: the table is missing" in capsys.readouterr().err
    assert execute(["check", str(path)]) == 0 and "caster: 15 slices" in capsys.readouterr().out


def test_single_run_ignores_the_table(tmp_path: Path) -> None:
    case = caster()
    assert case.physics_hash() == case.model_copy(update={"caster": None}).physics_hash()
    assert MPI.COMM_WORLD.size == 1
