"""The wrapper passes on status, streams, signals, folder, variables, arguments."""

from __future__ import annotations

import importlib.util
import os
import pwd
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """Return an environment's folder with a space in its name, that uses the host's Python."""
    folder = tmp_path / "with blank" / ".castfem"
    (folder / "venv/bin").mkdir(parents=True)
    tool = folder / "venv/bin/tool"
    tool.write_text("#!/bin/sh\necho own tool\n")
    tool.chmod(0o755)
    (folder / "env.conf").write_text(f"kind=host\npython={sys.executable}\nuserland=''\n")
    return folder


def enter(home: Path, *command: str, **options: object) -> subprocess.CompletedProcess[str]:
    line = [str(ROOT / "tools/enter.sh"), str(home), *command]
    return subprocess.run(line, capture_output=True, text=True, **options)  # type: ignore


@pytest.mark.parametrize("status", [0, 77])
def test_exit_status(home: Path, status: int) -> None:
    assert enter(home, "sh", "-c", f"exit {status}").returncode == status


def test_streams_arguments_and_folder(home: Path, tmp_path: Path) -> None:
    script = 'cat; pwd; printf "<%s>" "$@"; echo oops >&2'
    done = enter(home, "sh", "-c", script, "sh", "a b", "*", "", input="typed\n", cwd=tmp_path)
    assert done.stdout == f"typed\n{tmp_path}\n<a b><*><>"
    assert done.stderr == "oops\n"


def test_own_programs_have_precedence(home: Path) -> None:
    assert enter(home, "tool").stdout == "own tool\n"


def test_open_mpi_finds_its_folders(home: Path, tmp_path: Path) -> None:
    """It needs a HOME, and an existing TMPDIR."""
    script = 'printf "%s|%s" "$HOME" "${TMPDIR-none}"'
    known = {key: value for key, value in os.environ.items() if key not in ("HOME", "TMPDIR")}
    done = enter(home, "sh", "-c", script, env=known | {"TMPDIR": str(tmp_path / "gone")})
    assert done.stdout == f"{pwd.getpwuid(os.geteuid()).pw_dir}|none"
    gone = f"castfem: warning: TMPDIR={tmp_path / 'gone'} is no folder: /tmp is used\n"
    assert (done.returncode, done.stderr) == (0, gone)
    mine = known | {"HOME": "/my home", "TMPDIR": str(tmp_path)}
    done = enter(home, "sh", "-c", script, env=mine)
    assert (done.stdout, done.stderr) == (f"/my home|{tmp_path}", "")


LINE = 74 * "-"
STATUS = f"""[host:16207] PMIX ERROR: PMIX_ERR_UNREACH in file server.c at line 3184
{LINE}
prterun detected that one or more processes exited with non-zero status,
thus causing the job to be terminated. The first process to do so was:

   Process name: [prterun-host-16207@1,1]
   Exit code:    1
{LINE}
"""
STATUS_4 = f"""{LINE}
Primary job  terminated normally, but 1 process returned
a non-zero exit code. Per user-direction, the job has been aborted.
{LINE}
{LINE}
mpirun detected that one or more processes exited with non-zero status, thus causing
the job to be terminated.
{LINE}
"""
ABORT = f"""{LINE}
MPI_ABORT was invoked on rank 1 in communicator MPI_COMM_WORLD
{LINE}
{LINE}
"""


@pytest.mark.parametrize("more", [STATUS, STATUS_4])
def test_launcher_does_not_repeat_the_status(home: Path, more: str) -> None:
    """Its message about an abort, and any other, is kept; so are status and output."""
    launcher = home / "venv/bin/mpirun"
    message = f"castfem: a.toml: bad\n{ABORT}and more\n"
    launcher.write_text(f"#!/bin/sh\ncat\ncat >&2 <<'END'\n{message}{more}END\nexit 3\n")
    launcher.chmod(0o755)
    done = enter(home, "mpirun", "-n", "2", input=STATUS)
    assert (done.returncode, done.stdout, done.stderr) == (3, STATUS, message)
    launcher.rename(home / "venv/bin/other")
    assert enter(home, "other", input="").stderr == message + more


def test_variables_of_the_user_have_precedence(home: Path) -> None:
    bare = {key: value for key, value in os.environ.items() if key != "OMP_NUM_THREADS"}
    show = ("sh", "-c", "echo $OMP_NUM_THREADS $PETSC_OPTIONS")
    assert enter(home, *show, env=bare | {"PETSC_OPTIONS": "-log"}).stdout == "1 -log\n"
    assert enter(home, *show, env=bare | {"OMP_NUM_THREADS": "3"}).stdout.startswith("3")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_reaches_the_program(home: Path, number: signal.Signals) -> None:
    script = f'trap "exit 9" {number.name[3:]}; echo up; while :; do sleep 0.02; done'
    line = [str(ROOT / "tools/enter.sh"), str(home), "sh", "-c", script]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "up\n"
        process.send_signal(number)
        assert process.wait(timeout=10) == 9


