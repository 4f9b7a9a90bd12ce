"""`castfem error`: runs, table, and errors in all later results."""

from __future__ import annotations

import json
import math
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
from ranks import python_on
from small_case import SMALL, write_small

from castfem.cli.options import case_and_target
from castfem.model import load_case
from castfem.runs.output.summary_file import Summary
from castfem.studies.accuracy.sizes import described, factors_between
from castfem.studies.accuracy.table import ErrorTable

# tests/cli/test_cli_sweep.py runs it with processes.
pytestmark = pytest.mark.usefixtures("runs_here")

WORDS = ("error", "small", "-j", 1)


def _quantities(folder: str) -> dict[str, Any]:
    content = json.loads((Path(folder) / "summary.json").read_text())
    found: dict[str, Any] = content["quantities"]
    return found


def test_errors_are_written_into_the_results(castfem, tmp_path) -> None:
    """Of the case itself, of its existing run, and of a later one."""
    write_small(tmp_path)
    assert castfem("run", "small", "-q").status == 0
    before = _quantities("results/small")
    outcome = castfem(*WORDS)
    assert outcome.status == 0, outcome.err
    assert "errors in results/small_error/error.json" in outcome.out
    table = ErrorTable.load(Path("results/small_error/error.json"))
    entry = table.quantities["surface_temperature_mid_face"]
    assert set(entry.parts) == {"mesh", "step"}
    assert len(entry.parts["mesh"].values) >= 3  # coarse ones may have the same cells
    assert len(entry.parts["step"].values) == 3
    assert entry.error() == pytest.approx(sum(p.error for p in entry.parts.values()))
    assert "position" not in table.quantities
    for folder in ("results/small_error/base", "results/small"):
        after = _quantities(folder)
        error = after["surface_temperature_mid_face"].pop("error")
        assert error == pytest.approx(entry.error())
        for name, quantity in after.items():
            assert {k: v for k, v in quantity.items() if k != "error"} == before[name]
    kelvin = Summary.load("results/small")
    assert kelvin.quantities["surface_temperature_mid_face"].error == pytest.approx(error)
    shown = castfem("show", "results/small").out
    assert " ± " in next(line for line in shown.splitlines() if "surface" in line)
    again = castfem("run", "small", "-q")
    assert again.status == 0, again.err
    assert _quantities("results/small")["heat_removed"]["error"] > 0.0
    assert castfem("run", "small", "-q", "-o", "fast", "--set", "speed=5 m/min").status == 0
    compared = castfem("compare", "results/small", "fast", "--no-figures")
    heat = next(line for line in compared.out.splitlines() if line.startswith("heat removed per"))
    assert heat.count("±") == 1
    head, *lines = Path("results/compare/compare.csv").read_text().splitlines()
    assert head == "quantity,unit,small,small: error,small: reference,fast"
    assert any(float(line.split(",")[3] or "nan") > 0.0 for line in lines)


def test_finished_runs_are_not_repeated(castfem, tmp_path) -> None:
    """Also after an interruption; other sizes of the same case have their errors."""
    path = write_small(tmp_path)
    assert castfem(*WORDS, "-o", "out", "-q").status == 0
    first = json.loads(Path("out/error.json").read_text())
    run = Path("out/mesh_x2/run.json")
    stamp = run.stat().st_mtime_ns
    record = json.loads(Path("out/sweep.json").read_text())
    del record["runs"]["mesh_x0.707"]
    Path("out/sweep.json").write_text(json.dumps(record))
    assert "6 of 6 runs" in castfem(*WORDS, "-o", "out").err  # it had ended without a record
    Path("out/sweep.json").write_text(json.dumps(record))
    shutil.rmtree("out/mesh_x0.707")
    again = castfem(*WORDS, "-o", "out")
    assert again.status == 0, again.err
    assert "5 of 6 runs" in again.err
    assert run.stat().st_mtime_ns == stamp
    second = json.loads(Path("out/error.json").read_text())
    assert second["quantities"] == first["quantities"]
    table = ErrorTable.load(Path("out/error.json"))
    case = load_case(path)
    errors = table.errors_of(case.with_({"thermal.time.step": "25 ms"}))
    whole = table.errors_of(case)
    entry = table.quantities["heat_removed"]
    assert errors["heat_removed"] == pytest.approx(entry.error({"step": 0.5}))
    assert errors["heat_removed"] < whole["heat_removed"]
    assert table.errors_of(case.with_(superheat="30 K")) is None
    proposed = castfem(*WORDS, "-o", "out", "--to", "2%")
    assert proposed.status == 0, proposed.err
    (line,) = (li for li in proposed.out.splitlines() if li.startswith("castfem run small --set"))
    assert line.endswith("-o FOLDER")
    assert "errors of 2%: mesh x " in proposed.out
    other = castfem(*WORDS, "-o", "out", "--set", "superheat=30 K")
    assert other.status == 1
    assert "casting.superheat: 40 K there" in other.err


