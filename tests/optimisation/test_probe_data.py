"""A case is fitted to what was measured at its probes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.cli.calibrating import _check_results
from castfem.model import Case
from castfem.studies.calibration.fit import computed
from castfem.studies.calibration.measured import Measured, read_measured


def probed(coefficient: str = "1600 W/(m^2 K)") -> Case:
    probe = {"name": "tc1", "under": "mid_face", "depth": "3 mm"}
    return small({"output.probe": [probe], "cooling.0.surface.0.coefficient": coefficient})


def test_what_a_run_has_at_a_probe(tmp_path: Path) -> None:
    result = castfem.run(probed(), folder=tmp_path / "run")
    table = result.probes["tc1"]
    (found,) = computed(
        probed(), tmp_path / "run", [Measured(0.045, "tc1.temperature", 1700.0, 5.0)]
    )
    known = np.interp(0.045, table["position"], table["temperature"])
    assert found.value == pytest.approx(known + 273.15)
    assert (found.shown_unit, found.label) == ("degC", "temperature at tc1")
    with pytest.raises(InputError, match="probe tc1 has no temperature at 90 mm"):
        computed(probed(), tmp_path / "run", [Measured(0.09, "tc1.temperature", 1700.0, 5.0)])


def data(folder: Path, heading: str) -> list[Measured]:
    path = folder / "data.csv"
    path.write_text(f"position [mm], {heading}\n45, 1200\n")
    return read_measured(path)


def test_a_file_names_probe_and_column(tmp_path: Path) -> None:
    (one,) = data(tmp_path, "tc1.temperature [degC]")
    assert (one.name, one.value) == ("tc1.temperature", pytest.approx(1473.15))
    _check_results(probed(), [one])


@pytest.mark.parametrize(
    ("heading", "message"),
    [
        ("tc2.temperature [degC]", "the case has no probe tc2; did you mean tc1.*it has tc1"),
        ("tc1.temprature [degC]", "a probe has no temprature; did you mean temperature"),
        ("tc1.stress_zz [MPa]", "a probe has no stress_zz.*it has temperature, solid_fraction"),
        ("tc1.temperature [mm]", "does not measure tc1.temperature; it has a unit such as"),
        ("tc1.temperature", "tc1.temperature has no unit"),
    ],
)
def test_what_is_not_there_is_refused_before_anything_runs(
    tmp_path: Path, heading: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        _check_results(probed(), data(tmp_path, heading))