BUBBLEWRAP = f"""#!{sys.executable}
import os, sys
program = sys.argv[sys.argv.index("env"):]
if (child := os.fork()) == 0:
    os.setsid()
    os.execvp(program[0], program)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.fixture
def userland(home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the home with a userland, entered by a substitute of bubblewrap with its session."""
    folder = home.parent / "userland"
    folder.mkdir()
    (folder / "castfem-ready").touch()
    (home / "env.conf").write_text(f"kind=userland\npython=x\nuserland='{folder}'\nopenmpi=5\n")
    programs = home.parent / "programs"
    programs.mkdir()
    (programs / "bwrap").write_text(BUBBLEWRAP)
    (programs / "bwrap").chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.delenv("CASTFEM_INSIDE", raising=False)
    return home


LAUNCHER = """#!/bin/sh
for name in USR1 TERM INT HUP; do trap "echo $name" $name; done
trap "echo TERM; exit 7" TERM
echo up
for i in 1 2 3 4 5 6; do for j in 1 2 3 4 5 6 7 8 9 10; do sleep 1 & wait $!; done; done
"""


@pytest.mark.parametrize("kind", ["home", "userland"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ranks_are_stopped_before_their_launcher(
    kind: str, number: signal.Signals, request: pytest.FixtureRequest
) -> None:
    """A stopped mpirun kills its ranks within a step; SIGUSR1 is only passed on."""
    home = request.getfixturevalue(kind)
    launcher = home / "venv/bin/mpirun"
    launcher.write_text(LAUNCHER)
    launcher.chmod(0o755)
    line = [str(ROOT / "tools/enter.sh"), str(home), "mpirun"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "up\n"
        process.send_signal(number)
        process.send_signal(number)  # as `timeout` does: a single request
        assert process.stdout.readline() == "USR1\n"
        time.sleep(2.5)
        process.send_signal(signal.SIGTERM)
        assert process.stdout.read() == "TERM\n"
        assert process.wait(timeout=10) == 7


@pytest.mark.skipif(shutil.which("timeout") is None, reason="needs timeout of coreutils")
@pytest.mark.parametrize("kind", ["home", "userland"])
def test_timeout_ends_the_program(kind: str, request: pytest.FixtureRequest) -> None:
    """It sends TERM and CONT to the wrapper, and both to its group: the program must receive it."""
    home = request.getfixturevalue(kind)
    script = 'trap "echo heard; exit 9" TERM; for _ in $(seq 900); do sleep 0.02; done; echo late'
    line = ["timeout", "3", str(ROOT / "tools/enter.sh"), str(home), "sh", "-c", script]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60, check=False)
    # A busy machine may deliver the second one before the program has ended.
    assert set(done.stdout.splitlines()) == {"heard"}
    assert done.returncode == 124


def test_missing_environment_names_the_fix(tmp_path: Path) -> None:
    done = enter(tmp_path, "true")
    assert done.returncode == 125
    assert "make env" in done.stderr.splitlines()[-1]


def test_missing_userland_names_the_fix(home: Path, tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    (home / "env.conf").write_text(f"kind=userland\npython=/usr/bin/python3\nuserland={gone}\n")
    done = enter(home, "true")
    assert done.returncode == 125
    assert "make env" in done.stderr


# Whether a Python is suitable: version range, and requirements met or not.


@pytest.fixture(scope="module")
def probe() -> ModuleType:
    spec = importlib.util.spec_from_file_location("probe", ROOT / "tools/probe.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("version", "good"),
    [
        ("0.8.0", False),
        ("0.9.0", True),
        ("0.11.0.post0", True),
        ("0.12.0.dev0", False),
        ("0.90", False),
        ("2019.2.0.dev0", False),
        ("unknown", False),
    ],
)
def test_range_of_dolfinx(probe: ModuleType, version: str, good: bool) -> None:
    assert probe.in_range(version) is good


@pytest.mark.parametrize(
    ("requirement", "installed", "met"),
    [
        ("numpy", "1.26.4", True),
        ("numpy>=1.26", "1.9.0", False),
        ("numpy>=1.26.0", "1.26", True),
        ("numpy>=1.26", "2", True),
        ("numpy==1.26", "1.26.0", True),
        ("numpy==1.26", "1.26.1", False),
        ("no-such-package>=1", None, False),
    ],
)
def test_requirement(
    probe: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    requirement: str,
    installed: str | None,
    met: bool,
) -> None:
    if installed is not None:
        monkeypatch.setattr("importlib.metadata.version", lambda name: installed)
    assert probe.is_met(requirement) is met


def test_requirements_are_those_of_the_project(probe: ModuleType) -> None:
    names = probe.requirements()
    assert any(name.startswith("pydantic") for name in names)
    assert any(name.startswith("gmsh") for name in names)
    assert not any(name.startswith("ruff") for name in names)


def test_this_python_passes_or_has_a_reason() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "tools/probe.py"], capture_output=True, text=True, check=False
    )
    if done.returncode == 0:
        answers = dict(shlex.split(line)[0].split("=", 1) for line in done.stdout.splitlines())
        assert set(answers) == {"python", "dolfinx", "parent", "missing"}
        assert Path(answers["python"]).exists()
    else:
        assert len(done.stdout.splitlines()) == 1


def test_venv_with_wheels_is_possible_or_has_a_reason() -> None:
    line = [sys.executable, ROOT / "tools/probe.py", "wheel"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        answers = dict(shlex.split(line)[0].split("=", 1) for line in done.stdout.splitlines())
        assert answers["python"] == sys.executable
        assert answers["wheels"].startswith("dolfinx-solver-real>=")
    else:
        assert len(done.stdout.splitlines()) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("version_info", (3, 11, 7)), "Python 3.11 is older than 3.12"),
        (("platform", "darwin"), "no wheels for darwin"),
        (("path", None), "no C compiler"),
    ],
)
def test_reasons_against_wheels(
    probe: ModuleType, monkeypatch: pytest.MonkeyPatch, change: tuple[str, object], message: str
) -> None:
    name, value = change
    if value is None:
        monkeypatch.setenv("CC", "/nowhere/cc")
    else:
        monkeypatch.setattr(probe.sys, name, value)
    assert message in (probe.reason_against_wheel() or "")