def test_impossible_sizes_are_reported(castfem, tmp_path) -> None:
    """Cells that would be larger than the billet; the other runs are evaluated."""
    (tmp_path / "small.toml").write_text(SMALL.replace('"12 mm"', '"30 mm"'))
    outcome = castfem(*WORDS, "-o", "out")
    assert outcome.status == 0, outcome.err
    table = ErrorTable.load(Path("out/error.json"))
    refused = [run.name for run in table.runs if run.message]
    assert all(f"mesh x {name[6:]}: no result of this run" in outcome.err for name in refused)
    assert math.isfinite(table.quantities["heat_removed"].error())


def test_run_with_coarser_cells_by_one_option(castfem, tmp_path) -> None:
    """Its case has its sizes; a resumed run would scale them twice."""
    path = write_small(tmp_path)
    words = ("run", "small", "-q", "--set", "casting.length=10 mm", "-o", "out")
    assert castfem(*words, "--accuracy", "coarse").status == 0
    case, ran = load_case(path), load_case(tmp_path / "out" / "case.toml")
    ratios = factors_between(described(case), described(ran))
    assert ratios is not None
    assert ratios == {"mesh": pytest.approx(1.5), "step": pytest.approx(2.0)}
    assert ran.title == "coarse billet; casting.length = 10 mm; coarse accuracy"
    again = castfem("run", "out", "--resume", "--accuracy", "coarse")
    assert again.status == 1
    assert "leave out --accuracy" in again.err
    refused = castfem(*words, "--accuracy", "fein")
    assert refused.status == 1
    assert "--accuracy fein:" in refused.err


def test_error_of_a_run_with_coarser_cells(castfem, tmp_path) -> None:
    """The proposed run has each size once; mesh, mould and section take the option, too."""
    path = write_small(tmp_path)
    given = ("--set", "casting.length=10 mm", "--accuracy", "coarse")
    outcome = castfem(*WORDS, *given, "--to", "2%", "-o", "out")
    assert outcome.status == 0, outcome.err
    case, base = load_case(path), load_case(tmp_path / "out" / "base" / "case.toml")
    ratios = factors_between(described(case), described(base))
    assert ratios == {"mesh": pytest.approx(1.5), "step": pytest.approx(2.0)}
    (line,) = (li for li in outcome.out.splitlines() if li.startswith("castfem run small --set"))
    keys = [word.partition("=")[0] for word in shlex.split(line) if "=" in word]
    assert len(keys) == len(set(keys)) and {"casting.length", "mesh.surface_size"} < set(keys)
    for command in ("mesh", "mould", "section"):
        assert "--accuracy" in castfem(command, "--help").out
    drawn, _ = case_and_target("small", None, ("casting.length=10 mm",), "mesh", "coarse")
    assert described(drawn) == described(base)


