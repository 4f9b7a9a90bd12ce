"""[optimise]: its meaning, and one line for each mistake in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from known_results import HEAT, SPEED, STRESS, SUPERHEAT, solve
from small_case import SMALL, small

from castfem.base.errors import InputError
from castfem.model import read_case
from castfem.model.load import load
from castfem.post.compare.optimum_tables import report
from castfem.studies.optimisation import Optimum, RunRequest, Study
from castfem.studies.optimisation.problem import DesignProblem

LENGTHS = ["0 mm", "1 mm"]
TABLE = """
[optimise]
minimise = "surface_temperature_mid_face"
constraints = ["shell_mid_face >= 1 mm"]

[[optimise.variable]]
key = "casting.speed"
range = ["2 m/min", "5 m/min"]
"""


def test_round_trip(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(SMALL + TABLE)
    case = load(path)
    other = tmp_path / "again.toml"
    other.write_text(case.resolved_toml())
    assert load(other) == case
    assert case.physics_hash() == small().physics_hash()
    (axis,) = DesignProblem(case).variables
    assert (axis.low, axis.high, axis.unit) == (2.0, 5.0, "m/min")
    assert axis.value(0.5) == 3.5
    (bound,) = case.optimise.bounds
    assert (bound.value, bound.sign, bound.relative) == (1e-3, 1.0, False)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('"surface_temperature_mid_face"', '"shel_mid_face"',
         'optimise.minimise: ("shel_mid_face") is not a result of a run; did you mean shell_mid'),
        ('minimise = "surface_temperature_mid_face"', "",
         "optimise: no result to optimise; give minimise ="),
        (">= 1 mm", ">= 1 MPa",
         'optimise.constraints.0: ("1 MPa") does not measure shell_mid_face; it has a unit'),
        (">= 1 mm", "> 1 mm",
         'optimise.constraints.0: is not a constraint; write it with >= or <=, not ">", as "heat'),
        (">= 1 mm", ">= 99 % of idealised", "the case has no [mould], it is idealised"),
        ('"shell_mid_face >= 1 mm"', '"heat >= 1 MJ/m"', '("heat") is not a result of a run'),
        ('["2 m/min", "5 m/min"]', '["5 m/min", "5 m/min"]',
         "optimise.variable.0.range: is empty: the first value must lie below the second"),
        ('["2 m/min", "5 m/min"]', '["2 m/min", "5 K"]',
         "optimise.variable.0.range: its ends measure different things (m/s and K)"),
        ('["2 m/min", "5 m/min"]', '["2 m/min"]', 'two values are needed, such as ["0 %/m"'),
        ('["2 m/min", "5 m/min"]', '["2 furlongs", "5 m/min"]', "optimise.variable.0.range: "),
        ("[[optimise.variable]]", "[[optimise.variables]]", "did you mean variable?"),
        ('"5 m/min"]', '"5 m/min"]\nstart = "0.09 m/s"',
         'optimise.variable.0.start: ("0.09 m/s") is not within the range, 2 m/min to 5 m/min'),
        ('"5 m/min"]', '"5 m/min"]\nstart = "swift"', "optimise.variable.0.start: "),
        ('"5 m/min"]', '"5 m/min"]\n[[optimise.variable]]\nkey = "casting.speed"\n'
         'range = ["2 m/min", "5 m/min"]', "is given twice; leave one out"),
        ('"5 m/min"]', '"5 m/min"]\n[[optimise.input]]\nkey = "casting.speed"\nrange = [1, 2]',
         'optimise.input.0.key: ("casting.speed") is a variable, too'),
    ],
)  # fmt: skip
def test_mistakes_in_the_file_are_reported(tmp_path: Path, old: str, new: str, line: str):
    path = tmp_path / "case.toml"
    path.write_text(SMALL + TABLE.replace(old, new))
    problems = read_case(path).problems
    assert problems
    assert all(problem.startswith(f"{path}: ") for problem in problems)
    assert any(line in problem for problem in problems), problems


@pytest.mark.parametrize(
    ("key", "ends", "line"),
    [
        ("casting.sped", ["2 m/min", "5 m/min"], "casting.sped"),
        ("casting.speed", ["2 mm", "5 mm"], "casting.speed: "),
        ("mould.taper", ["0 %/m", "1 %/m"], "mould"),
        ("casting.speed", ["-1 m/min", "5 m/min"], "casting.speed: "),
        ("casting.speed", [2, 5], "casting.speed: a speed needs its unit, such as"),
        ("steel.name", LENGTHS, 'steel.name: is a text ("carbon_042"); a number is varied: name a'),
        ("title", LENGTHS, 'title: is a text ("coarse billet"); a number is varied: name a key'),
        ("section.symmetry", LENGTHS,
         "one of quarter, half, whole; a number is varied: name a key"),
        ("thermal.time.scheme", LENGTHS, "one of sdirk2, backward_euler; a number is varied: name"),
    ],
)  # fmt: skip
def test_invalid_keys_are_refused(key: str, ends: list[Any], line: str):
    request: dict[str, Any] = {
        "minimise": "heat_removed",
        "variable": [{"key": key, "range": ends}],
    }
    request["constraints"] = "shell_mid_face >= 1 mm"  # a single one needs no list
    case = small({"optimise": request})
    assert case.optimise is not None and len(case.optimise.bounds) == 1
    with pytest.raises(InputError) as error:
        DesignProblem(case, "file.toml")
    problems = error.value.problems
    assert all(problem.startswith("file.toml: optimise.variable.0: ") for problem in problems)
    assert any(line in problem for problem in problems)
    assert len(problems) == 1 or key == "mould.taper"  # of a case that has no mould at all


def test_results_that_no_run_has_are_refused():
    request = {
        "minimise": "von_mises_max",
        "constraints": ["gap_max <= 1 mm", "shell_tip >= 1 mm", "shell_mid_face >= 1 mm"],
        "front": {"maximise": "negative_strip_time"},
        "variable": [{"key": "casting.speed", "range": ["2 m/min", "5 m/min"]}],
    }
    with pytest.raises(InputError) as error:
        DesignProblem(small({"optimise": request}), "f.toml").check_results()
    for problem, key in zip(
        error.value.problems,
        ('minimise: ("von_mises_max") is none of this case, for it has no [mechanics]; add it, or',
         'constraints.0: ("gap_max") is none of this case, for it has no [mechanics] and [mould]',
         'constraints.1: ("shell_tip") has no place "tip" on this section; allowed: mid_face',
         'front.maximise: ("negative_strip_time") is none of this case'),
        strict=True,
    ):  # fmt: skip
        assert problem.startswith(f"f.toml: optimise.{key}"), problem


def test_case_without_the_table_is_refused():
    with pytest.raises(InputError, match=r"optimise: the table is missing; add \[optimise\]"):
        DesignProblem(small(), "file.toml")


def test_numbers_without_unit():
    mould = {"length": "600 mm", "friction": {"law": "coulomb", "coefficient": 0.2}}
    case = load("billet125/taper_1").with_({"mould": mould})
    variable = {"key": "mould.friction.coefficient", "range": [0, 0.5]}
    study_of = case.with_({"optimise": {"minimise": "heat_removed", "variable": [variable]}})
    question = DesignProblem(study_of)
    wanted = question.request(question.start(None))
    assert question.changes(wanted) == {"mould.friction.coefficient": 0.2}


@pytest.mark.parametrize(
    ("key", "ends", "expected"),
    [
        ("cooling.mould.surface.0.coefficient", ["1 kW/(m^2 K)", "3 kW/(m^2 K)"], 0.3),
        ("cooling.0.surface.0.coefficient", ["1 kW/(m^2 K)", "3 kW/(m^2 K)"], 0.3),
        ("speed", ["2 m/min", "6 m/min"], 0.4),
        ("casting.speed", ["0.02 m/s", "0.07 m/s"], 0.8),
    ],
)
def test_search_begins_with_the_value_of_the_case(key: str, ends: list[str], expected: float):
    """Zones have names or numbers, keys may omit their tables."""
    case = small({"casting.speed": "3.6 m/min"})
    study_of = {"minimise": "heat_removed", "variable": [{"key": key, "range": ends}]}
    question = DesignProblem(case.with_({"optimise": study_of}))
    assert question.start(None) == pytest.approx([expected])


def test_list_of_one_result_is_that_result(tmp_path: Path):
    """It means the same, and is written as a list if the case has one."""
    single, listed = tmp_path / "alone.toml", tmp_path / "listed.toml"
    single.write_text(SMALL + TABLE)
    name = '"surface_temperature_mid_face"'
    listed.write_text(SMALL + TABLE.replace(name, f"[{name}]"))
    assert load(listed) == load(single)
    assert load(listed).optimise.objectives == (("surface_temperature_mid_face", 1.0),)


@pytest.mark.parametrize("two", ['["von_mises_max", "heat_removed"]', '["gap_max", "gap_max"]'])
def test_list_of_two_results_is_refused(tmp_path: Path, two: str) -> None:
    path = tmp_path / "two.toml"
    path.write_text(SMALL + TABLE.replace('"surface_temperature_mid_face"', two))
    with pytest.raises(InputError) as caught:
        load(path)
    (line,) = caught.value.problems
    assert "two.toml: optimise: 2 results to optimise; give minimise = " in line
    assert line.endswith("one of them, and weigh it against another by [optimise.front]")


def test_thermal_runs_exclude_mould_and_mechanics() -> None:
    """Mould, shares of an idealised one, and results of the mechanics: a line each."""

    def study_of(**table: object) -> list[str]:
        speed = {"key": "casting.speed", "range": ["1 m/min", "2 m/min"]}
        table = {"fidelity": "thermal", "maximise": "heat_removed", "variable": [speed], **table}
        case = load("billet125/taper_1").with_({"optimise": table})
        try:
            DesignProblem(case).check_results()
        except InputError as error:
            return list(error.problems)
        return []

    assert study_of() == []
    taper = {"key": "mould.taper", "range": ["0 %/m", "1 %/m"]}
    (line,) = study_of(variable=[taper])
    assert "optimise.fidelity: thermal runs have no mould: mould.taper changes nothing" in line
    (line,) = study_of(constraints=["heat_removed >= 99 % of idealised"])
    assert 'thermal runs have no mould, to hold "heat_removed >= 99 % of idealised" against' in line
    (line,) = study_of(maximise=[], minimise="von_mises_max")
    assert 'optimise.minimise: ("von_mises_max") is not a result of temperature alone' in line
    assert line.endswith('take fidelity = "coarse"')


HINT = "a wider one may meet them"


def study_of(*constraints: str, **start: str) -> Study:
    variables = [{**SPEED, "start": "3 m/min"}, {**SUPERHEAT, "start": start["superheat"]}]
    table: dict[str, Any] = {"minimise": STRESS, "constraints": constraints, "variable": variables}
    return Study(small({"casting.length": "6 mm", "optimise": table}))


def first_line(found: Optimum) -> str:
    assert found.status == "impossible"
    return str(next(iter(report(found))))


@pytest.mark.parametrize("superheat", ["10 K", "50 K"])
def test_ineffective_variable_is_not_named(superheat: str):
    """The objective moves it to an end: the heat depends only on the speed."""
    sign = 1.0 if superheat == "10 K" else -1.0

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, at = wanted.values
        return {STRESS: 100.0 + sign * at, HEAT: 1e6 * (5.0 - (speed - 4.2) ** 2)}

    found = solve(study_of("heat_removed >= 9 MJ/m", superheat=superheat), given)
    assert found.values[1].at_end in ("lowest", "highest")
    assert HINT not in first_line(found)


def test_only_the_effective_variable_is_named():
    def given(wanted: RunRequest) -> dict[str, float]:
        speed, superheat = wanted.values
        return {STRESS: 10.0 + superheat, HEAT: 1e6 * speed}

    found = solve(study_of("heat_removed >= 9 MJ/m", superheat="10 K"), given)
    assert found.values[0].at_end == "highest" and found.values[1].at_end == "lowest"
    line = first_line(found)
    assert line.endswith(f"with casting.speed at the highest of its range: {HINT}")
    assert "superheat" not in line


def test_variable_without_further_gain_is_not_named():
    """Flat above 4 m/min: the last part of the range gains nothing."""

    def given(wanted: RunRequest) -> dict[str, float]:
        speed, _ = wanted.values
        return {STRESS: 100.0 - speed, HEAT: 1e6 * min(speed, 4.0)}

    found = solve(study_of("heat_removed >= 9 MJ/m", superheat="30 K"), given)
    assert HINT not in first_line(found)


def test_second_missed_constraint_suppresses_the_hint():
    """More speed helps one; the other is missed at any speed, or by more with each step."""
    for more in (0.0, 1.0):

        def given(wanted: RunRequest, more: float = more) -> dict[str, float]:
            speed, _ = wanted.values
            return {STRESS: 1e6 * (100.0 + more * speed), HEAT: 1e6 * speed}

        both = ("heat_removed >= 9 MJ/m", "von_mises_max <= 10 MPa")
        found = solve(study_of(*both, superheat="30 K"), given)
        assert HINT not in first_line(found)
