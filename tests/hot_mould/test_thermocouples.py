"""Thermocouples in the copper: closed form of a round tube, and a case fitted to readings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.cli.calibrating import _check_results
from castfem.model import Case
from castfem.runs.results.wall_flux import read_wall_flux
from castfem.studies.calibration.fit import calibrate, computed, followed, read_free
from castfem.studies.calibration.measured import Measured
from castfem.studies.mould_fit.coupled import CopperTemperatures, hot_mould_of
from castfem.studies.optimisation.evaluator import Evaluator

LENGTH = 0.06
NAME = "tc.temperature"
H = "mould.tube.water_coefficient"


IN_A_MOULD = {
    "mesh.order": 2,
    "cooling.0.surface.0.gap_conductivity": "0.15 W/(m K)",
    "mechanics": {},
    "cooling.0.to": "60 mm",
}


def case_with_tube(
    tube: dict[str, Any] | None = None, rows: list[dict[str, Any]] | None = None
) -> Case:
    """Return the small billet in a mould of its length with thermocouples at mid-face."""
    thermocouples = rows if rows is not None else [{"name": "tc", "depth": "5 mm"}]
    table = {"thickness": "10 mm", "thermocouple": thermocouples, **(tube or {})}
    return small({**IN_A_MOULD, "mould": {"length": "60 mm", "taper": "1 %/m", "tube": table}})


def test_round_tube_has_the_temperature_of_its_closed_form() -> None:
    """T = T_water + q a/(h b) + q a ln(b/r)/k, far from the ends of the heated length."""
    a, b, depth, q, h, k = 0.06, 0.08, 0.005, 2e6, 3e4, 380.0
    section = {"shape": "round", "diameter": "120 mm", "symmetry": "quarter"}
    tube = {"thickness": "20 mm", "flux": "2 MW/m^2", "water_coefficient": "30000 W/(m^2 K)",
            "thermocouple": [{"name": "tc", "depth": "5 mm", "way": "20 mm"}]}  # fmt: skip
    mould = {"length": "300 mm", "tube": tube, "copper": {"conductivity": "380 W/(m K)"}}
    mesh = {"surface_size": "4 mm", "core_size": "12 mm", "order": 2}
    case = small(
        {
            **IN_A_MOULD,
            "section": section,
            "mesh": mesh,
            "mould": mould,
            "casting.length": "300 mm",
            "cooling.0.to": "300 mm",
        }
    )
    (row,) = tube_of(case).thermocouple
    read = CopperTemperatures(case, Path()).at(row, 0.2)
    expected = 40.0 + 273.15 + q * a / (h * b) + q * a * np.log(b / (a + depth)) / k
    assert read.value == pytest.approx(expected, abs=0.2)
    assert read.shown_unit == "degC"


def tube_of(case: Case) -> Any:
    assert case.mould is not None and case.mould.tube is not None
    return case.mould.tube


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("tubed") / "run"
    castfem.run(case_with_tube(), folder=found)
    return found


def test_wall_flux_of_a_run_heats_the_hot_mould(folder: Path) -> None:
    """The file wall_flux.csv gives the same copper as the run of `castfem mould --hot`."""
    from mpi4py import MPI

    (turn,) = hot_mould_of(case_with_tube(), MPI.COMM_SELF, "here")
    flux = read_wall_flux(folder, LENGTH)
    tube = turn.wall.model
    again = tube.heat(flux)
    expected = turn.wall.heated
    assert again.supplied == pytest.approx(expected.supplied, rel=1e-9)
    at = np.array([0.03])
    both = [tube.temperature_at(one, at, 0.0, 0.005) for one in (again, expected)]
    assert both[0] == pytest.approx(both[1], abs=1e-6)


def test_resumed_run_has_an_identical_wall_flux_file(folder: Path, tmp_path: Path) -> None:
    short = case_with_tube().with_({"casting.length": "30 mm"})
    castfem.run(short, folder=tmp_path / "run")
    castfem.run(case_with_tube(), folder=tmp_path / "run", resume=True)
    name = "wall_flux.csv"
    assert (tmp_path / "run" / name).read_bytes() == (folder / name).read_bytes()


def test_water_coefficient_is_fitted_to_thermocouples(tmp_path: Path) -> None:
    """The fit to readings of a case with another coefficient returns that coefficient."""
    truth = case_with_tube({"water_coefficient": "20000 W/(m^2 K)"})
    castfem.run(truth, folder=tmp_path / "truth")
    places = (0.02, 0.03, 0.04)
    blank = [Measured(place, NAME, 0.0, 1.0) for place in places]
    read = computed(truth, tmp_path / "truth", blank)
    measured = [Measured(m.position, NAME, q.value, 1.0) for m, q in zip(blank, read, strict=True)]
    case, free = case_with_tube(), read_free(f"{H}=10000..40000 W/(m^2 K)")
    with Evaluator(followed(case, measured), tmp_path / "fit", processes=0) as evaluator:
        found = calibrate(case, measured, [free], evaluator)
    (key,) = found.fit.keys
    assert key.start == pytest.approx(30000.0)
    assert key.value == pytest.approx(20000.0, rel=1e-3)
    assert key.interval > 0.0 and not key.held


def test_fit_computes_the_strand_to_the_mould_exit() -> None:
    """The copper needs the heat of the complete mould; a shorter case is rejected."""
    measured = [Measured(0.02, NAME, 400.0, 1.0)]
    assert followed(case_with_tube(), measured).casting.length == pytest.approx(LENGTH)
    short = case_with_tube().with_({"casting.length": "30 mm"})
    with pytest.raises(InputError, match=r"60 mm of mould.*--set casting.length"):
        followed(short, measured)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([{"name": "tc", "depth": "11 mm"}], r"thermocouple.0.depth.*deeper than the wall, 10 mm"),
        ([{"name": "a", "depth": "1 mm"}, {"name": "A", "depth": "2 mm"}], "1.name.*used twice"),
    ],
)
def test_thermocouples_too_deep_or_named_twice_are_rejected(
    rows: list[dict[str, Any]], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        case_with_tube(rows=rows)


def test_name_of_a_probe_is_rejected() -> None:
    probe = {"name": "TC", "under": "mid_face", "depth": "3 mm"}
    with pytest.raises(InputError, match="name of a probe, too"):
        case_with_tube().with_({"output.probe": [probe]})


def test_points_outside_the_copper_are_rejected(folder: Path) -> None:
    case = case_with_tube(rows=[{"name": "tc", "depth": "5 mm", "way": "200 mm"}])
    (row,) = tube_of(case).thermocouple
    with pytest.raises(InputError, match=r"way .200 mm. is beyond the quarter"):
        CopperTemperatures(case, folder).at(row, 0.03)
    with pytest.raises(InputError, match="65 mm is not within the mould"):
        CopperTemperatures(case_with_tube(), folder).at(
            tube_of(case_with_tube()).thermocouple[0], 0.065
        )
    wrong = Measured(0.03, "tc.solid_fraction", 0.5, 0.1)
    with pytest.raises(InputError, match=r"has no solid_fraction.*it has temperature"):
        _check_results(case_with_tube(), [wrong])
