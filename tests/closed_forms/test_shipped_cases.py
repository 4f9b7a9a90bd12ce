"""The shipped cases with a closed form have the documented errors.

Each runs unchanged except the longest, of which only the first quarter is run.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

import pytest

from benchmarks.verification import BEGUN, CASES, NAMES, case_of, row_of
from castfem.base.errors import InputError
from castfem.model import Case, load_case, read_case
from castfem.physics.closed_forms import NAMES as FORMS
from castfem.runs import loop
from castfem.runs.output.summary_file import Summary

pytestmark = pytest.mark.slow

DATA = Path(__file__).parents[2] / "docs" / "data" / "verification.csv"
# Bounds of the documented errors of temperature [mK] and stress [% of 20 MPa].
BOUNDS = {
    "alloy_similarity": (50.0, None),
    "neumann": (150.0, None),
    "weiner_boley_coarse": (600.0, 2.5),
    "weiner_boley, to 84 mm": (400.0, 0.8),
}
QUIET = ("output.fields=[]", "output.figures=false")


def changed(name: str, changes: Sequence[str] = ()) -> Case:
    return load_case(CASES / f"{name}.toml", changes)


def run(case: Case, folder: Path) -> Summary:
    return loop.run(case, folder, comm=MPI.COMM_SELF)


def documented(name: str) -> dict[str, str]:
    with DATA.open(encoding="utf-8") as file:
        return next(row for row in csv.DictReader(file) if row["case"] == name)


def test_every_file_names_its_closed_form_and_is_tested() -> None:
    tested = {BEGUN.get(name, (name,))[0] for name in BOUNDS}
    assert {p.stem for p in CASES.glob("*.toml")} == set(NAMES) == tested
    assert {changed(n).verification.closed_form for n in NAMES} == set(FORMS)


@pytest.mark.parametrize("name", BOUNDS)
def test_shipped_file_has_the_documented_error(name: str, tmp_path: Path) -> None:
    case = case_of(name)
    found = row_of(name, run(case, tmp_path))
    for key, value in documented(name).items():
        if key != "case":
            # The values of the table to 10 %.
            number = float(value) if value else None
            assert found[key] == (None if number is None else pytest.approx(number, rel=0.1)), key
    kelvin, stress = BOUNDS[name]
    assert found["error_temperature"] < kelvin
    assert stress is None or found["error_stress"] < stress
    assert abs(found["shell_mid_face"]) <= 1.1e3 * case.mesh.surface_size
    if stress is not None:
        forms = json.loads((tmp_path / "run.json").read_text())["compiled_forms"]
        assert not any("contact" in form for form in forms)


def test_error_and_closed_form_are_in_the_summary(tmp_path: Path) -> None:
    case = changed("alloy_similarity", ['casting.length="50 mm"', *QUIET])
    run(case, tmp_path)
    content = json.loads((tmp_path / "summary.json").read_text())
    error = content["quantities"]["error_temperature"]
    assert error["unit"] == "mK" and 0.0 < error["value"] < 600.0
    references = {r["quantity"]: r for r in content["references"]}
    assert set(references) == {"shell_mid_face", "liquidus_depth_mid_face", "heat_flux_mid_face"}
    assert references["heat_flux_mid_face"]["difference"] == pytest.approx(0.0, abs=30.0)
    assert not any(r["changed"] for r in references.values()), "it follows the case"


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("weiner_boley", "coupling.follow_shape=true", "give coupling.follow_shape = false"),
        ("weiner_boley", "coupling.dissipation=1", "give coupling.dissipation = 0"),
        ("weiner_boley", 'mechanics.strain="large"', 'give mechanics.strain = "small"'),
        ("weiner_boley", "mechanics.law=kozlowski_3", 'give mechanics.law = "weiner_boley"'),
        (
            "neumann",
            'cooling.0.surface=[{law="flux", value="1 MW/m^2"}]',
            'one law = "temperature"',
        ),
        ("neumann", "verification.closed_form=neuman", "did you mean neumann"),
    ],
)
def test_case_without_that_closed_form_is_rejected(name: str, change: str, message: str) -> None:
    found = read_case(CASES / f"{name}.toml", [change])
    assert any(message in problem for problem in found.problems), found.problems
    assert all("verification" in p or "closed_form" in p for p in found.problems)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("neumann", "steel.name=alloy_similarity", 'it is "alloy_similarity"'),
        ("neumann", 'steel.overrides={conductivity={temperature=["900 degC", "1600 degC"], '
         'value=["30 W/(m K)", "34 W/(m K)"]}}', "conductivity of neumann_steel changes"),
        ("alloy_similarity", "steel.name=neumann_steel", 'it is "neumann"'),
        ("alloy_similarity", 'casting.temperature="1440 degC"', "chilled below the solidus"),
        ("weiner_boley", 'cooling.0.surface.0.value="900 degC"', "has its own constants"),
    ],
)  # fmt: skip
def test_steel_or_temperature_without_closed_form_is_rejected(
    name: str, change: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        run(changed(name, [change]), tmp_path)
