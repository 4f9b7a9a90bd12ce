"""Requests for hot tearing and ductility in a case: tables, and invalid input."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from small_case import small
from stretched_strip import AXIAL, stretched

from castfem.base.errors import InputError
from castfem.cli.checking import check_case
from castfem.model.build.simulation import build
from castfem.runs import loop
from castfem.runs.loop import TimeLoop
from castfem.runs.output.folder import DEPTH_ROWS_NAME, DEPTHS_NAME

DUCTILITY = {
    "temperature": [1100, 1100, 1500, 1500], "temperature_unit": "degC",
    "strain_rate": [1e-4, 1e-2, 1e-4, 1e-2], "strain_rate_unit": "1/s",
    "critical_strain": [0.2, 0.2, 0.2, 0.2],
}  # fmt: skip


def test_ductility_is_used_by_tension_in_its_range(tmp_path: Path) -> None:
    """At 1000 degC nothing counts; with a table from 900 degC, 0.003 of 0.2 are 1.5 %."""
    wide = DUCTILITY | {"temperature": [900, 900, 1540.1, 1540.1]}
    used = []
    for number, table in enumerate((DUCTILITY, wide)):
        case = stretched(1.0, 0.4, quality={"ductility": table})
        folder = tmp_path / f"{number}"
        used.append(loop.run(case, folder, comm=MPI.COMM_SELF).quantities)
        assert not (folder / DEPTHS_NAME).exists()
    strain = AXIAL * 30.0
    assert used[1]["way_ductility_used_max"].value == pytest.approx(strain / 0.2, rel=1e-6)
    assert used[0]["way_ductility_used_max"].value < 0.1 * strain / 0.2
    area = {k: v for k, v in DUCTILITY.items() if k != "critical_strain"}
    area["reduction_of_area"] = ["50 percent"] * 4
    given = stretched(quality={"ductility": area}).quality
    assert np.ravel(given.ductility.strains) == pytest.approx([np.log(2.0)] * 4, rel=1e-12)
    again = stretched(quality=stretched(quality={"ductility": area}).document()["quality"])
    assert again.quality == given


def test_criterion_of_time_needs_no_mechanics(tmp_path: Path) -> None:
    case = small({"quality": {"hot_tearing": ["clyne_davies"]}, "casting.length": "120 mm"})
    found = loop.run(case, tmp_path, comm=MPI.COMM_SELF).quantities
    assert 0.05 < found["way_clyne_davies_front_max"].value < 2.0
    assert "way_won_front_max" not in found and "way_rdg_front_max" not in found


def test_case_without_criteria_has_no_results_of_them(tmp_path: Path) -> None:
    quantities = loop.run(small({"quality": {}}), tmp_path, comm=MPI.COMM_SELF).quantities
    assert not {DEPTHS_NAME, DEPTH_ROWS_NAME} & {path.name for path in tmp_path.iterdir()}
    assert "hot_tearing" not in (tmp_path / "case.toml").read_text()
    words = ("won", "rdg", "clyne", "ductility")
    assert not [name for name in quantities if any(word in name for word in words)]


@pytest.mark.parametrize(
    ("quality", "key", "message"),
    [
        ({"hot_tearing": ["won"]}, "quality.hot_tearing", "needs strain"),
        ({"hot_tearing": ["wom"]}, "quality.hot_tearing", "won"),
        ({"hot_tearing": ["clyne_davies"], "brittle": [0.9, 1.0]}, "quality.brittle", "0.99"),
        ({"rdg": {}}, "quality.rdg", 'hot_tearing = ["rdg"]'),
        ({"won": {}}, "quality.won", 'hot_tearing = ["won"]'),
        ({"ductility": DUCTILITY}, "quality.ductility", "[mechanics]"),
        (
            {"ductility": DUCTILITY | {"strain_rate": [1e-4, 1e-4, 1e-4, 1e-2]}},
            "quality.ductility", "row 2: this temperature and rate appear twice",
        ),
        (
            {"ductility": DUCTILITY | {"reduction_of_area": [0.4] * 4}},
            "quality.ductility", "give one of",
        ),
    ],
)  # fmt: skip
def test_invalid_input_is_rejected_with_its_key(
    quality: dict[str, object], key: str, message: str
) -> None:
    with pytest.raises(InputError) as error:
        small({"quality": quality})
    assert key in str(error.value) and message in str(error.value)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"steel.name": "neumann_steel"}, "quality.hot_tearing"),
        ({"steel": {"name": "plain_carbon", "composition": {"C": 0.15}}}, "quality.hot_tearing"),
        ({"quality": {"hot_tearing": ["rdg"]}, "mechanics": {}}, "quality.rdg.shrinkage"),
        (
            {"quality": {"hot_tearing": ["rdg"], "rdg": {"shrinkage": "4 percent"}},
             "mechanics": {}, "steel.composition": {}}, "",
        ),
    ],
)  # fmt: skip
def test_missing_data_of_a_steel_are_reported(
    tmp_path: Path, changes: dict[str, object], key: str
) -> None:
    case = small({"quality": {"hot_tearing": ["clyne_davies"]}} | changes)
    if not key:  # carbon_042 states its carbon
        build(case, MPI.COMM_SELF).destroy()
        return
    with pytest.raises(InputError, match=key) as error:
        TimeLoop(build(case, MPI.COMM_SELF))
    widened = 'steel.diagram = "segregated"' in str(error.value)
    assert widened == (case.steel.composition.get("C") == 0.15)
    path = tmp_path / "lacking.toml"
    path.write_text(case.resolved_toml())
    with pytest.raises(InputError, match=f"lacking.toml: {key}: "):  # before the run
        check_case("lacking", path, ())
