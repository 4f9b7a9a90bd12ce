"""Invalid input of an optimum is a one-line error with the argument and the fix."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import known_results
import pytest
from known_results import HEAT, SPEED, STRESS, SUPERHEAT
from small_case import small, write_small

from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.studies.optimisation import Evaluation, Evaluator, RunRequest, Study

SHORT = {"casting.length": "6 mm"}


def study(**table: Any) -> Study:
    return known_results.study(SPEED, SUPERHEAT, **table)


def problem(call: Callable[[], object]) -> str:
    with pytest.raises(InputError) as caught:
        call()
    (line,) = caught.value.problems
    assert "\n" not in line
    return line


def test_case_is_accepted_by_name_and_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert Study("billet125/optimum_single").problem.variables[0].key == "mould.taper"
    path = write_small(tmp_path)
    by_path = Evaluator(path, tmp_path / "one")
    assert by_path.case == Evaluator("small", tmp_path / "two").case
    assert by_path.case == Evaluator(small(), tmp_path / "three").case
    assert problem(lambda: Study(path)).startswith(f"{path}: optimise: the table is missing; add")
    line = problem(lambda: Study("billet125/optimum_singel"))
    assert line.endswith("did you mean billet125/optimum_single?")


@pytest.mark.parametrize("given", [3, None, {"casting": {}}])
def test_invalid_case_is_refused(tmp_path, given):
    for function in (Study, lambda case: Evaluator(case, tmp_path)):
        assert "a case is needed, its path or the name of a" in problem(lambda a=function: a(given))


def test_folders_and_counts(tmp_path):
    case = small(SHORT)
    (tmp_path / "file").write_text("")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.json").write_text("{}")
    for folder, line in (
        (3, "folder must be a path, got 3"),
        (
            tmp_path / "file",
            f"folder: {tmp_path / 'file'}: is a file, a folder is needed; choose another",
        ),
        (tmp_path / "run", f"folder: {tmp_path / 'run'}: holds a single run; choose another"),
    ):
        assert line in problem(lambda f=folder: Evaluator(case, f))
        assert line in problem(lambda f=folder: Study(small({**SHORT, "optimise": REQUEST}), f))
    for given, line in (
        ({"processes": -1}, "processes must be an integer >= 0, got -1"),
        ({"processes": "2"}, "processes must be an integer >= 0, got '2'"),
        ({"ranks": 1.5}, "ranks must be an integer >= 1, got 1.5"),
    ):
        assert (
            problem(lambda g=given: Evaluator(case, tmp_path / "new", **g)) == f"Evaluator: {line}"
        )
    assert not (tmp_path / "new").exists()


REQUEST = {"minimise": "heat_removed", "variable": [SPEED]}


def test_changes(tmp_path):
    evaluate = Evaluator(small(SHORT), tmp_path / "new")
    for given, line in (
        ("casting.speed", 'changes must be keys with their values, {"casting.'),
        ({"casting.sped": "3 m/min"}, "changes: casting.sped"),
        ({3: 1}, "changes: 3: the name of a key is needed"),
    ):
        assert problem(lambda g=given: evaluate(g)).startswith(line)
    for word in ("corse", 3, ["coarse"]):
        assert "fidelity must be one of thermal, coarse" in problem(lambda w=word: evaluate({}, w))
    assert evaluate.runs == 0 and not (tmp_path / "new").exists()


def test_folder_with_runs_of_another_strand_is_refused(tmp_path):
    with Evaluator(small(SHORT), tmp_path) as evaluate:
        evaluate({"speed": "3 m/min"}, "coarse")
    other = small({**SHORT, "section.width": "150 mm", "section.height": "150 mm"})
    line = problem(lambda: Evaluator(other, tmp_path))
    assert line.startswith(f"{tmp_path}: holds runs of another case (section.")
    assert line.endswith("; choose another folder")
    Evaluator(small({**SHORT, "casting.superheat": "12 K"}), tmp_path)  # may be varied
    with Evaluator(other, tmp_path / "both") as evaluate:
        evaluate({"section.width": "125 mm", "section.height": "125 mm"})
    Evaluator(small(SHORT), tmp_path / "both")


def test_missing_result_is_reported():
    one = Evaluation({HEAT: Quantity(1.0, "J/m", "heat")})
    assert problem(lambda: one["heat_remoed"]).endswith("did you mean heat_removed?")
    assert "has failed: breakout" in problem(lambda: Evaluation({}, 0.5, "breakout")[HEAT])


def test_runs_are_given_by_values_of_variables():
    one = study()
    run = {"casting.speed": "0.05 m/s", "superheat": 30}
    one.tell(run, {STRESS: 1e6})
    assert list(one._runs.results) == [RunRequest((3.0, 30.0), "default")]
    assert one.case(run) == one.case(RunRequest((3.0, 30.0), "default"))
    for end in (2.0, 5.0):  # the ends of a range are included
        one.tell(RunRequest((end, 30.0), "default"), {STRESS: 1.0})
    assert len(one._runs.results) == 3


@pytest.mark.parametrize(
    ("run", "line"),
    [
        (
            {"casting.sped": 3.0, "casting.superheat": 30.0},
            "casting.sped is not a variable of [optimise]; there are casting.speed, "
            "casting.superheat; did you mean casting.speed?",
        ),
        ({"casting.speed": 3.0}, "casting.superheat is missing; give all variables a value"),
        (
            {"casting.speed": "3 K", "casting.superheat": 30.0},
            "casting.speed must be a number in m/min, got '3 K'",
        ),
        (
            {"casting.speed": None, "casting.superheat": 30.0},
            "casting.speed must be a number in m/min",
        ),
        ({3: 3.0}, "3 is not a variable of [optimise]; there are casting.speed"),
        ({"casting.speed": 6.0, "casting.superheat": 30.0}, "is outside the range, 2 to 5 m/min"),
        (RunRequest((math.nan, 30.0), "default"), "casting.speed = nan m/min of a run is outside"),
        (RunRequest((3.0,), "default"), "a run has 1 values and 0 inputs; it needs a value for"),
        (3.0, 'a run must be one that ask() returns, or values by key, {"casting.speed'),
        (RunRequest(("3", 30.0), "default"), "casting.speed must be a number in m/min, got '3'"),  # type: ignore[arg-type]
        (RunRequest(3.0, "default"), "a run must be one that ask() returns, or values by key"),  # type: ignore[arg-type]
        (
            RunRequest((3.0, 30.0), "corse"),
            "fidelity must be one of thermal, coarse, default, fine",
        ),
        (RunRequest((3.0, 30.0), "fine", inputs=(1.0,)), "and 1 inputs; it needs"),
    ],
)
def test_invalid_run_is_refused(tmp_path: Path, run: Any, line: str) -> None:
    one = study()
    assert line in problem(lambda: one.tell(run, {STRESS: 1e6}))
    assert line in problem(lambda: one.case(run))
    assert not one._runs.results


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"von_mises": 1e6}, "tell: von_mises_max is missing; [optimise] needs it; write it so, "),
        ({STRESS: "3 MPa"}, "tell: von_mises_max must be a finite number in SI, got '3 MPa'"),
        ({STRESS: math.nan}, "tell: von_mises_max must be a finite number in SI, got nan;"),
        (None, 'tell: results must be an Evaluation, a Result or results by name, {"heat_removed'),
    ],
)
def test_invalid_result_is_refused(given: Any, line: str) -> None:
    one = study()
    (wanted, *_) = one.ask()
    assert problem(lambda: one.tell(wanted, given)).startswith(line)


def test_missing_results_are_refused():
    assert "solve: obtain gave no results for" in problem(
        lambda: study().solve(obtain=lambda w: None)
    )
