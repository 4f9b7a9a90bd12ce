"""Readings of the slab's defect tables from a run: rows, faces, rolls."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rolls_of_file import rolls_of

from benchmarks import slab_error, slab_sprays, slabs
from benchmarks.report import Output
from castfem.model import load_case
from castfem.physics.machine.rolls import Rolls
from castfem.physics.machine.stations import Stations
from castfem.runs.output.surface_maps import SurfaceLine

CASES = Path(__file__).parents[2] / "cases" / "slab1200"


def rolls() -> Rolls:
    return rolls_of(load_case(CASES / "reference.toml"))


@pytest.fixture(scope="module")
def stations() -> Stations:
    return Stations(rolls(), 0.22, 0.8)


class Maps:
    """Map rows at some rolls; mid-width and corner of both wide faces."""

    def __init__(self, stations: Stations, numbers: tuple[int, ...]) -> None:
        assert stations.rolls is not None
        self.position = np.array([stations.rolls.pairs[n - 1].position for n in numbers])
        place = np.array([[0.0, -0.11], [0.6, -0.11], [0.6, 0.11], [0.0, 0.11]])
        line = SurfaceLine(
            np.arange(4), place, np.array([0.0, 0.6, 0.82, 1.42]),
            ("extrados", "narrow face", "intrados"), np.array([0, 0, 2, 2]),
            np.array([0.6, 0.0, 0.0, 0.6]), False,
        )  # fmt: skip
        self.heading = SimpleNamespace(line=line, band=(1073.15, 1223.15))
        shape = (len(numbers), 4)
        self.values = {"temperature": np.full(shape, 1300.0)}
        self.values |= {"I1": np.zeros(shape), "I2": np.zeros(shape)}

    def __getitem__(self, name: str) -> Any:
        return self.values[name]


def test_indexes_near_a_misaligned_roll(stations: Stations) -> None:
    """Beyond #47, up to #50, by face: values outside are not used."""
    maps: Any = Maps(stations, (47, 48, 49, 50, 51))
    maps["I1"][:, 1] = 90e6, 10e6, 20e6, 30e6, 80e6
    maps["I2"][:, 2] = 9e-4, 1e-4, 3e-4, 2e-4, 8e-4
    found = slabs._between(maps, stations, slabs.DEFECT)
    assert found["defect_extrados_I1"] == pytest.approx(30.0)
    assert found["defect_intrados_I1"] == 0.0
    assert found["defect_intrados_I2"] == pytest.approx(30.0)
    assert found["defect_extrados_I2"] == 0.0


def test_largest_index_of_a_phase(stations: Stations) -> None:
    maps: Any = Maps(stations, (12, 15, 30, 56, 57))
    maps["I1"][:, 2] = 1e6, 2e6, 99e6, 5e6, 7e6
    maps["I1"][1, 1] = 4e6
    maps["temperature"][4, 2] = 1093.15
    found = slabs._worst(maps, stations, "straightening")
    assert found["straightening_place"].startswith("intrados, corner")
    assert found["straightening_roll"] == 57
    assert found["straightening_warm"] == pytest.approx(820.0)
    found = slabs._worst(maps, stations, "bending")
    assert found["bending_place"].startswith("extrados, corner")
    assert found["bending_roll"] == 15


def test_surface_between_the_rolls_with_less_water(stations: Stations) -> None:
    maps: Any = Maps(stations, (47, 49, 52, 53))
    maps["temperature"][:, 3] = 0.0, 1173.15, 1273.15, 0.0
    found = slabs._surface(maps, stations)
    assert found["warm_intrados"] == pytest.approx(950.0)
    assert found["band_intrados"] == pytest.approx(25.0)  # one of four
    assert found["band_extrados"] == 0.0


def test_largest_effort_and_its_roll(stations: Stations) -> None:
    assert stations.rolls is not None
    at = [stations.rolls.pairs[n - 1].position for n in (50, 55, 57)]
    history = pd.DataFrame({"position": at, "effort": [90.0, 110.0, 20.0]})
    history.attrs["units"] = {"effort": "kN"}
    assert slabs._effort(history, stations) == {"effort": 110.0, "effort_roll": 55}


def test_unfinished_run_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert slabs._case(tmp_path / "locked_48") is None
    assert "locked_48: not finished, left out" in capsys.readouterr().out


def test_value_of_the_thesis_is_in_brackets(tmp_path: Path) -> None:
    assert slabs._beside({"a": 34.26, "a_thesis": 41.1}, "a") == "34.3 (41.1)"
    assert slabs._beside({"a": 34.26, "a_thesis": None}, "a") == "34.3"
    assert Output(tmp_path).rows("slab_defects") == []


