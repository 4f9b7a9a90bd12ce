"""Commands without a run: check, cases, init, schema, show, mesh, material, and mistakes."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

import castfem as package
from castfem.cli.app import app
from castfem.model.schema import markdown_page


def test_version(castfem):
    outcome = castfem("--version")
    assert (outcome.status, outcome.out) == (0, f"castfem {package.__version__}\n")


def test_check_of_a_shipped_case(castfem):
    outcome = castfem("check", "billet125/idealised", "--set", "casting.length=20 m")
    assert outcome.status == 0
    assert "carbon_042: solidus 1452 degC, liquidus 1502.5 degC" in outcome.out
    assert "20 m at 3.6 m/min" in outcome.out
    assert re.search(r"mesh of \d{3,4} cells", outcome.out)
    assert "foot spray: spray, radiation" in outcome.out
    assert castfem("check", "billet125/idealised", "-q").out == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_full_output_is_reported_in_one_line():
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "castfem.cli", "cases"], stdout=full, stderr=-1, text=True
        )
    assert done.returncode == 2 and "bug in castfem" not in done.stderr
    assert done.stderr == "castfem: what is printed: No space left on device; free some space\n"


def test_characters_missing_in_the_terminal(tmp_path):
    """The rules of tables are not in ISO 8859-1."""
    known = os.environ | {"PYTHONIOENCODING": "iso-8859-1"}
    words = [sys.executable, "-m", "castfem.cli", "mould", "billet125/taper_1", "-o", "m.png"]
    done = subprocess.run(words, capture_output=True, env=known, cwd=tmp_path)
    assert done.returncode == 0 and b"bug in castfem" not in done.stderr
    assert b"????" in done.stdout


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("thermal.solver.foo=1", "solver option 'foo': "),
        ("thermal.solver.pc_type=none_such", 'thermal.solver: thermal solver, pc_type = "none_s'),
        ("thermal.solver.snes_rtol=abc", "abc has no numeric value"),
        ("mechanics.solver.pc_factor_mat_solver_type=mumpz", "mechanics.solver: mechanical solver"),
    ],
)
def test_check_reports_options_refused_by_petsc(castfem, change, message):
    outcome = castfem("check", "billet125/idealised", "--set", change)
    assert outcome.status == 1 and outcome.err.startswith("castfem: --set: ")
    assert message in outcome.err and len(outcome.err.splitlines()) == 1


def test_check_accepts_options_of_petsc(castfem):
    sound = ("thermal.solver.pc_type=lu", "mechanics.solver.pc_factor_mat_solver_type=mumps")
    changes = [word for one in sound for word in ("--set", one)]
    assert castfem("check", "billet125/idealised", "-q", *changes).status == 0


def test_check_reports_all_problems_of_the_steel_too(castfem, case_file):
    case_file.write_text(case_file.read_text().replace("carbon_042", "carbon_42") + "colour = 1\n")
    outcome = castfem("check", case_file, "--set", "casting.speed=3 m")
    assert outcome.status == 1
    assert outcome.out == ""
    lines = outcome.err.splitlines()
    assert lines[0] == "castfem: 3 problems"
    assert any("did you mean carbon_042?" in line for line in lines)
    assert any(line.startswith("  --set: casting.speed") for line in lines)
    assert any("output.colour: unknown key (1)" in line for line in lines)


def test_cases_lists_runnable_cases(castfem):
    outcome = castfem("cases")
    assert outcome.status == 0
    assert re.search(r"billet125/idealised +125 mm billet, idealised mould", outcome.out)
    assert "base" not in outcome.out


def test_init_writes_a_valid_case(castfem):
    outcome = castfem("init", "bloom_small")
    assert outcome.status == 0
    assert "castfem run bloom_small.toml" in outcome.out
    assert castfem("check", "bloom_small").status == 0
    again = castfem("init", "bloom_small")
    assert again.status == 1
    assert "exists already" in again.err


@pytest.mark.parametrize("name", ["", ".toml", " "])
def test_init_without_a_name(castfem, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    outcome = castfem("init", name)
    assert outcome.status == 1 and "file a name" in outcome.err
    assert not list(tmp_path.iterdir())


def test_fault_of_a_steel_names_its_source(castfem, case_file):
    outcome = castfem("check", case_file, "--set", "steel.overrides={density=3}")
    assert outcome.status == 1
    assert outcome.err.startswith("castfem: --set: steel.overrides.density: ")
    (case_file.parent / "d.toml").mkdir()
    outcome = castfem("check", case_file, "--set", f"steel.name={case_file.parent}/d.toml")
    assert "is a folder" in outcome.err and "did you mean" not in outcome.err


def test_schema(castfem):
    assert json.loads(castfem("schema").out)["title"] == "castfem case"
    assert castfem("schema", "--markdown").out == markdown_page()


def test_weight_percent_may_have_its_sign(castfem):
    plain, signed = (
        castfem("material", "plain_carbon", "-c", f"C=0.1{sign}", "-c", f"Mn=1.4{sign}")
        for sign in ("", "%")
    )
    assert (signed.status, signed.out) == (0, plain.out)
    assert "0.1 %C, 1.4 %Mn" in signed.out
    wrong = castfem("material", "plain_carbon", "-c", "Mn=1.4 mm").err
    assert 'write it as element=weight percent, such as C=0.42 or C="0.42 %"' in wrong


def test_missing_composition_is_reported_with_the_option(castfem):
    outcome = castfem("material", "plain_carbon")
    assert outcome.status == 1 and outcome.err.rstrip().endswith(
        "such as C = 0.2, here by -c C=0.2"
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("check", "billet125/idealized"), "billet125/idealised?"),
        (("init", "nowhere/x"), "cannot be written"),
        (("mesh", "billet125/thermal", "-o", "nowhere/m.png"), "castfem: nowhere/m.png: "),
        (("show", "nowhere"), "nowhere: no such folder"),
        (("report", "nowhere"), "nowhere: no such folder"),
        (("material", "carbon_042", "-c", "C:0.2"), "C=0.42"),
    ],
)
def test_unusable_input_is_reported_with_suggestions(castfem, words, message):
    outcome = castfem(*words)
    assert outcome.status == 1 and message in outcome.err


@pytest.mark.parametrize(
    "words",
    [
        ("chek", "x"),
        ("check",),
        ("check", "x", "--colour"),
        ("run", "billet125/idealised", "--resume", "--overwrite"),
    ],
)
def test_usage_errors_end_with_one(castfem, words):
    outcome = castfem(*words)
    assert outcome.status == 1
    assert outcome.err


def test_help_is_printed_without_arguments(castfem):
    outcome = castfem()
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out == castfem("-h").out


@pytest.mark.parametrize("name", app.commands)
def test_example_of_a_command_is_valid(castfem, name):
    shown = castfem(name, "--help").out
    example = re.search("^ *Example: castfem (.*?)( > .*)?$", shown, re.MULTILINE)
    called, *words = shlex.split(example[1])
    assert called == name
    command = app.commands[name]
    context = command.make_context(name, words)
    assert set(context.params) == {one.name for one in command.params}
    assert shown.count("Exit status: 0 if") == 1 and "130 if interrupted" in shown


def test_unexpected_error_asks_for_a_report(castfem, monkeypatch):
    from castfem.model import shipped_cases

    def broken():
        raise error

    monkeypatch.setattr(shipped_cases, "shipped", broken)
    error = ZeroDivisionError("oh")
    outcome = castfem("cases")
    assert outcome.status == 2
    first, second = outcome.err.splitlines()
    assert first.startswith("castfem: unexpected ZeroDivisionError: oh (")
    assert first.endswith(", broken)")
    assert second.endswith("please report it.")  # the command has no -v
    error = AssertionError()
    first = castfem("cases").err.splitlines()[0]
    assert re.fullmatch(r"castfem: unexpected AssertionError \(.*\.py:\d+, broken\)", first)


def test_as_a_process(tmp_path):
    """The same exit status and streams through the real entry point."""
    command = [sys.executable, "-m", "castfem.cli"]
    good = subprocess.run(
        [*command, "check", "billet125/idealised"], cwd=tmp_path, capture_output=True, text=True
    )
    assert (good.returncode, good.stderr) == (0, "")
    bad = subprocess.run(
        [*command, "check", "no/such"], cwd=tmp_path, capture_output=True, text=True
    )
    assert (bad.returncode, bad.stdout) == (1, "")
    assert bad.stderr.startswith("castfem: no/such: ")


def test_light_commands_load_no_heavy_modules(tmp_path):
    code = (
        "import sys; from castfem.cli import execute; "
        "assert execute(['check', 'billet125/idealised', '-q']) == 0; "
        "bad = {'dolfinx', 'gmsh', 'mpi4py', 'petsc4py', 'ufl', 'matplotlib'} & set(sys.modules); "
        "assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)


def test_mesh_prints_and_draws(castfem, case_file):
    outcome = castfem("mesh", case_file, "-o", "m.png", "--set", "mesh.surface_size=2 mm")
    assert outcome.status == 0, outcome.err
    assert "quadrilateral, order 1" in outcome.out
    assert "wide_face" in outcome.out
    assert Path("m.png").read_bytes().startswith(b"\x89PNG")


def test_mesh_that_cannot_be_built(castfem, case_file):
    for command in ("mesh", "check", "run", "error"):
        wrong = castfem(command, case_file, "--set", "mesh.surface_depth=300 mm")
        assert wrong.status == 1
        (line,) = wrong.err.splitlines()
        named = f"castfem: {case_file}: mesh: surface_depth = 300 mm is larger than core_depth"
        assert line.startswith(named)


@pytest.mark.parametrize(
    "words",
    [
        ("machine", "slab1200/thermal"),
        ("mesh", "slab1200/thermal"),
        ("mould", "billet125/optimum_corner"),
        ("material", "plain_carbon"),
    ],
)
def test_picture_without_a_format_is_refused_first(castfem, words):
    outcome = castfem(*words, "-o", "picture")
    assert (outcome.status, outcome.out) == (1, "")
    assert (
        "picture: the name of a picture ends in .png, .pdf, .svg; to write into a folder, make"
        in outcome.err
    )


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("mesh", "billet125/thermal"), "thermal_mesh.png"),
        (("mould", "billet125/taper_1"), "taper_1_mould.png"),
        (("material", "plain_carbon", "-c", "C=0.1"), "plain_carbon.png"),
    ],
)
def test_picture_in_a_folder_has_its_usual_name(castfem, words, name):
    """As for commands that run something, `-o` may name a folder."""
    Path("pictures").mkdir()
    outcome = castfem(*words, "-o", "pictures")
    assert outcome.status == 0, outcome.err
    assert (Path("pictures") / name).stat().st_size > 10_000


def test_material_compares_segregation_with_equilibrium(castfem):
    steel = ("material", "plain_carbon", "-c", "C=0.15", "-c", "S=0.01", "-o", "steel.png")
    solidus = []
    for words in ((), ("--segregated",)):
        outcome = castfem(*steel, *words)
        assert outcome.status == 0, outcome.err
        (line,) = [one for one in outcome.out.splitlines() if one.startswith("solidus")]
        solidus.append(float(line.split()[1]))
    assert solidus[1] < solidus[0] - 10.0
    assert "microsegregation" in line
    outcome = castfem(*steel, "--segregated", "--database", "steel.tdb")
    assert outcome.status == 1 and "--segregated: goes without a database" in outcome.err


@pytest.mark.parametrize(
    ("command", "fix"),
    [
        ("optimise", "; the same command continues"),
        ("sensitivity", "; `castfem sensitivity ... --resume` continues"),
        ("run", "; `castfem run ... --resume` continues"),
        ("show", ""),
    ],
)
def test_interrupt_is_reported_with_how_to_continue(castfem, monkeypatch, command, fix):
    def interrupted(**_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("castfem.cli.app.app", interrupted)
    outcome = castfem(command, "billet125/thermal")
    assert (outcome.status, outcome.err) == (130, f"castfem: interrupted{fix}\n")


@pytest.mark.parametrize("error", [EOFError("Ran out of input"), click.Abort()])
def test_other_failures_are_not_called_interrupted(castfem, monkeypatch, error):
    def fails():
        raise error

    monkeypatch.setattr("castfem.model.shipped_cases.shipped", fails)
    outcome = castfem("cases")
    assert outcome.status == 2 and "interrupted" not in outcome.err
    assert outcome.err.startswith(f"castfem: unexpected {type(error).__name__}")


def test_command_ends_without_garbage_collection(tmp_path):
    """Python would search all objects several times before the process ends."""
    code = (
        "import atexit, gc, sys; from castfem.cli import main; "
        "atexit.register(lambda: print(len(gc.get_objects()) < 1000 < gc.get_freeze_count())); "
        "main(['cases'])"
    )
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, check=True, capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.splitlines()[-1] == "True"
