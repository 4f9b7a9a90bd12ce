"""Derivatives computed in runs for the spread of an optimum: units, files, fits, refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from known_results import HEAT, SPEED, STRESS
from ranks import needs_mpirun, python_on
from small_case import small, write_small

from castfem.model.load import load
from castfem.runs.output.folder import DERIVATIVES_NAME
from castfem.studies.optimisation import Evaluation, RunRequest, Study
from castfem.studies.optimisation.argument_checks import quantities_of
from castfem.studies.optimisation.responses import Responses, of_run
from castfem.studies.optimisation.store import Store
from castfem.studies.sensitivity.result import Slope, read_slopes
from castfem.studies.sensitivity.run import sensitivity
from castfem.studies.sweep.work import Derivatives, Job, work

LENGTH = {"casting.length": "6 mm"}
H = {"key": "cooling.mould.surface.0.coefficient", "relative": ["-10 %", "10 %"]}
SUPERHEAT = {"key": "casting.superheat", "range": ["20 K", "40 K"]}
WALL = {"key": "cooling.mould.surface.0.wall", "range": ["300 degF", "340 degF"]}
BY = (SPEED["key"], H["key"], SUPERHEAT["key"])


def study(folder: Path | None = None, **table: Any) -> Study:
    request = {"maximise": HEAT, "variable": [SPEED], "input": [H, SUPERHEAT], **table}
    return Study(small({**LENGTH, "optimise": request}), folder)


def test_derivatives_do_not_change_the_run(tmp_path: Path) -> None:
    """Its results agree to the last digit, and the derivatives are those of the command."""
    case = small(LENGTH)
    plain = Job("plain", tmp_path / "plain", case)
    carries = replace(plain, folder=tmp_path / "own", derivatives=Derivatives((HEAT,), BY))
    assert not work(plain).failed
    assert not work(carries).failed
    one, other = (
        json.loads((job.folder / "summary.json").read_text())["quantities"]
        for job in (plain, carries)
    )
    assert one == other
    history = [(job.folder / "history.csv").read_bytes() for job in (plain, carries)]
    assert history[0] == history[1]
    assert read_slopes(plain.folder) is None
    slopes = read_slopes(carries.folder)
    assert slopes is not None
    alone = sensitivity(case, [HEAT], BY)
    for p in alone.parameters:
        found = slopes[HEAT][p.name]
        assert found.value == pytest.approx(alone.gradient[HEAT][p.name], rel=1e-12)
        assert (found.at, found.unit) == (p.value, p.unit)
    assert not work(replace(plain, folder=carries.folder)).failed
    assert read_slopes(carries.folder) is None, "they are those of another run"


def test_slopes_are_by_shares_of_ranges(tmp_path: Path) -> None:
    """Compared with runs slightly to both sides: other units, factors, temperature differences."""
    one = study(tmp_path / "runs", input=[H, WALL])
    middle, ranges = (
        RunRequest((3.5,), "default", inputs=(1.04, 320.0), derivatives=True),
        (3.0, 0.2, 40.0),
    )
    one.run([middle])
    outputs = Responses(one.problem, one._runs, one.run)
    outputs.fetch([middle])
    found = outputs.slopes(middle)
    assert found.shape == (1, 3)
    at = np.array([*middle.values, *middle.inputs])
    for i, width in enumerate(ranges):
        ends = []
        for sign in (1.0, -1.0):
            place = at + sign * 2e-3 * width * np.eye(3)[i]
            run = RunRequest((place[0],), "default", inputs=(place[1], place[2]))
            one.run([run])
            outputs.fetch([run])
            ends.append(outputs.cost(run))
        assert found[0, i] == pytest.approx((ends[0] - ends[1]) / 4e-3, rel=2e-3)


def test_runs_without_derivatives_are_repeated(tmp_path: Path) -> None:
    case, wanted = small(LENGTH), Derivatives((HEAT,), BY)
    store = Store(tmp_path)
    job = store.job(case, {})
    store.note(job, work(job))
    assert store.find(case) is not None
    assert store.find(case, wanted) is None
    again = store.job(case, {}, wanted)
    assert again.folder == job.folder
    store.note(again, work(again))
    for known in (store, Store(tmp_path)):
        given = known.find(case, wanted)
        assert given is not None
        assert given == known.find(case)
    assert Store(tmp_path).find(case, Derivatives((HEAT,), (*BY, "casting.length"))) is None


def test_run_without_possible_derivatives_is_made(tmp_path: Path) -> None:
    """Steps are no function of a key: the run is made, reports it, and is not repeated."""
    wanted = Derivatives((HEAT, "steps"), BY)
    job = Job("run", tmp_path / "run", small(LENGTH), derivatives=wanted)
    assert not work(job).failed
    assert read_slopes(job.folder) == {}
    assert "the run has no derivatives: --of steps" in (job.folder / "run.log").read_text()
    assert Evaluation(slopes={}).has(wanted)
    (job.folder / DERIVATIVES_NAME).write_text("{")
    assert read_slopes(job.folder) is None


@needs_mpirun
def test_on_two_ranks(tmp_path: Path) -> None:
    """One run on both ranks has the derivatives of one on a single rank."""
    write_small(tmp_path)
    script = tmp_path / "script.py"
    script.write_text(
        "import castfem\nfrom pathlib import Path\nfrom mpi4py import MPI\n"
        "from castfem.studies.sweep.work import Derivatives, Job, work\n"
        "case = castfem.load('small').with_(length='6 mm')\n"
        f"asked = Derivatives(('{HEAT}',), {BY})\n"
        "done = work(Job('run', Path('two'), case, derivatives=asked), comm=MPI.COMM_WORLD)\n"
        "assert not done.failed, done.message\n"
    )
    done = python_on(2, str(script), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    one = Job("one", tmp_path / "one", small(LENGTH), derivatives=Derivatives((HEAT,), BY))
    assert not work(one).failed
    single, both = read_slopes(one.folder), read_slopes(tmp_path / "two")
    assert single is not None and both is not None
    for key in BY:
        assert both[HEAT][key].value == pytest.approx(single[HEAT][key].value, rel=1e-8)


def results_of(
    one: Study, slope: Callable[[float], Slope] | None
) -> Callable[[RunRequest], Evaluation]:
    """Return results: heat is largest at 3.3 + 0.06 a + 0.03 b, of inputs a and b from -1 to 1."""

    def given(wanted: RunRequest) -> Evaluation:
        h, warm = wanted.inputs or (1.0, 30.0)
        a, b = (h - 1.0) / 0.1, (warm - 30.0) / 10.0
        off = wanted.values[0] - (3.3 + 0.06 * a + 0.03 * b)
        quantities = quantities_of(one.problem, wanted, {HEAT: 9.0 - 2.0 * off**2})
        slopes = None
        if wanted.derivatives and slope is not None:
            by = (-4.0 * off, 4.0 * off * 0.06, 4.0 * off * 0.03)
            # Per m/min, per per cent of h, per K.
            units = ("m/min", "percent", "K")
            per = (by[0], by[1] / 0.1 / (100.0 / h), by[2] / 10.0)
            at = (wanted.values[0], 100.0, warm)
            each = zip(BY, per, at, units, strict=True)
            slopes = {HEAT: {key: Slope(v, x, unit) for key, v, x, unit in each}}
        return Evaluation(quantities, slopes=slopes)

    return given


@pytest.mark.parametrize("carries", [True, False])
def test_spread_by_derivatives(tmp_path: Path, carries: bool) -> None:
    """The same from fewer runs; if a run has no derivatives, from the usual number."""
    one = study(tmp_path / "runs")
    given = results_of(one, Slope if carries else None)  # type: ignore[arg-type]
    drawn = set()
    while wanted := one.ask():
        for run in wanted:
            one.tell(run, given(run))
            drawn |= {run.inputs} if run.inputs else set()
    found = one.result()
    assert found.spread.derivatives == carries
    assert found.spread.runs == len(drawn) == (12 if carries else 16)
    ends = 0.09 - np.sqrt(8.0 * 0.06 * 0.03 * 0.05)  # 5 and 95 % of 0.06 a + 0.03 b
    (value,) = found.values
    assert value.drawn == pytest.approx((3.3 - ends, 3.3 + ends), abs=0.006)
    _, place = found.spread.rows
    assert place.first == pytest.approx((0.8, 0.2), abs=0.06)


def test_derivatives_of_runs_are_those_needed() -> None:
    """The run in the idealised mould has neither the taper nor the objective."""
    request = {"minimise": STRESS, "input": [H], "constraints": [f"{HEAT} >= 99 % of idealised"],
             "variable": [{"key": "mould.taper", "range": ["0 %/m", "1 %/m"]}]}  # fmt: skip
    one = Study(load("billet125/taper_1").with_({"optimise": request}))
    run = RunRequest((0.5,), "coarse", inputs=(1.0,))
    assert of_run(one.problem, run) == Derivatives((STRESS, HEAT), ("mould.taper", H["key"]))
    ideal = of_run(one.problem, one.problem.ideal(run))
    assert ideal == Derivatives((HEAT,), (H["key"],))


@pytest.mark.parametrize("inputs", [(), (1.0,)])
def test_share_of_the_idealised_mould(inputs: tuple[float, ...]) -> None:
    """It depends on the inputs, not on the taper: without inputs it needs no derivatives."""
    request = {"minimise": STRESS, "input": [H], "constraints": [f"{HEAT} >= 50 % of idealised"],
             "variable": [{"key": "mould.taper", "range": ["0 %/m", "2 %/m"]}]}  # fmt: skip
    one = Study(load("billet125/taper_1").with_({"optimise": request}))
    run = RunRequest((0.5,), "coarse", inputs=inputs, derivatives=True)
    by = {"mould.taper": Slope(3.0, 0.5, "%/m"), H["key"]: Slope(0.4, 1600.0, "W/(m^2 K)")}
    ideal = {H["key"]: Slope(0.2, 1600.0, "W/(m^2 K)")} if inputs else None
    given = quantities_of(one.problem, run, {STRESS: 1e7, HEAT: 9e6})
    one.tell(run, Evaluation(given, slopes={STRESS: by, HEAT: by}))
    slopes = None if ideal is None else {HEAT: ideal}
    one.tell(one.problem.ideal(run), Evaluation(given, slopes=slopes))
    outputs = Responses(one.problem, one._runs, one.run)
    outputs.fetch([run])
    found = outputs.slopes(run)
    assert found is not None
    factor = 1600.0 * 0.2  # by the share of a range of 20 % of 1600
    expected = [[6.0, 0.4 * factor], [6.0, (0.4 - 0.5 * 0.2) * factor]]
    assert found == pytest.approx(np.array(expected)[:, : 1 + len(inputs)])