def test_plain_run_loads_no_studies(tmp_path) -> None:
    """Neither modules nor files of them."""
    write_small(tmp_path)
    script = (
        "import sys; from castfem.cli import execute; "
        "assert execute(['run', 'small', '-q', '--set', 'casting.length=10 mm']) == 0; "
        "parts = tuple('castfem.studies.' + s for s in ('accuracy', 'sweep', 'optimisation')); "
        "print([m for m in sys.modules if m.startswith(parts)])"
    )
    done = python_on(1, "-c", script, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("error", "small", "--to", "1"), "--to 1: "),
        (("error", "nosuch"), "nosuch: no such case file"),
        (("check", "/dev/fd/63"), "/dev/fd/63: is a pipe, not a file; write the case to a file"),
        (("error", "small", "-j", 0), "at least one process"),
        (("error", "small", "-o", "small.toml"), "small.toml: is a file"),
        (("error", "small", "-o", "lone"), "lone: holds a single run"),
        (("error", "small", "--set", "speed=3"), "a speed needs its unit"),
        (("error", "tensile/unloading"), "is a tensile test"),
    ],
)
def test_bad_input_runs_nothing(refused, words, message) -> None:
    assert message in refused(*words)


def test_damaged_table_is_reported(tmp_path) -> None:
    from castfem.base.errors import InputError

    path = tmp_path / "error.json"
    path.write_text('{"format": "castfem error"}')
    with pytest.raises(InputError, match=r"cannot be read .* repeat castfem error"):
        ErrorTable.load(path)


def test_errors_along_the_strand(castfem, tmp_path) -> None:
    """At requested places and at the end of the mould; show, compare and report print them."""
    text = SMALL.replace('name = "mould"', 'name = "mould"\nto = "50 mm"')
    below = '\n[[cooling]]\nname = "below"\n\n[thermal.time]'
    slow = text.replace("3.6 m/min", "1 m/min").replace('"50 ms"', '"200 ms"')
    Path("small.toml").write_text(slow.replace("\n[thermal.time]", below))
    assert castfem("run", "small", "-q").status == 0
    outcome = castfem(*WORDS, "--at", "40 mm")
    assert outcome.status == 0, outcome.err
    titles = [line.strip() for line in outcome.out.splitlines() if line.startswith("At ")]
    assert titles == ["At 40 mm", "At 50 mm", "At the end of the run"]
    table = ErrorTable.load(Path("results/small_error/error.json"))
    assert list(table.places) == [0.04, 0.05]
    entry = table.places[0.05]["shell_corner"]
    assert entry.value == pytest.approx(entry.parts["step"].values[1.0])
    assert entry.error() > 0.0 and entry.value > 0.0
    summary = Summary.load("results/small")
    assert summary.errors_near(0.05)["shell_corner"] == pytest.approx(1e-3 * entry.error())
    warm = table.places[0.04]["surface_temperature_mid_face"]
    assert summary.errors_near(0.04)["surface_temperature_mid_face"] == pytest.approx(warm.error())
    assert summary.errors_near(0.055) == {}
    shown = castfem("show", "results/small", "--at", "50 mm", "--at", "55 mm").out
    row = next(line for line in shown.splitlines() if line.startswith("shell, corner"))
    assert row.count("±") == 1
    assert castfem("run", "small", "-q", "-o", "fast", "--set", "speed=2 m/min").status == 0
    for words in ((), ("--at", "50 mm")):
        compared = castfem("compare", "results/small", "fast", "--no-figures", *words).out
        least = "shell, corner" if words else "thinnest shell"
        lines = [line for line in compared.splitlines() if line.strip().startswith(least)]
        assert lines[0].count("±") == 1
    assert castfem("report", "results/small", "-o", "page.html").status == 0
    page = Path("page.html").read_text()
    assert "±" in page[page.index("thinnest shell") :][:200]
    result = castfem("show", "results/small_error")
    assert result.status == 0 and "At 40 mm" in result.out and "from" in result.out
    refused = castfem(*WORDS, "--at", "2 m")
    assert refused.status == 1 and "--at 2000 mm: " in refused.err