# Origin of DOLFINx: the Python that `tools/env.sh` chooses, and messages about others.


# Answers of Pythons to a request for DOLFINx, and for a venv with one from PyPI.
WITHOUT = 'echo "no DOLFINx (No module named dolfinx)"; exit 1'
OLD = 'echo "Python 3.11 is older than 3.12"; exit 1'
LATER = 'echo "python=$0"; echo "wheels=solver"'
WITH = 'echo "python=$0"; echo "dolfinx=0.11.0"; echo "parent="; echo "missing="'
PYENV = "home/.pyenv/versions/3.13.0/bin/python3"
OTHERS = {f"bin/python3{minor}": (WITHOUT, OLD) for minor in ("", ".12", ".13", ".14")}
HIDDEN = "raise ModuleNotFoundError(\"No module named 'dolfinx'\")"


def choice(folder: Path, pythons: dict[str, tuple[str, str]], **variables: str) -> tuple[str, str]:
    """Return output and messages for a path with these Pythons, and others of no use."""
    home = folder / "home"
    for place, (system, wheel) in (OTHERS | pythons).items():
        file = folder / place
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'#!/bin/sh\nif [ "$2" = wheel ]; then\n{wheel}\nelse\n{system}\nfi\n')
        file.chmod(0o755)
    own = ("PYTHON", "SOLVER", "DEBIAN", "PYENV_ROOT")
    environment = {name: value for name, value in os.environ.items() if name not in own}
    (folder / "dolfinx.py").write_text(HIDDEN)  # of /usr/bin/python3
    environment["PYTHONPATH"] = str(folder)
    environment |= {"PATH": f"{folder}/bin:/usr/bin:/bin", "HOME": str(home), **variables}
    done = subprocess.run(
        [ROOT / "tools/env.sh", "choice"], env=environment, capture_output=True, text=True
    )
    return done.stdout.replace(str(folder), "").strip(), done.stderr


@pytest.mark.parametrize(
    ("pythons", "variables", "chosen"),
    [
        ({"bin/python3": (WITH, LATER)}, {}, "system /bin/python3"),
        ({"bin/python3": (WITHOUT, LATER)}, {}, "wheel /bin/python3"),
        ({}, {}, "debian /usr/bin/python3"),
        ({"bin/python3": (WITH, LATER)}, {"SOLVER": "wheel"}, "wheel /bin/python3"),
        ({PYENV: (WITHOUT, LATER)}, {"SOLVER": "wheel"}, f"wheel /{PYENV}"),
    ],
)
def test_first_suitable_python_is_chosen(
    pythons: dict[str, tuple[str, str]], variables: dict[str, str], chosen: str, tmp_path: Path
) -> None:
    found, message = choice(tmp_path, pythons, **variables)
    assert (found, message) == (chosen, "")


def test_variable_python_has_precedence(tmp_path: Path) -> None:
    pythons = {"bin/python3": (WITH, LATER), "mine": (WITHOUT, LATER), "other": (WITH, LATER)}
    assert choice(tmp_path, pythons, PYTHON=str(tmp_path / "other"))[0] == "system /other"
    found, message = choice(tmp_path, pythons, PYTHON=str(tmp_path / "mine"), SOLVER="wheel")
    assert (found, message) == ("wheel /mine", "")


@pytest.mark.parametrize(
    ("variables", "why"),
    [
        ({"SOLVER": "conda"}, "SOLVER=conda is unknown: choose system, wheel or debian"),
        ({"SOLVER": "wheel", "DEBIAN": "sid"}, "DEBIAN=sid and SOLVER=wheel exclude each other"),
        ({"SOLVER": "wheel"}, "SOLVER=wheel: there is no Python for it; "),
        ({"SOLVER": "system"}, "python3 is passed over: no DOLFINx (No module"),
    ],
)
def test_missing_python_is_reported_in_a_line(
    variables: dict[str, str], why: str, tmp_path: Path
) -> None:
    found, message = choice(tmp_path, {}, **variables)
    assert found == "" and why in message and len(message.splitlines()) == 1
