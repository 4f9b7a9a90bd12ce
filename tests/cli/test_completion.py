"""Completion in shells, without heavy imports; the page of the commands is up to date."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from castfem.cli import execute
from castfem.cli.command import VARIABLE
from castfem.cli.reference_page import markdown_page

HEAVY = ("dolfinx", "petsc4py", "mpi4py", "numba", "scipy", "matplotlib", "pandas", "h5py")


@pytest.fixture
def completed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., list[str]]:
    """Return a function that completes the last of some words."""
    monkeypatch.chdir(tmp_path)

    def offered(*words: str) -> list[str]:
        monkeypatch.setenv(VARIABLE, "bash_complete")
        monkeypatch.setenv("COMP_WORDS", "\n".join(("castfem", *words)))
        monkeypatch.setenv("COMP_CWORD", str(len(words)))
        assert execute([]) == 0
        return capsys.readouterr().out.split()

    return offered


def test_commands_and_options(completed: Callable[..., list[str]]) -> None:
    assert completed("opt") == ["plain,optimise"]
    assert completed("run", "--ac") == ["plain,--accuracy"]


def test_names_of_cases_and_files(completed: Callable[..., list[str]], tmp_path: Path) -> None:
    (tmp_path / "billets.toml").touch()
    found = completed("run", "billet")
    assert found[0] == "plain,billets.toml" and "plain,billet125/thermal" in found
    assert completed("check", "copper200/") == ["plain,copper200/round"]
    assert completed("run", "somewhere/mine") == ["file,somewhere/mine"]


@pytest.mark.parametrize(
    "words",
    [
        ("run", "billet125/thermal", "--set"),
        ("run", "billet125/thermal", "--set", 'casting.speed="3 m/min"', "--set"),
        ("sweep", "billet125/thermal", "--set"),
        ("calibrate", "billet125/thermal", "--free"),
    ],
)
def test_keys_are_those_of_the_case(completed: Callable[..., list[str]], words: str) -> None:
    assert "plain,casting.length=" in completed(*words, "casting.le")
    assert "plain,cooling.mould.to=" in completed(*words, "cooling.mould.t")
    assert completed(*words, "mould.") == []  # a case without it
    assert completed(*words, "casting.length=2") == []


def test_invalid_case_has_no_keys(completed: Callable[..., list[str]]) -> None:
    assert completed("run", "no_such_case", "--set", "casting.") == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_has_its_part(
    shell: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(["completion", shell]) == 0
    text = capsys.readouterr().out
    assert f"{VARIABLE}={shell}_complete" in text
    monkeypatch.setenv(VARIABLE, f"{shell}_source")
    assert execute([]) == 0
    assert capsys.readouterr().out.strip() in text  # click's script, unchanged
    assert ("nospace" in text) is (shell == "bash") and ("-S ''" in text) is (shell == "zsh")


def test_unknown_shell_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert execute(["completion", "csh"]) == 1
    assert capsys.readouterr().err == "castfem: csh: no such shell; there are bash, zsh, fish\n"


def test_bash_inserts_the_completion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In bash itself, with a castfem that offers a key."""
    assert execute(["completion", "bash"]) == 0
    (tmp_path / "part").write_text(capsys.readouterr().out)
    offers = tmp_path / "castfem"
    offers.write_text("#!/bin/sh\necho plain,casting.length=\n")
    offers.chmod(0o755)
    lines = (
        "complete() { called=${@: -2:1}; }; compopt() { echo option $2; }; . ./part",
        "COMP_WORDS=(castfem run); COMP_CWORD=1; $called ./castfem",
        'echo "${COMPREPLY[@]}"',
    )
    done = subprocess.run(
        ["bash", "-c", "\n".join(lines)], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stdout.splitlines() == ["option nospace", "casting.length="], done.stderr


def test_no_heavy_module_is_imported() -> None:
    words = {VARIABLE: "bash_complete", "COMP_CWORD": "4"}
    words["COMP_WORDS"] = "castfem\nrun\nbillet125/thermal\n--set\ncasting.le"
    code = (
        "import sys; from castfem.cli import execute; execute([]);"
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **words}, capture_output=True, text=True
    )
    assert done.stdout.split() == ["plain,casting.length=", "[]"], done.stderr


PAGE = Path(__file__).parents[2] / "docs" / "commands.md"


def test_page_is_that_of_the_commands() -> None:
    assert PAGE.read_text(encoding="utf-8") == markdown_page(), "regenerate it: make pages"