def test_best_known_result_has_fine_cells_and_windows(tmp_path: Path) -> None:
    """If a result depends on both, it is that of fine cells with short windows; lines by rms."""
    rows = []
    for one in (*slab_error.SETTINGS[:6], slab_error.SHIPPED):
        value = 10.0 + 2.0 * one.size + 0.1 * one.window
        line = " ".join(f"{0.001 * (value + shift):.7g}" for shift in (0.0, 3.0))
        row: dict[str, Any] = dict.fromkeys(slab_error.COMPARED, value)
        row |= dict.fromkeys(slab_error.ALONG, line)
        given = {"name": one.name, "size": one.size, "window": one.window, "what": one.what}
        rows.append(
            given | {"cells": 1, "windows": 1, "newton": 1, "seconds": 1.0, "failure": ""} | row
        )
    output = Output(tmp_path, "slab_error.md")
    output.csv("slab_error", rows)
    table = {row["name"]: row for row in slab_error._runs_with_errors(output)}
    assert table[slab_error.EVENLY.name]["effort"] == pytest.approx(2.0 * 2.5 + 0.1 * 25.0)
    assert table[slab_error.FINE_CELLS.name]["effort"] == pytest.approx(0.1 * 25.0)
    assert table[slab_error.EVENLY.name]["surface"] == pytest.approx(7.5e-3)
    assert table[slab_error.EVENLY.name]["bulge"] == pytest.approx(7.5)  # um of mm
    slab_error.show(output)
    assert "| **5** | **25** | growing, 3e-5 |" in output.page.read_text(encoding="utf-8")


def test_heat_is_assigned_to_the_zones_of_the_face() -> None:
    """With one flux each has its share of the length; twice the flux on one face counts twice."""
    case = load_case(CASES / "sprays.toml")
    at = np.arange(0.8, 18.0, 0.002)
    flux = {f"heat_flux_mid_face_{face}": np.full(len(at), 1e6) for face in slab_sprays.SIDES}
    history = pd.DataFrame({"position": at, "time": at / 0.02} | flux)
    machine = rolls()
    (bender, *_, last) = slab_sprays._heat(case, machine, history)
    met = {face: slab_sprays.faces_met(case, machine, 18.0)[face] for face in slab_sprays.SIDES}
    low, high = machine.pairs[48].position, machine.pairs[56].position
    for kind in ("contact", "spray"):
        way = sum(
            np.clip(s.end, low, high) - np.clip(s.start, low, high)
            for face in met.values() for s in face if s.kind == kind
        )  # fmt: skip
        assert last[kind] == pytest.approx(100.0 * way / (2.0 * (high - low)), rel=1e-6)
    assert sum(v for v in bender.values() if isinstance(v, float)) == pytest.approx(100.0)


def test_surface_falls_under_sprays_and_rolls() -> None:
    """A surface up to 40 K colder in each spray, 20 K at each roll; the extrados 50 K warmer."""
    case, machine = load_case(CASES / "sprays.toml"), rolls()
    at = np.arange(0.8, 18.0, 0.001)
    line = np.full(len(at), 900.0)
    for stretch in slab_sprays.faces_met(case, machine, 18.0)["intrados"]:
        fall = {"spray": 40.0, "contact": 20.0}.get(stretch.kind, 0.0)
        within = np.clip((at - stretch.start) / (stretch.end - stretch.start), 0.0, 1.0)
        line -= fall * np.sin(np.pi * within)
    columns = {
        "mid_face_intrados": line, "mid_face_extrados": line + 50.0,
        "corner_intrados": np.linspace(1000.0, 800.0, len(at)),
    }  # fmt: skip
    table = {f"surface_temperature_{name}": values for name, values in columns.items()}
    found = slab_sprays._surface(case, machine, pd.DataFrame({"position": at} | table))
    for key in ("straightener_spray_most", "top_spray_most"):
        assert found[key] == pytest.approx(40.0, abs=1.0)
    assert found["straightener_contact_most"] == pytest.approx(20.0, abs=1.0)
    assert found["extrados_warmer"] == pytest.approx(50.0)
    assert found["corner_least"] < found["corner_most"] < 1000.0


def test_conclusions_about_the_thesis_are_in_the_data() -> None:
    """VI.3.3 to VI.4.4: straightening above bending, locked rolls below a misaligned one."""
    data = Path(__file__).parents[2] / "docs" / "data" / "slab_defects.csv"
    found = pd.read_csv(data).set_index("case")
    for case in ("reference", "locked_48", "locked_48_52", "warm_edges"):
        row = found.loc[case]
        assert row.bending_stress < row.straightening_stress
        assert row.bending_I1 < row.straightening_I1
        assert row.straightening_place.startswith("intrados")
    moved = found.straightening_I1 / found.straightening_I1["reference"] - 1.0
    assert abs(moved["locked_48"]) < 0.02 < moved["locked_48_52"]
    for face in ("intrados", "extrados"):
        rates, stresses = found[f"defect_{face}_I2"], found[f"defect_{face}_I1"]
        assert rates["misaligned_48"] > 2.0 * found.straightening_I2["locked_48_52"]
        assert stresses["misaligned_48"] > 4.0 * stresses["reference"]
    edges, nozzles = found.loc["warm_edges"], found.loc["nozzles_47_52"]
    assert nozzles.warm_intrados > edges.warm_intrados + 5.0
    for name in ("straightening_I1", "straightening_I2", "straightening_stress"):
        assert nozzles[name] == pytest.approx(edges[name], rel=0.03)
