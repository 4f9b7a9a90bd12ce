"""A caster that follows a file of the plant gives the files of the complete history."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_caster import caster
from test_caster_exact import ZONES

from castfem.base.errors import InputError
from castfem.model import load_case
from castfem.model.caster_slices import by_plant, slice_of
from castfem.model.shipped_cases import find
from castfem.runs.caster.files import read_table
from castfem.runs.caster.plant_file import PlantFile, recent
from castfem.runs.caster.run import run_caster
from castfem.runs.output.run_record import RunRecord

FILES = "strand.csv", "slices.csv"
HEAD = "time [s], speed [m/min], superheat [K], mould_heat [-], ring [L/min], event"
GOOD = (
    "0, 3.6, 40, 1, 2,", "1, 3.6, 40, 1, 2,", "2.2, 3.7, 40, 1, 2, ladle change",
    "3, 0, 40, 1, 2, stop", "4.4, 0, 20, 0.8, 1,", "5, 1.2, 20, 0.8, 1,", "9, 2.0, 20, 0.8, 0,",
)  # fmt: skip
FAULTY = "2.5, fast, 40, 1, 2,", "2, 3.6, 40, 1, 2,", "2.6, -1, 40, 1, 2,", "2.7, 3.6, , 1, 2,"


def of_file(path: Path, **changes: Any) -> Any:
    """Return the small caster with water, whose plant is a file."""
    return caster({**ZONES, "caster.plant": {"file": str(path)}, **changes})


def add(path: Path, rows: Sequence[str]) -> None:
    """Append rows, the last in two pieces."""
    with path.open("a") as file:
        file.write("".join(f"{row}\n" for row in rows[:-1]) + rows[-1][:4])
        file.flush()
        time.sleep(0.05)
        file.write(f"{rows[-1][4:]}\n")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a caster with a complete history, and its file."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "plant.csv").write_text("\n".join([HEAD, *GOOD]) + "\n")
    run_caster(of_file(folder / "plant.csv"), folder)
    return folder


def same(one: Path, other: Path) -> bool:
    """Return whether two folders have the same strand, byte for byte, and the same totals.

    The length of the youngest slice is known once the next one has its start. It is 40 mm until
    then; starts are rounded to 1e-6 s, which at 3.7 m/min is 1.5e-6 of that. The power of the
    strand is a difference of two instants, and may have twice that error.
    """
    (here, _, events), (there, _, others) = (read_table(f / "caster.csv") for f in (one, other))
    heat = [here.pop("cooling_power"), there.pop("cooling_power")]
    assert max(abs(found.pop("energy_error")).max() for found in (here, there)) < 1e-12
    alike = events == others and all(np.array_equal(here[n], there[n], True) for n in here)
    alike = alike and all((one / n).read_bytes() == (other / n).read_bytes() for n in FILES)
    return alike and np.allclose(*heat, rtol=3.1e-6, atol=0.0, equal_nan=True)


def test_growing_file_is_followed(whole: Path, tmp_path: Path) -> None:
    plant, folder = tmp_path / "plant.csv", tmp_path / "out"
    plant.write_text(f"{HEAD}\n{GOOD[0]}\n")
    source, seen, over = PlantFile(plant), [], threading.Event()
    assert source.take() == 1

    def write() -> None:
        for row in (*GOOD[1:3], *FAULTY, *GOOD[3:]):
            time.sleep(0.3)
            add(plant, [row])

    def read() -> None:  # another program: its files are complete at any moment
        while not over.wait(0.01):
            if (folder / "now.json").is_file():
                seen.append(json.loads((folder / "now.json").read_text()))
                read_table(folder / "now.csv")

    threads = [threading.Thread(target=one) for one in (write, read)]
    for one in threads:
        one.start()
    try:
        run_caster(of_file(whole / "plant.csv", **{"caster.end": "9 s"}), folder, source=source)
    finally:
        over.set()
        for one in threads:
            one.join()
    assert same(whole, folder)
    assert source.left_out == len(FAULTY) and len(source) == len(GOOD)
    log = (folder / "run.log").read_text()
    for text in ("line 5: speed (fast)", "line 6: time (2 s) does not exceed that of the pr",
                 "line 7: speed (-1", "line 8: superheat is empty"):  # fmt: skip
        assert text in log
    assert len({state["clock"] for state in seen}) >= 3
    now = json.loads((folder / "now.json").read_text())
    assert now["clock"] == now["last_row"] == 9.0 and now["left_out"] == 4 and now["rows"] == 7
    rows, units, _ = read_table(folder / "now.csv")
    strand, _, _ = read_table(folder / "strand.csv")
    last = strand["clock"] == 9.0
    for name, values in rows.items():
        np.testing.assert_array_equal(values, strand[name][last])
    assert now["units"]["position"] == units["position"] == "m"
    assert [one["position"] for one in now["slices"]] == pytest.approx(rows["position"], rel=1e-11)


def wait_for(condition: Any, process: subprocess.Popen[str]) -> None:
    """Wait until a condition holds of a running process."""
    while not condition():
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)


@pytest.fixture
def followed(whole: Path, tmp_path: Path) -> Iterator[Any]:
    """Return a function that starts the command on a file of rows."""
    (tmp_path / "case.toml").write_text(
        of_file(
            whole / "plant.csv", **{"caster.end": "9 s", "caster.longest_gap": "5 s"}
        ).resolved_toml()
    )
    begun: list[subprocess.Popen[str]] = []

    def start(*words: str) -> subprocess.Popen[str]:
        command = [
            sys.executable, "-m", "castfem.cli", "caster", "case.toml", "--follow", "plant.csv",
            "-o", "out", "--no-figures", *words,
        ]  # fmt: skip
        begun.append(
            subprocess.Popen(
                command,
                cwd=tmp_path,
                stderr=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
            )
        )
        return begun[-1]

    yield start
    for process in begun:
        if process.poll() is None:
            process.kill()
        process.communicate()


def test_sigterm_saves_and_resume_continues(followed: Any, whole: Path, tmp_path: Path) -> None:
    plant, now = tmp_path / "plant.csv", tmp_path / "out" / "now.json"
    first = followed()
    plant.write_text(f"{HEAD}\n")  # later than the command
    add(plant, [*GOOD[:3], *FAULTY[:1]])
    wait_for(lambda: now.is_file() and json.loads(now.read_text())["rows"] == 3, first)
    first.send_signal(signal.SIGTERM)
    _, err = first.communicate()
    assert first.returncode == 130 and "interrupted" in err
    record = RunRecord.load(tmp_path / "out")
    assert record.status == "interrupted" and "SIGTERM" in record.reason
    assert not same(whole, tmp_path / "out")
    add(plant, GOOD[3:])
    second = followed("--resume")
    _, err = second.communicate()
    assert second.returncode == 0, err
    assert same(whole, tmp_path / "out")
    again = followed()  # the case in the folder has all rows
    assert again.wait() == 0 and same(whole, tmp_path / "out")
    plant.write_text(plant.read_text().replace("0, 3.6", "0, 3.5", 1))
    third = followed("--resume")
    _, err = third.communicate()
    assert third.returncode == 1 and "are not those that were followed before" in err


def test_incoming_lines_are_read(
    tmp_path: Path, told: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "plant.csv"
    source = PlantFile(path)
    assert source.take() == 0 and len(source) == 0
    path.write_bytes(
        "\ufefftime [min]; speed [m/min]; event\r\n# by hand\r\n0; 0; before\r\n".encode()
    )
    assert source.take() == 1 and source.plant().values["speed"][-1] > 0.0
    with path.open("a") as file:
        file.write("1; 1,2; begun\n1,5; 1,25")
    assert source.take() == 1
    with path.open("a") as file:
        file.write("; \n5; 1,3; \n6; 1,3; ; 7; 8\n")
    assert source.take() == 2 and source.last == 300.0
    assert "line 6: no row between 90 s and 300 s" in told.text
    assert "line 7: 5 cells, not 3" in told.text
    plant = source.plant()
    assert plant.times[:4] == (0.0, 60.0, 90.0, 300.0) and plant.events[:2] == ("before", "begun")
    assert plant.values["speed"][1:4] == pytest.approx((0.02, 1.25 / 60.0, 1.3 / 60.0))
    path.write_text("time [min]; speed [m/min]; event\n6; 1,3; \n")  # begun again
    assert source.take() == 1 and "is shorter than before" in told.text
    assert "no row since" not in told.text
    monkeypatch.setattr("castfem.runs.caster.plant_file.LATE", 1e-9)
    assert source.take() == source.take() == 0
    assert told.text.count("no row since that of 360 s") == 1


def test_file_replaces_the_plant_of_a_case(tmp_path: Path) -> None:
    path = tmp_path / "plant.csv"
    path.write_text("time [s], speed [m/min], event\n0, 1.1, begun\n")
    source = PlantFile(path)
    source.take()
    caster = load_case(find("slab1200/ladle_change"), [source.assignment()]).caster
    assert caster is not None and set(caster.plant.values) == {"speed"}
    assert caster.plant.times[0] == 0.0 and caster.plant.events[0] == "begun"


def test_rows_of_no_remaining_slice_are_left_out(whole: Path) -> None:
    case = of_file(whole / "plant.csv")
    start = 4.5
    ends = []
    for one in (case, recent(case, start)):
        casting = slice_of(by_plant(one), start).casting
        ends.append([casting.travel.position(age) for age in np.linspace(0.0, 4.4, 45)])
    assert ends[0] == ends[1]
    assert recent(case, start).caster.plant.times == (2.2, 3.0, 4.4, 5.0, 9.0)  # at rest at 3 s
    assert recent(case, 6.0).caster.plant.times == (5.0, 9.0)
    assert recent(case, -1.0) is case


def test_incomplete_header_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "plant.csv"
    path.write_text("time [s], superheat [K]\n0, 20\n")
    with pytest.raises(InputError, match=r"plant.csv: needs the column 'speed'"):
        PlantFile(path).take()
